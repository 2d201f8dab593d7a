//! krait-model: the mathematics of a multi-backbone snake and of the long elastic lines that actuate it.
//!
//! Purpose: kinematics, statics, friction, line extension, corrected Jacobians, compensation and estimation of its
//! parameters, after K. Xu and N. Simaan, "Actuation Compensation for Flexible Surgical Snake-like Robots with Redundant
//! Remote Actuation", ICRA 2006. Equation numbers in this crate are that paper's.
//!
//! Terms: *bend* b is the angle of the end disk from straight; the *bend vector* is b (cos delta, sin delta); *psi* is
//! (theta_L, delta) with theta_L = pi/2 - b; a *line* is a secondary backbone together with its long part behind the snake;
//! the *extension* eps is what a line gives under load; the *sign of motion* of a line is +1 while it is pushed towards the
//! snake, -1 while it is drawn back.
//!
//! Frames and units: SI and radians; `base` is the base disk, `tip` the end disk; push is positive. See `docs/NOTATION.md`.
//!
//! Nothing here does input or output, reads a clock or logs, and no step allocates; building a chain or reading a model file does.
//!
//! ```
//! use krait_model::model_file::{ModelFile, built_in};
//! use krait_model::{Circumstances, KnownColumns};
//! use nalgebra::Vector2;
//!
//! let file = ModelFile::parse(built_in("estimated").expect("one of three"))?;
//! let chain = file.chain(KnownColumns::default())?.expect("a snake");
//! let command = chain.compensator()?.step(Vector2::new(0.5, 0.1), &Circumstances::at(0.0));
//! assert!((command.q_tilde_m - command.q_m - command.eps_m).norm() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod chain;
mod change;
pub mod effects;
pub mod gripper;
mod hash;
mod jacobian;
pub mod joints;
mod kinematics;
mod learner;
mod loads;
pub mod model_file;
mod nearest;
pub mod oracle;
mod parameters;
mod recursion;
pub mod segments;
mod series;
mod snake;
mod statics;
mod tip;
mod vector_learner;

pub use chain::{
    Chain, ChainCommand, ChainCompensator, ChainError, ChainMemory, ChainSettings, ChainStatus, Circumstances,
    CommandTangents, EffectSetting, Implausible, KnownColumns, Learn, LearntParameter, MAX_LEARNT, Prediction,
    PredictionTangents, Predictor, PredictorTangents,
};
pub use change::{Change, ChangeKind, ChangeParameters, ChangeWatch, Innovation};
pub use hash::ModelHash;
pub use kinematics::Psi;
pub use learner::{Learner, LearnerParameters, Sight};
pub use loads::{LineLoads, LoadBounds, LoadRequest, LoadStatus};
pub use nearest::{meant_name, nearest_name};
pub use parameters::{MachineParameters, ParameterError};
pub use recursion::{Learning, Learnt};
pub use snake::Snake;
pub use tip::DampedRate;
pub use vector_learner::{SlopedPredictor, VectorLearner, VectorLearnerParameters, VectorSight};
