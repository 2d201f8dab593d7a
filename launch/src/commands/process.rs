//! `krait master | resolve | compensate | estimate | slave | record`: one process of the chain.

use crate::cli::{Common, EngageKind, MasterKind};
use crate::cli_process::{MasterArgs, ProcessVerb};
use crate::config::Config;
use crate::in_force::{Compensation, drawn_of};
use crate::signals;
use anyhow::{Context, bail, ensure};
use krait_bridge::{Feed, LiveModel};
use krait_drives::open_drive;
use krait_ipc::{Beside, Bus, Priority, Process, WaitMode, allowed_cores, clock, input};
use krait_master::{Engage, GuidePlan, HidRecording, LineLoadLimits, LiveMotion, MasterConfig, Script, SourceChoice};
use krait_model::segments::{SegmentParameters, SegmentsParameters};
use krait_record::{Attachment, CONFIG_ATTACHMENT, MODEL_ATTACHMENT, RecordConfig};
use krait_sim::{MachineTruth, SegmentTruth, SegmentsOfModel, Simulation};
use krait_slave::{DriveKind, Limits, SlaveConfig};
use rustix::process::{Resource, getrlimit};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Name under which a recording embeds the simulated snake.
pub const TRUTH_ATTACHMENT: &str = "truth.toml";
/// How the names begin under which a recording embeds the built-in model files, which passes of a demo use in turn.
pub const BUILT_IN_ATTACHMENT: &str = "model-";
/// How long a recorder waits for the last words of the others, ns.
const LAST_WORDS_NS: i64 = 1_000_000_000;

/// Joins the instance and runs the process until it is told to stop.
pub fn run(common: &Common, process: &ProcessVerb) -> anyhow::Result<ExitCode> {
    run_named(common, process).with_context(|| format!("process `{}`", process.process()))?;
    Ok(ExitCode::SUCCESS)
}

fn feed(is_cued: bool) -> Feed {
    if is_cued { Feed::Cued } else { Feed::Live }
}

fn run_named(common: &Common, process: &ProcessVerb) -> anyhow::Result<()> {
    let stop = signals::stop_flag()?;
    check_limits()?;
    signals::end_with_supervisor()?;
    let mut config = Config::load(common.config.as_deref())?;
    config.check()?;
    let polls = [config.resolve.wait, config.compensate.wait, config.slave.wait].contains(&WaitMode::Polling);
    let priority = &mut config.realtime.priority;
    *priority = if is_cued(process) { Priority::NONE } else { priority.for_chain(polls, allowed_cores().len()) };
    let beside = Beside::before(&config.realtime);
    apply_realtime(&config, &common.instance, process);
    let bus = Bus::open_unless(&common.instance, process.process().name(), &stop)?;
    match process {
        ProcessVerb::Master(args) => run_master(&bus, &config, args, &stop)?,
        ProcessVerb::Resolve(args) => {
            let machine = &config.model()?.machine;
            let feed = feed(args.cued);
            krait_bridge::run_resolve(&bus, machine, config.resolve, &config.joints, config.gripper, feed, &stop)?;
        }
        ProcessVerb::Compensate(args) => {
            let machine = &config.model()?.machine;
            krait_bridge::run_compensate(&bus, machine, config.compensate, &config.joints, feed(args.cued), &stop)?;
        }
        ProcessVerb::Estimate(args) => {
            let machine = &config.model()?.machine;
            krait_bridge::run_estimate(&bus, machine, config.estimate, &config.joints, feed(args.cued), &stop)?;
        }
        ProcessVerb::Slave(args) => match args.recorded_time_ns {
            Some(start_ns) => {
                krait_sim::run_in_recorded_time(&bus, &config.slave, simulation(&config)?, start_ns, &stop)?
            }
            None => {
                let latency_limits = config.budget.latency_limits();
                let slave = SlaveConfig { latency_limits, ..config.slave.clone() };
                match slave.drive.kind {
                    DriveKind::Sim => krait_sim::run(&bus, &slave, simulation(&config)?, &stop)?,
                    DriveKind::Sts3215 | DriveKind::Xl330 | DriveKind::Cia402 => {
                        config.check_drives()?;
                        let drive = open_drive(&slave, Some(beside))?;
                        krait_drives::run(&bus, &slave, drive, &stop)?;
                    }
                }
            }
        },
        ProcessVerb::Record => {
            let report = krait_record::run(&bus, &with_attachments(&config)?, record_until(&bus, &stop))?;
            tracing::info!(?report, "recorded");
        }
    }
    Ok(())
}

/// When the recorder has to end. A supervisor asks it last; where that was killed, the kernel asks every process at once, and
/// the last words of the others still belong into the file.
fn record_until(bus: &Bus, stop: &AtomicBool) -> impl FnMut() -> bool {
    let mut give_up_ns = None;
    move || {
        if !stop.load(Ordering::Relaxed) {
            return false;
        }
        let now_ns = clock::monotonic_ns();
        let ends_before = |process| process != Process::Record && Process::END_ORDER.contains(&process);
        let is_alone = !bus.members().iter().any(|(name, _)| Process::from_name(name).is_some_and(ends_before));
        is_alone || now_ns > *give_up_ns.get_or_insert(now_ns + LAST_WORDS_NS)
    }
}

/// The simulated machine that goes with the model.
fn simulation(config: &Config) -> anyhow::Result<Simulation> {
    Ok(match config.model()?.machine {
        LiveModel::Snake(chain) => Simulation::Snake(chain.gripper().map(|gripper| gripper.numbers().wire_m_per_rad)),
        LiveModel::Joints(joints) => Simulation::Joints(joints.n()),
        LiveModel::Segments(segments) => Simulation::Segments(segments_of(segments.parameters())),
    })
}

/// Segments to be simulated with the dimensions that the model has.
fn segments_of(model: &SegmentsParameters) -> SegmentsOfModel {
    let segment = |own: &SegmentParameters| SegmentTruth {
        effects: None,
        azimuths_rad: own.lines.iter().map(|line| line.azimuth_rad).collect(),
        radii_m: own.lines.iter().map(|line| line.radius_m).collect(),
        machine: MachineTruth {
            l_m: own.l_m,
            e_pa: own.e_pa,
            d_outer_m: own.d_outer_m,
            d_inner_m: own.d_inner_m,
            l_d_m: own.l_d_m,
            l_c_m: own.l_c_m,
            ..MachineTruth::default()
        },
    };
    SegmentsOfModel { segments: model.segments.iter().map(segment).collect(), phi_rad: model.phi_rad }
}

/// Files that a process of the chain may need: each channel takes some, with each reader and writer that it has.
const OPEN_FILES: u64 = 512;

/// Size that a file may need: the memory of a channel is one, and the largest takes 5 MB.
const FILE_BYTES: u64 = 8 << 20;

/// A limit that is too low is named at the start, not by whatever fails in the middle of a motion.
fn check_limits() -> anyhow::Result<()> {
    let limit = |resource| getrlimit(resource).current.unwrap_or(u64::MAX);
    let (files, bytes) = (limit(Resource::Nofile), limit(Resource::Fsize));
    ensure!(
        files >= OPEN_FILES,
        "the limit of open files (`ulimit -n`) is {files}, expected at least {OPEN_FILES}; raise it with `ulimit -n {OPEN_FILES}` and start again"
    );
    ensure!(
        bytes >= FILE_BYTES,
        "the limit of a file's size (`ulimit -f`) is {bytes} bytes, expected at least {FILE_BYTES} for the memory of a channel; raise it with `ulimit -f unlimited` and start again"
    );
    Ok(())
}

/// Before anything is opened, so that whatever is mapped later is locked as well. What the kernel refuses is told, and the
/// process goes on without it.
fn apply_realtime(config: &Config, instance: &str, process: &ProcessVerb) {
    let Some(core_turn) = process.process().core_turn() else { return };
    // A replay as fast as possible is not about one sample's latency: its stages work at once, on as many cores as there are.
    if is_cued(process) {
        return;
    }
    // The slave must be in time whatever else the machine does with its memory.
    if matches!(process, ProcessVerb::Slave(_)) && !config.realtime.lock_memory {
        if krait_ipc::lock_what_is_used() {
            tracing::info!("the memory of the slave is locked");
        } else {
            tracing::warn!(
                "the memory of the slave could not be locked, so a page that is swapped out may delay a step; allow it with \
                 `ulimit -l unlimited` (`memlock unlimited` in /etc/security/limits.conf), `krait doctor` says more"
            );
        }
    }
    for refused in config.realtime.apply(core_turn, instance) {
        tracing::warn!(process = process.process().name(), "{refused}");
    }
}

fn is_cued(process: &ProcessVerb) -> bool {
    match process {
        ProcessVerb::Resolve(args) => args.cued,
        ProcessVerb::Compensate(args) => args.cued,
        ProcessVerb::Estimate(args) => args.cued,
        ProcessVerb::Slave(args) => args.recorded_time_ns.is_some(),
        ProcessVerb::Master(_) | ProcessVerb::Record => false,
    }
}

/// A page may stop and pause real drives; to move them takes a device that nothing but a hand can move.
///
/// # Errors
/// One sentence where the drives are real.
pub fn refuse_pad_of_real_drives(drive: DriveKind) -> anyhow::Result<()> {
    match drive {
        DriveKind::Sim => Ok(()),
        DriveKind::Sts3215 | DriveKind::Xl330 | DriveKind::Cia402 => bail!(
            "--master browser drives simulated drives only, and [slave.drive] names real ones; \
             drive them with --master hid, or try the page with --slave sim"
        ),
    }
}

/// Whoever reaches the port can send poses: that is enough for a simulated snake, and for a real one somebody must say so.
///
/// # Errors
/// One sentence where the drives are real and the configuration does not allow it, or no address is named.
pub fn refuse_poses_of_real_drives(config: &Config) -> anyhow::Result<()> {
    ensure!(
        config.master.pose.listen.is_some(),
        "--master pose needs the address on which poses are awaited: name it with --listen, as in --listen 127.0.0.1:5005, or with `listen` in [master.pose]"
    );
    match config.slave.drive.kind {
        DriveKind::Sts3215 | DriveKind::Xl330 | DriveKind::Cia402 if !config.master.pose.real_drives => bail!(
            "--master pose moves real drives only where [master.pose] says `real_drives = true`: its packets carry no \
             authentication, so whatever program of yours reaches the port can move the robot (docs/pose.md); or try it with --slave sim"
        ),
        DriveKind::Sim | DriveKind::Sts3215 | DriveKind::Xl330 | DriveKind::Cia402 => Ok(()),
    }
}

fn run_master(bus: &Bus, config: &Config, args: &MasterArgs, stop: &AtomicBool) -> anyhow::Result<()> {
    let (input, looping) = (args.input.as_deref(), args.looped);
    let source = match (args.kind, input) {
        (MasterKind::Hid, None) if args.given_back => SourceChoice::GivenBack,
        (MasterKind::Hid, None) => SourceChoice::Hid,
        (MasterKind::Browser, None) => {
            refuse_pad_of_real_drives(config.slave.drive.kind)?;
            SourceChoice::Browser
        }
        (MasterKind::Pose, None) => {
            refuse_poses_of_real_drives(config)?;
            SourceChoice::Pose
        }
        (MasterKind::Hid | MasterKind::Browser | MasterKind::Pose, Some(path)) => {
            bail!("--input {}: a live device has no input file", path.display())
        }
        (MasterKind::Replay, None) => SourceChoice::Recording { recording: HidRecording::shipped()?, looping },
        (MasterKind::Replay, Some(path)) => SourceChoice::Recording { recording: HidRecording::load(path)?, looping },
        (MasterKind::Script, Some(path)) => SourceChoice::Script { script: Script::load(path)?, looping },
        (MasterKind::Guide, Some(path)) => SourceChoice::Guide(GuidePlan::load(path)?),
        (MasterKind::Guide, None) => bail!("a plan is missing: name it with --input FILE"),
        (MasterKind::Script, None) => bail!("a script is missing: name it with --input FILE"),
    };
    let record_reports = args.record_reports.clone().or_else(|| config.master.record_reports.clone());
    let record_reports = record_reports.filter(|path| {
        if args.started_again {
            let path = path.display();
            tracing::warn!(%path, "the hand's reports are not recorded any more, because the master was started again; the file holds those of before");
        }
        !args.started_again
    });
    let engage = match args.engage {
        None => Engage::Never,
        Some(EngageKind::Once) => Engage::Once,
        Some(EngageKind::Again) => Engage::Again,
    };
    ensure!(args.locks & !LiveMotion::LOCKS == 0, "--locks is {}: expected bits of {}", args.locks, LiveMotion::LOCKS);
    let begin = LiveMotion { scale_permille: args.scale_permille, locks: args.locks };
    let Limits { push_n, pull_n, .. } = config.slave.limits;
    let load_limits = LineLoadLimits { push_n, pull_n };
    let config = MasterConfig { record_reports, engage, begin, load_limits, ..config.master.clone() };
    Ok(krait_master::run(bus, &config, source, stop)?)
}

/// The recording holds what a reader needs to repeat the run: the whole configuration, every model that a pass may run with,
/// and the truth, if there is one.
pub fn with_attachments(config: &Config) -> anyhow::Result<RecordConfig> {
    let toml = |name: &str, data| Attachment { name: name.to_owned(), media_type: "application/toml".to_owned(), data };
    let mut record = config.record.clone();
    let model = config.model()?;
    record.machine = drawn_of(&model.machine);
    record.metadata.insert("git_revision".to_owned(), env!("KRAIT_GIT_REVISION").to_owned());
    // The model has an attachment of its own.
    let settings = Config { model: Some(MODEL_ATTACHMENT.into()), model_text: None, ..config.clone() };
    record.attachments.push(toml(CONFIG_ATTACHMENT, settings.to_toml()?.into_bytes()));
    record.attachments.push(toml(MODEL_ATTACHMENT, model.text.into_bytes()));
    for own in Compensation::ALL {
        let name = format!("{BUILT_IN_ATTACHMENT}{}.toml", own.name());
        record.attachments.push(toml(&name, own.text().as_bytes().to_vec()));
    }
    if let Some(path) = &config.slave.truth {
        let text = input::bytes(path, input::CONFIG_BYTES)
            .with_context(|| format!("{TRUTH_ATTACHMENT} from {}", path.display()))?;
        record.attachments.push(toml(TRUTH_ATTACHMENT, text));
    }
    Ok(record)
}
