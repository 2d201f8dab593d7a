//! The effects that make a real machine leave the model: each defined once, for values, derivatives, forward and inverse.
//!
//! An effect is an [`EffectKind`] with a [`Definition`] and its equation as code in the module of its kind: `moment` (what
//! bends the snake), `friction` (a line's load on its way to the actuator), `extension`, `geometry`, `encoder`, `shape`,
//! `formula`. Memory is a function of the present input and of the memory before; the chain decides when it is kept.
//! `docs/physics/effects.md` has each equation, its source and its range.

pub(crate) mod arc;
pub(crate) mod cone;
mod definition;
pub(crate) mod encoder;
mod explanation;
pub(crate) mod extension;
mod force;
mod force_formula;
pub(crate) mod formula;
mod formula_amplitudes;
mod formula_error;
mod formula_operators;
pub(crate) mod formula_variables;
pub(crate) mod friction;
pub(crate) mod geometry;
mod kind;
pub(crate) mod moment;
mod of_segment;
mod operators;
pub(crate) mod prepared;
mod real;
pub(crate) mod shape;
pub(crate) mod varying;

pub use definition::{Class, Definition, Hook, Inverse, Needs, ParameterSpec};
pub(crate) use definition::{effect, parameter};
pub use explanation::{Explanation, explanation};
pub use force::ForceEffect;
pub use force_formula::{AtForce, ForceFormula};
pub use formula::{FormulaParameter, FormulaText, MAX_FORMULA_NAMES, is_free_word};
pub use formula_amplitudes::amplitudes;
pub use formula_error::FormulaError;
pub use formula_variables::{FORMULA_VARIABLES, FormulaVariable};
pub use kind::EffectKind;
pub use of_segment::{SegmentEffect, SegmentLaw, without_segment};
pub(crate) use operators::{bouc_wen, play, relax};
pub use prepared::MAX_PARAMETERS;
pub(crate) use real::three;
pub use real::{Dual, Real, Scalar};
pub use varying::{FormulaColumn, MAX_COLUMNS, SLOPE, Varying};
