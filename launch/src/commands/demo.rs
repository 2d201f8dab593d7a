//! `krait demo`: the same recorded hand three times through the whole chain, and what compensation does about it.

use crate::cli::{Common, DemoArgs, EngageKind, MasterKind};
use crate::config::Config;
use crate::evidence::Evidence;
use crate::in_force::Compensation;
use crate::progress::Progress;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use crate::{device, print, signals};
use anyhow::bail;
use krait_ipc::clock;
use krait_slave::DriveConfig;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// The passes, in the order in which they are shown.
const PASSES: [Compensation; 3] = Compensation::ALL;
/// What opens the page for somebody without a device: the recorded hand drives, also after a busy machine has held it up.
const PAGE: &str = "krait run --console --engage=again";
/// A pass shorter than this leaves nothing to score.
const SHORTEST_PASS_S: f64 = krait_report::SCORED_FROM_S + 2.0;

/// Runs the three passes, reads the recording back and prints what it shows.
pub fn run(common: &Common, args: &DemoArgs) -> anyhow::Result<ExitCode> {
    if !(SHORTEST_PASS_S..=3600.0).contains(&args.seconds) {
        bail!(
            "--seconds {}: expected {SHORTEST_PASS_S} to 3600, because the score counts from second 10 on",
            args.seconds
        );
    }
    let stop = signals::stop_flag()?;
    let mut config = Config::load(common.config.as_deref())?;
    if let Some(truth) = &args.truth {
        config.slave.truth = Some(std::path::absolute(truth)?);
    }
    // A demo engages by itself, so it never has real drives.
    config.slave.drive = DriveConfig::default();
    config.record.path = Some(crate::recording_path(args.recording.as_deref(), "demo")?);
    config.record.metadata.insert("run".to_owned(), "demo".to_owned());
    device::enter(&mut config.record.metadata, &config.master, MasterKind::Replay, None);
    config.check()?;

    let mut evidence = Evidence::default();
    let n_engagements = record_passes(common, args, &config, &mut evidence, &stop)?;
    let path = config.record.path.as_deref().unwrap_or(Path::new(""));
    let figures = evidence.figures(path)?;
    if args.json {
        print::json(&figures)?;
    } else {
        let next = next_thing_to_try(&path.display().to_string());
        print::figures(&figures, &next)?;
        print::out(&format!(
            "The recorded hand engaged {n_engagements} times in {} passes, by itself, because the drives are simulated\n\
             Watch it: `{PAGE}` prints the address of a page with the snake in 3-D, the latency and the lab\n",
            PASSES.len()
        ))?;
    }
    Ok(if figures.samples.lost == 0 && figures.recording_is_whole { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Returns how often the recorded hand engaged.
fn record_passes(
    common: &Common,
    args: &DemoArgs,
    config: &Config,
    evidence: &mut Evidence,
    stop: &AtomicBool,
) -> anyhow::Result<u64> {
    let mut supervisor = Supervisor::new(&common.instance, stop)?;
    supervisor.start_recorder(config, stop)?;
    evidence.processes("recorder", &supervisor.processes());
    for mode in PASSES {
        let mut pass_config = config.clone();
        (pass_config.compensation, pass_config.model) = (mode, None);
        let model = pass_config.model()?;
        let (master, cast) = (MasterKind::Replay, Cast::live());
        let options = ChainOptions {
            config: pass_config,
            master,
            input: None,
            looped: false,
            engage: Some(EngageKind::Again),
            cast,
        };
        let start_ns = clock::monotonic_ns();
        supervisor.start_chain(&options, stop)?;
        evidence.processes(mode.name(), &supervisor.processes());
        let label = format!("pass {} of {}, compensation {}", mode as u32 + 1, PASSES.len(), mode.name());
        let finished =
            Progress::new(&label, supervisor.bus(), Some(args.seconds), false)?.show(&mut supervisor, stop)?;
        supervisor.end_chain();
        evidence.pass(model, start_ns..clock::monotonic_ns(), &supervisor);
        if !finished {
            supervisor.end();
            bail!(
                "the demo was stopped before its end; what was recorded is kept in {}",
                config.record.path.as_deref().unwrap_or(Path::new("")).display()
            );
        }
    }
    let clean = supervisor.end() && supervisor.is_unscathed();
    evidence.recorder(&supervisor);
    anyhow::ensure!(clean, "a process of the demo did not end by itself and was killed");
    Ok(supervisor.n_engagements())
}

/// What to try next, for somebody who has just seen the demo.
fn next_thing_to_try(recording: &str) -> String {
    format!(
        "drive it yourself with `krait run --master hid` (without a device: `krait run --engage`), feel the lines with \
         `krait run --engage --compensation off`, or open {recording} in Foxglove, Lichtblick, PlotJuggler or Rerun"
    )
}
