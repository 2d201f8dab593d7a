//! What a calibration found, in a model file: each value with its standard error, the readings it came from and the day.

use crate::CalibrateError;
use krait_model::EffectSetting;
use krait_model::effects::EffectKind;
use krait_model::model_file::{FileEffect, Known, Machine, ModelFile, Origin};

/// One value.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedValue {
    /// The effect, by its name in model files, or `machine`.
    pub effect: &'static str,
    /// Its parameter.
    pub parameter: &'static str,
    /// The value, in the parameter's unit.
    pub value: f64,
    /// Its standard error.
    pub se: f64,
}

/// Where the numbers of the machine itself stand.
const MACHINE: &str = "machine";
/// Effects that a calibration can add, in the order of the chain: static friction before the capstan's.
const ORDER: [&str; 5] = ["stiffness-scale", "static-friction", CONE[0], CONE[1], "backlash"];
/// The two laws of the cone's friction, of which a model holds one: the loads of a hanging weight are the same in both.
const CONE: [&str; 2] = ["cone-friction", "distributed-capstan"];

/// The text of a model file with calibrated values in it; every other effect stays as it is.
///
/// `text` is the file as it was, or `None` for a new one of the paper's snake; `from` names the readings, `date` is YYYY-MM-DD.
///
/// # Errors
/// [`CalibrateError::Model`] for a file or a value that the format refuses.
pub fn written(
    text: Option<&str>,
    found: &[CalibratedValue],
    from: &str,
    date: &str,
) -> Result<String, CalibrateError> {
    let refused = |e: &dyn core::fmt::Display| CalibrateError::Model(e.to_string());
    let file = ModelFile::parse(text.unwrap_or(NEW)).map_err(|e| refused(&e))?;
    let (mut machine, mut effects) = (file.machine().clone(), file.effects().to_vec());
    for value in found {
        if value.effect == MACHINE {
            let Machine::Snake(snake) = machine else { return Err(refused(&"it describes no snake")) };
            let known = Known::Fitted { se: value.se, from: Some(from.to_owned()), date: Some(date.to_owned()) };
            machine = Machine::Snake(snake.with(value.parameter, value.value, known));
            continue;
        }
        let is_own = |name: &str| name == value.effect || CONE.contains(&name) && CONE.contains(&value.effect);
        let at = match effects.iter().position(|e| is_own(e.setting().kind().name())) {
            Some(at) => at,
            None => insert(&mut effects, value.effect)?,
        };
        let old = &effects[at];
        let setting = old.setting().clone().with(value.parameter, value.value).map_err(|e| refused(&e))?;
        let mut effect = FileEffect::new(setting);
        for name in old.setting().parameter_names() {
            if let Some(origin) = old.origin(name).cloned() {
                effect = effect.with_origin(origin).map_err(|e| refused(&e))?;
            }
        }
        let origin = Origin {
            parameter: value.parameter.to_owned(),
            se: Some(value.se),
            from: Some(from.to_owned()),
            date: Some(date.to_owned()),
        };
        effects[at] = effect.with_origin(origin).map_err(|e| refused(&e))?;
    }
    let file = ModelFile::new(machine, effects, file.history().to_vec()).map_err(|e| refused(&e))?;
    Ok(file.to_toml())
}

/// A snake with the paper's dimensions and no effect.
const NEW: &str = "format = 1\n[machine]\nkind = \"snake\"\n";

/// Adds an effect with its defaults before the first one that has to come after it.
fn insert(effects: &mut Vec<FileEffect>, name: &str) -> Result<usize, CalibrateError> {
    let kind = EffectKind::from_name(name).ok_or_else(|| CalibrateError::Model(format!("no effect {name}")))?;
    let later = ORDER.iter().skip_while(|own| **own != name).skip(1);
    let place = later
        .filter_map(|own| effects.iter().position(|e| e.setting().kind().name() == *own))
        .min()
        .unwrap_or(effects.len());
    effects.insert(place, FileEffect::new(EffectSetting::new(kind)));
    Ok(place)
}
