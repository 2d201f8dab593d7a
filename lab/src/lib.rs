//! The model lab: how far model and measurement are apart, where, which effect is missing, and what adding it brings.
//!
//! Measurements (`measurements`), read from files (`read`), are predicted by a machine (`machine`) with a list of effects (`term`); statistics stand above
//! the machine and know only inputs, outputs and parameters.
#![forbid(unsafe_code)]

mod add;
mod calibrated;
mod called;
mod camera;
mod cells;
mod clock;
pub mod compare;
pub mod diagnose;
mod digits;
mod error;
pub mod experiment;
pub mod fit;
mod free;
pub mod init;
mod joint;
pub mod machine;
mod measurements;
pub mod noise;
mod offered;
mod outliers;
mod output_noise;
mod prepare;
mod problem;
pub mod read;
pub mod report;
mod same_data;
mod save;
mod session;
mod stage;
mod term;
mod tip;
mod trees;

pub use add::{AddOptions, Added, JointNumber, add, refit};
pub use calibrated::{disagreements, drawn_away};
pub use called::{called, parameters_called};
pub use camera::CameraOffset;
pub use clock::ClockOffset;
pub use error::LabError;
pub use measurements::{LoadUse, Measurements, Names, Quantity, SecondClock};
pub use offered::{Offered, OfferedError, offered};
pub use problem::{FEWEST_BLOCKS, Problem, scored_time_s};
pub use same_data::FittedData;
pub use save::{fitted_to, save};
pub use session::{Session, SessionError, open_model};
pub use stage::tell_stages;
pub use term::{Parameter, Term};
pub use tip::TipFrame;
