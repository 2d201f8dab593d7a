//! `krait master | resolve | compensate | estimate | slave | record`: one process of the chain.

use crate::cli::{Common, MasterArgs, MasterKind, Process};
use crate::config::Config;
use crate::{signals, supervisor};
use anyhow::Context;
use krait_ipc::Bus;
use krait_master::{RecordingSource, ReportRecording, ScriptSource, SourceChoice};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Joins the instance and runs the process until it is told to stop.
pub fn run(common: &Common, process: &Process) -> anyhow::Result<ExitCode> {
    let name = name_of(process);
    run_named(common, process, name).with_context(|| format!("process `{name}`"))?;
    Ok(ExitCode::SUCCESS)
}

fn name_of(process: &Process) -> &'static str {
    match process {
        Process::Master(_) => "master",
        Process::Resolve => "resolve",
        Process::Compensate => "compensate",
        Process::Estimate => "estimate",
        Process::Slave => "slave",
        Process::Record => "record",
    }
}

fn run_named(common: &Common, process: &Process, name: &str) -> anyhow::Result<()> {
    let stop = signals::stop_flag()?;
    if let Ok(pid) = std::env::var(supervisor::SUPERVISOR_PID) {
        signals::end_with(pid.parse().with_context(|| format!("{} is {pid:?}", supervisor::SUPERVISOR_PID))?)?;
    }
    let config = Config::load(common.config.as_deref())?;
    config.check()?;
    let bus = Bus::open(&common.instance, name)?;
    match process {
        Process::Master(args) => run_master(&bus, &config, args, &stop)?,
        Process::Resolve => {
            krait_bridge::run_resolve(&bus, &config.machine, config.compensate.lines(), config.resolve, &stop)?;
        }
        Process::Compensate => krait_bridge::run_compensate(&bus, &config.machine, config.compensate, &stop)?,
        Process::Estimate => {
            let (eta, lambda_m) = (config.compensate.eta, config.compensate.lambda_m);
            krait_bridge::run_estimate(&bus, &config.machine, eta, lambda_m, config.estimate, &stop)?;
        }
        Process::Slave => krait_slave::run(&bus, &config.slave, &stop)?,
        Process::Record => {
            krait_record::run(&bus, &config.record, &stop)?;
        }
    }
    Ok(())
}
