//! The simulated snake, the default drive: a quasi-static plant with memory, encoders, line loads and a camera.
//!
//! It shares no physics code with `krait-model`, so that agreement between the two means something.

mod bending;
mod camera;
mod encoders;
mod ends;
mod hidden;
mod line;
mod noise;
mod plant;
mod sight;
mod snake;
mod truth;
mod truth_error;

pub use hidden::{BendingTruth, EncodersTruth, LinesTruth, SightTruth, SlowTruth};
pub use snake::SimulatedSnake;
pub use truth::{CameraTruth, DriveTruth, EffectsTruth, MachineTruth, Truth};
pub use truth_error::TruthError;
