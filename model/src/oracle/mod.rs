//! The paper's own equations, as they are printed and as they are corrected: the oracle of `krait paper` and of tests.
//!
//! No process of the chain calls anything here. What drives a machine is a [`crate::Chain`], made from a model file; the
//! built-in files `off`, `naive` and `estimated` say the same as [`CompensationMode`], and tests hold the two together.

mod compensator;
mod direction;
mod equilibrium;
mod estimator;
mod estimator_parameters;
mod extension;
mod friction;
mod friction_fit;
mod least_squares;
mod measurement;

pub use compensator::{Compensated, CompensationMode, Compensator, CompensatorParameters};
pub use direction::SignMemory;
pub use equilibrium::{Equilibrium, EquilibriumStatus};
pub use estimator::{Estimate, EstimateOutcome, Estimator, LeftOutReason};
pub use estimator_parameters::EstimatorParameters;
pub use extension::Extension;
pub use friction::{ConeLoad, F_S_N, MU};
pub use friction_fit::{ConeFrictionFit, fit_cone_friction};
