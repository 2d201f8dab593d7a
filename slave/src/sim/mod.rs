//! The simulated snake, the default drive: a quasi-static plant with memory, encoders, line loads and a camera.
//!
//! It shares no physics code with `krait-model`, so that agreement between the two means something.

mod camera;
mod line;
mod noise;
mod plant;
mod snake;
mod truth;
mod truth_error;

pub use snake::SimulatedSnake;
pub use truth::{CameraTruth, DriveTruth, EffectsTruth, MachineTruth, Truth};
pub use truth_error::TruthError;
