//! Power of the drives: switching takes time and is polled; what a fault does to it is the drives' business.

use crate::{Drive, DriveError, OnFault, SlaveCore, Switching, TransitionRefused};
use krait_ipc::Reason;
use krait_ipc::message::{OperatingState, Transition};

/// Drives that are not under power after so long have failed, ns.
const SWITCHING_NS: i64 = 5_000_000_000;
const NO_POWER: &str = "after 5 s they were not all under power with the limits that they were told, as while an emergency stop is pressed";

impl<D: Drive> SlaveCore<D> {
    /// Whether power has been asked for and has not come yet.
    pub(crate) fn is_switching(&self) -> bool {
        self.switching_since_ns.is_some()
    }

    /// Power has come: the setpoint is where the encoders say.
    pub(crate) fn powered_up(&mut self, now_ns: i64) -> Result<(), TransitionRefused> {
        self.switching_since_ns = None;
        self.read(now_ns);
        if let Some(error) = self.drive_error {
            return Err(error.into());
        }
        self.gate.rest_at(self.reading.q_tilde_m);
        self.find_jaw();
        if self.home_on_start && !self.machine.is_homed() && self.machine.state() == OperatingState::Enabled {
            self.machine.apply(Transition::Home)?;
        }
        Ok(())
    }

    /// Goes on waiting for power that has not come yet.
    pub(crate) fn continue_switching(&mut self, since_ns: i64, now_ns: i64) {
        match self.drive.set_power(now_ns, true) {
            Ok(Switching::Done) => {
                // Whatever is wrong now has led to FAULT, which says so.
                let result = self.powered_up(now_ns);
                debug_assert!(result.is_ok() || self.machine.state() == OperatingState::Fault, "{result:?}");
            }
            Ok(Switching::Busy) if now_ns.saturating_sub(since_ns) > SWITCHING_NS => {
                self.fault(DriveError::Failed { what: NO_POWER }, now_ns);
            }
            Ok(Switching::Busy) => {
                self.read(now_ns);
                self.gate.rest_at(self.reading.q_tilde_m);
            }
            Err(error) => self.fault(error, now_ns),
        }
    }

    /// From now on motion is forbidden, until somebody asks to try again. What becomes of the power is the drives' business.
    pub(crate) fn fault(&mut self, error: DriveError, now_ns: i64) {
        self.disengage(Reason::DriveFault, None);
        self.gate.rest();
        self.switching_since_ns = None;
        if self.machine.state() == OperatingState::Fault {
            return;
        }
        self.machine.fault();
        // Who asked for power off before the fault gets it: nothing is relaxed any more.
        let lets_go = self.letting_go.take().is_some() || self.drive.traits().on_fault == OnFault::PowerOff;
        self.has_kept_power = !lets_go;
        let is_safe = if lets_go {
            self.drive.set_power(now_ns, false).is_ok()
        } else {
            self.drive.quick_stop(now_ns);
            true
        };
        // That power could not be removed is worse news than why it should have been.
        self.drive_error =
            Some(if is_safe { error } else { DriveError::Failed { what: "power could not be removed after a fault" } });
    }
}
