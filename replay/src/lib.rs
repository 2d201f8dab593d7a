//! krait-replay: recorded input through the real processes again.
//!
//! Purpose: say whether the same input still gives the same bytes ([`Verifier`]), play recordings and trajectories to the
//! simulated snake in their own time ([`Player`]) or to any slave on the machine's clock, and lay two recordings side by
//! side.
//!
//! Terms: a *pass* is one chain within a recording, a *run* what one process published between its start and its end; a *cue* says what a step depends on besides its input
//! ([`krait_ipc::message::Cue`]); samples *under way* have been published and their last output has not come back yet.
//!
//! Frames and units: see `docs/NOTATION.md`. SI and radians; times are nanoseconds, CLOCK_MONOTONIC of the machine that
//! recorded, unless a name says otherwise.

#![forbid(unsafe_code)]

mod difference;
mod error;
mod input_track;
mod keeper;
mod learning;
mod live;
mod player;
mod program;
mod sender;
mod slave_run;
mod stage;
mod steering;
mod steps;
mod survey;
mod trajectory;
mod verifier;
mod window;

pub use difference::Difference;
pub use error::{ReplayError, end_of_range};
pub use input_track::{Beginning, InputChoice, InputTrack, TrackCounts};
pub use keeper::Keeper;
pub use learning::LearningVerifier;
pub use live::LivePlayer;
pub use player::{NewestPlayed, PlayCounts, Player, UNDER_WAY};
pub use program::{Next, Planned, Program, ProgramPart, Score, Tally, What};
pub use slave_run::{SlaveRun, repeat_slave};
pub use stage::{Compensate, Resolve, Stage};
pub use steering::{MachinePose, Steering};
pub use survey::{Restart, Survey};
pub use trajectory::{Trajectory, TrajectoryError, TrajectoryLimits};
pub use verifier::{Repetition, Turn, Verifier};
pub use window::Window;
