//! What is done to processes and to the machine around a chain: signals, full file systems, a deleted file, a second writer.

use super::kind::{Blow, Fault};
use super::tiny::fill;
use super::watch::SceneWatch;
use anyhow::{Context, bail};
use krait_ipc::message::Command;
use krait_ipc::{Bus, IpcError, Process, clock, ground};
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::path::Path;

/// Strikes a process; returns when, ns.
///
/// # Errors
/// One sentence when it does not run.
pub fn strike_process(watch: &mut SceneWatch<'_>, process: Process, blow: Blow, stall_s: f64) -> anyhow::Result<i64> {
    let (_, pid) = watch.supervisor_of(process).with_context(|| format!("process `{process}` does not run"))?;
    strike_pid(watch, pid, blow, stall_s)
}

/// Strikes the process of a number; returns when, ns.
///
/// # Errors
/// As [`strike_process`].
pub fn strike_pid(watch: &mut SceneWatch<'_>, pid: u32, blow: Blow, stall_s: f64) -> anyhow::Result<i64> {
    let pid = Pid::from_raw(pid.cast_signed()).context("a process id")?;
    let struck_ns = clock::monotonic_ns();
    kill_process(pid, if blow == Blow::Kill { Signal::KILL } else { Signal::STOP })?;
    if blow == Blow::Stall {
        watch.run(stall_s)?;
        // A supervisor that has taken it for hung was faster.
        let _gone_is_fine = kill_process(pid, Signal::CONT);
    }
    Ok(struck_ns)
}

/// Strikes the machine around a chain; returns when, ns.
///
/// # Errors
/// One sentence when that could not be done, or was let happen although it must be refused.
pub fn strike_machine(fault: Fault, instance: &str, recording: &Path) -> anyhow::Result<i64> {
    let struck_ns = clock::monotonic_ns();
    match fault {
        Fault::DeletedRecording => {
            fs::remove_file(recording).with_context(|| format!("{} could not be deleted", recording.display()))?;
        }
        Fault::FullDisk => fill(recording.parent().unwrap_or(recording))?,
        Fault::FullMemory => {
            fill(ground().parent().unwrap_or(ground()))?;
            must_be_refused(Bus::open(instance, "late").map(drop), "a process has joined without room")?;
        }
        Fault::ForeignWriter => {
            let bus = Bus::open(instance, "foreign")?;
            must_be_refused(bus.writer::<Command>().map(drop), "a second process has become a writer of `command`")?;
        }
        other => bail!("{other:?} does not strike the machine"),
    }
    Ok(struck_ns)
}

/// A refusal is told like every other: on standard error, where it is looked for.
fn must_be_refused(done: Result<(), IpcError>, what: &str) -> anyhow::Result<()> {
    match done {
        Ok(()) => bail!("{what}"),
        Err(refused) => {
            tracing::warn!("refused: {refused}");
            Ok(())
        }
    }
}
