//! Adding an effect to a model, or fitting those that it has: values, standard errors, and the error on data not fitted to.

use crate::diagnose::Calibration;
use crate::diagnose::floor::Floor;
use crate::diagnose::search::{Search, Trial};
use crate::fit::{Fit, Uncertainty, Variable, fit_to_end, held_out_output_squares, uncertainty};
use crate::free::free_variables;
use crate::joint::{Ground, OF_MACHINE, Start, Together, check_effect, check_gains};
use crate::machine::{Candidate, FreeJoints, Freed, JointsLab, MachineUnderTest, freed, joint_number, nearest};
use crate::noise::NoiseFloor;
use crate::prepare::{Prepared, prepare};
use crate::stage::stage;
use crate::{LabError, Measurements, Parameter, Problem, Term};
use krait_model::model_file::Known;

/// What to add, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct AddOptions {
    /// The effect with its starting values.
    pub term: Term,
    /// Whether the starting values are the user's: no other start is tried.
    pub from_given: bool,
    /// Names of its parameters that the fit frees; empty: those that the catalogue frees, for a formula all.
    pub free: Vec<String>,
    /// Parameters of the model's own effects that are fitted again with it: effect's label and parameter's name.
    pub refit: Vec<(String, String)>,
    /// Name and first trial of each recording, where there are several: of joints each has its own gain and offset.
    pub recordings: Vec<(String, usize)>,
}

/// A model with a further or refitted effect.
#[derive(Clone, Debug)]
pub struct Added {
    /// All effects of the model.
    pub terms: Vec<Term>,
    /// What was free.
    pub variables: Vec<Variable>,
    /// Standard errors of the free parameters.
    pub uncertainty: Uncertainty,
    /// Error of the model before, in the machine's unit for errors, root mean square.
    pub before: f64,
    /// Error on blocks that the fit did not see.
    pub after: f64,
    /// The measurement's own noise; `None` where the data do not tell.
    pub noise_floor: Option<f64>,
    /// Its relative standard error; zero where it is unknown.
    pub floor_relative_error: f64,
    /// Gain and offset that were fitted with it; empty for a machine without such numbers.
    pub calibration: Vec<Calibration>,
    /// Those of them that were asked for by name, or that the model file calls "free": they go into the file.
    pub joint_numbers: Vec<JointNumber>,
}

/// A gain or an offset as it stands in a model file of joints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointNumber {
    /// Whether it is an offset, not a gain.
    pub is_offset: bool,
    /// The joint, from 1.
    pub joint: usize,
    /// In the file's unit.
    pub value: f64,
    /// Standard error in the same unit.
    pub se: f64,
    /// Unit of both.
    pub unit: String,
}

impl JointNumber {
    /// What it is called behind `--free`: `gain1`, `offset2`.
    pub fn name(&self) -> String {
        joint_number(self.is_offset, self.joint)
    }
}

const FOLDS: usize = 6;

/// Adds an effect behind the model's own and fits it, with the values of those that are to be fitted again.
///
/// # Errors
/// [`LabError`] for an effect or a parameter that the machine does not have, and where it makes no chain.
pub fn add(machine: &dyn MachineUnderTest, data: &Measurements, options: &AddOptions) -> Result<Added, LabError> {
    let parameters = machine.parameters(&options.term)?;
    let freed = machine.as_joints().map(|joints| freed(joints, &options.refit)).transpose()?;
    let of_joints = freed.as_ref().map(|own| AddOptions { refit: own.others.clone(), ..options.clone() });
    let options = of_joints.as_ref().unwrap_or(options);
    let machine = freed.as_ref().map_or(machine, |own| &own.joints as &dyn MachineUnderTest);
    let asked = freed.as_ref().map_or(Vec::new(), |own| own.numbers.clone());
    if let Some(joints) = machine.as_joints() {
        check_gains(joints, data, &options.recordings)?;
        check_effect(&options.term, data, &options.recordings)?;
    }
    if let Some(joints) = machine.as_joints().filter(|_| !options.from_given && options.free.is_empty())
        && let Some(added) = crate::joint::add(joints, data, options)?
    {
        return with_own(joints, data, options, added, &asked, Ground::frees_own);
    }
    let joints = machine.as_joints();
    let calibrated = machine.as_joints().map(|joints| crate::joint::calibrated(joints, data)).transpose()?;
    let machine = calibrated.as_ref().map_or(machine, |joints| joints as &dyn MachineUnderTest);
    let bench = Bench::new(machine, data)?;
    let known = machine.candidates(data).into_iter().find(|candidate| candidate.name == options.term.name);
    if let Some(reason) = known.as_ref().and_then(|candidate| candidate.cannot.clone()) {
        return Err(LabError::CannotShow { effect: options.term.label().to_owned(), reason });
    }
    let free = places(&options.term, &parameters, &options.free, known.as_ref())?;
    let again = free_variables(machine, data, &options.refit)?;
    stage("Fitting the effect");
    let fitted = match known.filter(|_| !options.from_given && options.free.is_empty()) {
        Some(candidate) => bench.on_grid(&of_asked_joint(machine, candidate, &options.term), &again)?,
        None => bench.near_values(&options.term, &parameters, &free, again)?,
    };
    unseen(&options.term, &fitted)?;
    let alone = bench.report(fitted);
    match joints {
        // Gains and offsets were held where they are best without the effect.
        Some(joints) => with_own(joints, data, options, alone, &asked, Ground::is_open),
        None => Ok(alone),
    }
}

/// Refuses a formula of which a parameter changes nothing where the fit ended: nobody knows its value, and a standard error of zero says
/// the opposite.
fn unseen(term: &Term, fitted: &Fit) -> Result<(), LabError> {
    let all = fitted.variables.iter().zip(&fitted.slopes);
    let unseen = all.filter(|(_, slope)| slope.iter().all(|own| *own == 0.0)).map(|(own, _)| own.name.as_str());
    let names: Vec<&str> = unseen.collect();
    if term.formula.is_none() || names.is_empty() {
        return Ok(());
    }
    let reason = format!(
        "has parameters that change nothing where its fit ended ({}): begin with other values",
        names.join(", ")
    );
    Err(LabError::CannotShow { effect: term.label().to_owned(), reason })
}

/// A force's effect on the joint that is asked for; on the one where it helps most where none is.
fn of_asked_joint(machine: &dyn MachineUnderTest, mut candidate: Candidate, term: &Term) -> Candidate {
    if let Some(joint) = term.values.first().copied().filter(|joint| machine.as_force().is_some() && *joint > 0.0) {
        candidate.starts.retain(|start| start[0] == 0.0 || start[0] == joint);
        candidate.starts.iter_mut().for_each(|start| start[0] = joint);
    }
    candidate
}

/// Fits the new effect of joints again, from what was found with the model's own effects held, together with those of their values
/// that are free or known with a standard error, and with gains and offsets; `is_again` says whether that changes anything, and `asked`
/// names the gains and offsets that go into the file.
fn with_own(
    joints: &JointsLab,
    data: &Measurements,
    options: &AddOptions,
    alone: Added,
    asked: &[(bool, usize)],
    is_again: fn(&Ground) -> bool,
) -> Result<Added, LabError> {
    let n_own = joints.effects().len();
    let of_new: Vec<Variable> = alone.variables.iter().filter(|own| own.effect >= n_own).cloned().collect();
    let start = Start { terms: &alone.terms, variables: &of_new };
    let ground = start.ground(joints, data, &options.refit, &options.recordings)?;
    let mut added = if is_again(&ground) {
        let Ground { joints, calibration, effects, variables } = ground;
        let machine = FreeJoints::new(&joints, data, &calibration, &options.recordings);
        let bench = Bench::new(&machine, data)?;
        let found = bench.report(fit_to_end(&bench.problem, &effects, &variables)?);
        without_machine(&machine, Added { before: alone.before, ..found }, calibration)
    } else {
        alone
    };
    added.joint_numbers = joint_numbers(joints, &added.calibration);
    added.joint_numbers.retain(|own| asked.contains(&(own.is_offset, own.joint)));
    Ok(added)
}

/// What was fitted, with gains and offsets as calibration.
fn without_machine(machine: &FreeJoints, found: Added, calibration: Vec<Calibration>) -> Added {
    let Added { terms, variables, uncertainty, .. } = found;
    let Together { terms, variables, uncertainty, calibration } =
        machine.without_machine(Together { terms, variables, uncertainty, calibration });
    Added { terms, variables, uncertainty, calibration, joint_numbers: Vec::new(), ..found }
}

/// Fits parameters of the model's own effects: effect's label and parameter's name.
///
/// # Errors
/// [`LabError`] for names that are not there.
pub fn refit(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    free: &[(String, String)],
) -> Result<Added, LabError> {
    stage("Fitting the values");
    // A gain or an offset that the user frees by name takes the place of the machine's.
    let is_asked = |name: &str| free.iter().any(|(effect, _)| effect == name);
    if let Some(joints) = machine.as_joints() {
        check_gains(&freed(joints, free)?.joints, data, &[])?;
    }
    if let Some(joints) = machine.as_joints().filter(|_| !OF_MACHINE.into_iter().any(is_asked)) {
        // Of the values that the file has, before anything of them is freed.
        let given = crate::joint::calibrated(joints, data)?;
        let before = Bench::new(&given, data)?.before * joints.error_unit().1;
        let Freed { joints, others, .. } = &freed(joints, free)?;
        let start = Start { terms: joints.effects(), variables: &[] };
        let Ground { joints, calibration, effects, variables } = start.ground(joints, data, others, &[])?;
        let machine = FreeJoints::new(&joints, data, &calibration, &[]);
        let bench = Bench::new(&machine, data)?;
        let fitted = fit_to_end(&bench.problem, &effects, &variables)?;
        let mut found = without_machine(&machine, Added { before, ..bench.report(fitted) }, calibration);
        found.joint_numbers = joint_numbers(&joints, &found.calibration);
        return Ok(found);
    }
    let calibrated = machine.as_joints().map(|joints| crate::joint::calibrated(joints, data)).transpose()?;
    let machine = calibrated.as_ref().map_or(machine, |joints| joints as &dyn MachineUnderTest);
    let bench = Bench::new(machine, data)?;
    let variables = free_variables(machine, data, free)?;
    let fitted = fit_to_end(&bench.problem, machine.effects(), &variables)?;
    Ok(bench.report(fitted))
}

/// What of gains and offsets goes into the model file: what is free, by the file or by name; what it leaves out stays out.
fn joint_numbers(joints: &JointsLab, calibration: &[Calibration]) -> Vec<JointNumber> {
    let (_, scale) = joints.error_unit();
    let own = joints.joints();
    let to_file = |found: &Calibration| {
        let (joint, is_offset) = (found.joint?, found.name == "offset");
        let known = if is_offset { &own.offset_known } else { &own.gain_known };
        // A value with a standard error may come from these very data, which do not count twice: it stays.
        let is_open = *known.get(joint - 1)? == Known::Free;
        let scale = if is_offset { scale } else { 1.0 };
        let is_wanted = (is_offset || found.name == "gain") && is_open;
        is_wanted.then(|| JointNumber {
            is_offset,
            joint,
            value: found.value / scale,
            se: found.se / scale,
            unit: if is_offset { own.y_unit.clone() } else { found.unit.clone() },
        })
    };
    calibration.iter().filter(|found| found.recording.is_none()).filter_map(to_file).collect()
}

/// The measurements ready for a fit.
struct Bench<'a> {
    machine: &'a dyn MachineUnderTest,
    problem: Problem<'a>,
    floors: NoiseFloor,
    before: f64,
}

impl<'a> Bench<'a> {
    fn new(machine: &'a dyn MachineUnderTest, data: &Measurements) -> Result<Self, LabError> {
        let Prepared { problem, floors, .. } = prepare(machine, data)?;
        let own = problem.outputs_of(&problem.residual(machine.effects())?);
        let before = problem.rms_of_outputs(own.iter().map(|r| r * r).sum());
        Ok(Self { machine, problem, floors, before })
    }

    /// The best of the fits from every cell of the catalogue's grid.
    fn on_grid(&self, candidate: &Candidate, again: &[Variable]) -> Result<Fit, LabError> {
        let candidates = [candidate.clone()];
        let search = Search {
            problem: &self.problem,
            candidates: &candidates,
            base: self.machine.effects(),
            base_variables: again,
            seed: 1,
        };
        let best: Option<Trial> = search.every_start(&search.start()?).into_iter().next();
        let best = best.ok_or_else(|| LabError::CannotShow {
            effect: candidate.name.to_owned(),
            reason: "makes no chain with the model's own effects".to_owned(),
        })?;
        fit_to_end(&self.problem, &best.fit.effects, &best.fit.variables)
    }

    fn near_values(
        &self,
        term: &Term,
        parameters: &[Parameter],
        free: &[usize],
        again: Vec<Variable>,
    ) -> Result<Fit, LabError> {
        let mut effects = self.machine.effects().to_vec();
        effects.push(term.clone());
        let place = effects.len() - 1;
        let variable = |&k: &usize| {
            let width = (parameters[k].high - parameters[k].low).min(100.0);
            let size = if term.values[k] == 0.0 { 0.01 * width } else { term.values[k].abs() };
            Variable::new(self.machine, &effects, place, k, size)
        };
        let variables: Vec<Variable> =
            again.into_iter().map(Ok).chain(free.iter().map(variable)).collect::<Result<_, _>>()?;
        fit_to_end(&self.problem, &effects, &variables)
    }

    fn report(&self, fitted: Fit) -> Added {
        let (_, scale) = self.machine.error_unit();
        stage("On data that it was not fitted to");
        let held_out: f64 = held_out_output_squares(&self.problem, &fitted, FOLDS).iter().sum();
        let floor = Floor::new(&self.problem, &self.floors, &fitted.residual);
        Added {
            uncertainty: uncertainty(&self.problem, &fitted),
            before: self.before * scale,
            after: self.problem.rms_of_outputs(held_out) * scale,
            noise_floor: floor.rms,
            floor_relative_error: floor.relative_error,
            terms: fitted.effects,
            variables: fitted.variables,
            calibration: Vec::new(),
            joint_numbers: Vec::new(),
        }
    }
}

/// Places of the free parameters.
fn places(
    term: &Term,
    parameters: &[Parameter],
    free: &[String],
    known: Option<&Candidate>,
) -> Result<Vec<usize>, LabError> {
    if free.is_empty() {
        return Ok(known.map_or((0..parameters.len()).collect(), |candidate| candidate.free.clone()));
    }
    let place = |name: &String| {
        parameters.iter().position(|own| own.name == *name).ok_or_else(|| LabError::UnknownParameter {
            effect: term.label().to_owned(),
            name: name.clone(),
            nearest: nearest(name, parameters.iter().map(|own| own.name.as_str())),
        })
    };
    free.iter().map(place).collect()
}
