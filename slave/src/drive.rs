//! What the slave needs of its actuators: the seam behind which a simulated snake or real hardware sits.

/// Three push-pull actuators with encoders and line loads, and perhaps a camera on the snake.
///
/// # Real-time
/// No method allocates, blocks, logs or reads a clock; every instant is the argument `stamp_ns`, CLOCK_MONOTONIC,
/// nanoseconds, which never decreases from call to call.
pub trait Drive {
    /// Tells the actuators where to be: q~ of the three lines, m, push positive.
    ///
    /// # Errors
    /// [`DriveError`]; the actuators then stay where they are.
    fn write(&mut self, stamp_ns: i64, q_tilde_m: [f64; 3]) -> Result<(), DriveError>;

    /// Reads the encoders and the line loads.
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

    /// Whether this drive has a camera on the snake, whose shapes are then the slave's to publish.
    fn has_camera(&self) -> bool {
        false
    }

    /// The next measured shape that has become available, if this drive has a camera on the snake.
    fn shape(&mut self, _stamp_ns: i64) -> Option<ShapeReading> {
        None
    }
}

/// What the actuators measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveReading {
    /// Encoder positions q~, m, push positive.
    pub q_tilde_m: [f64; 3],
    /// Load of each line at its actuator, N, push positive; NaN where it is not measured.
    pub tau_n: [f64; 3],
}

/// What a camera saw of the snake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeReading {
    /// Instant of exposure, CLOCK_MONOTONIC, nanoseconds.
    pub exposure_ns: i64,
    /// Measured bend vector b (cos delta, sin delta), rad.
    pub bend_rad: [f64; 2],
    /// Standard deviation of each component, rad.
    pub sigma_bend_rad: f64,
    /// Encoder positions q~ at the instant of exposure, m; NaN where not known.
    pub q_tilde_m: [f64; 3],
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
