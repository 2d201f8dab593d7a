//! What the actuators shall do: published by `compensate`, read by `slave`.

use super::{HopStamps, message};
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
    /// The bend vector that this command is for, rad; equals the setpoint's.
    pub bend_rad: [f64; 2],
    /// q of Eq. (1): what an inextensible snake would need, m, push positive.
    pub q_uncompensated_m: [f64; 3],
    /// q~ = q + eps: what the actuators are told, m, push positive.
    pub q_tilde_m: [f64; 3],
    /// Actuator rates that J~ asks for, m/s; copied from the setpoint, NaN where nobody has computed them.
    pub q_tilde_vel_m_per_s: [f64; 3],
    /// Load scale eta in use, 1; NaN where a model file's chain compensates.
    pub eta: f64,
    /// Backlash lambda (half-width, with the sign of motion) in use, m; NaN where a model file's chain compensates.
    pub lambda_m: f64,
    /// Counts model changes since start; 0 is the model as configured.
    pub model_version: u64,
    /// See [`Compensation`].
    pub compensation: u32,
    /// See [`super::Phase`]; copied from the setpoint.
    pub phase: u32,
    /// The set of reasons ([`crate::Reasons`]) that hold at this sample.
    pub reasons: u64,
}

message!(Command, "command", 3, super::EVERY_SAMPLE);

impl Command {
    /// The typed compensation mode, or `None` for a value that no version of krait sends.
    pub fn compensation(&self) -> Option<Compensation> {
        Compensation::ALL.into_iter().find(|c| *c as u32 == self.compensation)
    }
}

/// How q becomes q~.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compensation {
    /// q~ = q.
    Off = 0,
    /// Eqs. (15)-(17): extension of the lines with the loading friction branch always.
    Naive = 1,
    /// Eqs. (18)-(23): load scale and backlash estimated, signs of motion where the physics has them.
    Estimated = 2,
    /// The inverse of a model file's chain of effects.
    Model = 3,
}

impl Compensation {
    /// Every mode.
    pub const ALL: [Self; 4] = [Self::Off, Self::Naive, Self::Estimated, Self::Model];

    /// The word used in configuration, tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Naive => "naive",
            Self::Estimated => "estimated",
            Self::Model => "model",
        }
    }
}
