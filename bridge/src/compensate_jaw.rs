//! Actuation compensation of a gripper's wire: a wanted angle of the jaw becomes a length of wire, beside the snake's lines and apart
//! from them.
//!
//! Problem: u such that y(u; memory of the wire's effects) is what is wanted. The wire runs through the central tube, whose length no
//! bend changes, so the bend is no argument.
//!
//! Failure: as the lines'; what limits the wire limits no line, and the other way round.

use crate::config::CompensateConfig;
use crate::reach::{Reach, Wish};
use krait_ipc::Reason;
use krait_ipc::Reasons;
use krait_ipc::message::{Command, GRIPPER_WIRE, JAW, N_WITH_GRIPPER, Setpoint, SlaveState};
use krait_model::gripper::Gripper;
use krait_model::joints::{JointCompensator, JointInverseSettings};
use krait_model::{ChainError, Circumstances};
use nalgebra::SVector;

/// Part of the largest rate of an actuator at which a play is crossed.
const PART_OF_RATE: f64 = 0.9;

/// The wire of a snake's gripper.
#[derive(Clone, Debug)]
pub(crate) struct JawWire {
    joint: JointCompensator,
    /// Where a warm-up step keeps what the joint remembers.
    spare: JointCompensator,
    reach: Reach<1>,
    spare_reach: Reach<1>,
    q_uncompensated_m: f64,
    q_tilde_m: f64,
}

/// What a step of the wire rests on beside the setpoint.
pub(crate) struct JawStep<'a> {
    pub at: &'a Circumstances,
    pub state: Option<&'a SlaveState>,
    /// Whether setpoint and state are young enough.
    pub is_fresh: bool,
    pub step_s: f64,
}

impl JawWire {
    /// At rest at the jaw's zero. Where the jaw turns back, its wire crosses its play as fast as the actuator may at the jaw's fastest
    /// motion and no faster, so that a play that is crossed is no limit that holds anything back.
    pub(crate) fn new(gripper: &Gripper, config: &CompensateConfig) -> Result<Self, ChainError> {
        let fastest_m_per_s = gripper.numbers().wire_m_per_rad * gripper.numbers().max_vel_deg_per_s.to_radians();
        let usual = JointInverseSettings::default();
        let reversal_gain = (PART_OF_RATE * config.max_rate_m_per_s / fastest_m_per_s).clamp(1.0, usual.reversal_gain);
        let joint = gripper.chain().compensator(JointInverseSettings { reversal_gain, ..usual })?;
        let (spare, reach) = (joint.clone(), Reach::behind_lines());
        Ok(Self { joint, spare, reach, spare_reach: reach, q_uncompensated_m: 0.0, q_tilde_m: 0.0 })
    }

    /// Keeps what a warm-up step will change.
    pub(crate) fn keep(&mut self) {
        self.spare.remember_as(&self.joint);
        self.spare_reach = self.reach;
    }

    /// Forgets a warm-up step.
    pub(crate) fn forget(&mut self) {
        self.joint.remember_as(&self.spare);
        self.reach = self.spare_reach;
    }

    /// One step for a setpoint; returns whether the effects' formulas had values.
    ///
    /// # Real-time
    /// No allocation, no clock; the joint's inverse has a largest number of rounds.
    pub(crate) fn step(
        &mut self,
        setpoint: &Setpoint,
        step: &JawStep,
        config: &CompensateConfig,
        reasons: &mut Reasons,
    ) -> bool {
        let wanted = [setpoint.joints_rad[JAW]];
        let n_faults = self.joint.n_formula_faults();
        let found = self.joint.step(&wanted, step.at);
        let is_finite = self.joint.n_formula_faults() == n_faults;
        reasons.insert_if(Reason::JointUnreachable, !found.is_reachable);
        let wish = Wish {
            raw_m: SVector::from([found.u[0]]),
            load_n: 0.0,
            state: step.state,
            is_fresh: step.is_fresh && is_finite,
            step_s: step.step_s,
        };
        self.q_tilde_m = self.reach.command(&wish, config, reasons)[0];
        self.q_uncompensated_m = self.joint.without_effects(&wanted)[0];
        is_finite
    }

    /// Puts the wire beside the lines.
    pub(crate) fn add_to(&self, setpoint: &Setpoint, command: &mut Command) {
        command.joints_rad[JAW] = setpoint.joints_rad[JAW];
        command.q_uncompensated_m[GRIPPER_WIRE] = self.q_uncompensated_m;
        command.q_tilde_m[GRIPPER_WIRE] = self.q_tilde_m;
        command.n_actuators = N_WITH_GRIPPER as u32;
    }
}
