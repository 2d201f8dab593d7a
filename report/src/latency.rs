//! Latency of each hop and of the whole chain, from the stamps in the slave's states.

use hdrhistogram::{CreationError, Histogram};
use krait_ipc::message::{HopStamps, SlaveState};
use serde::Serialize;

/// Longest latency that the histograms hold, ns (10 s).
const LONGEST_NS: u64 = 10_000_000_000;

/// Quantiles of a latency, microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Largest.
    pub max: f64,
}

/// Latency of one hop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HopReport {
    /// Where the sample left.
    pub from: &'static str,
    /// Where it arrived.
    pub to: &'static str,
    /// Quantiles, microseconds.
    #[serde(flatten)]
    pub quantiles: Quantiles,
}

/// Latency of the whole chain.
#[derive(Clone, Debug, Serialize)]
pub struct LatencyReport {
    /// Device stamp to drive written.
    pub end_to_end: Quantiles,
    /// Each hop: from the moment that one stage had published to the moment that the next had.
    pub hops: Vec<HopReport>,
}

/// Histograms of every hop, filled from the slave's states.
pub struct LatencyLog {
    end_to_end: Histogram<u64>,
    hops: Vec<Histogram<u64>>,
    last_command: u64,
}

impl LatencyLog {
    /// Empty histograms.
    ///
    /// # Errors
    /// Never with these bounds; the histogram library checks them.
    pub fn new() -> Result<Self, CreationError> {
        let empty = || Histogram::new_with_bounds(1, LONGEST_NS, 3);
        let hops = HopStamps::HOPS.iter().map(|_| empty()).collect::<Result<_, _>>()?;
        Ok(Self { end_to_end: empty()?, hops, last_command: 0 })
    }

    /// Takes a slave state; each command counts once. Returns whether this one counted.
    pub fn state(&mut self, state: &SlaveState) -> bool {
        let stamps = &state.stamps;
        if state.command_sequence == self.last_command || stamps.drive_written_ns == 0 || stamps.device_ns == 0 {
            return false;
        }
        self.last_command = state.command_sequence;
        enter(&mut self.end_to_end, stamps.end_to_end_ns());
        for (hop, histogram) in self.hops.iter_mut().enumerate() {
            enter(histogram, stamps.hop_ns(hop));
        }
        true
    }

    /// Commands that have counted.
    pub fn n_samples(&self) -> u64 {
        self.end_to_end.len()
    }

    /// The quantiles.
    pub fn report(&self) -> LatencyReport {
        let hops = self.hops.iter().zip(HopStamps::HOPS).map(|(histogram, (from, to))| HopReport {
            from,
            to,
            quantiles: quantiles(histogram),
        });
        LatencyReport { end_to_end: quantiles(&self.end_to_end), hops: hops.collect() }
    }
}

fn enter(histogram: &mut Histogram<u64>, latency_ns: i64) {
    histogram.saturating_record(u64::try_from(latency_ns).unwrap_or(0).clamp(1, LONGEST_NS));
}

fn quantiles(histogram: &Histogram<u64>) -> Quantiles {
    let at = |q: f64| histogram.value_at_quantile(q) as f64 * 1e-3;
    Quantiles { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: histogram.max() as f64 * 1e-3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_counts_once_however_many_states_repeat_it() {
        let mut log = LatencyLog::new().expect("histograms");
        let mut state = SlaveState {
            sequence: 1,
            sample_ns: 0,
            stamps: HopStamps { device_ns: 1000, drive_written_ns: 251_000, ..HopStamps::default() },
            command_sequence: 7,
            operating_state: 1,
            flags: 7,
            setpoint_q_m: [0.0; 3],
            setpoint_bend_rad: [0.0; 2],
            measured_q_m: [0.0; 3],
            measured_tau_n: [0.0; 3],
            reasons: 0,
            n_commands: 0,
            n_refused: 0,
            ..SlaveState::default()
        };
        log.state(&state);
        log.state(&state);
        state.command_sequence = 8;
        log.state(&state);
        assert_eq!(log.end_to_end.len(), 2);
        assert!((log.report().end_to_end.p50 - 250.0).abs() < 1.0);
    }
}
