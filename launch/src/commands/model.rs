//! `krait model show | check`: prints a model file with what every key means, and checks one.

use crate::cli::{ModelFileArgs, ModelShowArgs, ModelVerb};
use crate::print;
use anyhow::{Context, bail};
use krait_ipc::input;
use krait_model::model_file::{FileEffect, Machine, ModelFile, ModelFileError, documented_defaults};
use krait_model::{ChainError, Columns};
use serde::Serialize;
use std::path::Path;
use std::process::ExitCode;

/// The largest bend that a chain can be configured for, rad.
const LARGEST_BEND_RAD: f64 = core::f64::consts::FRAC_PI_2;

/// Shows or checks a model file.
pub fn run(verb: &ModelVerb) -> anyhow::Result<ExitCode> {
    match verb {
        ModelVerb::Show(args) => show(args),
        ModelVerb::Check(args) => check(args),
    }
}

fn show(args: &ModelShowArgs) -> anyhow::Result<ExitCode> {
    if args.defaults {
        print::out(&documented_defaults())?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(path) = &args.file else { bail!("a model file is missing: name one, or ask for --defaults") };
    let model = ModelFile::parse(&text_of(path)?).with_context(|| path.display().to_string())?;
    if args.json {
        print::json(&described(path, &model)?)?;
    } else {
        print::out(&model.to_documented_toml())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A file that is refused is a failure found; one that cannot be read could not be checked.
fn check(args: &ModelFileArgs) -> anyhow::Result<ExitCode> {
    let path = &args.file;
    match ModelFile::parse(&text_of(path)?) {
        Ok(model) => {
            let found = described(path, &model)?;
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

fn text_of(path: &Path) -> anyhow::Result<String> {
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
    machine: &'static str,
    /// Largest bend that the strain limit allows, degrees; snakes only.
    max_bend_deg: Option<f64>,
    /// Why the live compensator cannot use it; null where it can.
    not_compensable: Option<String>,
    /// Why it must not steer a machine though every number of it is within bounds; null where it may.
    implausible: Option<String>,
    effects: Vec<Effect>,
    n_history: usize,
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
    se: Option<f64>,
    from: Option<String>,
    date: Option<String>,
}

fn described(path: &Path, model: &ModelFile) -> Result<Described, ModelFileError> {
    let every_column = Columns { time: true, stem_angle: true, temperature: true };
    // The file was checked as a whole when it was read; should it fail here, it is the whole file that fails.
    let whole = |source: ChainError| ModelFileError::Chain { line: 1, source };
    let chain = model.chain(every_column).map_err(whole)?;
    let (not_compensable, implausible) = match chain.as_ref().map(|chain| chain.plausible(LARGEST_BEND_RAD)) {
        Some(Ok(found)) => (None, found.err().map(|implausible| implausible.to_string())),
        Some(Err(error)) => (Some(error.to_string()), None),
        None => (Some("a machine of kind joints has no live compensator".to_owned()), None),
    };
    Ok(Described {
        file: path.display().to_string(),
        valid: true,
        machine: match model.machine() {
            Machine::Snake(_) => "snake",
            Machine::Joints(_) => "joints",
        },
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
    match found.implausible.as_ref().or(found.not_compensable.as_ref()) {
        Some(reason) if found.implausible.is_some() => text += &format!("  it must not steer a machine: {reason}\n"),
        Some(reason) => text += &format!("  the compensator cannot use it: {reason}\n"),
        None => text += "  the compensator can use it\n",
    }
    text
}

fn verdict(found: &Described) -> &'static str {
    if found.implausible.is_none() { "good" } else { "REFUSED" }
}
