//! Where a sample's time goes: histograms of each hop and of the whole way, and what each of the last seconds was like.

use hdrhistogram::Histogram;
use krait_ipc::message::{HopStamps, N_HOPS, SlaveState};
use serde::Serialize;
use std::collections::VecDeque;

/// Longest latency that is told apart, ns (10 s).
const LONGEST_NS: u64 = 10_000_000_000;
/// Bars of a histogram on the page: ten a decade from 1 us on.
pub const N_BINS: usize = 50;
/// Seconds of history.
const N_SECONDS: usize = 60;

/// One stretch of the way: a hop, or all of it.
#[derive(Debug)]
struct Stretch {
    bins: [u64; N_BINS],
    quantiles: Histogram<u64>,
}

/// Quantiles and bars of one stretch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StretchReport {
    /// Median, us.
    pub p50_us: f64,
    /// 99th percentile, us.
    pub p99_us: f64,
    /// Largest, us.
    pub worst_us: f64,
    /// Samples per bar; bar n begins at 10^(n/10) us.
    pub bins: Vec<u64>,
}

/// One second of the whole way, us.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Second {
    /// Median, us.
    pub p50_us: f64,
    /// 99th percentile, us.
    pub p99_us: f64,
    /// Largest, us.
    pub worst_us: f64,
}

/// Everything about latency on the page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveLatencyReport {
    /// Samples counted.
    pub n: u64,
    /// Samples beyond the budget's worst.
    pub n_late: u64,
    /// Each hop, then end to end.
    pub stretches: Vec<StretchReport>,
    /// The last seconds, oldest first; null where nothing came.
    pub seconds: Vec<Option<Second>>,
}

/// Fills histograms from slave states; each command counts once.
#[derive(Debug)]
pub struct LiveLatency {
    stretches: Vec<Stretch>,
    second: Histogram<u64>,
    seconds: VecDeque<Option<Second>>,
    last_command: u64,
    n_late: u64,
}

impl LiveLatency {
    /// Empty histograms.
    ///
    /// # Errors
    /// Never with these bounds; the histogram library checks them.
    pub fn new() -> Result<Self, hdrhistogram::CreationError> {
        let empty = || Histogram::new_with_bounds(1, LONGEST_NS, 3);
        let stretch = |_| Ok(Stretch { bins: [0; N_BINS], quantiles: empty()? });
        Ok(Self {
            stretches: (0..=N_HOPS).map(stretch).collect::<Result<_, _>>()?,
            second: empty()?,
            seconds: VecDeque::new(),
            last_command: 0,
            n_late: 0,
        })
    }

    /// Takes a slave state.
    pub fn state(&mut self, state: &SlaveState, worst_us: f64) {
        let stamps = &state.stamps;
        if state.command_sequence == self.last_command || stamps.drive_written_ns == 0 || stamps.device_ns == 0 {
            return;
        }
        self.last_command = state.command_sequence;
        for (idx, stretch) in self.stretches.iter_mut().enumerate() {
            stretch.enter(if idx == N_HOPS { stamps.end_to_end_ns() } else { stamps.hop_ns(idx) });
        }
        let whole_ns = stamps.end_to_end_ns();
        self.n_late += u64::from(whole_ns as f64 * 1e-3 > worst_us);
        self.second.saturating_record(in_range(whole_ns));
    }

    /// A second has passed.
    pub fn end_second(&mut self) {
        let (p50_us, p99_us, worst_us) = quantiles(&self.second);
        let second = (!self.second.is_empty()).then_some(Second { p50_us, p99_us, worst_us });
        self.second.reset();
        if self.seconds.len() == N_SECONDS {
            self.seconds.pop_front();
        }
        self.seconds.push_back(second);
    }

    /// What there is to show.
    pub fn report(&self) -> LiveLatencyReport {
        LiveLatencyReport {
            n: self.stretches.last().map_or(0, |whole| whole.quantiles.len()),
            n_late: self.n_late,
            stretches: self.stretches.iter().map(Stretch::report).collect(),
            seconds: self.seconds.iter().copied().collect(),
        }
    }
}

/// Names of the stretches, in their order.
pub fn stretch_names() -> Vec<String> {
    let hops = HopStamps::HOPS.iter().map(|(from, to)| format!("{from} \u{2192} {to}"));
    hops.chain([String::from("end to end")]).collect()
}

impl Stretch {
    fn enter(&mut self, latency_ns: i64) {
        let latency_ns = in_range(latency_ns);
        self.quantiles.saturating_record(latency_ns);
        let bin = ((latency_ns as f64 * 1e-3).log10() * 10.0).max(0.0) as usize;
        self.bins[bin.min(N_BINS - 1)] += 1;
    }

    fn report(&self) -> StretchReport {
        let (p50_us, p99_us, worst_us) = quantiles(&self.quantiles);
        StretchReport { p50_us, p99_us, worst_us, bins: self.bins.to_vec() }
    }
}

/// Stamps of another process that run backwards count as the smallest latency.
fn in_range(latency_ns: i64) -> u64 {
    latency_ns.max(1).unsigned_abs().min(LONGEST_NS)
}

fn quantiles(histogram: &Histogram<u64>) -> (f64, f64, f64) {
    let at = |q: f64| histogram.value_at_quantile(q) as f64 * 1e-3;
    (at(0.5), at(0.99), histogram.max() as f64 * 1e-3)
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;

    /// The state behind a command whose hops took so long.
    fn state(command_sequence: u64, hops_us: [i64; N_HOPS]) -> SlaveState {
        let device_ns = 1_000_000_000;
        let after = |n: usize| device_ns + 1000 * hops_us[..n].iter().sum::<i64>();
        let stamps = HopStamps {
            device_ns,
            input_sent_ns: after(1),
            setpoint_sent_ns: after(2),
            command_sent_ns: after(3),
            drive_written_ns: after(4),
            ..HopStamps::default()
        };
        SlaveState { command_sequence, stamps, ..SlaveState::default() }
    }

    fn is_near(value_us: f64, expected_us: f64) -> bool {
        // The histograms keep three digits.
        (value_us / expected_us - 1.0).abs() < 2e-3
    }

    #[test]
    fn each_command_counts_once_and_every_hop_by_itself() {
        let mut latency = LiveLatency::new().expect("histograms");
        for n in 1..=100 {
            // The slave reports one command in many states.
            for _ in 0..3 {
                latency.state(&state(n, [1, 10, 100, 1000]), 2000.0);
            }
        }
        latency.state(&state(101, [1, 10, 100, 5000]), 2000.0);
        let report = latency.report();
        assert_eq!((report.n, report.n_late), (101, 1), "one of them is late");
        let expected_us = [1.0, 10.0, 100.0, 1000.0, 1111.0];
        for (idx, (stretch, expected_us)) in report.stretches.iter().zip(expected_us).enumerate() {
            assert!(is_near(stretch.p50_us, expected_us), "{idx}: {stretch:?}");
            assert_eq!(stretch.bins.iter().sum::<u64>(), 101);
        }
        // Ten bars a decade: those of one, ten, a hundred and a thousand microseconds begin there.
        for (idx, bin) in [(0, 0), (1, 10), (2, 20)] {
            assert_eq!(report.stretches[idx].bins[bin], 101, "hop {idx}");
        }
        assert_eq!((report.stretches[3].bins[30], report.stretches[3].bins[36]), (100, 1));
        assert!(is_near(report.stretches[4].worst_us, 5111.0), "{:?}", report.stretches[4]);
    }

    #[test]
    fn a_second_has_its_own_figures_and_one_without_a_sample_has_none() {
        let mut latency = LiveLatency::new().expect("histograms");
        latency.state(&state(1, [10, 10, 10, 10]), 2000.0);
        latency.end_second();
        latency.end_second();
        latency.state(&state(2, [20, 20, 20, 20]), 2000.0);
        latency.end_second();
        let seconds = latency.report().seconds;
        let medians: Vec<Option<bool>> = seconds
            .iter()
            .zip([40.0, 0.0, 80.0])
            .map(|(second, expected_us)| second.map(|second| is_near(second.p50_us, expected_us)))
            .collect();
        assert_eq!(medians, [Some(true), None, Some(true)], "{seconds:?}");
        (0..2 * N_SECONDS).for_each(|_| latency.end_second());
        assert_eq!(latency.report().seconds, vec![None; N_SECONDS], "the oldest make room");
    }

    #[test]
    fn what_was_not_driven_counts_nowhere_and_a_clock_that_runs_backwards_is_the_shortest() {
        let mut latency = LiveLatency::new().expect("histograms");
        let SlaveState { stamps, .. } = state(1, [10; N_HOPS]);
        for stamps in [HopStamps { drive_written_ns: 0, ..stamps }, HopStamps { device_ns: 0, ..stamps }] {
            latency.state(&SlaveState { command_sequence: 1, stamps, ..SlaveState::default() }, 2000.0);
        }
        assert_eq!(latency.report().n, 0);
        latency.state(&state(2, [10, -5, 10, 10]), 2000.0);
        let report = latency.report();
        assert_eq!((report.n, report.stretches[1].bins[0]), (1, 1), "{report:?}");
    }
}
