//! `krait model show | check`: prints a model file with what every key means, and checks one.

use crate::cli::Common;
use crate::cli_model::{ModelFileArgs, ModelShowArgs, ModelVerb};
use crate::commands::model_loads::{LoadLimit, first_limit};
use crate::commands::model_segments::{self, SegmentEntry};
use crate::commands::{model_compensate, model_exchange, model_learnt};
use crate::config::Config;
use crate::print;
use anyhow::Context;
use krait_bridge::{JointMachine, LiveModel};
use krait_ipc::input;
use krait_model::gripper::Gripper;
use krait_model::model_file::{Assumed, FileEffect, ModelFile, ModelFileError, assumed, built_in, documented_defaults};
use krait_model::{Chain, ChainError, KnownColumns};
use serde::Serialize;
use std::path::Path;
use std::process::ExitCode;

/// The largest bend that a chain can be configured for, rad.
const LARGEST_BEND_RAD: f64 = core::f64::consts::FRAC_PI_2;

/// Shows or checks a model file.
pub fn run(common: &Common, verb: &ModelVerb) -> anyhow::Result<ExitCode> {
    match verb {
        ModelVerb::Show(args) => show(&Config::load(common.config.as_deref())?, args),
        ModelVerb::Check(args) => check(&Config::load(common.config.as_deref())?, args),
        ModelVerb::SaveLearnt(args) => model_learnt::run(args),
        ModelVerb::Compensate(args) => model_compensate::run(args),
        ModelVerb::Exchange(args) => model_exchange::run(common, args),
    }
}

/// Without a file: the model that `krait run` takes with the same configuration.
fn show(config: &Config, args: &ModelShowArgs) -> anyhow::Result<ExitCode> {
    if args.defaults {
        print::out(&documented_defaults())?;
        return Ok(ExitCode::SUCCESS);
    }
    let (path, text, is_built_in) = match args.file.as_ref().or(config.model.as_ref()) {
        Some(path) => (path.clone(), text_of(path)?, built_in_of(path).is_some()),
        None => (config.compensation.name().into(), config.compensation.text().to_owned(), true),
    };
    let model = ModelFile::parse(&text).with_context(|| path.display().to_string())?;
    if args.json {
        return print::json(&described(config, &path, &text, &model)?).map(|()| ExitCode::SUCCESS);
    }
    if args.file.is_none() {
        print::out(&format!("# {}: the model that `krait run` takes where none is named.\n", path.display()))?;
    }
    if is_built_in {
        print::out(&text)?;
    } else {
        print::out(&model.to_documented_toml())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A file that is refused is a failure found; one that cannot be read could not be checked.
fn check(config: &Config, args: &ModelFileArgs) -> anyhow::Result<ExitCode> {
    let path = &args.file;
    let text = text_of(path)?;
    match ModelFile::parse(&text) {
        Ok(model) => {
            let found = described(config, path, &text, &model)?;
            if args.json {
                print::json(&found)?;
            } else {
                print::out(&sentences(&found))?;
            }
            Ok(if found.implausible.is_none() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        Err(error) => {
            if args.json {
                print::json(&Refused { file: path.display().to_string(), valid: false, error: error.to_string() })?;
            } else {
                print::out(&format!("{}: {error}\n", path.display()))?;
            }
            Ok(ExitCode::FAILURE)
        }
    }
}

/// A word that is no file, but the name of a built-in model.
fn built_in_of(path: &Path) -> Option<&'static str> {
    if path.exists() { None } else { built_in(path.to_str()?) }
}

pub(super) fn text_of(path: &Path) -> anyhow::Result<String> {
    if let Some(text) = built_in_of(path) {
        return Ok(text.to_owned());
    }
    input::text(path, input::CONFIG_BYTES)
        .with_context(|| format!("the model file {} could not be read", path.display()))
}

/// A model file that is none, as `--json` prints it.
#[derive(Serialize)]
struct Refused {
    file: String,
    valid: bool,
    error: String,
}

/// A model file, as `--json` prints it.
#[derive(Serialize)]
struct Described {
    file: String,
    valid: bool,
    /// Which model it is: every message that rests on it carries this.
    hash: String,
    machine: &'static str,
    /// Largest bend that the strain limit allows, degrees; snakes only.
    max_bend_deg: Option<f64>,
    /// Where a line is first at the slave's limit of pull or push; null where none is up to the largest bend.
    load_limit: Option<LoadLimit>,
    /// The segments from the base on; only of a machine of segments.
    #[serde(skip_serializing_if = "Option::is_none")]
    segments: Option<Vec<SegmentEntry>>,
    /// The gripper; only of a snake that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    gripper: Option<GripperEntry>,
    /// Why the live compensator cannot use it; null where it can.
    not_compensable: Option<String>,
    /// Why it must not steer a machine though every number of it is within bounds; null where it may.
    implausible: Option<String>,
    effects: Vec<Effect>,
    /// Keys that the file leaves out, and what is assumed for them.
    assumed: Vec<AssumedKey>,
    n_history: usize,
}

/// A gripper, as `--json` prints it.
#[derive(Serialize)]
struct GripperEntry {
    /// The jaw closed and open, deg.
    range_deg: [f64; 2],
    /// The way of the wire from the jaw's zero, m.
    travel_m: f64,
    /// The effects of its wire.
    effects: Vec<&'static str>,
}

#[derive(Serialize)]
struct AssumedKey {
    place: String,
    key: &'static str,
    value: f64,
}

#[derive(Serialize)]
struct LearnEntry {
    sd: f64,
    memory_s: f64,
}

#[derive(Serialize)]
struct Effect {
    kind: &'static str,
    name: String,
    hook: &'static str,
    class: &'static str,
    inverse: &'static str,
    parameters: Vec<Parameter>,
}

#[derive(Serialize)]
struct Parameter {
    name: String,
    value: f64,
    unit: String,
    /// How it is learnt while the machine moves, if it is.
    learn: Option<LearnEntry>,
    se: Option<f64>,
    from: Option<String>,
    date: Option<String>,
}

fn described(config: &Config, path: &Path, text: &str, model: &ModelFile) -> Result<Described, ModelFileError> {
    let every_column = KnownColumns { time: true, stem_angle: true, temperature: true, named: true };
    // The file was checked as a whole when it was read; should it fail here, it is the whole file that fails.
    let whole = |source: ChainError| ModelFileError::Chain { line: 1, source };
    let chain = model.chain(every_column).map_err(whole)?;
    // Asked as `krait run` asks: what that refuses must not be promised here.
    let live = LiveModel::of(model);
    let mut not_compensable = live.as_ref().err().map(|error| format!("{error:#}"));
    let implausible = match &live {
        Ok(LiveModel::Snake(chain)) => {
            let of_snake = chain.plausible(LARGEST_BEND_RAD).map_err(whole)?.err().map(|error| error.to_string());
            let of_gripper = chain.gripper().map(Gripper::plausible).transpose().map_err(whole)?.and_then(Result::err);
            of_snake.or(of_gripper.map(|error| format!("its gripper: {error}")))
        }
        Ok(LiveModel::Joints(joints)) => match JointMachine::new(joints, &config.joints) {
            Ok(machine) => machine.plausible().map_err(whole)?.err().map(|e| e.to_string()),
            Err(error) => {
                not_compensable = Some(error.to_string());
                None
            }
        },
        // Every effect of segments has its bounds and an inverse of its own.
        Ok(LiveModel::Segments(_)) | Err(_) => None,
    };
    let within = |chain: &Chain| chain.max_bend_rad().min(config.resolve.max_bend_rad);
    let load_limit = chain.as_ref().map(|chain| first_limit(model, chain, &config.slave.limits, within(chain)));
    let load_limit = load_limit.transpose().map_err(|error| whole(error.into()))?.flatten();
    Ok(Described {
        load_limit,
        segments: model.segment_chain().map_err(whole)?.as_ref().map(model_segments::described),
        gripper: chain.as_ref().and_then(Chain::gripper).map(|gripper| GripperEntry {
            range_deg: gripper.numbers().range_deg,
            travel_m: gripper.travel_m(),
            effects: gripper.effects().iter().map(|effect| effect.kind().name()).collect(),
        }),
        file: path.display().to_string(),
        valid: true,
        hash: model.hash().to_string(),
        assumed: assumed(text)
            .into_iter()
            .map(|Assumed { place, key, value, .. }| AssumedKey { place, key, value })
            .collect(),
        machine: model.machine().kind(),
        max_bend_deg: chain.map(|chain| chain.max_bend_rad().to_degrees()),
        not_compensable,
        implausible,
        effects: model.effects().iter().map(effect).collect(),
        n_history: model.history().len(),
    })
}

fn effect(effect: &FileEffect) -> Effect {
    let setting = effect.setting();
    let definition = setting.kind().definition();
    let formula = setting.formula_text();
    let parameter = |name: &str| {
        let origin = effect.origin(name);
        let known = definition.parameters.iter().find(|p| p.name == name).map(|p| p.unit.to_owned());
        let own = formula.and_then(|f| f.parameters.iter().find(|p| p.name == name)).map(|p| p.unit.clone());
        Parameter {
            name: name.to_owned(),
            value: setting.value(name).unwrap_or(f64::NAN),
            unit: known.or(own).unwrap_or_default(),
            learn: setting.learn(name).map(|learn| LearnEntry { sd: learn.sd, memory_s: learn.memory_s }),
            se: origin.and_then(|o| o.se),
            from: origin.and_then(|o| o.from.clone()),
            date: origin.and_then(|o| o.date.clone()),
        }
    };
    Effect {
        kind: definition.name,
        name: setting.label().to_owned(),
        hook: formula.map_or(definition.hook, |f| f.hook).word(),
        class: definition.class.label(),
        inverse: setting.inverse().word(),
        parameters: setting.parameter_names().map(parameter).collect(),
    }
}

fn sentences(found: &Described) -> String {
    let names: Vec<&str> = found.effects.iter().map(|e| e.name.as_str()).collect();
    let effects = if names.is_empty() { "no effects: elastic lines alone".to_owned() } else { names.join(", ") };
    let mut text = format!("{}: {}; {} with {effects}\n", found.file, verdict(found), found.machine);
    if let Some(degrees) = found.max_bend_deg {
        text += &format!("  bends up to {degrees:.1} deg stay within the strain limit\n");
    }
    if let Some(limit) = found.load_limit {
        text += &load_sentence(&limit);
    }
    if let Some(GripperEntry { range_deg: [closed, open], travel_m, effects }) = &found.gripper {
        let with = if effects.is_empty() { "no effects".to_owned() } else { effects.join(", ") };
        text += &format!("  gripper: {closed} to {open} deg, {:.2} mm of wire, with {with}\n", travel_m * 1e3);
    }
    text += &model_segments::sentences(found.segments.as_deref().unwrap_or_default());
    match found.implausible.as_ref().or(found.not_compensable.as_ref()) {
        Some(reason) if found.implausible.is_some() => text += &format!("  it must not steer a machine: {reason}\n"),
        Some(reason) => text += &format!("  `krait run` cannot use it: {reason}\n"),
        None => text += "  `krait run` can use it\n",
    }
    let learnt: Vec<String> = found
        .effects
        .iter()
        .flat_map(|e| e.parameters.iter().filter(|p| p.learn.is_some()).map(move |p| format!("{}.{}", e.name, p.name)))
        .collect();
    if !learnt.is_empty() {
        text += &format!("  learns while the machine moves: {}\n", learnt.join(", "));
    }
    if !found.assumed.is_empty() {
        let assumed: Vec<String> =
            found.assumed.iter().map(|a| format!("{}.{} = {:?}", a.place, a.key, a.value)).collect();
        text += &format!("  assumed, because the file does not say: {}\n", assumed.join(", "));
    }
    text += &format!("  model {}\n", found.hash);
    text
}

fn load_sentence(limit: &LoadLimit) -> String {
    let LoadLimit { bend_deg, direction_deg, line, load_n, a_preload_helps } = *limit;
    let way = if load_n < 0.0 { "pull" } else { "push" };
    let newtons = load_n.abs();
    let help = if a_preload_helps { "; a load that all lines share would keep each within its limit" } else { "" };
    format!(
        "  line {line} is the first at a limit of [slave.limits]: at {bend_deg:.1} deg in the direction {direction_deg:.0} deg \
         the snake's elasticity alone needs {newtons:.1} N of {way}{help}\n"
    )
}

fn verdict(found: &Described) -> &'static str {
    if found.implausible.is_none() { "good" } else { "REFUSED" }
}
