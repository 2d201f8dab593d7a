//! A model file with what a fit found: values with their standard errors and origin, and one more line of history.

use crate::machine::{acting, is_geometry, setting, term, with_geometry};
use crate::{Added, FittedData, LabError, Measurements, Term, called};
use krait_model::model_file::{FileEffect, HeldOutRms, HistoryEntry, Joints, Known, Machine, ModelFile, Origin};

/// The file with the effects of a fit. `what` names the effect for the history; `date` is the day, YYYY-MM-DD.
///
/// # Errors
/// [`LabError::Chain`] for values that the file's format refuses.
pub fn save(
    file: &ModelFile,
    added: &Added,
    what: &str,
    data: &Measurements,
    date: &str,
) -> Result<ModelFile, LabError> {
    let fitted_here = |se: f64| Known::Fitted { se, from: Some(data.source.clone()), date: Some(date.to_owned()) };
    let machine = match file.machine() {
        Machine::Snake(snake) => Machine::Snake(with_geometry(snake, added, fitted_here)),
        Machine::Joints(joints) => Machine::Joints(with_numbers(joints.clone(), added, fitted_here)),
        other => other.clone(),
    };
    let order = acting(file.effects().len(), &added.terms);
    let mut effects = Vec::with_capacity(added.terms.len());
    for (place, term) in added.terms.iter().enumerate() {
        if is_geometry(term) {
            effects.push(None);
            continue;
        }
        let mut own = setting(file.machine(), term)?;
        // How a parameter is learnt while the machine moves is not the fit's to change.
        if let Some(old) = file.effects().get(place).map(FileEffect::setting).filter(|old| old.label() == own.label()) {
            for name in old.parameter_names() {
                if let Some(learn) = old.learn(name) {
                    own = own.with_learn(name, learn)?;
                }
            }
        }
        let mut effect = FileEffect::new(own);
        for parameter in effect.setting().parameter_names().map(str::to_owned).collect::<Vec<_>>() {
            let fitted = added.variables.iter().position(|v| v.effect == place && v.name == parameter);
            let origin = match fitted {
                Some(n) => Some(Origin {
                    parameter,
                    se: added.uncertainty.robust.get(n).copied().filter(|se| se.is_finite()),
                    from: Some(data.source.clone()),
                    date: Some(date.to_owned()),
                }),
                None => file.effects().get(place).and_then(|old| old.origin(&parameter)).cloned(),
            };
            if let Some(origin) = origin {
                effect = effect.with_origin(origin)?;
            }
        }
        effects.push(Some(effect));
    }
    // As they act, so they stand in the file.
    let effects = order.into_iter().filter_map(|k| effects.get(k).cloned().flatten()).collect();
    let mut history = file.history().to_vec();
    history.push(HistoryEntry {
        effect: what.to_owned(),
        data: data.source.clone(),
        data_sha256: data.sha256.clone(),
        date: Some(date.to_owned()),
        heldout_rms: HeldOutRms { before: added.before, after: added.after, noise_floor: added.noise_floor },
        unit: unit(file.machine()),
    });
    Ok(ModelFile::new(machine, effects, history)?)
}

/// Joints with the gains and offsets that were fitted for the file.
fn with_numbers(mut joints: Joints, added: &Added, fitted: impl Fn(f64) -> Known) -> Joints {
    for own in &added.joint_numbers {
        let k = own.joint - 1;
        let known = if own.se.is_finite() && own.se > 0.0 { fitted(own.se) } else { Known::Held };
        if own.is_offset {
            (joints.offset[k], joints.offset_known[k]) = (own.value, known);
        } else {
            (joints.gain[k][k], joints.gain_known[k]) = (own.value, known);
        }
    }
    joints
}

/// Parameters whose values were fitted to these very data, by what the effect is called and the parameter's name. With a further effect they take
/// other values; what was fitted to other data, or written by hand, is held.
pub fn fitted_to(file: &ModelFile, data: &Measurements) -> Vec<(String, String)> {
    let is_same = |origin: &Origin| {
        let from = FittedData::of(file, origin.from.as_deref(), origin.date.as_deref());
        from.is_some_and(|own| own.is(&data.source, &data.sha256))
    };
    let names = |(effect, label): (&FileEffect, String)| {
        let fitted = effect.setting().parameter_names().filter(|name| effect.origin(name).is_some_and(is_same));
        fitted.map(|name| (label.clone(), name.to_owned())).collect::<Vec<_>>()
    };
    file.effects().iter().zip(called_in(file)).flat_map(names).collect()
}

/// What the effects of a model file are called, each by a name of its own.
pub(crate) fn called_in(file: &ModelFile) -> Vec<String> {
    let terms: Vec<Term> = file.effects().iter().map(|effect| term(effect.setting())).collect();
    called(file.machine().kind(), &terms)
}

/// Unit of a machine's errors.
fn unit(machine: &Machine) -> String {
    match machine {
        Machine::Joints(joints) if joints.y_unit != "rad" => joints.y_unit.clone(),
        Machine::Force(force) => force.unit.word().to_owned(),
        _ => "deg".to_owned(),
    }
}
