//! What the slave needs of its actuators: the seam behind which a simulated machine or real hardware sits.

use krait_ipc::message::{Actuators, Joints};

/// Push-pull actuators with encoders and loads, and perhaps a camera on what they move.
///
/// # Real-time
/// No method allocates, blocks, logs or reads a clock; every instant is the argument `stamp_ns`, CLOCK_MONOTONIC,
/// nanoseconds, which never decreases from call to call.
pub trait Drive {
    /// How many actuators there are, 1 to 12; never changes.
    fn n_actuators(&self) -> usize;

    /// Tells the actuators where to be: q~, m, push positive; zeros behind the last.
    ///
    /// # Errors
    /// [`DriveError`]; the actuators then stay where they are.
    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError>;

    /// Reads the encoders and the loads.
    ///
    /// # Errors
    /// [`DriveError`] when the drives do not answer.
    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError>;

    /// Begins or continues the search for the drives' zero; called every tick until it says [`Homing::Done`]. A search
    /// that is not continued is abandoned.
    ///
    /// # Errors
    /// [`DriveError`] when the search fails.
    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError>;

    /// Switches the power of the drives. Without power they hold their place by their own friction.
    ///
    /// # Errors
    /// [`DriveError`] when the drives refuse.
    fn set_power(&mut self, stamp_ns: i64, on: bool) -> Result<(), DriveError>;

    /// Whether this drive has a camera, whose shapes are then the slave's to publish.
    fn has_camera(&self) -> bool {
        false
    }

    /// The next measured shape that has become available, if this drive has a camera.
    fn shape(&mut self, _stamp_ns: i64) -> Option<ShapeReading> {
        None
    }
}

/// What the actuators measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveReading {
    /// Encoder positions q~, m, push positive; zeros behind the last actuator.
    pub q_tilde_m: Actuators,
    /// Load at each actuator, N, push positive; NaN where it is not measured, zeros behind the last actuator.
    pub tau_n: Actuators,
}

/// What a camera saw of a snake, or of joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeReading {
    /// Instant of exposure, CLOCK_MONOTONIC, nanoseconds.
    pub exposure_ns: i64,
    /// What it saw.
    pub seen: Seen,
    /// Standard deviation of each number of it, rad (m for a sliding joint).
    pub sigma_rad: f64,
    /// Encoder positions q~ at the instant of exposure, m; NaN where not known. Of joints the camera's maker gives none.
    pub q_tilde_m: [f64; 3],
}

/// The shape of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen {
    /// Of a snake: bend vector b (cos delta, sin delta), rad.
    Bend([f64; 2]),
    /// Of so many joints: their positions, rad (m for a sliding joint).
    Joints(Joints, usize),
}

/// How far the search for the zero is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Homing {
    /// The actuators are still searching.
    Busy,
    /// The zero is known and the actuators stand still.
    Done,
}

/// Why a drive refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// Motion was asked for while the power was off.
    #[error("the drives were told to move while their power is off; send `enable` first")]
    NotPowered,
    /// A position was NaN or infinite.
    #[error(
        "actuator {actuator} was told to go to {found_m} m, expected a finite position; the command was not executed"
    )]
    NotFinite {
        /// Which, from 1.
        actuator: usize,
        /// What was asked for, m.
        found_m: f64,
    },
    /// A position was beyond the hard stops.
    #[error(
        "actuator {actuator} was told to go to {found_m} m, expected at most {limit_m} m either way; the command was not executed"
    )]
    OutOfTravel {
        /// Which, from 1.
        actuator: usize,
        /// What was asked for, m.
        found_m: f64,
        /// Distance of the hard stops from zero, m.
        limit_m: f64,
    },
    /// The hardware failed in a way of its own.
    #[error("the drives failed: {what}; mend that, then send `enable`")]
    Failed {
        /// The hardware's own words.
        what: &'static str,
    },
}
