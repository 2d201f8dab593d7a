//! `krait master | resolve | compensate | estimate | slave | record`: one process of the chain.

use crate::cli::{Common, MasterArgs, MasterKind, Process};
use crate::config::Config;
use crate::{signals, supervisor};
use anyhow::{Context, bail};
use krait_ipc::Bus;
use krait_master::{MasterConfig, Recording, Script, SourceChoice};
use krait_record::{Attachment, RecordConfig};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Name under which a recording embeds the model file.
pub const MODEL_ATTACHMENT: &str = "model.toml";

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
        Process::Compensate => {
            let chain = config.chain()?;
            krait_bridge::run_compensate(&bus, &config.machine, config.compensate, chain.as_ref(), &stop)?;
        }
        Process::Estimate => {
            let (eta, lambda_m) = (config.compensate.eta, config.compensate.lambda_m);
            krait_bridge::run_estimate(&bus, &config.machine, eta, lambda_m, config.estimate, &stop)?;
        }
        Process::Slave => krait_slave::run(&bus, &config.slave, &stop)?,
        Process::Record => {
            let report = krait_record::run(&bus, &with_attachments(&config)?, &stop)?;
            tracing::info!(?report, "recorded");
        }
    }
    Ok(())
}

fn run_master(bus: &Bus, config: &Config, args: &MasterArgs, stop: &AtomicBool) -> anyhow::Result<()> {
    let (input, looping) = (args.input.as_deref(), args.looped);
    let source = match (args.kind, input) {
        (MasterKind::Hid, None) => SourceChoice::Hid,
        (MasterKind::Hid, Some(path)) => bail!("--input {}: a live device has no input file", path.display()),
        (MasterKind::Replay, None) => SourceChoice::Recording { recording: Recording::shipped()?, looping },
        (MasterKind::Replay, Some(path)) => SourceChoice::Recording { recording: Recording::load(path)?, looping },
        (MasterKind::Script, Some(path)) => SourceChoice::Script { script: Script::load(path)?, looping },
        (MasterKind::Script, None) => bail!("a script is missing: name it with --input FILE"),
    };
    let record_reports = args.record_reports.clone().or_else(|| config.master.record_reports.clone());
    let config = MasterConfig { record_reports, ..config.master.clone() };
    Ok(krait_master::run(bus, &config, source, stop)?)
}

/// The recording holds what a reader needs to repeat the run: the whole configuration, and the truth and model
/// files, if there are any.
fn with_attachments(config: &Config) -> anyhow::Result<RecordConfig> {
    let toml = |name: &str, data| Attachment { name: name.to_owned(), media_type: "application/toml".to_owned(), data };
    let mut record = config.record.clone();
    record.attachments.push(toml("krait.toml", config.to_toml()?.into_bytes()));
    for (name, path) in [("truth.toml", &config.slave.truth), (MODEL_ATTACHMENT, &config.model)] {
        if let Some(path) = path {
            let text = std::fs::read(path).with_context(|| format!("{name} from {}", path.display()))?;
            record.attachments.push(toml(name, text));
        }
    }
    Ok(record)
}
