//! Ctrl-C, Ctrl-Z, Ctrl-\, SIGTERM and SIGHUP as one flag, and the promise that a child does not outlive its supervisor.

use crate::supervisor::SUPERVISOR_PID;
use anyhow::Context;
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTSTP, SIGXFSZ};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The flag that a stop signal sets. Ctrl-Z is one: a supervisor that sleeps while the snake goes on watches nobody. A second signal of the same kind does nothing more: the end is already under way.
pub fn stop_flag() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .with_context(|| format!("signal {signal} could not be caught"))?;
    }
    Ok(stop)
}

/// A file that has reached the largest size that this process may write becomes an error of that write, not the end of the
/// process (SIGXFSZ); Rust does the same for a pipe whose reader has gone (SIGPIPE).
pub fn survive_full_files() -> anyhow::Result<()> {
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false))).context("SIGXFSZ could not be caught")?;
    Ok(())
}

/// Asks the kernel to end this process (SIGTERM) when the supervisor that has started it dies, however that comes about. Does
/// nothing where somebody else has started it.
pub fn end_with_supervisor() -> anyhow::Result<()> {
    let Ok(pid) = std::env::var(SUPERVISOR_PID) else { return Ok(()) };
    let pid: u32 = pid.parse().with_context(|| format!("{SUPERVISOR_PID} is {pid:?}"))?;
    set_parent_process_death_signal(Some(Signal::TERM)).context("the supervisor's death could not be subscribed to")?;
    let parent = getppid().map(|pid| pid.as_raw_nonzero().get().unsigned_abs());
    anyhow::ensure!(parent == Some(pid), "the supervisor (process {pid}) has already ended, so this process ends too");
    Ok(())
}
