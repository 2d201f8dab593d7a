//! krait-calibrate: from a real robot to a model file, by readings that a person takes.
//!
//! Purpose: friction by hanging weights, play by a dial indicator, bends from photographs of graph paper, and eta with the play
//! from guided poses, the stem's angle from load cells; each value with its standard error, or a refusal that says which readings are missing.
//!
//! Terms: a *reading* is one row of a procedure's CSV; *up* is motion towards the actuator against the load, *down* the way
//! back; the *standard error* (se) of a value is from the stated error of a reading, widened where the readings scatter more.
//!
//! Frames and units: see `docs/NOTATION.md`. SI and radians inside; grams, millimetres and degrees in the dialogues, and the
//! names say so.
#![forbid(unsafe_code)]

mod dialogue;
mod error;
mod fit;
pub mod friction;
mod homography;
mod lines;
mod log;
mod model;
pub mod photo;
mod pictures;
pub mod play;
mod pose_answers;
mod pose_plan;
mod pose_price;
mod pose_reading;
pub mod poses;
pub mod stem;
mod stem_rows;

pub use dialogue::{Dialogue, Reply};
pub use error::CalibrateError;
pub use fit::LeastSquares;
pub use lines::ConeFriction;
pub use model::{CalibratedValue, written};
