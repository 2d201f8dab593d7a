//! What the actuators shall do: published by `compensate`, read by `slave`.

use super::{Actuators, HopStamps, JointValues, MAX_LEARNT, message};
use iceoryx2::prelude::ZeroCopySend;

/// Actuator positions, uncompensated and compensated side by side.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.Command")]
pub struct Command {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of the operator input that led here, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// When each stage touched the sample.
    pub stamps: HopStamps,
    /// Sequence number of the setpoint.
    pub setpoint_sequence: u64,
    /// Sequence number of the operator input that led here; one that falls back is a master that began anew.
    pub input_sequence: u64,
    /// Sequence number of the newest slave state that this step had seen (0: none).
    pub state_sequence: u64,
    /// Sequence number of the newest model update that this step had seen (0: none).
    pub model_update_sequence: u64,
    /// The bend vector that this command is for, rad; equals the setpoint's; NaN for joints.
    pub bend_rad: [f64; 2],
    /// The positions of joints that this command is for, rad (m for a sliding joint), or the bend vectors of segments; equal the
    /// setpoint's; zeros for a snake, but for the jaw of its gripper in the place [`super::JAW`].
    pub joints_rad: JointValues,
    /// q of Eq. (1): what an inextensible snake would need, or what joints without effects would, m, push positive.
    pub q_uncompensated_m: Actuators,
    /// q~ = q + eps: what the actuators are told, m, push positive.
    pub q_tilde_m: Actuators,
    /// Actuator rates that the model asks for, m/s; copied from the setpoint, NaN where nobody has computed them.
    pub q_tilde_vel_m_per_s: Actuators,
    /// How many actuators it commands; 0: the three lines of a snake; [`super::N_WITH_GRIPPER`] and no joints: these and its gripper's wire.
    pub n_actuators: u32,
    /// How many joints they move, or twice the number of segments; 0 for a snake.
    pub n_joints: u32,
    /// Which model this command rests on: its hash.
    pub model_hash: u64,
    /// Values in force of the parameters that the model learns, in the order of the model file, each in its own unit; NaN
    /// behind the last.
    pub learnt: [f64; MAX_LEARNT],
    /// How many those are.
    pub n_learnt: u32,
    /// See [`super::Phase`]; copied from the setpoint.
    pub phase: u32,
    /// The set of reasons ([`crate::Reasons`]) that hold at this sample.
    pub reasons: u64,
}

message!(Command, "command", 5, super::EVERY_SAMPLE);

impl Command {
    /// Values in force of the parameters that the model learns.
    pub fn learnt(&self) -> &[f64] {
        &self.learnt[..(self.n_learnt as usize).min(MAX_LEARNT)]
    }
}
