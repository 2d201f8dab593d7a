//! `krait console`: the page of a chain that runs, as a process of its own.

use crate::cli::Common;
use crate::cli_console::ConsoleArgs;
use crate::config::Config;
use crate::in_force::{ModelInForce, drawn_of, lanes_of};
use crate::supervisor::KeptConfig;
use crate::{print, recorded, signals, supervisor};
use anyhow::Context;
use krait_bridge::{JointMachine, LiveModel, SegmentModel};
use krait_console::{
    Facts, FoxgloveSettings, HopBudget, JointFacts, LineFacts, LoadFacts, NewChain, SegmentFacts, ServerSettings,
};
use krait_ipc::Bus;
use krait_ipc::message::{GRIPPER_WIRE, ModelUpdate, n_of_snake};
use krait_master::Presence;
use krait_model::gripper::Gripper;
use krait_model::model_file::ModelFile;
use krait_model::segments::{LineParameters, SegmentParameters};
use krait_model::{Chain, ModelHash};
use krait_record::{RecordConfig, Recording, Views};
use krait_report::{Lanes, LearntReport};
use krait_slave::{DriveKind, Limits, SlaveConfig};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub use krait_console::NAME;

/// The model that the lab begins with: the paper's machine and no effect besides.
const BASE_MODEL: &str = include_str!("../../../docs/lab-tutorial/base.toml");

/// Serves the page until Ctrl-C.
pub fn run(common: &Common, args: &ConsoleArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    signals::end_with_supervisor()?;
    let mut kept = None;
    let (bus, facts, viewers) = match &args.recording {
        Some(path) => {
            let (bus, facts) = of_recording(common, path)?;
            (bus, facts, None)
        }
        None => {
            let bus = Bus::open(&common.instance, NAME)?;
            let config = match &common.config {
                Some(path) => Config::load(Some(path))?,
                None => kept.insert(KeptConfig::of(&bus)).newer()?.unwrap_or_default(),
            };
            let model = config.model()?;
            let wish = &args.viewers;
            let viewers = wish.foxglove.then(|| viewers_of(&config, &model, &wish.foxglove_origin)).transpose()?;
            (bus, facts_of(&common.instance, &config, &model)?, viewers)
        }
    };
    let announce = |address: &krait_console::Address| {
        let foxglove = address.foxglove.as_ref().map_or_else(String::new, |address| format!("Foxglove: {address}\n"));
        if let Err(error) = print::out(&format!("Console: {}\nStop:    {}\n{foxglove}", address.page, address.stop)) {
            tracing::warn!(%error, "the console's address could not be printed");
        }
    };
    let settings = ServerSettings {
        port: args.port,
        stop_port: args.stop_port,
        recordings: args.recording.as_deref().map_or_else(|| args.recordings.clone(), folder_of),
        learnt_of,
        lab: args.lab.clone(),
        base_model: BASE_MODEL.to_owned(),
        program: supervisor::own_program()?,
        foxglove: viewers,
    };
    let (instance, has_viewers) = (common.instance.clone(), settings.foxglove.is_some());
    // Without `--config` the page shows whatever chain runs here, also one that is started later.
    let newer = move || newer_chain(kept.as_mut()?, &instance, has_viewers);
    krait_console::run(bus, settings, facts, newer, announce, &stop)?;
    Ok(ExitCode::SUCCESS)
}

/// What is known of a chain that came since it was asked for last. What cannot be taken over is said in the log, and page and viewers
/// stay as they are.
fn newer_chain(kept: &mut KeptConfig, instance: &str, has_viewers: bool) -> Option<NewChain> {
    let found = kept.newer().transpose()?;
    let known = |config: &Config| {
        let model = config.model()?;
        let views = has_viewers.then(|| views_of(config, &model)).transpose()?;
        Ok(NewChain { facts: facts_of(instance, config, &model)?, views })
    };
    match found.and_then(|config| known(&config)) {
        Ok(chain) => Some(chain),
        Err(error) => {
            tracing::warn!(
                "the page keeps the machine that it has, as that of the chain that runs is not known: {error:#}; start krait console \
                 anew with --config"
            );
            None
        }
    }
}

/// What engineers' own viewers are served: the machine is drawn as in a recording.
fn viewers_of(config: &Config, model: &ModelInForce, origins: &[String]) -> anyhow::Result<FoxgloveSettings> {
    Ok(FoxgloveSettings { views: views_of(config, model)?, origins: origins.to_vec() })
}

fn views_of(config: &Config, model: &ModelInForce) -> anyhow::Result<Views> {
    // Without pictures in recordings, viewers have them as often as by default.
    let rate_hz = if config.record.view_hz == 0 { RecordConfig::default().view_hz } else { config.record.view_hz };
    Views::new(drawn_of(&model.machine).as_ref(), rate_hz).context("the machine of the model cannot be drawn")
}

/// An instance of its own, where no chain runs, and the machine that a recording was made with.
fn of_recording(common: &Common, path: &Path) -> anyhow::Result<(Bus, Facts)> {
    let named = || format!("recording {}", path.display());
    let recording = Recording::open(path)?;
    let is_listed = path.extension().is_some_and(|end| end == "mcap");
    let name = path.file_name().and_then(OsStr::to_str).filter(|_| is_listed).with_context(|| {
        format!("{}: expected a name that ends in .mcap, as the page lists them; rename it", named())
    })?;
    let bus = Bus::open(&recorded::instance_of(&common.instance, NAME), NAME)?;
    let config = recorded::config_of(&recording, &bus.instance().folder()).with_context(named)?;
    let facts = facts_of(bus.instance().as_str(), &config, &config.model()?).with_context(named)?;
    Ok((bus, Facts { opens: Some(name.to_owned()), recording: None, ..facts }))
}

/// What was learnt until a recording's end, named by the model that it embeds.
fn learnt_of(recording: &Recording, update: &ModelUpdate) -> Vec<String> {
    let named = || -> anyhow::Result<Vec<String>> {
        let file = ModelFile::parse(&recorded::model_text(recording, ModelHash(update.model_hash))?)?;
        let model = LiveModel::of(&file)?;
        Ok(LearntReport::of(update, model.learnt()).iter().map(LearntReport::sentence).collect())
    };
    named().unwrap_or_else(|error| vec![format!("what was learnt has no name: {error:#}")])
}

/// The folder of a file; the one we are in, for a bare name.
fn folder_of(path: &Path) -> PathBuf {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf()
}

fn facts_of(instance: &str, config: &Config, model: &ModelInForce) -> anyhow::Result<Facts> {
    let lanes = lanes_of(&model.machine).unwrap_or(Lanes::Turning);
    let (unit, per_si) = lanes.unit();
    let (machine, joints, n_actuators) = match &model.machine {
        LiveModel::Snake(chain) => (Some(chain.machine()), None, n_of_snake(chain.gripper().is_some())),
        LiveModel::Joints(joints) => {
            let joints = JointMachine::new(joints, &config.joints)?;
            (None, Some(joint_facts(&joints)), joints.n())
        }
        LiveModel::Segments(segments) => {
            (None, Some(segment_facts(segments, config)), segments.chain().machine().n_lines())
        }
    };
    let has_wire = model.machine.snake().is_some_and(|chain| chain.gripper().is_some());
    let allowance =
        |a: crate::budget::Allowance| HopBudget { p50_us: a.p50_us, p99_us: a.p99_us, worst_us: a.worst_us };
    let budget = &config.budget;
    Ok(Facts {
        instance: instance.to_owned(),
        is_simulated: config.slave.drive.kind == DriveKind::Sim,
        l_m: machine.map_or(0.0, |machine| machine.l_m),
        r_m: machine.map_or(0.0, |machine| machine.r_m),
        n_actuators,
        unit,
        per_si,
        joints,
        jaw: model.machine.snake().and_then(Chain::gripper).map(Gripper::range_rad),
        max_bend_rad: config.resolve.max_bend_rad,
        max_stroke_m: config.compensate.max_stroke_m,
        max_load_n: config.compensate.max_load_n,
        loads: (0..n_actuators).map(|actuator| load_facts(&config.slave, actuator, has_wire)).collect(),
        view_roll_rad: config.resolve.view_roll_rad,
        compensation: model.label.to_owned(),
        presence_hint: presence_hint(config.master.presence),
        recording: config.record.path.as_ref().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned())),
        opens: None,
        budgets: budget.hops().into_iter().chain([budget.end_to_end]).map(allowance).collect(),
    })
}

/// What the slave lets an actuator's load be; a gripper's wire has a limit of its own.
fn load_facts(slave: &SlaveConfig, actuator: usize, has_wire: bool) -> LoadFacts {
    let Limits { pull_n, push_n, jaw_n, .. } = slave.limits_of(actuator);
    if has_wire && actuator == GRIPPER_WIRE {
        LoadFacts { pull_n: jaw_n, push_n: jaw_n }
    } else {
        LoadFacts { pull_n, push_n }
    }
}

fn joint_facts(joints: &JointMachine) -> JointFacts {
    let [low, high] = joints.range_rad().map(|values| values[..joints.n()].to_vec());
    JointFacts { low, high, segments: Vec::new() }
}

/// Both components of each segment's bend vector may be as large as its bend.
fn segment_facts(segments: &SegmentModel, config: &Config) -> JointFacts {
    let n_segments = segments.chain().machine().n();
    let largest_rad = &segments.max_bend_rad(&config.resolve)[..n_segments];
    let high: Vec<f64> = largest_rad.iter().flat_map(|rad| [*rad; 2]).collect();
    let line = |own: &LineParameters| LineFacts { azimuth_rad: own.azimuth_rad, r_m: own.radius_m };
    let segment = |own: &SegmentParameters| SegmentFacts { l_m: own.l_m, lines: own.lines.iter().map(line).collect() };
    let segments = segments.parameters().segments.iter().map(segment).collect();
    JointFacts { low: high.iter().map(|rad| -rad).collect(), high, segments }
}

fn presence_hint(presence: Presence) -> String {
    let button = |n: u8| match n {
        0 => "the left button".to_owned(),
        1 => "the right button".to_owned(),
        n => format!("button {}", n + 1),
    };
    match presence {
        Presence::Hold(n) => format!("Hold {} to follow.", button(n)),
        Presence::Toggle(n) => format!("Press {} to follow.", button(n)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_actuator_has_the_limits_of_its_own_load_a_grippers_wire_too() {
        let model = ModelInForce::parse(include_str!("../../../docs/gripper/snake.toml")).expect("the shipped model");
        let loads = |text: &str| {
            let config = Config::parse(text).expect("a configuration");
            let loads = facts_of("main", &config, &model).expect("facts").loads;
            loads.iter().map(|own| (own.pull_n, own.push_n)).collect::<Vec<_>>()
        };
        let limits = "[slave.limits]\npull_n = 50.0\npush_n = 20.0\n";
        assert_eq!(loads(limits), [(50.0, 20.0), (50.0, 20.0), (50.0, 20.0), (15.0, 15.0)]);
        let drive = "[slave.drive]\nkind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n";
        let own = ["", "load_n = 8.0", "", "jaw_m_per_rad = 0.002\nload_n = 6.0"].into_iter().enumerate();
        let tables: String = own.map(|(k, own)| format!("[[slave.drive.actuator]]\nid = {}\n{own}\n", k + 1)).collect();
        let narrowed = loads(&format!("{limits}{drive}{tables}"));
        assert_eq!(narrowed, [(50.0, 20.0), (8.0, 8.0), (50.0, 20.0), (6.0, 6.0)]);
    }
}
