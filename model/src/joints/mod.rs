//! Cable-driven joints: y = G x + c, where x is what the transmission makes of the commands u, and the effects that belong to it.
//!
//! Problem: predict the measured positions y of n joints for the history of their commands u.
//!
//! Effects at hook cmd change x, in the order of the model, before G; effects at hook meas, and formulas, change y after it. Each
//! acts on every joint by itself, or on the one that its parameter `joint` names. Memory starts afresh at the first step: plays
//! in their middle, everything slow settled.

mod chain;
mod effect;
mod hysteresis;
mod position;
mod rate;

pub use chain::{JointChain, JointPredictor};
pub use effect::JointEffect;

use crate::effects::ParameterSpec;

/// The largest number of joints.
pub const MAX_JOINTS: usize = 16;

/// The parameter that every effect of a joint has first.
const JOINT: ParameterSpec = ParameterSpec {
    name: "joint",
    unit: "1",
    low: 0.0,
    high: MAX_JOINTS as f64,
    default: 0.0,
    source: "which joint, counted from 1; 0: every joint",
};

/// What an effect's step is given.
#[derive(Clone, Copy, Debug)]
struct Now {
    /// Time since the first step, s.
    elapsed_s: f64,
    /// Time since the step before, s.
    dt_s: f64,
    /// Whether this is the first step.
    fresh: bool,
}

/// Numbers that an effect remembers for one joint.
const N_STATES: usize = 3;
