//! Which parameters of the model's own a fit frees: those that the user names, and the numbers that the model file leaves to it.

use crate::called::{called, meant};
use crate::fit::Variable;
use crate::machine::{MachineUnderTest, OpenNumber, is_geometry, nearest};
use crate::{LabError, Measurements};

/// A unit step of a parameter near zero, as a part of its range, and the widest range that counts.
const SMALLEST_STEP: f64 = 1e-3;
const WIDEST: f64 = 1e3;

/// Standard error of a free number of the machine about where it begins, as a part of it: no machine is as far from its drawing.
const ANCHOR: f64 = 0.3;

/// The variables of parameters named by what the effect is called and the parameter's name, and of the machine's open numbers. A label
/// that several effects share means them all. A number that the file drew from these very data is free: data do not count twice.
///
/// # Errors
/// [`LabError::NotInModel`] or [`LabError::UnknownParameter`] for a name that is not there.
pub(crate) fn free_variables(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    free: &[(String, String)],
) -> Result<Vec<Variable>, LabError> {
    let effects = machine.effects();
    let absent = |name: &str| {
        let names = called(machine.kind(), effects);
        let has = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        LabError::NotInModel { name: name.to_owned(), has }
    };
    let mut variables: Vec<Variable> = Vec::with_capacity(free.len());
    for (effect, parameter) in free {
        let places = meant(machine.kind(), effects, effect);
        if places.is_empty() {
            return Err(absent(effect));
        }
        for place in places {
            let own = machine.parameters(&effects[place])?;
            let k = own.iter().position(|p| p.name == *parameter).ok_or_else(|| LabError::UnknownParameter {
                effect: effect.clone(),
                name: parameter.clone(),
                nearest: nearest(parameter, own.iter().map(|p| p.name.as_str())),
            })?;
            // Named twice, it is one number all the same.
            if !variables.iter().any(|own| (own.effect, own.parameter) == (place, k)) {
                variables.push(variable(machine, place, k)?);
            }
        }
    }
    for OpenNumber { effect, parameter, prior, from } in machine.open_numbers() {
        if !variables.iter().any(|own| (own.effect, own.parameter) == (effect, parameter)) {
            let prior = prior.filter(|_| from.as_ref().is_none_or(|own| !own.is(&data.source, &data.sha256)));
            let mut own = variable(machine, effect, parameter)?;
            own.prior = prior;
            variables.push(own);
        }
    }
    Ok(variables)
}

fn variable(machine: &dyn MachineUnderTest, place: usize, k: usize) -> Result<Variable, LabError> {
    let effects = machine.effects();
    let own = machine.parameters(&effects[place])?;
    let value = effects[place].values[k];
    // What has no bounds and a value is stepped by parts of it.
    let width = own[k].high - own[k].low;
    let least = if width.is_finite() || value == 0.0 { width.min(WIDEST) } else { value.abs() };
    let size = (0.1 * value).abs().max(SMALLEST_STEP * least);
    let mut variable = Variable::new(machine, effects, place, k, size)?;
    variable.anchor = is_geometry(&effects[place]).then(|| (value, (ANCHOR * value).abs().max(size)));
    Ok(variable)
}
