//! The error on a part of the measurements that no choice has seen: the last of several recordings, the last of several trials, or the
//! last fifth of a long one.
//!
//! The error that a diagnosis gives is on blocks that its last fit did not see, but effects were chosen with all of them. Here the whole
//! diagnosis is done once more without the locked part, and the model that it ends with predicts that part.

use super::answer::{Diagnosis, Verdict};
use super::own_third::by_own_third;
use super::whole::{DiagnoseOptions, open_diagnosis};
use crate::joint::{calibrated, has_starts, with_starts};
use crate::machine::{JointsLab, MachineUnderTest};
use crate::noise::autocorrelation_time;
use crate::prepare::prepare;
use crate::problem::Problem;
use crate::stage::stage;
use crate::{LabError, Measurements, Term};

/// Of one trial so many correlation times are needed, of which the last part is locked.
const LEAST_TIMES: f64 = 30.0;
/// One part of so many is locked of a single trial.
const PARTS: usize = 5;
/// Where hysteresis begins in a locked trial no model can know, nor what a locked recording has of its own (gain and offset of joints;
/// where its camera stood, and its clock): they are sought in one part of so many, which then does not count.
const START_PARTS: usize = 3;
/// Fewer measured rows say nothing.
const FEWEST_ROWS: usize = 30;

/// What is locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LockedPart {
    /// The last of several recordings.
    Recording,
    /// The last of several trials.
    Trial,
    /// The end of the only trial.
    Fifth,
}

/// What no choice has seen, and how well it is predicted.
#[derive(Clone, Debug, PartialEq)]
pub struct LockedError {
    /// Error there, root mean square of its length, in the unit of errors.
    pub rms: f64,
    /// The same of the model as given, with what the open part says of the machine's calibration.
    pub base_rms: f64,
    /// Measured rows that were predicted.
    pub n_rows: usize,
    /// What they are.
    pub part: LockedPart,
    /// What the open part says.
    pub verdict: Verdict,
    /// The effects beside the model's own that predict here: those that it names, or its hypotheses where it names none.
    pub effects: Vec<String>,
}

impl LockedPart {
    /// In words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Recording => "last recording",
            Self::Trial => "last trial",
            Self::Fifth => "last fifth",
        }
    }
}

/// The locked error of measurements whose diagnosis is known; `None` where they are too few to lock a part of them.
///
/// # Errors
/// As [`super::diagnose`].
pub(super) fn error(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    known: &Diagnosis,
) -> Result<Option<LockedError>, LabError> {
    match &options.recordings[..] {
        [open @ .., (_, first_trial)] if !open.is_empty() => {
            let first = Some(data.first_row_of(*first_trial)).filter(|row| *row < data.n_rows());
            let recordings = if open.len() > 1 { open.to_vec() } else { Vec::new() };
            let options = DiagnoseOptions { recordings, ..options.clone() };
            first.map_or(Ok(None), |first| of_recording(machine, data, &options, first))
        }
        _ => of_end(machine, data, options, known),
    }
}

/// The last recording, from its first row on, by what those before it say: they have the options.
fn of_recording(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    first: usize,
) -> Result<Option<LockedError>, LabError> {
    stage("All once more without the last recording");
    let open = open_diagnosis(machine, &rows(data, 0..first), options)?;
    let there = rows(data, first..data.n_rows());
    let there = Measurements { trial: there.trial.iter().map(|own| own - there.trial[0]).collect(), ..there };
    let from = there.n_rows() / START_PARTS;
    let begin = rows(&there, 0..from);
    let predicted = |terms: &[Term]| match machine.as_joints() {
        Some(joints) => {
            // The clock of joints is one of all recordings.
            let moved = there.by_clocks(&open.clocks[..open.clocks.len().min(1)], &[0]);
            let from = row_at(&moved, there.trial[from], there.time_s[from]).unwrap_or(moved.n_rows());
            let begin = rows(&moved, 0..from);
            Scored::new(&calibrated(&joints.with_effects(terms), &begin)?, &moved, from)?.rms(terms)
        }
        None => {
            let moved = by_own_third(machine, (&begin, &there), options, &open, terms)?;
            let from = row_at(&moved, there.trial[from], there.time_s[from]).unwrap_or(moved.n_rows());
            Scored::new(machine, &moved, from)?.rms(terms)
        }
    };
    judged(LockedPart::Recording, &open, machine.effects().len(), predicted)
}

/// The error of a part, by what predicts it: with all effects that the open part says, and with the model's own alone.
fn judged(
    part: LockedPart,
    open: &Diagnosis,
    n_own: usize,
    predicted: impl Fn(&[Term]) -> Result<(f64, usize), LabError>,
) -> Result<Option<LockedError>, LabError> {
    let (own, found) = open.terms.split_at(n_own.min(open.terms.len()));
    let (rms, n_rows) = predicted(&open.terms)?;
    let (base_rms, _) = predicted(own)?;
    let effects = found.iter().map(|own| own.name.clone()).collect();
    Ok((n_rows >= FEWEST_ROWS).then_some(LockedError { rms, base_rms, n_rows, part, verdict: open.verdict, effects }))
}

/// The last trial, or the last fifth of the only one.
fn of_end(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    known: &Diagnosis,
) -> Result<Option<LockedError>, LabError> {
    let Some(first) = first_locked(machine, data, known)? else { return Ok(None) };
    stage("All once more without a last part");
    let is_trial = data.starts_trial(first);
    let open = open_diagnosis(machine, &rows(data, 0..first), options)?;
    // What was found beside the effects, the clock and the calibration, is the open part's as well.
    let all = data.by_clocks(&open.clocks, &[0]);
    let locked_time_s = data.time_s[first];
    let trial = data.trial[first];
    let Some(first) = row_at(&all, trial, locked_time_s) else { return Ok(None) };
    let joints = open.calibrated.as_ref().or(machine.as_joints());
    let began = joints
        .filter(|_| is_trial && has_starts(&open.terms, data.n_inputs))
        .map(|joints| begun(joints, &all, first, &open))
        .transpose()?;
    let from = if began.is_some() { first + (all.n_rows() - first) / START_PARTS } else { first };
    let own = began.as_ref().or(joints).map_or(machine, |joints| joints as &dyn MachineUnderTest);
    let scored = Scored::new(own, &all, from)?;
    let part = if is_trial { LockedPart::Trial } else { LockedPart::Fifth };
    judged(part, &open, own.effects().len(), |terms| scored.rms(terms))
}

/// Measured rows that a machine predicts.
struct Scored<'a> {
    machine: &'a dyn MachineUnderTest,
    problem: Problem<'a>,
    rows: Vec<usize>,
    n_outputs: usize,
}

impl<'a> Scored<'a> {
    /// Those of the data from a row on.
    fn new(machine: &'a dyn MachineUnderTest, data: &'a Measurements, from: usize) -> Result<Self, LabError> {
        let problem = prepare(machine, data)?.problem;
        let n_outputs = data.n_outputs;
        let rows = (from..data.n_rows()).filter(|row| problem.weight[row * n_outputs] > 0.0).collect();
        Ok(Self { machine, problem, rows, n_outputs })
    }

    /// Root mean square of the error with these effects, in the unit of errors, and of how many rows.
    fn rms(&self, terms: &[Term]) -> Result<(f64, usize), LabError> {
        let left = self.problem.outputs_of(&self.problem.residual(terms)?);
        let square = |row: &usize| left[row * self.n_outputs..][..self.n_outputs].iter().map(|x| x * x).sum::<f64>();
        let mean = self.rows.iter().map(square).sum::<f64>() / self.rows.len() as f64;
        Ok((mean.sqrt() * self.machine.error_unit().1, self.rows.len()))
    }
}

fn rows(data: &Measurements, range: core::ops::Range<usize>) -> Measurements {
    data.select(&range.collect::<Vec<_>>())
}

/// The first row of a trial from a time on: rows of measurements that a clock has moved stand between those of the commands.
fn row_at(data: &Measurements, trial: u32, time_s: f64) -> Option<usize> {
    (0..data.n_rows()).find(|&row| data.trial[row] == trial && data.time_s[row] >= time_s)
}

/// The first row of the locked part: it goes to the end.
fn first_locked(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    known: &Diagnosis,
) -> Result<Option<usize>, LabError> {
    let trials: Vec<usize> = (0..data.n_rows()).filter(|row| data.starts_trial(*row)).collect();
    if trials.len() > 1 {
        return Ok(trials.last().copied());
    }
    let clocked = data.by_clocks(&known.clocks, &[0]);
    let joints = known.calibrated.as_ref().map(|joints| joints as &dyn MachineUnderTest);
    let problem = prepare(joints.unwrap_or(machine), &clocked)?.problem;
    let left = problem.outputs_of(&problem.residual(&known.terms)?);
    let n_outputs = data.n_outputs;
    let is_scored = |row: &usize| problem.weight[row * n_outputs] > 0.0;
    let rows: Vec<usize> = (0..clocked.n_rows()).filter(is_scored).collect();
    let of_rows: Vec<f64> = rows.iter().flat_map(|row| &left[row * n_outputs..][..n_outputs]).copied().collect();
    let n_times = rows.len() as f64 / autocorrelation_time(&of_rows, n_outputs);
    Ok((n_times >= LEAST_TIMES).then(|| data.n_rows() - data.n_rows() / PARTS))
}

/// Joints whose hysteresis begins in the locked trial where its first part says.
fn begun(joints: &JointsLab, all: &Measurements, first: usize, open: &Diagnosis) -> Result<JointsLab, LabError> {
    let part = rows(all, first..first + (all.n_rows() - first) / START_PARTS);
    with_starts(joints, &open.terms, &part, &open.calibration, &[])
}
