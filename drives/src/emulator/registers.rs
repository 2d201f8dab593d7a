//! Where registers of each make are that the emulation of both needs.

use crate::serial::ServoMake;
use crate::xl330::{VELOCITY_STEP_COUNTS_PER_S, table};

/// A number in registers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Register {
    pub at: usize,
    pub n: usize,
}

/// The registers of a make, and how fast it goes.
#[derive(Debug)]
pub(super) struct Registers {
    pub id: usize,
    pub model: usize,
    pub return_delay: usize,
    pub torque: usize,
    pub goal: Register,
    pub speed: Register,
    /// Of a speed, counts/s.
    pub speed_step: f64,
    pub position: Register,
    /// Without load.
    pub most_counts_per_s: f64,
}

static STS3215: Registers = Registers {
    id: 5,
    model: 3,
    return_delay: 7,
    torque: 40,
    goal: Register { at: 42, n: 2 },
    speed: Register { at: 46, n: 2 },
    speed_step: 1.0,
    position: Register { at: 56, n: 2 },
    // 60 degrees in 0.222 s at 7.4 V.
    most_counts_per_s: 3075.0,
};

static XL330: Registers = Registers {
    id: table::ID as usize,
    model: table::MODEL as usize,
    return_delay: table::RETURN_DELAY as usize,
    torque: table::TORQUE_ENABLE as usize,
    goal: Register { at: table::GOAL_POSITION as usize, n: 4 },
    speed: Register { at: table::PROFILE_VELOCITY as usize, n: 4 },
    speed_step: VELOCITY_STEP_COUNTS_PER_S,
    position: Register { at: table::PRESENT_POSITION as usize, n: 4 },
    // 103 turns a minute of an XL330-M288 at 5 V.
    most_counts_per_s: 7031.0,
};

impl Registers {
    pub(super) fn of(make: ServoMake) -> &'static Self {
        match make {
            ServoMake::Sts3215 => &STS3215,
            ServoMake::Xl330 => &XL330,
        }
    }
}
