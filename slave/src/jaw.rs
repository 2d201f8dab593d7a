//! Where the jaw of a gripper is, as far as the slave knows: where it was last told to be, or where an encoder finds its wire.
//!
//! Problem: power may come while the jaw stands open or holds something. A setpoint of zero would then have it closed as soon as the
//! operator moves anything.
//!
//! Intuition: what was told counts as long as the wire is still there, because the wire's play and stretch are in it; a wire that is
//! elsewhere (the slave began anew, somebody turned the spool without power) tells the jaw to within these.

use crate::{Drive, SlaveCore};
use krait_ipc::message::{JAW, MAX_JOINTS};

impl<D: Drive> SlaveCore<D> {
    /// A command was executed: its wire is where the jaw was told to be.
    pub(crate) fn note_jaw(&mut self) {
        if let Some(wire) = self.drive.traits().alone() {
            self.jaw_wire_m = self.gate.q_m()[wire];
        }
    }

    /// Power has come: the jaw is where its wire is found, if that is not where it was told to be.
    pub(crate) fn find_jaw(&mut self) {
        let traits = self.drive.traits();
        let (Some(wire), Some(jaw_m_per_rad)) = (traits.alone(), traits.jaw_m_per_rad) else { return };
        let found_m = self.reading.q_tilde_m[wire];
        if (found_m - self.jaw_wire_m).abs() > self.limiter.limits().engage_m {
            (self.jaw_wire_m, self.setpoint_joints_rad[JAW]) = (found_m, found_m / jaw_m_per_rad);
        }
    }

    /// The lines were homed: all is at zero but a jaw, which was not moved.
    pub(crate) fn zero_setpoint(&mut self) {
        let jaw_rad = self.setpoint_joints_rad[JAW];
        (self.setpoint_bend_rad, self.setpoint_joints_rad) = ([0.0; 2], [0.0; MAX_JOINTS]);
        if self.drive.traits().alone().is_some() {
            self.setpoint_joints_rad[JAW] = jaw_rad;
        }
    }
}
