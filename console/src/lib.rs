//! krait-console: the page of a running chain, and the server that gives it to a browser on this machine.
//!
//! Purpose: a surgeon sees the robot, an engineer the latency, a modeller the error. The console is a process of its own;
//! it reads channels as the recorder does, wakes no writer, and publishes nothing but the operator's wishes.
//!
//! Terms: a *page* is one open connection; a *frame* is what changes for every picture, made once for all pages; a *slot*
//! holds the newest frame only. Frames, signs and units are those of `docs/NOTATION.md`.

mod accept;
mod allowance;
mod assets;
mod columns;
mod doctor;
mod error;
mod facts;
mod fitted;
mod foxglove;
mod glance;
mod guard;
mod jobs;
mod latency;
mod library;
mod live;
mod load_limit;
mod observer;
mod pad;
mod processes;
mod quiz;
mod recordings;
mod server;
mod snapshot;
mod stop;
mod stop_door;
mod tracking;
mod watch;
mod whole_body;
mod wishes;
mod words;

pub use error::ConsoleError;
pub use facts::{Facts, HopBudget, JointFacts, LineFacts, LoadFacts, NewChain, SegmentFacts};
pub use fitted::{GlanceLine, GlanceWeight, fitted};
pub use foxglove::FoxgloveSettings;
pub use glance::{bend_deg, glance, number, plane_deg};
pub use observer::Observer;
pub use recordings::LearntOf;
pub use server::{Address, ServerSettings, run};
pub use tracking::LiveTracking;
pub use words::fault_sentence;

use std::sync::atomic::{AtomicU64, AtomicUsize};

/// The console's name among the members of an instance; it is no part of a chain, and a chain may start beside it.
pub const NAME: &str = "console";

/// Environment variable of the lab's jobs that the console starts: somebody waits for them and reads what they are at.
pub const STAGES: &str = "KRAIT_STAGES";
/// Environment variable of what the console starts: it gives way to the chain and to the operator's browser.
pub const GIVES_WAY: &str = "KRAIT_GIVES_WAY";

/// Pages that are open, and frames that slow ones skipped.
#[derive(Debug, Default)]
pub(crate) struct PageCounts {
    pub(crate) open: AtomicUsize,
    pub(crate) skipped: AtomicU64,
}
