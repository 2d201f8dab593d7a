//! The processes that `krait bench` starts beside krait's own: relays, an observer, processes that keep a core busy; and the
//! scenes of `krait fault`.

use crate::cli::Common;
use crate::cli_bench::{YardstickArgs, YardstickVerb};
use crate::fault::{Fault, StrikeTime};
use crate::{signals, supervisor};
use anyhow::Context;
use core::time::Duration;
use krait_bench::{BenchError, ChainKind, Role, Scratch, StageOptions};
use krait_ipc::{Bus, ReadOptions};
use krait_schema::Channel;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitCode, Stdio};

/// A screen is drawn this often.
const FRAME: Duration = Duration::from_millis(16);

/// Becomes one of the processes.
pub fn run(common: &Common, part: &YardstickVerb) -> anyhow::Result<ExitCode> {
    signals::end_with_supervisor()?;
    match part {
        YardstickVerb::Stage(args) => stage(args),
        YardstickVerb::Observe => observe(&common.instance),
        YardstickVerb::Burn => krait_bench::burn(),
        YardstickVerb::Scene(args) => super::fault::scene(args),
    }
}

/// The command that becomes one process of a relay.
///
/// # Errors
/// [`BenchError`] when the krait program cannot find itself.
pub fn stage_command(kind: ChainKind, role: Role, scratch: &Scratch) -> Result<Command, BenchError> {
    let mut command = own_command("stage")?;
    command.args(["--chain", kind.name(), "--role", role.name(), "--prefix", scratch.prefix()]);
    command.arg("--folder").arg(scratch.folder());
    Ok(command)
}

/// The command that becomes a process that keeps a core busy.
///
/// # Errors
/// As [`stage_command`].
pub fn burn_command() -> Result<Command, BenchError> {
    own_command("burn")
}

/// Starts the observer of an instance.
///
/// # Errors
/// One sentence when it cannot be started.
pub fn observer(instance: &str) -> anyhow::Result<Child> {
    let mut command = own_command("observe")?;
    command.args(["--instance", instance]).stdin(Stdio::null()).stdout(Stdio::null());
    command.spawn().context("the observer could not be started")
}

/// The command that plays one scene of `krait fault`.
///
/// # Errors
/// As [`stage_command`].
pub fn scene_command(fault: Fault, moment: StrikeTime, folder: &Path) -> Result<Command, BenchError> {
    let mut command = own_command("scene")?;
    command.args(["--wait-s", &moment.wait_s.to_string(), "--stall-s", &moment.stall_s.to_string()]);
    command.args(["--fault", &fault.name()]).arg("--folder").arg(folder);
    Ok(command)
}

fn own_command(part: &str) -> Result<Command, BenchError> {
    let program = std::env::current_exe().map_err(|source| BenchError::File {
        doing: "found",
        path: "/proc/self/exe".into(),
        source,
    })?;
    let mut command = Command::new(program);
    command.args(["yardstick", part]);
    // A group of its own: Ctrl-C reaches the process that measures alone, which then ends the others.
    command.process_group(0).env(supervisor::SUPERVISOR_PID, std::process::id().to_string());
    Ok(command)
}

fn stage(args: &YardstickArgs) -> anyhow::Result<ExitCode> {
    let (kind, role) = (args.chain, args.role);
    let options = StageOptions { kind, role, folder: args.folder.clone(), prefix: args.prefix.clone() };
    let mut tell = |refused: &str| tracing::warn!(chain = kind.name(), process = role.name(), "{refused}");
    krait_bench::run_stage(&options, &mut tell)?;
    Ok(ExitCode::SUCCESS)
}

/// Reads every channel for as long as it is let: once a frame, all that has come since.
fn observe(instance: &str) -> anyhow::Result<ExitCode> {
    let bus = Bus::open(instance, "observe")?;
    let mut sources = Vec::new();
    for channel in Channel::ALL {
        sources.extend(channel.source(&bus, ReadOptions::observing())?);
    }
    loop {
        for source in &mut sources {
            while let Some(sample) = source.take()? {
                core::hint::black_box(sample);
            }
        }
        std::thread::sleep(FRAME);
    }
}
