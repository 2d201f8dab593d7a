//! Counts the commands that came too late: the last stage sees every stamp, and tells the health channel while it happens.

use crate::Findings;
use krait_ipc::message::{HopStamps, SlaveState};
use krait_ipc::{LatencyLimits, Reason};

/// Looks at each executed command once.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LatencyWatch {
    limits: LatencyLimits,
    last_command: u64,
}

impl LatencyWatch {
    pub(crate) fn new(limits: LatencyLimits) -> Self {
        Self { limits, last_command: 0 }
    }

    /// Notes every latency of a newly executed command that is beyond its limit, us.
    ///
    /// # Real-time
    /// No allocation, no clock, five comparisons.
    pub(crate) fn look(&mut self, state: &SlaveState, findings: &mut Findings) {
        if state.command_sequence == self.last_command || state.stamps.drive_written_ns == 0 {
            return;
        }
        self.last_command = state.command_sequence;
        let mut note = |latency_ns: i64, limit_ns: i64| {
            if latency_ns > limit_ns {
                findings.note(Reason::LatencyBudget, latency_ns as f64 * 1e-3, limit_ns as f64 * 1e-3);
            }
        };
        note(state.stamps.end_to_end_ns(), self.limits.end_to_end_ns);
        for hop in 0..HopStamps::HOPS.len() {
            note(state.stamps.hop_ns(hop), self.limits.hops_ns[hop]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(command_sequence: u64, drive_written_ns: i64) -> SlaveState {
        let stamps = HopStamps {
            device_ns: 1000,
            input_sent_ns: 2000,
            setpoint_sent_ns: 3000,
            command_sent_ns: 4000,
            drive_written_ns,
            ..HopStamps::default()
        };
        SlaveState {
            sequence: 1,
            sample_ns: 0,
            stamps,
            command_sequence,
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
        }
    }

    #[test]
    fn a_late_command_is_noted_once_with_its_latency_and_the_limit() {
        let mut watch = LatencyWatch::new(LatencyLimits { end_to_end_ns: 10_000, hops_ns: [i64::MAX; 4] });
        let mut found = |state: &SlaveState| {
            let mut findings = Findings::default();
            watch.look(state, &mut findings);
            findings.note_of(Reason::LatencyBudget).map(|note| (note.value, note.limit))
        };
        assert_eq!(found(&state(1, 11_000)), None, "10 us are allowed");
        assert_eq!(found(&state(2, 13_000)), Some((12.0, 10.0)));
        assert_eq!(found(&state(2, 13_000)), None, "the same command again");
    }

    #[test]
    fn a_late_hop_is_noted_though_the_whole_was_in_time() {
        let limits = LatencyLimits { end_to_end_ns: i64::MAX, hops_ns: [i64::MAX, i64::MAX, 900, i64::MAX] };
        let mut findings = Findings::default();
        LatencyWatch::new(limits).look(&state(1, 5000), &mut findings);
        assert_eq!(findings.note_of(Reason::LatencyBudget).map(|note| note.limit), Some(0.9));
    }
}
