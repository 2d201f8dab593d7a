//! Faults on purpose: each is injected into a simulated chain of its own, and what becomes of that is held against what must.
//!
//! Messages are broken by a relay between two instances: the stages before the fault run in one, those behind it in the
//! other, and every process of both is the one that `krait run` starts. So production has no word for a fault.

mod command_line;
mod harm;
mod judge;
mod kind;
mod moment;
mod pauses;
mod relay;
mod scene;
mod tiny;
mod watch;

pub use judge::{FaultOutcome, Observed, judge};
pub use kind::Fault;
pub use moment::StrikeTime;
pub use scene::{NOT_BEGUN, play};
pub use tiny::TinyDisk;
