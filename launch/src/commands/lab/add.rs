//! `krait lab add` and `krait lab fit`: values with standard errors, the error before and after, and the better model file.

use super::next::after_fit;
use super::{page, stages};
use crate::cli_lab::{AddArgs, FitArgs, LabFiles, dotted, effect_parameter};
use crate::commands::overwrite::{refuse_existing, write_whole};
use crate::commands::today;
use crate::print;
use anyhow::{Context, bail};
use krait_bridge::LiveModel;
use krait_lab::machine::MachineUnderTest;
use krait_lab::report::added_page;
use krait_lab::{
    AddOptions, Added, Measurements, Session, Term, add, disagreements, drawn_away, fitted_to, offered, open_model,
    parameters_called, refit as fit_again, save,
};
use krait_model::EffectSetting;
use krait_model::effects::{FormulaColumn, FormulaParameter, FormulaText, Hook, Inverse, Varying};
use krait_model::model_file::{FileEffect, Known, Machine, ModelFile};
use krait_report::Table;
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;

/// Adds an effect.
pub fn run(args: &AddArgs) -> anyhow::Result<ExitCode> {
    refuse_existing(&args.out, "toml", args.force)?;
    page::refuse_place(args.report.as_deref())?;
    stages::tell();
    let session = open(&args.files)?;
    let term = match of_file(args, &session.file)? {
        Some(own) => own,
        None => term(args, session.machine.as_ref(), &session.data)?,
    };
    let label = term.label().to_owned();
    // Said now, not after the fit: no model file has two formulas of one name.
    if term.formula.is_some() && has_formula(&session.file, &label) {
        bail!(
            "formula {label}: {} has a formula of that name already, expected another one; give it with --name",
            args.files.model.display()
        );
    }
    let from_given = args.set.iter().any(|(name, _)| is_start(name)) || term.formula.is_some();
    // A name with a point is a number of the model's own, which is fitted again.
    let (own, of_new): (Vec<&String>, Vec<&String>) = args.free.iter().partition(|name| name.contains('.'));
    let mut refit = fitted_to(&session.file, &session.data);
    for name in own {
        refit.push(effect_parameter(name).map_err(anyhow::Error::msg)?);
    }
    let recordings = session.recordings.clone();
    let options = AddOptions { term, from_given, free: of_new.into_iter().cloned().collect(), refit, recordings };
    let added = add(session.machine.as_ref(), &session.data, &options)?;
    write_page(args.report.as_deref(), &session, &added, &label)?;
    finish(&args.files, &session, &added, &label, &args.out, args.json)
}

/// A fit whose error on data that it did not see is this much larger than that of the values before is none.
const WORSE: f64 = 1.02;

/// Fits what a model has.
pub fn refit(args: &FitArgs) -> anyhow::Result<ExitCode> {
    refuse_existing(&args.out, "toml", args.force)?;
    page::refuse_place(args.report.as_deref())?;
    stages::tell();
    let session = open(&args.files)?;
    // Without names: what was fitted to these data once, and what the file leaves open, which a fit has anyway.
    let free = if args.free.is_empty() { fitted_to(&session.file, &session.data) } else { args.free.clone() };
    if free.is_empty()
        && session.machine.open_numbers().is_empty()
        && !has_joint_number(&session.file, |own| *own == Known::Free)
    {
        bail!(
            "nothing is free: expected --free EFFECT.PARAMETER, --free machine.KEY, or a number in {} that is \"free\" or has a \
             standard error; name what is to be fitted",
            args.files.model.display()
        );
    }
    let added = fit_again(session.machine.as_ref(), &session.data, &free)?;
    if added.after > WORSE * added.before {
        let unit = session.machine.error_unit().0;
        bail!(
            "the values of {} leave {:.4} {unit}, and fitted ones {:.4} {unit} on blocks that they were not fitted to: expected a smaller error, \
             so nothing was written; record longer, or free fewer values",
            args.files.model.display(),
            added.before,
            added.after
        );
    }
    let names = dotted(&free);
    let what = if names.is_empty() { "fit of the machine".to_owned() } else { format!("fit of {}", names.join(", ")) };
    write_page(args.report.as_deref(), &session, &added, &what)?;
    finish(&args.files, &session, &added, &what, &args.out, args.json)
}

/// Which joint an effect is on, and which one it feels, is no value to start from.
fn is_start(name: &str) -> bool {
    name != "joint" && name != "from"
}

/// Whether a model knows no more than this of a gain or an offset of joints.
pub(super) fn has_joint_number(file: &ModelFile, is: impl Fn(&Known) -> bool) -> bool {
    let Machine::Joints(joints) = file.machine() else { return false };
    joints.gain_known.iter().chain(&joints.offset_known).any(is)
}

fn write_page(path: Option<&Path>, session: &Session, added: &Added, what: &str) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    page::write(path, |origin| added_page(session.machine.as_ref(), &session.data, added, what, origin))
}

fn open(files: &LabFiles) -> anyhow::Result<Session> {
    files.session()
}

/// The formula of this name in the file of `--effects`, with its starting values; `None` where the library's effect is meant.
fn of_file(args: &AddArgs, model: &ModelFile) -> anyhow::Result<Option<Term>> {
    let Some(path) = &args.effects else { return Ok(None) };
    let machine = model.machine();
    let all = offered(path, &open_model(path)?, machine)?;
    let Some(own) = all.into_iter().find(|own| own.name() == args.effect) else { return Ok(None) };
    if is_formula_said(args) || args.by.is_some() {
        bail!(
            "--formula, --hook, --param, --column and --by say what {} of {} says itself; leave them out",
            args.effect,
            path.display()
        );
    }
    let value = |name: &str| args.set.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
    let n_joints = if let Machine::Joints(joints) = machine { joints.n } else { 1 };
    let said = value("joint");
    let joint = match said {
        None if n_joints == 1 => 0,
        Some(number) if (1..=n_joints).any(|joint| joint as f64 == number) => number as usize - 1,
        _ => bail!(
            "{} of {}: expected --set joint=NUMBER, one of 1 to {n_joints}, found {}; say which joint has it",
            args.effect,
            path.display(),
            said.map_or("none".to_owned(), |number| number.to_string())
        ),
    };
    let mut term = own.term(joint, value);
    // The same formula on a further joint is another one of the model.
    if let Some(text) = term.formula.as_mut().filter(|_| n_joints > 1) {
        text.name = free_name(&text.name, |name| has_formula(model, name));
    }
    let has = |name: &str| {
        name == "joint" || term.formula.iter().any(|text| text.parameters.iter().any(|own| own.name == name))
    };
    if let Some((name, _)) = args.set.iter().find(|(name, _)| !has(name)) {
        bail!("--set {name}: the formula {} of {} has no such parameter; leave it out", args.effect, path.display());
    }
    Ok(Some(term))
}

/// Whether a model has a formula of this name.
pub(super) fn has_formula(file: &ModelFile, name: &str) -> bool {
    let formulas = file.effects().iter().map(FileEffect::setting).filter(|own| own.formula_text().is_some());
    formulas.map(EffectSetting::label).any(|own| own == name)
}

/// The name itself, or with a number behind it the first that is not taken: `rest`, `rest2`, `rest3`.
pub(super) fn free_name(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let mut all = std::iter::once(name.to_owned()).chain((2_u32..).map(|number| format!("{name}{number}")));
    all.find(|own| !is_taken(own)).unwrap_or_else(|| name.to_owned())
}

/// Whether options describe a formula.
fn is_formula_said(args: &AddArgs) -> bool {
    args.formula.is_some() || args.hook.is_some() || !args.param.is_empty() || !args.column.is_empty()
}

/// The effect with its starting values.
fn term(args: &AddArgs, machine: &dyn MachineUnderTest, data: &Measurements) -> anyhow::Result<Term> {
    let formula = if args.effect == "formula" { Some(formula(args)?) } else { None };
    if formula.is_none() && is_formula_said(args) {
        bail!(
            "--formula, --hook, --param and --column belong to the effect formula, and {} was asked for; leave them out",
            args.effect
        );
    }
    let varying = args.by.as_ref().map(|by| varying(by, args, machine, data)).transpose()?;
    let mut term = Term { name: args.effect.clone(), values: Vec::new(), formula, varying };
    let parameters = machine.parameters(&term)?;
    term.values = parameters.iter().map(|own| own.default).collect();
    for (name, value) in &args.set {
        let Some(k) = parameters.iter().position(|own| own.name == *name) else {
            let names: Vec<&str> = parameters.iter().map(|own| own.name.as_str()).collect();
            bail!("--set {name}: {} has no such parameter; it has {}", args.effect, names.join(", "));
        };
        if !(parameters[k].low..=parameters[k].high).contains(value) {
            bail!(
                "--set {name}={value}: expected {} to {} {}",
                parameters[k].low,
                parameters[k].high,
                parameters[k].unit
            );
        }
        if !is_start(name) && value.fract() != 0.0 {
            bail!("--set {name}={value}: expected the number of a joint, a whole one");
        }
        term.values[k] = *value;
    }
    Ok(term)
}

/// The number that depends on a column, and the middle of the column, where it has its value.
fn varying(
    (parameter, column): &(String, String),
    args: &AddArgs,
    machine: &dyn MachineUnderTest,
    data: &Measurements,
) -> anyhow::Result<Varying> {
    let own = || machine.as_joints().and_then(|joints| joints.varying_number(&args.effect));
    let Some(own) = own() else {
        bail!("--by {parameter}={column}: no number of {} can depend on a column; leave --by out", args.effect)
    };
    if own != parameter {
        bail!("--by {parameter}={column}: of {} only {own} can depend on a column; name it", args.effect);
    }
    let Some(at) = data.middle_of(column) else {
        let names: Vec<&str> = data.names_beside().collect();
        bail!(
            "--by {parameter}={column}: expected a column of {} that changes and does not repeat the measurement; it has {}",
            data.source,
            if names.is_empty() { "none beside the motion".to_owned() } else { names.join(", ") }
        )
    };
    Ok(Varying { parameter: own, column: column.clone(), at })
}

fn formula(args: &AddArgs) -> anyhow::Result<FormulaText> {
    let (Some(hook), Some(text)) = (&args.hook, &args.formula) else {
        bail!("a formula needs --hook and --formula; see krait lab add --help")
    };
    let Some(hook) = Hook::from_word(hook) else {
        bail!(
            "--hook {hook}: expected eps, tau, geo, meas or enc of a snake, meas of segments, joint of joints, force of a machine of kind force"
        )
    };
    let parameter = |(name, value, unit): &(String, f64, String)| FormulaParameter {
        name: name.clone(),
        value: *value,
        unit: unit.clone(),
    };
    Ok(FormulaText {
        name: args.name.clone(),
        hook,
        text: text.clone(),
        parameters: args.param.iter().map(parameter).collect(),
        columns: args
            .column
            .iter()
            .map(|(name, column)| FormulaColumn { name: name.clone(), column: column.clone() })
            .collect(),
    })
}

fn finish(
    files: &LabFiles,
    session: &Session,
    added: &Added,
    what: &str,
    out: &Path,
    as_json: bool,
) -> anyhow::Result<ExitCode> {
    let file = save(&session.file, added, what, &session.data, &today())?;
    write_whole(out, file.to_toml())
        .with_context(|| format!("the model file {} could not be written", out.display()))?;
    let mut calibrated = disagreements(&session.file, added, &session.data);
    calibrated.extend(drawn_away(&session.file, &added.calibration));
    if as_json {
        print::json(&answer(added, session, what, out, &not_compensated(&file), &calibrated))?;
    } else {
        let mut told = text(added, session, what, out, &not_compensated(&file));
        for sentence in &calibrated {
            told += &print::lines(sentence);
        }
        told += &after_fit(files, out);
        print::out(&told)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What a running chain does not do with a model, a sentence each.
fn not_compensated(file: &ModelFile) -> Vec<String> {
    if matches!(file.machine(), Machine::Joints(_) | Machine::Force(_)) {
        let refused = LiveModel::of(file).err();
        return refused.map(|why| format!("`krait run` refuses this model: {why}")).into_iter().collect();
    }
    let sentence = |effect: &FileEffect| {
        let (name, inverse) = (effect.setting().label(), effect.setting().inverse());
        match inverse {
            Inverse::Exact | Inverse::Smoothed => None,
            Inverse::NotNeeded(reason) => Some(format!(
                "{name}: {reason}; no command follows it, so that what the camera shows of it stays while the chain runs"
            )),
            Inverse::None(reason) => Some(format!("{name}: {reason}; `krait run` refuses this model")),
        }
    };
    file.effects().iter().filter_map(sentence).collect()
}

fn answer(
    added: &Added,
    session: &Session,
    what: &str,
    out: &Path,
    not_compensated: &[String],
    calibrated: &[String],
) -> Value {
    let unit = session.machine.error_unit().0;
    let errors = json!({ "before": added.before, "after": added.after });
    let mut params: serde_json::Map<String, Value> = added
        .variables
        .iter()
        .zip(parameters_called(added, session.machine.as_ref()))
        .enumerate()
        .map(|(k, (variable, key))| {
            let value = json!({
                "value": variable.value(&added.terms), "se": added.uncertainty.robust.get(k),
                "se_if_independent": added.uncertainty.naive.get(k), "unit": variable.unit,
                "on_bound": variable.bound(&added.terms).is_some(),
            });
            (key, value)
        })
        .collect();
    for own in &added.joint_numbers {
        let value = json!({
            "value": own.value, "se": own.se, "se_if_independent": null, "unit": own.unit, "on_bound": false,
        });
        params.insert(format!("machine.{}", own.name()), value);
    }
    json!({
        "effect": what, "model": out, "params": params,
        "format": 2, "unit": unit,
        "heldout_rms": errors, "heldout_rms_deg": (unit == "deg").then_some(&errors),
        "noise_floor_relative_se": added.noise_floor.map(|_| added.floor_relative_error),
        "noise_floor": added.noise_floor, "noise_floor_deg": added.noise_floor.filter(|_| unit == "deg"),
        "calibration": added.calibration.iter().map(krait_lab::diagnose::Calibration::to_json).collect::<Vec<_>>(),
        "not_compensated": not_compensated,
        "disagrees_with_calibration": calibrated,
    })
}

fn text(added: &Added, session: &Session, what: &str, out: &Path, not_compensated: &[String]) -> String {
    let unit = session.machine.error_unit().0;
    let mut table = Table::new(&["parameter", "value", "standard error", "unit", ""]);
    for (k, (variable, key)) in
        added.variables.iter().zip(parameters_called(added, session.machine.as_ref())).enumerate()
    {
        table.row(vec![
            key,
            format!("{:.5e}", variable.value(&added.terms)),
            format!("{:.1e}", added.uncertainty.robust.get(k).copied().unwrap_or(f64::NAN)),
            variable.unit.clone(),
            if variable.bound(&added.terms).is_some() { "on its bound".to_owned() } else { String::new() },
        ]);
    }
    for own in &added.joint_numbers {
        let (value, se) = (format!("{:.5e}", own.value), format!("{:.1e}", own.se));
        table.row(vec![format!("machine.{}", own.name()), value, se, own.unit.clone(), String::new()]);
    }
    let floor = added.noise_floor.map_or(String::new(), |floor| format!(", noise floor {floor:.4} {unit}"));
    let rose = if added.after < added.before {
        String::new()
    } else {
        print::lines(
            "The error did not fall: on data that it was not fitted to it explains nothing, so keep the model as it was.",
        )
    };
    let live = match not_compensated {
        [] => format!(" (krait run --engage --model {} compensates with it)", out.display()),
        sentences => format!("\n  {}", sentences.join("\n  ")),
    };
    format!(
        "{what}: error {:.4} {unit} before, {:.4} {unit} after on data that it was not fitted to{floor}\n{table}\
         {rose}Written: {}{live}\n",
        added.before,
        added.after,
        out.display(),
    )
}
