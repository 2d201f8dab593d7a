//! From rounds to figures: quantiles, ratio to the floor, use of the machine, losses.

use crate::samples::{N_HOPS, RelaySample};
use crate::{Round, Usage};
use hdrhistogram::Histogram;
use serde::Serialize;

/// Longest latency that the histograms hold, ns (10 s).
const LONGEST_NS: u64 = 10_000_000_000;

/// Quantiles of a latency, microseconds; zero where there is no sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Largest.
    pub max: f64,
}

impl Quantiles {
    /// The quantiles of latencies in ns, to three digits.
    pub fn of_ns(values: impl IntoIterator<Item = i64>) -> Self {
        let Ok(mut histogram) = Histogram::<u64>::new_with_bounds(1, LONGEST_NS, 3) else { return Self::default() };
        for value in values {
            histogram.saturating_record(u64::try_from(value).unwrap_or(0).clamp(1, LONGEST_NS));
        }
        Self::of(&histogram)
    }

    /// The quantiles of a histogram of latencies in ns; all zero for an empty one.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        if histogram.is_empty() {
            return Self::default();
        }
        let at = |q: f64| histogram.value_at_quantile(q) as f64 * 1e-3;
        Self { p50: at(0.5), p90: at(0.9), p99: at(0.99), p999: at(0.999), max: histogram.max() as f64 * 1e-3 }
    }
}

/// Figures of one chain over all its rounds, microseconds; the shape of `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct ChainFigures {
    /// The chain.
    pub name: &'static str,
    /// From one process to the next, how often.
    pub hops: usize,
    /// From the source's stamp to the end of the chain.
    #[serde(flatten)]
    pub latency: Quantiles,
    /// Of each hop.
    pub per_hop: [Quantiles; N_HOPS],
    /// Medians of the rounds, in their order.
    pub p50_of_rounds: Vec<f64>,
    /// Median of the rounds' medians over that of the floor, round by round; absent without the floor.
    pub ratio_to_floor: Option<f64>,
    /// The chain's own work per sample: everything but waiting and transport; absent for a relay, which computes nothing.
    pub own_work: Option<Quantiles>,
    /// Part of one core that all processes of the chain used together.
    pub cpu_share: f64,
    /// Context switches per sample, all processes together.
    pub switches_per_sample: f64,
    /// Samples that the figures rest on: those after the warm-up.
    pub measured: usize,
    /// Samples sent, the warm-up included.
    pub sent: u64,
    /// Of these, lost.
    pub lost: u64,
}

/// All rounds of a chain.
#[derive(Clone, Debug)]
pub struct ChainRounds {
    /// The chain.
    pub name: &'static str,
    /// Its rounds, in order.
    pub rounds: Vec<Round>,
}

impl ChainRounds {
    /// All samples.
    pub fn samples(&self) -> impl Iterator<Item = &RelaySample> {
        self.rounds.iter().flat_map(|round| &round.samples)
    }

    /// Median of each round, microseconds.
    pub fn p50_of_rounds(&self) -> Vec<f64> {
        self.rounds
            .iter()
            .map(|round| Quantiles::of_ns(round.samples.iter().map(RelaySample::latency_ns)).p50)
            .collect()
    }

    /// The figures, beside those of the floor measured in the same rounds.
    pub fn figures(&self, floor: Option<&Self>) -> ChainFigures {
        let mut usage = Usage::default();
        for round in &self.rounds {
            usage += round.usage;
        }
        let own_work: Vec<i64> =
            self.rounds.iter().flat_map(|round| &round.own_work_ns).map(|ns| i64::from(*ns)).collect();
        let measured = self.samples().count();
        ChainFigures {
            name: self.name,
            hops: N_HOPS,
            latency: Quantiles::of_ns(self.samples().map(RelaySample::latency_ns)),
            per_hop: core::array::from_fn(|hop| Quantiles::of_ns(self.samples().map(|s| s.hop_ns(hop)))),
            p50_of_rounds: self.p50_of_rounds(),
            ratio_to_floor: floor.and_then(|floor| median_ratio(&self.p50_of_rounds(), &floor.p50_of_rounds())),
            own_work: (!own_work.is_empty()).then(|| Quantiles::of_ns(own_work)),
            cpu_share: usage.cpu_share(),
            switches_per_sample: usage.n_switches as f64 / (measured as f64).max(1.0),
            measured,
            sent: self.rounds.iter().map(|round| round.n_sent).sum(),
            lost: self.rounds.iter().map(|round| round.n_lost).sum(),
        }
    }
}

/// The median over the rounds with samples of one value over the other: what disturbed a whole round disturbed both.
fn median_ratio(values: &[f64], floors: &[f64]) -> Option<f64> {
    let mut ratios: Vec<f64> = values
        .iter()
        .zip(floors)
        .filter(|(value, floor)| **value > 0.0 && **floor > 0.0)
        .map(|(value, floor)| value / floor)
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rounds(name: &'static str, medians_us: &[i64]) -> ChainRounds {
        let round = |us: &i64| Round {
            samples: (1..=101)
                .map(|i| {
                    let end_ns = us * 1000 + (i - 51) * 10;
                    RelaySample {
                        sequence: i.unsigned_abs(),
                        source_ns: 0,
                        arrived_ns: [end_ns / 3, end_ns / 2, end_ns],
                    }
                })
                .collect(),
            n_sent: 151,
            n_lost: 2,
            usage: Usage { cpu_ns: 1_000, n_switches: 202, wall_ns: 10_000 },
            own_work_ns: Vec::new(),
        };
        ChainRounds { name, rounds: medians_us.iter().map(round).collect() }
    }

    #[test]
    fn figures_are_those_of_all_rounds_and_the_ratio_is_taken_round_by_round() {
        // A round in which the whole machine was ten times slower does not change the ratio.
        let (floor, chain) = (rounds("floor-futex", &[10, 100, 11]), rounds("krait", &[20, 200, 22]));
        let figures = chain.figures(Some(&floor));
        assert!((figures.ratio_to_floor.expect("a floor") - 2.0).abs() < 0.01, "{figures:?}");
        assert_eq!((figures.measured, figures.sent, figures.lost), (303, 453, 6));
        assert!((figures.cpu_share - 0.1).abs() < 1e-12 && (figures.switches_per_sample - 2.0).abs() < 1e-12);
        assert!((figures.latency.p50 - 22.0).abs() < 0.6, "{figures:?}");
        assert!(figures.own_work.is_none() && chain.figures(None).ratio_to_floor.is_none());
    }

    #[test]
    fn a_chain_without_a_sample_has_figures_of_zero() {
        assert_eq!(Quantiles::of_ns([]), Quantiles::default());
        let empty = ChainRounds { name: "pipe", rounds: vec![Round::default()] };
        assert_eq!(empty.figures(Some(&empty)).ratio_to_floor, None);
    }
}
