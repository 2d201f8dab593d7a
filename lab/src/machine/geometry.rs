//! A snake's geometry and material as one more entry of its list of effects, so that a fit can free its numbers as it frees theirs.

use super::OpenNumber;
use crate::{Added, FittedData, Parameter, Term};
use krait_model::MachineParameters;
use krait_model::model_file::{GeometryKey, Known, ModelFile, SnakeMachine};

/// The entry's name; `--free machine.r_m` frees a number of it.
pub(crate) const GEOMETRY: &str = "machine";

/// Whether an entry of a list is the geometry.
pub(crate) fn is_geometry(term: &Term) -> bool {
    term.name == GEOMETRY && term.formula.is_none()
}

/// The geometry of a machine as an entry.
pub(super) fn term(machine: &SnakeMachine) -> Term {
    let values = SnakeMachine::geometry().filter_map(|key| machine.value(key.name)).collect();
    Term::new(GEOMETRY, values)
}

/// Its numbers.
pub(super) fn parameters() -> Vec<Parameter> {
    let own = |GeometryKey { name, unit, low, high, default }: GeometryKey| Parameter {
        name: name.to_owned(),
        unit: unit.to_owned(),
        low,
        high,
        default,
    };
    SnakeMachine::geometry().map(own).collect()
}

/// The numbers of the list's geometry, or those of the machine where the list has none.
pub(super) fn in_list(machine: &SnakeMachine, list: &[Term]) -> MachineParameters {
    let Some(own) = list.iter().find(|term| is_geometry(term)) else { return machine.parameters };
    let with = |machine: SnakeMachine, (key, value): (GeometryKey, &f64)| machine.with(key.name, *value, Known::Held);
    SnakeMachine::geometry().zip(&own.values).fold(machine.clone(), with).parameters
}

/// The machine of a model file with what a fit found of its geometry; `origin` says what is known of a number with this standard error.
pub(crate) fn with_geometry(machine: &SnakeMachine, added: &Added, origin: impl Fn(f64) -> Known) -> SnakeMachine {
    let Some(place) = added.terms.iter().position(is_geometry) else { return machine.clone() };
    let fitted = added.variables.iter().zip(&added.uncertainty.robust).filter(|(own, _)| own.effect == place);
    fitted.fold(machine.clone(), |machine, (own, se)| machine.with(&own.name, own.value(&added.terms), origin(*se)))
}

/// The numbers that the model file leaves to every fit, or gives with a standard error.
pub(super) fn open_numbers(file: &ModelFile, machine: &SnakeMachine, place: usize) -> Vec<OpenNumber> {
    let open = |(parameter, key): (usize, GeometryKey)| {
        let (prior, from) = match machine.known(key.name) {
            Known::Held => return None,
            Known::Absent | Known::Free => (None, None),
            Known::Fitted { se, from, date } => {
                let data = FittedData::of(file, from.as_deref(), date.as_deref());
                (machine.value(key.name).map(|value| (value, *se)), data)
            }
        };
        Some(OpenNumber { effect: place, parameter, prior, from })
    };
    SnakeMachine::geometry().enumerate().filter_map(open).collect()
}
