//! The next experiment as a script that `krait run --master script --input FILE.csv` plays, and what it would decide.
//!
//! The motion does what separates effects with memory: nested loops in two planes, rotations both ways, three speeds, holds. It
//! stays within 60 deg and 1 rad/s, below the limits that a chain has by default.

mod path;
mod separation;

pub use path::script;
pub use separation::{Pair, Separation, separation};
