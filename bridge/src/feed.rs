//! Who feeds a stage: a chain that runs, or a replay.

use crate::step::{BridgeError, Step};
use crate::{cued, live};
use core::sync::atomic::AtomicBool;
use krait_ipc::{Bus, Process, WaitMode};

/// What a stage is told besides its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feed {
    /// The newest there is, on the machine's clock.
    Live,
    /// What a replay's cues name.
    Cued,
}

/// Runs a stage until it is told to stop.
pub(crate) fn run<S: Step>(
    feed: Feed,
    bus: &Bus,
    process: Process,
    wait: WaitMode,
    core: S,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    match feed {
        Feed::Live => live::run(bus, process, wait, core, stop),
        Feed::Cued => cued::run(bus, process, core, stop),
    }
}
