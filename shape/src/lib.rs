//! krait-shape: measured shapes of another program, checked and published on the channel `shape`.
//!
//! Problem: a camera's program runs on its own clock and makes its own mistakes; what it says must never do harm.
//!
//! Intuition: every line is read as if it came from an enemy ([`ShapeLine`]), its stamps are mapped to CLOCK_MONOTONIC
//! ([`ClockMap`]), and a gate ([`ShapeGate`]) decides: publish it, publish it with a warning beside it, or refuse it. Each
//! decision has a name and a count.
//!
//! where: an exposure is the instant at which the camera saw the machine; an arrival is when its line was read.
//!
//! Failure: a program that stamps wrongly but plausibly (an offset of some milliseconds) looks like a machine that lags.
#![forbid(unsafe_code)]

mod clock_map;
mod counts;
mod gate;
mod line;
mod lines;
mod process;

pub use clock_map::{Arrival, ClockMap};
pub use counts::{Counts, ShapeFinding, ShapeRefusal};
pub use gate::{GateConfig, Passed, ShapeGate, ShapeRefused};
pub use line::{Header, LineError, MAX_LINE_BYTES, Measured, ShapeLine, SourceClock, Value};
pub use lines::{Cut, LineReader};
pub use process::{ShapeError, run};
