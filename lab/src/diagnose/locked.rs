//! The error on a part of the measurements that no choice has seen: the last of several trials, or the last fifth of a long one.
//!
//! The error that a diagnosis gives is on blocks that its last fit did not see, but effects were chosen with all of them. Here the whole
//! diagnosis is done once more without the locked part, and the model that it ends with predicts that part.

use super::answer::{Diagnosis, Verdict};
use super::whole::{DiagnoseOptions, open_diagnosis};
use crate::joint::{has_starts, with_starts};
use crate::machine::{JointsLab, MachineUnderTest};
use crate::noise::autocorrelation_time;
use crate::prepare::prepare;
use crate::stage::stage;
use crate::{LabError, Measurements};

/// Of one trial so many correlation times are needed, of which the last part is locked.
const LEAST_TIMES: f64 = 30.0;
/// One part of so many is locked of a single trial.
const PARTS: usize = 5;
/// Where hysteresis begins in a locked trial no model can know: it is sought in one part of so many, which then does not count.
const START_PARTS: usize = 3;
/// Fewer measured rows say nothing.
const FEWEST_ROWS: usize = 30;

/// What no choice has seen, and how well it is predicted.
#[derive(Clone, Debug, PartialEq)]
pub struct LockedError {
    /// Error there, root mean square of its length, in the unit of errors.
    pub rms: f64,
    /// The same of the model as given, with what the open part says of the machine's calibration.
    pub base_rms: f64,
    /// Measured rows that were predicted.
    pub n_rows: usize,
    /// Whether they are a trial of their own; otherwise they are the end of the only one.
    pub is_trial: bool,
    /// What the open part says.
    pub verdict: Verdict,
    /// The effects beside the model's own that predict here: those that it names, or its hypotheses where it names none.
    pub effects: Vec<String>,
}

impl LockedError {
    /// What was locked.
    pub fn part(&self) -> &'static str {
        if self.is_trial { "last trial" } else { "last fifth" }
    }
}

/// Refuses data of which no part can be locked, before anything is fitted.
///
/// # Errors
/// [`LabError::NotLocked`] of several recordings.
pub(super) fn check(options: &DiagnoseOptions) -> Result<(), LabError> {
    match options.recordings.len() {
        0 | 1 => Ok(()),
        n => Err(LabError::NotLocked { n }),
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
    let Some(first) = first_locked(machine, data, known)? else { return Ok(None) };
    stage("All once more without a last part");
    let is_trial = data.starts_trial(first);
    let open = open_diagnosis(machine, &data.select(&(0..first).collect::<Vec<_>>()), options)?;
    // What was found beside the effects, the clock and the calibration, is the open part's as well.
    let all = data.by_clocks(&open.clocks, &[0]);
    let locked_time_s = data.time_s[first];
    let trial = data.trial[first];
    let first = (0..all.n_rows()).find(|&row| all.trial[row] == trial && all.time_s[row] >= locked_time_s);
    let Some(first) = first else { return Ok(None) };
    let joints = open.calibrated.as_ref().or(machine.as_joints());
    let began = joints
        .filter(|_| is_trial && has_starts(&open.terms, data.n_inputs))
        .map(|joints| begun(joints, &all, first, &open))
        .transpose()?;
    let from = if began.is_some() { first + (all.n_rows() - first) / START_PARTS } else { first };
    let own = began.as_ref().or(joints).map_or(machine, |joints| joints as &dyn MachineUnderTest);
    let problem = prepare(own, &all)?.problem;
    let n_base = own.effects().len().min(open.terms.len());
    let n_outputs = all.n_outputs;
    let scored: Vec<usize> = (from..all.n_rows()).filter(|row| problem.weight[row * n_outputs] > 0.0).collect();
    if scored.len() < FEWEST_ROWS {
        return Ok(None);
    }
    let rms = |n_effects: usize| -> Result<f64, LabError> {
        let left = problem.outputs_of(&problem.residual(&open.terms[..n_effects])?);
        let square = |row: &usize| left[row * n_outputs..(row + 1) * n_outputs].iter().map(|x| x * x).sum::<f64>();
        Ok((scored.iter().map(square).sum::<f64>() / scored.len() as f64).sqrt() * machine.error_unit().1)
    };
    Ok(Some(LockedError {
        rms: rms(open.terms.len())?,
        base_rms: rms(n_base)?,
        n_rows: scored.len(),
        is_trial,
        verdict: open.verdict,
        effects: open.terms[n_base..].iter().map(|own| own.name.clone()).collect(),
    }))
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
    let part: Vec<usize> = (first..first + (all.n_rows() - first) / START_PARTS).collect();
    with_starts(joints, &open.terms, &all.select(&part), &open.calibration, &[])
}
