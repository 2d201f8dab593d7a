//! Gains and offsets of joints as data say, their effects as they are.

use super::answer;
use super::refine::{Loss, as_given};
use super::signal::Signal;
use super::solve::Solution;
use super::starts::settled;
use super::terms::Values;
use crate::diagnose::Calibration;
use crate::machine::{JointsLab, MachineUnderTest};
use crate::outliers::outliers;
use crate::{LabError, Measurements, Problem};

/// Rows of the loss.
const MOST_ROWS: usize = 20_000;

/// Rows that stand out from their neighbours, with gain and offset fitted.
pub(super) fn excluded(machine: &JointsLab, data: &Measurements) -> Result<Vec<usize>, LabError> {
    let calibrated = calibrated(machine, data)?;
    let problem = Problem::new(&calibrated, data.clone(), &[], f64::INFINITY);
    let residual = problem.residual(calibrated.effects())?;
    Ok(outliers(&problem, &residual))
}

/// The machine with gains, offsets and where hysteresis begins fitted to these data, effects as they are.
///
/// # Errors
/// [`LabError::Chain`] where the model as given cannot be computed.
pub(crate) fn calibrated(machine: &JointsLab, data: &Measurements) -> Result<JointsLab, LabError> {
    let (machine, _) = settled(machine, data, &[])?;
    let solutions = solutions(&machine, data, &[0])?;
    let (gains, offsets): (Vec<f64>, Vec<f64>) = solutions.iter().map(|own| (own.gains[0], own.offsets[0])).unzip();
    Ok(machine.calibrated(&gains, &offsets))
}

/// Gain and offset of each joint in each recording as these data say, its effects as they are; without standard errors.
///
/// # Errors
/// As [`calibrated`].
pub(crate) fn calibration(
    machine: &JointsLab,
    data: &Measurements,
    recordings: &[(String, usize)],
) -> Result<Vec<Calibration>, LabError> {
    let (names, first_trials) = names_and_trials(recordings);
    let of = |(joint, own): (usize, Solution)| {
        let numbers = |values: Vec<f64>| values.into_iter().map(|value| (value, 0.0)).collect();
        let values = Values { gains: numbers(own.gains), offsets: numbers(own.offsets), members: Vec::new() };
        answer::of_machine(machine, joint, &values, &names)
    };
    Ok(solutions(machine, data, &first_trials)?.into_iter().enumerate().flat_map(of).collect())
}

/// What the linear solve finds of each joint without further effects.
pub(super) fn solutions(
    machine: &JointsLab,
    data: &Measurements,
    recordings: &[usize],
) -> Result<Vec<Solution>, LabError> {
    let of = |joint: usize| {
        let signal = Signal::new(machine, data, joint, &[], MOST_ROWS, recordings)?;
        let weight = vec![1.0; signal.rows.len()];
        Ok(as_given(&signal, &[], Loss { weight: &weight, noise: 0.0 }).solution)
    };
    (0..data.n_outputs).map(of).collect()
}

/// Names of the recordings, and the first trial of each: one recording begins with the first.
pub(super) fn names_and_trials(recordings: &[(String, usize)]) -> (Vec<String>, Vec<usize>) {
    let (names, first_trials): (Vec<String>, Vec<usize>) = recordings.iter().cloned().unzip();
    let first_trials = if first_trials.is_empty() { vec![0] } else { first_trials };
    (names, first_trials)
}
