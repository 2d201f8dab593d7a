//! Judges each actuator after each cycle: silent, deaf to its goals, tripped, limp, started anew, leapt.
//!
//! A missing answer or two mean nothing; what led to it is no evidence of anything but which actuator it was. A failure stays
//! until power is switched anew, whatever comes back.

use crate::bus::{PerActuator, Seen, Trouble};
use crate::exchange::Phase;
use krait_ipc::message::MAX_ACTUATORS;
use krait_slave::{ActuatorState, DriveError};

/// What is remembered of the cycles before.
#[derive(Clone, Debug)]
pub(crate) struct Judge {
    n_actuators: usize,
    lost_cycles: u32,
    leap_counts: i32,
    n_missing: PerActuator<u32>,
    /// Cycles of these, without one of silence since, in which it answered and knew another goal.
    n_other: PerActuator<u32>,
    /// Where each was when it last answered; none: not known since power was switched.
    counts: PerActuator<Option<i32>>,
    answered_ns: PerActuator<i64>,
    /// How often each had started anew when power was switched.
    n_boots: PerActuator<u32>,
}

/// What was found, before units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Finding {
    /// The bus knows all about it.
    Known(DriveError),
    /// Its encoder leapt by so many counts.
    Leapt { actuator: usize, counts: i64 },
}

impl Judge {
    pub(crate) fn new(n_actuators: usize, lost_cycles: u32, leap_counts: i32, now_ns: i64) -> Self {
        Self {
            n_actuators,
            lost_cycles,
            leap_counts,
            n_missing: [0; MAX_ACTUATORS],
            n_other: [0; MAX_ACTUATORS],
            counts: [None; MAX_ACTUATORS],
            answered_ns: [now_ns; MAX_ACTUATORS],
            n_boots: [0; MAX_ACTUATORS],
        }
    }

    /// Power is switched anew: what failed before is forgiven, and whatever moved meanwhile has not leapt.
    pub(crate) fn begin(&mut self, seen: &Seen) {
        self.n_boots = seen.n_boots;
        (self.n_missing, self.n_other) = ([0; MAX_ACTUATORS], [0; MAX_ACTUATORS]);
        self.counts = [None; MAX_ACTUATORS];
    }

    /// Looks at what was seen in a phase; `told` are the goals of the same cycle, where any were sent.
    pub(crate) fn look(
        &mut self,
        seen: &Seen,
        told: Option<&PerActuator<i32>>,
        phase: Phase,
        now_ns: i64,
    ) -> Option<Finding> {
        let mut found = None;
        for k in 0..self.n_actuators {
            let finding = self.look_at(k, seen, told, phase, now_ns);
            found = found.or(finding);
        }
        // One cause, such as the supply of the bus, which may have gone between two answers: nobody is left who would hold.
        let most = self.lost_cycles.saturating_sub(1).max(1);
        let is_silent = |k: usize| self.n_missing[k] >= most && self.n_other[k] == 0;
        let is_lost = matches!(found, Some(Finding::Known(DriveError::Lost { .. })));
        if is_lost && self.n_actuators > 1 && (0..self.n_actuators).all(is_silent) {
            let longest_ms = (0..self.n_actuators).map(|k| self.silent_ms(k, now_ns)).fold(0.0, f64::max);
            return Some(Finding::Known(DriveError::AllLost { silent_ms: longest_ms }));
        }
        found
    }

    fn look_at(
        &mut self,
        k: usize,
        seen: &Seen,
        told: Option<&PerActuator<i32>>,
        phase: Phase,
        now_ns: i64,
    ) -> Option<Finding> {
        let actuator = k + 1;
        let is_driven = matches!(phase, Phase::On | Phase::Stopped);
        // Power or not, its zero may be gone.
        if seen.n_boots[k] != self.n_boots[k] {
            return Some(Finding::Known(DriveError::Reset { actuator }));
        }
        if seen.has_answered[k] {
            // An actuator that is limp or has started anew says so; that is worth more than which goal it remembers.
            match seen.trouble[k] {
                Trouble::Limp if is_driven => return Some(Finding::Known(DriveError::Limp { actuator })),
                Trouble::Tripped { code, meaning } if phase != Phase::Off => {
                    return Some(Finding::Known(DriveError::Tripped { actuator, code: code.into(), meaning }));
                }
                Trouble::HardwareStop { code } if phase != Phase::Off => {
                    return Some(Finding::Known(DriveError::HardwareStop { actuator, code: code.into() }));
                }
                _ if is_driven && !seen.is_powered[k] => return Some(Finding::Known(DriveError::Reset { actuator })),
                _ => {}
            }
        }
        // Who is being configured answers nothing yet; how long that may take is the bus's business.
        if seen.is_busy[k] && !is_driven {
            (self.n_missing[k], self.n_other[k]) = (0, 0);
            return None;
        }
        // An answer that knows another goal than the one just sent answers an earlier question, or the goal was lost.
        let in_step = seen.has_answered[k] && told.is_none_or(|told| told[k] == seen.goal_counts[k]);
        if !in_step {
            self.n_missing[k] += 1;
            self.n_other[k] = if seen.has_answered[k] { self.n_other[k] + 1 } else { 0 };
            let is_lost = self.n_missing[k] >= self.lost_cycles;
            return is_lost.then_some(Finding::Known(self.lost(k, now_ns)));
        }
        (self.n_missing[k], self.n_other[k], self.answered_ns[k]) = (0, 0, now_ns);
        let before = self.counts[k].replace(seen.counts[k]).filter(|_| phase != Phase::Off)?;
        let counts = i64::from(seen.counts[k]) - i64::from(before);
        (counts.unsigned_abs() > u64::from(self.leap_counts.unsigned_abs()))
            .then_some(Finding::Leapt { actuator, counts })
    }

    /// Why an actuator is not in step: it is silent, or it answers and knows another goal.
    fn lost(&self, k: usize, now_ns: i64) -> DriveError {
        let actuator = k + 1;
        if self.n_other[k] >= self.lost_cycles {
            return DriveError::OtherGoal { actuator };
        }
        DriveError::Lost { actuator, silent_ms: self.silent_ms(k, now_ns) }
    }

    fn silent_ms(&self, k: usize, now_ns: i64) -> f64 {
        now_ns.saturating_sub(self.answered_ns[k]) as f64 * 1e-6
    }

    /// What an actuator is doing, as far as is known.
    pub(crate) fn state(&self, k: usize, seen: &Seen, phase: Phase) -> ActuatorState {
        if self.n_missing[k] >= self.lost_cycles {
            return ActuatorState::Lost;
        }
        match (seen.trouble[k], phase) {
            (Trouble::Limp, _) => ActuatorState::Limp,
            (Trouble::Tripped { .. }, _) => ActuatorState::Faulted,
            (Trouble::HardwareStop { .. }, _) if !seen.is_powered[k] => ActuatorState::Off,
            (Trouble::HardwareStop { .. }, _) => ActuatorState::QuickStopped,
            (Trouble::None, Phase::Switching) if !seen.is_powered[k] || seen.is_unguarded[k] => {
                ActuatorState::Switching
            }
            (Trouble::None, _) if !seen.is_powered[k] => ActuatorState::Off,
            (Trouble::None, Phase::Stopped) => ActuatorState::QuickStopped,
            (Trouble::None, _) => ActuatorState::On,
        }
    }
}
