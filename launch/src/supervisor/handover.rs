//! What a child is handed at its start: its configuration and its command line.

use super::ChainOptions;
use crate::cli::MasterKind;
use crate::config::Config;
use anyhow::Context;
use krait_ipc::Process;
use rustix::fs::{MemfdFlags, memfd_create};
use std::ffi::OsString;
use std::fs::File;
use std::io::{Seek, Write};
use std::path::PathBuf;

/// The krait program that runs, for another process of it.
///
/// # Errors
/// The system does not say where it is.
pub fn own_program() -> anyhow::Result<PathBuf> {
    std::env::current_exe().context("the krait program could not find itself")
}

/// The complete configuration for a child, as a file that has no name: nobody can put another in its place.
pub(super) fn in_memory(config: &Config) -> anyhow::Result<File> {
    let could_not = "the configuration could not be handed over";
    let mut file = File::from(memfd_create("krait.toml", MemfdFlags::CLOEXEC).context(could_not)?);
    file.write_all(config.to_toml()?.as_bytes()).and_then(|()| file.rewind()).context(could_not)?;
    Ok(file)
}

/// The arguments of a process of a chain.
pub(super) fn arguments_of(process: Process, options: &ChainOptions) -> Vec<OsString> {
    match (process, options.cast.recorded_time_ns) {
        (Process::Master, _) => master_arguments(options),
        (_, None) => Vec::new(),
        (Process::Slave, Some(start_ns)) => vec!["--recorded-time-ns".into(), start_ns.to_string().into()],
        (_, Some(_)) => vec!["--cued".into()],
    }
}

fn master_arguments(options: &ChainOptions) -> Vec<OsString> {
    let source = match options.master {
        MasterKind::Hid => "hid",
        MasterKind::Replay => "replay",
        MasterKind::Script => "script",
        MasterKind::Browser => "browser",
        MasterKind::Pose => "pose",
        MasterKind::Guide => "guide",
    };
    let mut arguments: Vec<OsString> = vec!["--source".into(), source.into()];
    if let Some(path) = &options.input {
        arguments.extend(["--input".into(), path.clone().into_os_string()]);
    }
    arguments.extend(options.looped.then(|| "--loop".into()));
    arguments.extend(options.engage.map(|engage| format!("--engage={}", engage.name()).into()));
    arguments
}
