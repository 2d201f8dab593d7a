//! Relaxing: where one antagonist has let go of its line, the others give way to their own loads ([`krait_slave::GivingWay`]).
//!
//! Problem: lines that hold each other bend the snake to where one that is limp leaves it, and stay loaded against its structure.
//! Failure: whatever is not known (an answer, a load) keeps all where they are; what has ended does not begin again.

use crate::bus::{PerActuator, Seen};
use krait_ipc::message::Actuators;
use krait_slave::{DriveError, GivingWay, RelaxLimits};

/// The actuator that may have let go of its line, from 0. One that is silent or whose encoder leapt says nothing of the kind, and one
/// behind the `n_together` that hold each other held none of their lines.
pub(crate) fn suspect(failure: &DriveError, n_together: usize) -> Option<usize> {
    let suspect = match failure {
        DriveError::Limp { actuator }
        | DriveError::Reset { actuator }
        | DriveError::Tripped { actuator, .. }
        | DriveError::HardwareStop { actuator, .. } => Some(actuator - 1),
        _ => None,
    };
    suspect.filter(|k| *k < n_together)
}

/// The others while one is limp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relaxing {
    way: GivingWay,
    limp: usize,
    /// Who holds against it; the others stay.
    antagonists: PerActuator<bool>,
}

impl Relaxing {
    pub(crate) fn new(limits: RelaxLimits, (limp, antagonists): (usize, PerActuator<bool>), now_ns: i64) -> Self {
        Self { way: GivingWay::new(limits, now_ns), limp, antagonists }
    }

    pub(crate) fn has_begun(&self) -> bool {
        self.way.has_begun()
    }

    /// Whether an actuator, from 0, gives way.
    pub(crate) fn moves(&self, k: usize) -> bool {
        self.has_begun() && self.antagonists[k]
    }

    /// Where the others go in this period, m, from where all stand; none: it has ended for good.
    pub(crate) fn step(
        &mut self,
        goal_m: Actuators,
        tau_n: Actuators,
        seen: &Seen,
        (n, now_ns, period_ns): (usize, i64, i64),
    ) -> Option<Actuators> {
        if now_ns >= self.way.until_ns() {
            return None;
        }
        let has_all = seen.has_answered.iter().take(n).all(|answered| *answered);
        if !has_all || !seen.has_let_go[self.limp] {
            // It says that it holds again: that is the end. Silence or a word that is still to come is waited for.
            let holds = seen.has_answered[self.limp] && self.has_begun() && !seen.has_let_go[self.limp];
            return (!holds).then_some(goal_m);
        }
        // Other joints and segments stay, and a gripper's wire: what its jaw holds it goes on holding.
        let loads_n = core::array::from_fn(|k| if self.antagonists[k] { tau_n[k] } else { 0.0 });
        self.way.step(goal_m, loads_n, (now_ns, period_ns))
    }
}
