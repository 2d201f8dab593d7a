//! Where the machine shall be: published by `resolve`, read by `compensate`.

use super::{Actuators, HopStamps, JointValues, message};
use iceoryx2::prelude::ZeroCopySend;

/// The setpoint, a bend vector or positions of joints, and what follows from it without compensation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.Setpoint")]
pub struct Setpoint {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of the operator input that led here, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// When each stage touched the sample.
    pub stamps: HopStamps,
    /// Sequence number of the operator input.
    pub input_sequence: u64,
    /// Sequence number of the newest slave state that this step had seen (0: none).
    pub state_sequence: u64,
    /// Bend vector b (cos delta, sin delta), rad; NaN for joints.
    pub bend_rad: [f64; 2],
    /// Its rate, rad/s.
    pub bend_vel_rad_per_s: [f64; 2],
    /// Positions of joints, rad (m for a sliding joint), or the bend vectors of segments in series one after the other, rad; zeros for
    /// a snake, but for the jaw of its gripper in the place [`super::JAW`].
    pub joints_rad: JointValues,
    /// Their rates, rad/s (m/s).
    pub joints_vel_rad_per_s: JointValues,
    /// Actuator rates, m/s. Of a snake those that J~ = (I + J alpha)^-1 J asks for: q~_dot = (J_q_b + alpha_b) b_dot.
    pub q_tilde_vel_m_per_s: Actuators,
    /// End-disk centre in the base frame for this bend or these segments, m; NaN for joints, which tells them from segments.
    pub tip_pos_in_base_m: [f64; 3],
    /// The common factor by which limits shortened the operator's motion, 0..=1.
    pub motion_scale: f64,
    /// Which model the actuator rates rest on: its hash.
    pub model_hash: u64,
    /// See [`Phase`].
    pub phase: u32,
    /// Padding, zero.
    pub reserved: u32,
    /// How many actuators have a rate; 0: the three lines of a snake; [`super::N_WITH_GRIPPER`] and no joints: these and its gripper's wire.
    pub n_actuators: u32,
    /// How many joints, or twice the number of segments; 0 for a snake.
    pub n_joints: u32,
    /// The set of reasons ([`crate::Reasons`]) that hold at this sample.
    pub reasons: u64,
}

message!(Setpoint, "setpoint", 3, super::EVERY_SAMPLE);

impl Setpoint {
    /// How many segments in series it is for; 0 for a snake and for joints.
    pub fn n_segments(&self) -> usize {
        let has_tip = self.tip_pos_in_base_m.iter().all(|m| m.is_finite());
        if has_tip { (self.n_joints as usize).min(super::MAX_JOINTS) / 2 } else { 0 }
    }

    /// Where the jaw of a snake's gripper shall be, rad; `None` for other machines and a snake without one.
    pub fn jaw_rad(&self) -> Option<f64> {
        let has_gripper = self.n_joints == 0 && self.n_actuators as usize == super::N_WITH_GRIPPER;
        has_gripper.then(|| self.joints_rad[super::JAW])
    }

    /// The typed phase, or `None` for a value that no version of krait sends.
    pub fn phase(&self) -> Option<Phase> {
        [Phase::Holding, Phase::Following].into_iter().find(|p| *p as u32 == self.phase)
    }
}

/// Whether the setpoint follows the operator.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The setpoint stands still, for the reasons given.
    Holding = 0,
    /// The setpoint follows the operator's motion.
    Following = 1,
}
