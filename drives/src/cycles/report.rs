//! What a cycle says: to the slave, which reads the newest and logs a failure, and to the record, which gets each.

use super::Cycles;
use crate::bus::ActuatorBus;
use crate::exchange::{Phase, Report};
use crate::handover::record;
use crate::units::Units;
use krait_ipc::message::DriveCycle;
use krait_slave::{ActuatorState, DriveError};

impl<B: ActuatorBus> Cycles<B> {
    pub(super) fn report(&mut self, now_ns: i64) {
        let report = self.newest_report(now_ns);
        self.exchange.report.put(&report);
        self.hand_over(&report);
    }

    /// To the slave, which publishes it; nobody waits where it does not fetch.
    pub(super) fn hand_over(&mut self, report: &Report) {
        let cycle = record(self.begun_ns, self.setup.n(), &self.wish, &self.told, &self.seen, report);
        let cycle = DriveCycle { cycle: self.n_cycles, n_left_out: self.n_left_out, ..cycle };
        self.n_left_out += u64::from(!self.exchange.cycles.push(&cycle));
    }

    pub(super) fn newest_report(&self, now_ns: i64) -> Report {
        let mut report = Report::blank();
        (report.stamp_ns, report.turn, report.phase) = (now_ns, self.wish.turn, self.phase);
        report.failure = self.failure;
        report.has_emergency = self.seen.emergency_code.iter().any(|code| *code != 0);
        let is_bus_gone = matches!(self.failure, Some(DriveError::Bus { .. }));
        for (k, units) in self.setup.units.iter().enumerate() {
            self.fill(k, units, &mut report);
            if is_bus_gone {
                report.state[k] = ActuatorState::Lost;
            }
        }
        report
    }

    fn fill(&self, k: usize, units: &Units, report: &mut Report) {
        // Without power nothing follows: a dry run shows what was wished for.
        let is_followed = !self.is_dry() || self.phase == Phase::Off;
        report.q_m[k] = if is_followed { units.metres(self.seen.counts[k]) } else { self.goal_m[k] };
        report.tau_n[k] = units.load_n(&self.seen, k);
        report.sampled_ns[k] = self.seen.sampled_ns[k];
        let state = self.judge.state(k, &self.seen, self.judged_phase());
        let relaxes = state == ActuatorState::QuickStopped && self.relaxing.is_some_and(|relaxing| relaxing.moves(k));
        report.state[k] = if relaxes { ActuatorState::Relaxing } else { state };
    }
}
