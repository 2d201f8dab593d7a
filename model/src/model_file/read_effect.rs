//! One `[[effect]]` of a model file: its parameters with their origins, or a formula.

use super::machine::Machine;
use super::read::Section;
use super::{FileEffect, ModelFileError, Origin};
use crate::effects::{
    EffectKind, ForceEffect, FormulaColumn, FormulaParameter, FormulaText, Hook, SLOPE, SegmentEffect,
};
use crate::joints::JointEffect;
use crate::segments::SEGMENT_EFFECTS;
use crate::{ChainError, EffectSetting, Learn};

/// How long a learnt parameter takes to drift by its standard deviation where the file does not say, s.
const DEFAULT_MEMORY_S: f64 = 3600.0;

/// Parameters that say which joint is meant.
const NUMBERS_OF_JOINTS: [&str; 2] = ["joint", "from"];

/// What stands where a value cannot be free.
const NO_FREE: &str = "a number (\"free\" is for the effects of a snake and of joints, but for the number of a joint)";

/// Reads one effect.
pub(super) fn effect(section: &Section, machine: &Machine) -> Result<FileEffect, ModelFileError> {
    one(section, machine, matches!(machine, Machine::Snake(_) | Machine::Joints(_)))
}

/// Reads one effect none of whose values is left to a fit: a gripper's, which no fit knows.
pub(super) fn held_effect(section: &Section, machine: &Machine) -> Result<FileEffect, ModelFileError> {
    one(section, machine, false)
}

fn one(section: &Section, machine: &Machine, may_be_free: bool) -> Result<FileEffect, ModelFileError> {
    let kind = section.text("kind")?.ok_or_else(|| section.missing("kind", "the name of an effect"))?;
    let of_snake = EffectKind::from_name(&kind.value);
    let known = match machine {
        Machine::Snake(_) => of_snake.ok_or_else(|| kind.unknown("kind", EffectKind::ALL.map(EffectKind::name))),
        Machine::Joints(_) => match (JointEffect::from_name(&kind.value), of_snake) {
            (Some(effect), _) => Ok(EffectKind::Joint(effect)),
            (None, Some(EffectKind::Formula)) => Ok(EffectKind::Formula),
            (None, Some(other)) => {
                let (effect, machine) = (other.name(), "joints");
                let allowed = joint_names().collect::<Vec<_>>().join(", ");
                Err(ModelFileError::NotForMachine { line: kind.line, effect, machine, allowed })
            }
            (None, None) => Err(kind.unknown("kind", joint_names())),
        },
        Machine::Segments(_) => match (of_snake, SegmentEffect::from_name(&kind.value)) {
            (Some(effect), _) if SEGMENT_EFFECTS.contains(&effect) || effect == EffectKind::Formula => Ok(effect),
            (_, Some(effect)) => Ok(EffectKind::OfSegment(effect)),
            (Some(other), None) => {
                let (effect, machine) = (other.name(), "segments");
                let allowed = SEGMENT_EFFECTS.map(EffectKind::name).join(", ");
                Err(ModelFileError::NotForMachine { line: kind.line, effect, machine, allowed })
            }
            (None, None) => {
                let of_one = SegmentEffect::all().map(|effect| effect.definition().name);
                Err(kind.unknown("kind", SEGMENT_EFFECTS.map(EffectKind::name).into_iter().chain(of_one)))
            }
        },
        Machine::Force(_) => {
            let of_force = ForceEffect::from_name(&kind.value).map(EffectKind::Force);
            let formula = of_snake.filter(|effect| *effect == EffectKind::Formula);
            let names = ForceEffect::ALL.into_iter().map(ForceEffect::name).chain(["formula"]);
            of_force.or(formula).ok_or_else(|| kind.unknown("kind", names))
        }
    }?;
    let hooks: &[&str] = match machine {
        Machine::Snake(_) => &["eps", "tau", "geo", "meas", "enc"],
        Machine::Joints(_) => &["joint"],
        Machine::Segments(_) => &["meas"],
        Machine::Force(_) => &["force"],
    };
    match known {
        EffectKind::Formula => formula(section, hooks),
        known => named(section, known, may_be_free),
    }
}

fn joint_names() -> impl Iterator<Item = &'static str> {
    JointEffect::ALL.into_iter().map(JointEffect::name).chain(["formula"])
}

fn named(section: &Section, kind: EffectKind, may_be_free: bool) -> Result<FileEffect, ModelFileError> {
    let parameters = kind.definition().parameters;
    let mut setting = EffectSetting::new(kind);
    let by_column = with_column(section, &mut setting)?;
    let mut known = vec!["kind"];
    known.extend(parameters.iter().map(|p| p.name));
    if matches!(kind, EffectKind::Joint(_)) {
        known.push("by");
        known.extend(by_column.then_some(SLOPE));
    }
    section.only(&known)?;
    let (mut origins, mut free) = (Vec::new(), Vec::new());
    for parameter in parameters {
        if let Some(given) = section.get(parameter.name).filter(|given| given.get_ref().as_str() == Some("free")) {
            if !may_be_free || NUMBERS_OF_JOINTS.contains(&parameter.name) {
                return Err(section.wrong(parameter.name, given, NO_FREE));
            }
            free.push(parameter.name);
            continue;
        }
        let Some(given) = value(section, parameter.name, None)? else { continue };
        let refused = |source| chain(section, parameter.name, source);
        setting = setting.with(parameter.name, given.value).map_err(refused)?;
        if let Some(learn) = given.learn {
            setting = setting.with_learn(parameter.name, learn).map_err(refused)?;
        }
        origins.extend(given.origin);
    }
    if by_column && let Some(given) = value(section, SLOPE, None)? {
        setting = setting.with(SLOPE, given.value).map_err(|source| chain(section, SLOPE, source))?;
        if let Some(learn) = given.learn {
            setting = setting.with_learn(SLOPE, learn).map_err(|source| chain(section, SLOPE, source))?;
        }
        origins.extend(given.origin);
    }
    let effect = with_origins(section, setting, origins)?;
    free.into_iter()
        .try_fold(effect, |effect, name| effect.with_free(name).map_err(|source| chain(section, name, source)))
}

/// Reads `by`: the parameter that depends on a column, and where the column must stand for the parameter's value. Whether there is one.
fn with_column(section: &Section, setting: &mut EffectSetting) -> Result<bool, ModelFileError> {
    let Some(with) = section.section("by")? else { return Ok(false) };
    with.only(&["parameter", "column", "at"])?;
    let text = |key, expected| with.text(key)?.ok_or_else(|| with.missing(key, expected));
    let parameter = text("parameter", "the name of one of the effect's numbers")?.value;
    let column = text("column", "the name of a column of the data")?.value;
    let at = with.number("at")?.map_or(0.0, |at| at.value);
    let own = setting.clone().with_column(&parameter, &column, at);
    *setting = own.map_err(|source| chain(section, "by", source))?;
    Ok(true)
}

fn formula(section: &Section, hooks: &[&str]) -> Result<FileEffect, ModelFileError> {
    section.only(&["kind", "name", "hook", "formula", "params", "columns"])?;
    let text = |key: &'static str, expected| section.text(key)?.ok_or_else(|| section.missing(key, expected));
    let name = text("name", "a name for the formula")?.value;
    let hook = text("hook", "eps, tau, geo, meas or enc, joint for joints, force for kind force")?;
    let expression = text("formula", "an expression")?.value;
    let Some(hook) = Hook::from_word(&hook.value) else {
        return Err(hook.unknown("hook", hooks.iter().copied()));
    };
    let (mut parameters, mut origins, mut learns) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(params) = section.section("params")? {
        for key in params.keys() {
            let mut unit = "1".to_owned();
            let Some(Value { value, origin, learn }) = value(&params, key, Some(&mut unit))? else { continue };
            if !value.is_finite() {
                let source = ChainError::NotFinite { name: name.clone(), key: key.to_owned(), found: value };
                return Err(chain(&params, key, source));
            }
            parameters.push(FormulaParameter { name: key.to_owned(), value, unit });
            origins.extend(origin);
            learns.extend(learn.map(|learn| (key.to_owned(), learn)));
        }
    }
    let mut columns = Vec::new();
    if let Some(own) = section.section("columns")? {
        for key in own.keys() {
            let column = own.text(key)?.ok_or_else(|| own.missing("columns", "the name of a column"))?.value;
            columns.push(FormulaColumn { name: key.to_owned(), column });
        }
    }
    let mut setting = EffectSetting::formula(FormulaText { name, hook, text: expression, parameters, columns });
    for (key, learn) in learns {
        setting = setting.with_learn(&key, learn).map_err(|source| chain(section, "params", source))?;
    }
    with_origins(section, setting, origins)
}

fn with_origins(section: &Section, setting: EffectSetting, origins: Vec<Origin>) -> Result<FileEffect, ModelFileError> {
    let mut effect = FileEffect::new(setting);
    for origin in origins {
        let key = origin.parameter.clone();
        effect = effect.with_origin(origin).map_err(|source| chain(section, &key, source))?;
    }
    Ok(effect)
}

/// What stands behind a parameter's name.
struct Value {
    value: f64,
    origin: Option<Origin>,
    learn: Option<Learn>,
}

/// A parameter: a number, or a table with its value, how it is learnt, where it comes from and, for formulas, its unit.
fn value(section: &Section, key: &str, unit: Option<&mut String>) -> Result<Option<Value>, ModelFileError> {
    let Some(given) = section.get(key) else { return Ok(None) };
    if !given.get_ref().is_table() {
        return Ok(section.number(key)?.map(|number| Value { value: number.value, origin: None, learn: None }));
    }
    let Some(table) = section.section(key)? else { return Ok(None) };
    match unit {
        Some(unit) => {
            table.only(&["value", "unit", "learn", "se", "from", "date"])?;
            if let Some(given) = table.text("unit")? {
                *unit = given.value;
            }
        }
        None => table.only(&["value", "learn", "se", "from", "date"])?,
    }
    let number = table.number("value")?.ok_or_else(|| table.missing("value", "a number"))?;
    let origin = Origin {
        parameter: key.to_owned(),
        se: table.number("se")?.map(|se| se.value),
        from: table.text("from")?.map(|from| from.value),
        date: table.text("date")?.map(|date| date.value),
    };
    let learn = match table.section("learn")? {
        Some(learn) => {
            learn.only(&["sd", "memory_s"])?;
            let sd = learn.number("sd")?.ok_or_else(|| learn.missing("sd", "a standard deviation"))?.value;
            let memory_s = learn.number("memory_s")?.map_or(DEFAULT_MEMORY_S, |given| given.value);
            Some(Learn { sd, memory_s })
        }
        None => None,
    };
    let fitted = origin.se.is_some() || origin.from.is_some() || origin.date.is_some();
    Ok(Some(Value { value: number.value, origin: fitted.then_some(origin), learn }))
}

fn chain(section: &Section, key: &str, source: ChainError) -> ModelFileError {
    ModelFileError::Chain { line: section.line_of_key(key), source }
}
