//! `krait run`: the chain until Ctrl-C.

use crate::cli::{Common, EngageKind, MasterKind};
use crate::cli_run::RunArgs;
use crate::commands::process::{refuse_pad_of_real_drives, refuse_poses_of_real_drives};
use crate::commands::unused_axes;
use crate::config::Config;
use crate::evidence::Evidence;
use crate::progress::Progress;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use crate::{device, print, signals};
use anyhow::{bail, ensure};
use krait_bridge::JointModel;
use krait_console::fault_sentence;
use krait_ipc::clock;
use krait_ipc::message::OperatingState;
use krait_master::{BesideConfig, JoinedHand, Profile, ProfileDevice, refuse_no_input};
use std::path::{Path, PathBuf, absolute};
use std::process::ExitCode;

/// Runs one chain until it is stopped; a recording, if one was made, is read back and summed up.
pub fn run(common: &Common, args: &RunArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    match (args.master, args.engage) {
        (MasterKind::Hid | MasterKind::Browser | MasterKind::Pose, Some(_)) => {
            bail!(
                "--engage is for recordings and scripts; a hand engages by its own button, pad or gripper: leave it out"
            )
        }
        (MasterKind::Guide, _) => {
            bail!("--master guide is the guide of an experiment; start one with `krait experiment`")
        }
        (MasterKind::Replay | MasterKind::Script, None) => {
            tracing::warn!("nothing will move: a recording or script engages only with --engage");
        }
        _ => {}
    }
    let config = configure(common, args)?;
    if matches!(args.master, MasterKind::Hid | MasterKind::Pose)
        && let Some(sentence) = unused_axes::sentence(&config, args.master)?
    {
        tracing::warn!("{sentence}");
    }
    let has_console = args.console || args.viewers.foxglove || args.master == MasterKind::Browser;
    let options = ChainOptions {
        config,
        master: args.master,
        input: args.input.as_deref().map(absolute).transpose()?,
        looped: args.master == MasterKind::Replay,
        engage: args.engage,
        cast: Cast::driven(),
    };
    let mut evidence = Evidence::default();
    let mut supervisor = Supervisor::new(&common.instance, &stop)?;
    if !args.no_recording {
        supervisor.start_recorder(&options.config, &stop)?;
    }
    let start_ns = clock::monotonic_ns();
    if let Err(error) = supervisor.start_chain(&options, &stop) {
        supervisor.end();
        discard_empty_recording(&options.config, args);
        return Err(error);
    }
    let model = options.config.model()?;
    evidence.processes(model.label, &supervisor.processes());
    if has_console {
        supervisor.start_console(&options.config, &args.viewers, args.json)?;
    }
    let label = format!("Running, compensation {}; Ctrl-C ends it", model.label);
    let slides = model.machine.joints().is_some_and(JointModel::slides);
    Progress::new(&label, supervisor.bus(), args.seconds, slides)?.show(&mut supervisor, &stop)?;
    let in_fault = supervisor.newest_state().filter(|state| state.operating() == Some(OperatingState::Fault));
    let failure = in_fault.map(fault_sentence);
    if let Some(sentence) = &failure {
        tracing::error!("the run ended in FAULT: {sentence}");
    }
    supervisor.end_chain();
    // After an exchange the figures are those of the model that the chain ended with, and of its recording.
    let exchanged = supervisor.exchanged().cloned();
    let (config, start_ns) =
        exchanged.map_or((options.config, start_ns), |exchanged| (exchanged.config, exchanged.since_ns));
    evidence.pass(config.model()?, start_ns..clock::monotonic_ns(), &supervisor);
    let clean = supervisor.end() && supervisor.is_unscathed() && failure.is_none();
    evidence.recorder(&supervisor);
    let Some(path) = config.record.path.as_deref().filter(|_| !args.no_recording) else {
        return without_recording(&evidence, args, clean);
    };
    let figures = evidence.figures(path)?;
    if args.json {
        print::json(&figures)?;
    } else {
        let next = format!("open {} in Foxglove, Lichtblick, PlotJuggler or Rerun", path.display());
        print::figures(&figures, &next)?;
    }
    let is_whole = clean && figures.samples.lost == 0 && figures.recording_is_whole;
    Ok(if is_whole && keeps_budget(&evidence, args) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Enters the devices that the command line names, and says what a person must know before they are taken.
fn apply_hand(config: &mut Config, args: &RunArgs) -> anyhow::Result<()> {
    let whole = |profile: &Path| -> std::io::Result<PathBuf> {
        if Profile::is_shipped(profile) { Ok(profile.to_owned()) } else { absolute(profile) }
    };
    if let Some(profile) = &args.profile {
        config.master.profile = Some(whole(profile)?);
    }
    if let Some(node) = &args.node {
        config.master.node = Some(absolute(node)?);
    }
    if !args.beside.is_empty() {
        let beside = args.beside.iter().map(|one| {
            Ok(BesideConfig { profile: whole(&one.profile)?, node: one.node.as_deref().map(absolute).transpose()? })
        });
        config.master.beside = beside.collect::<std::io::Result<_>>()?;
    }
    if args.master == MasterKind::Hid {
        let hand = JoinedHand::read(&config.master)?;
        // A node that is no input device is said before anything starts.
        for profile in hand.profiles() {
            if let ProfileDevice::Path(node) = &profile.device {
                refuse_no_input(node)?;
            }
        }
        for warning in hand.profiles().filter_map(Profile::warning) {
            tracing::warn!("{warning}");
        }
        if !config.master.beside.is_empty() {
            tracing::warn!("{}", hand.sentence());
        }
    }
    Ok(())
}

/// Without a recording there is only what was watched while the chain ran.
fn without_recording(evidence: &Evidence, args: &RunArgs, clean: bool) -> anyhow::Result<ExitCode> {
    match evidence.budget() {
        Some(budget) if args.json => print::json(&serde_json::json!({ "budget": budget }))?,
        Some(budget) => print::out(&budget.text())?,
        None => {}
    }
    Ok(if clean && keeps_budget(evidence, args) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn keeps_budget(evidence: &Evidence, args: &RunArgs) -> bool {
    !args.check_budget || evidence.budget().is_some_and(|budget| budget.is_kept)
}

/// A chain that never came up has recorded nothing but its own start.
fn discard_empty_recording(config: &Config, args: &RunArgs) {
    let Some(path) = config.record.path.as_deref().filter(|_| !args.no_recording) else { return };
    if let Err(error) = std::fs::remove_file(path) {
        tracing::debug!(path = %path.display(), %error, "there was no recording to discard");
    }
}

fn configure(common: &Common, args: &RunArgs) -> anyhow::Result<Config> {
    let mut config = Config::load(common.config.as_deref())?;
    let is_real = args.machine.apply(&mut config)?;
    ensure!(
        !is_real || args.engage != Some(EngageKind::Again),
        "--engage=again would move real drives again after whatever has stopped them; use --engage, or --slave sim"
    );
    if args.master == MasterKind::Browser {
        ensure!(
            args.input.is_none(),
            "--input is for recordings and scripts, and a hand on a page has none; leave it out"
        );
        refuse_pad_of_real_drives(config.slave.drive.kind)?;
    }
    ensure!(
        args.listen.is_none() || args.master == MasterKind::Pose,
        "--listen is where poses are awaited, and this master awaits none; leave it out, or add --master pose"
    );
    ensure!(
        args.profile.is_none() || args.master == MasterKind::Hid,
        "--profile is of a hand controller on this machine, and this master reads none; leave it out, or add --master hid"
    );
    ensure!(
        args.beside.is_empty() || args.master == MasterKind::Hid,
        "--beside is of a device beside a hand controller on this machine, and this master reads none; leave it out, or add --master hid"
    );
    apply_hand(&mut config, args)?;
    config.master.pose.listen = args.listen.or(config.master.pose.listen);
    if args.master == MasterKind::Pose {
        ensure!(args.input.is_none(), "--input is for recordings and scripts, and a hand has none; leave it out");
        refuse_poses_of_real_drives(&config)?;
    }
    if let Some(model) = &args.model {
        config.model = Some(absolute(model)?);
    }
    if let Some(compensation) = args.compensation {
        config = config.with_compensation(compensation, args.model.is_some())?;
    }
    let wanted = args.recording.clone().or_else(|| config.record.path.clone());
    if !args.no_recording {
        config.record.path = Some(crate::recording_path(wanted.as_deref(), "run")?);
    }
    if let Some(megabytes) = args.rotate_mb {
        config.record.rotate_bytes = megabytes.saturating_mul(1_000_000);
    }
    if let Some(age_s) = args.rotate_s {
        config.record.rotate_s = age_s;
    }
    config.record.metadata.insert("run".to_owned(), "run".to_owned());
    device::enter(&mut config.record.metadata, &config.master, args.master, args.input.as_deref());
    config.check()?;
    config.check_drives()?;
    config.record.metadata.insert("compensation".to_owned(), config.model()?.label.to_owned());
    Ok(config)
}
