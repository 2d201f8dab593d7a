//! The model's own effects of joints whose values its file leaves open: these values and the missing effects are found in turn.
//!
//! A play that was fitted alone took a lag for its own, and with that play held the lag looks like something else. So the values are
//! fitted first without, then together with what the search names, and the search runs again with them, until it names the same.

use super::add::fitted_variables;
use super::decide::Found;
use super::starts::{has_starts, settled, with_starts};
use super::terms::{name, term};
use crate::diagnose::{Calibration, DiagnoseOptions, number_name};
use crate::fit::{Uncertainty, Variable, fit_to_end, uncertainty};
use crate::free::free_variables;
use crate::machine::{FreeJoints, JointsLab, MachineUnderTest};
use crate::prepare::prepare;
use crate::{LabError, Measurements, Term};

/// Searches after the first at most.
const MOST_TURNS: usize = 3;

/// Effects that do what a joint's gain and offset do.
pub(crate) const OF_MACHINE: [&str; 2] = ["scale", "offset"];

/// The variables that can be told beside gains and offsets.
pub(crate) fn told(joints: &JointsLab, variables: Vec<Variable>) -> Vec<Variable> {
    let name = |own: &Variable| joints.effects().get(own.effect).map_or("", |term| term.name.as_str());
    variables.into_iter().filter(|own| own.prior.is_some() || !OF_MACHINE.contains(&name(own))).collect()
}

/// What one fit found of effects, gains and offsets together.
pub(crate) struct Together {
    /// Every effect.
    pub terms: Vec<Term>,
    /// What was free.
    pub variables: Vec<Variable>,
    /// Standard errors of these.
    pub uncertainty: Uncertainty,
    /// Gain and offset of each joint in each recording.
    pub calibration: Vec<Calibration>,
}

/// Where a fit of own and further effects begins: the model's own effects and behind them those that were found beside them.
pub(crate) struct Start<'a> {
    /// The effects.
    pub terms: &'a [Term],
    /// What is free of those that were found.
    pub variables: &'a [Variable],
}

/// What a fit of joints begins from.
pub(crate) struct Ground {
    /// The joints, with where the hysteresis of every effect begins.
    pub joints: JointsLab,
    /// Gains and offsets that go with it.
    pub calibration: Vec<Calibration>,
    /// Every effect, with the machine as one of them.
    pub effects: Vec<Term>,
    /// What is free of them.
    pub variables: Vec<Variable>,
}

impl Ground {
    /// Whether something of the model's own effects is free.
    pub fn frees_own(&self) -> bool {
        self.variables.iter().any(|own| own.effect < self.joints.effects().len())
    }

    /// Whether something of the model's own is: an effect's value, a gain or an offset.
    pub fn is_open(&self) -> bool {
        self.frees_own() || self.calibration.iter().any(|own| !own.is_held)
    }
}

impl Start<'_> {
    /// What a fit begins from: a first fit of all values together says where hysteresis begins, and this where the values do.
    ///
    /// # Errors
    /// [`LabError::NotInModel`] or [`LabError::UnknownParameter`] for a name in `again` that the model does not have.
    pub fn ground(
        &self,
        joints: &JointsLab,
        data: &Measurements,
        again: &[(String, String)],
        recordings: &[(String, usize)],
    ) -> Result<Ground, LabError> {
        let (joints, calibration) = settled(joints, data, recordings)?;
        let (effects, variables) = self.free(&joints, self.terms, data, &calibration, again, recordings)?;
        let ground = Ground { joints, calibration, effects, variables };
        if !has_starts(self.terms, data.n_inputs) || !ground.frees_own() {
            return Ok(ground);
        }
        let Ground { joints, calibration, effects, variables } = ground;
        let joints = with_starts(&joints, self.terms, data, &calibration, recordings)?;
        let machine = FreeJoints::new(&joints, data, &calibration, recordings);
        let Together { terms, calibration, .. } = fitted(&machine, data, &effects, variables, calibration.clone())?;
        let joints = with_starts(&joints, &terms, data, &calibration, recordings)?;
        let joints = joints.with_effects(&terms[..joints.effects().len()]);
        let (effects, variables) = self.free(&joints, &terms, data, &calibration, again, recordings)?;
        Ok(Ground { joints, calibration, effects, variables })
    }

    /// Every effect with the machine as one of them, and what is free of them.
    fn free(
        &self,
        joints: &JointsLab,
        terms: &[Term],
        data: &Measurements,
        calibration: &[Calibration],
        again: &[(String, String)],
        recordings: &[(String, usize)],
    ) -> Result<(Vec<Term>, Vec<Variable>), LabError> {
        let n_own = joints.effects().len();
        let machine = FreeJoints::new(joints, data, calibration, recordings);
        let mut variables = told(joints, free_variables(&machine, data, again)?);
        let mut effects = machine.effects().to_vec();
        effects.extend_from_slice(&terms[n_own..]);
        // Behind the machine's own entry.
        variables.extend(self.variables.iter().cloned().map(|own| Variable { effect: own.effect + 1, ..own }));
        Ok((effects, variables))
    }
}

/// Everything that is free, fitted together.
fn fitted(
    machine: &FreeJoints,
    data: &Measurements,
    effects: &[Term],
    variables: Vec<Variable>,
    calibration: Vec<Calibration>,
) -> Result<Together, LabError> {
    let problem = prepare(machine, data)?.problem;
    let fit = fit_to_end(&problem, effects, &variables)?;
    let uncertainty = uncertainty(&problem, &fit);
    Ok(machine.without_machine(Together { terms: fit.effects, variables, uncertainty, calibration }))
}

/// Joints with the values of their own effects that suit the data.
pub(super) struct OwnValues {
    pub joints: JointsLab,
    pub values: Vec<Calibration>,
}

/// What the search finds, with the values of the model's own effects that go with it; `None` for a model that leaves none open.
///
/// # Errors
/// [`LabError`] where effects make no chain.
pub(super) fn in_turn(
    machine: &JointsLab,
    data: &Measurements,
    options: &DiagnoseOptions,
    search: impl Fn(&JointsLab) -> Result<Vec<Found>, LabError>,
) -> Result<(Option<OwnValues>, Vec<Found>), LabError> {
    let Some(mut own) = beside(machine, data, options, &[])? else { return Ok((None, search(machine)?)) };
    let mut found = search(&own.joints)?;
    let without: Vec<f64> = found.iter().map(|own| own.before.mean_square).collect();
    for _ in 0..MOST_TURNS {
        let named = named(&found);
        if named.is_empty() {
            break;
        }
        let Some(next) = beside(machine, data, options, &found)? else { break };
        let again = search(&next.joints)?;
        let is_same = self::named(&again) == named;
        if !is_same && left(&again) >= left(&found) {
            break;
        }
        (own, found) = (next, again);
        if is_same {
            break;
        }
    }
    // What was there before any effect is what the own values leave by themselves.
    for (found, without) in found.iter_mut().zip(without) {
        found.before.mean_square = without;
        found.steps[0] = without;
    }
    Ok((Some(own), found))
}

/// Joints and kinds that are asserted.
fn named(found: &[Found]) -> Vec<(usize, Vec<&'static str>)> {
    let of = |own: &Found| {
        let mut names: Vec<&str> = own.in_chain().map(|(kind, values)| name(kind, values)).collect();
        names.sort_unstable();
        (own.joint, names)
    };
    found.iter().filter(|own| own.stands()).map(of).filter(|(_, names)| !names.is_empty()).collect()
}

/// Held-out mean square of all joints with what is asserted.
fn left(found: &[Found]) -> f64 {
    found.iter().map(|own| if own.stands() { own.after.mean_square } else { own.before.mean_square }).sum()
}

/// Values of the model's own effects, fitted together with what was found, gains and offsets.
fn beside(
    joints: &JointsLab,
    data: &Measurements,
    options: &DiagnoseOptions,
    found: &[Found],
) -> Result<Option<OwnValues>, LabError> {
    if joints.open_numbers().is_empty() && options.free.is_empty() {
        return Ok(None);
    }
    let (mut terms, mut variables) = (joints.effects().to_vec(), Vec::new());
    for own in found.iter().filter(|own| own.stands()) {
        for (kind, values) in own.in_chain() {
            terms.push(term(kind, own.joint, values));
            variables.extend(fitted_variables(joints, &terms, values)?.into_iter().map(|(variable, _)| variable));
        }
    }
    let start = Start { terms: &terms, variables: &variables };
    let ground = start.ground(joints, data, &options.free, &options.recordings)?;
    if !ground.frees_own() {
        return Ok(None);
    }
    let Ground { joints, calibration, effects, variables } = ground;
    let machine = FreeJoints::new(&joints, data, &calibration, &options.recordings);
    let fitted = fitted(&machine, data, &effects, variables, calibration.clone())?;
    let joints = &with_starts(&joints, &fitted.terms, data, &fitted.calibration, &options.recordings)?;
    let own = fitted.variables.iter().zip(&fitted.uncertainty.robust);
    let own = own.filter(|(variable, _)| variable.effect < joints.effects().len());
    let value = |(variable, se): (&Variable, &f64)| {
        let entry = &fitted.terms[variable.effect];
        Ok(Calibration {
            name: number_name(entry, &variable.name),
            joint: joint_of(joints, entry)?,
            recording: None,
            value: variable.value(&fitted.terms),
            se: *se,
            unit: variable.unit.clone(),
            prior: variable.prior,
            is_held: false,
        })
    };
    let values = own.map(value).collect::<Result<Vec<_>, LabError>>()?;
    Ok(Some(OwnValues { joints: joints.with_effects(&fitted.terms[..joints.effects().len()]), values }))
}

/// The joint, from 1, that an effect is on alone.
fn joint_of(joints: &JointsLab, entry: &Term) -> Result<Option<usize>, LabError> {
    let place = joints.parameters(entry)?.iter().position(|own| own.name == "joint");
    Ok(place.map(|k| entry.values[k].round() as usize).filter(|joint| *joint > 0))
}
