//! Latency of each hop and of the whole chain, from the stamps in the slave's states.

use hdrhistogram::{CreationError, Histogram};
use krait_bench::Quantiles;
use krait_ipc::message::{HopStamps, SlaveState};
use serde::Serialize;

/// Longest latency that the histograms hold, ns (10 s).
const LONGEST_NS: i64 = 10_000_000_000;

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
        let empty = || Histogram::new_with_bounds(1, LONGEST_NS.unsigned_abs(), 3);
        let hops = HopStamps::HOPS.iter().map(|_| empty()).collect::<Result<_, _>>()?;
        Ok(Self { end_to_end: empty()?, hops, last_command: 0 })
    }

    /// Takes a slave state; each command counts once, and none in a replay's own time, in which nothing takes any. Returns
    /// whether this one counted.
    pub fn state(&mut self, state: &SlaveState) -> bool {
        let stamps = &state.stamps;
        let is_live = stamps.device_ns != 0 && stamps.drive_written_ns > stamps.device_ns;
        if state.command_sequence == self.last_command || !is_live {
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
            quantiles: Quantiles::of(histogram),
        });
        LatencyReport { end_to_end: Quantiles::of(&self.end_to_end), hops: hops.collect() }
    }
}

fn enter(histogram: &mut Histogram<u64>, latency_ns: i64) {
    histogram.saturating_record(latency_ns.clamp(1, LONGEST_NS).unsigned_abs());
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
            setpoint_q_m: [0.0; 12],
            setpoint_bend_rad: [0.0; 2],
            setpoint_joints_rad: [0.0; 8],
            n_actuators: 3,
            n_joints: 0,
            measured_q_m: [0.0; 12],
            measured_tau_n: [0.0; 12],
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
