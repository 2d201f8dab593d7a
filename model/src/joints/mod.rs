//! Cable-driven joints: y = G x + c, where x is what the transmission makes of the commands u, and the effects that belong to it.
//!
//! Problem: predict the measured positions y of n joints for the history of their commands u.
//!
//! Effects at hook cmd change x, in the order of the model, before G; effects at hook meas, and formulas, change y after it. An
//! effect that adds (Bouc-Wen, plays with a weight, creep, curves, periodic errors, couplings) is computed from x as the effects
//! before it pass it on, and its part goes around those behind it, so that amplitudes are linear whatever stands behind them. Each
//! acts on every joint by itself, or on the one that its parameter `joint` names. Memory starts afresh at the first step: plays
//! in their middle or where [`JointPredictor::begin_at`] says, everything slow settled.

mod chain;
mod effect;
mod formula;
mod hysteresis;
mod inverse;
mod plausible;
mod position;
mod rate;
mod slopes;

pub use chain::{JointChain, JointParts, JointPredictor};
pub use effect::JointEffect;
pub use formula::{AtJoint, JointFormula};
pub use hysteresis::{REACHES, load_play};
pub use inverse::{JointCommand, JointCompensator, JointInverseSettings};
pub use plausible::JointImplausible;
pub use rate::{lag_step, second_order_ramp, second_order_step};

/// Play of half-width r: p follows x at a distance of at most r.
#[inline]
pub fn play(p: f64, x: f64, half_width: f64) -> f64 {
    p.clamp(x - half_width, x + half_width)
}

/// Bouc-Wen's z after a change dx of x; gamma as in the effect.
#[inline]
pub fn bouc_wen(z: f64, dx: f64, travel: f64, gamma: f64) -> f64 {
    crate::effects::bouc_wen(z, dx, travel, gamma)
}

use crate::effects::ParameterSpec;
use crate::vector_learner::{VectorLearner, VectorLearnerParameters, VectorSight};

/// Learns parameters of joints; see [`VectorLearner`].
pub type JointLearner = VectorLearner<slopes::JointSlopes, MAX_JOINTS, MAX_JOINTS>;
/// What a model of joints saw at an instant.
pub type JointSight = VectorSight<MAX_JOINTS, MAX_JOINTS>;

impl JointChain {
    /// A learner of the parameters that the chain names, which starts from the values of the model file.
    pub fn learner(&self, parameters: VectorLearnerParameters) -> JointLearner {
        VectorLearner::new(slopes::JointSlopes::new(self), self.learnt(), self.n(), parameters)
    }
}

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
    not_learnt: Some("an index"),
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
const N_STATES: usize = 4;
