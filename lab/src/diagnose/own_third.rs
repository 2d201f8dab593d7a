//! What a recording that no choice has seen has of its own, from its first third: where its camera stood, and its camera's clock.

use super::answer::Diagnosis;
use super::clock::clock_of_part;
use super::rest::{ERRORS, LEAST_SHARE};
use super::whole::DiagnoseOptions;
use crate::camera::CameraOffset;
use crate::clock::ClockOffset;
use crate::machine::MachineUnderTest;
use crate::noise::autocorrelation_time;
use crate::prepare::prepare;
use crate::{LabError, Measurements, Quantity, Term};

/// The recording as if its camera stood where these effects ask for and had the commands' clock: `begin` is its first third, `there` all
/// of it, their trials numbered from 0. Both are moved where its first third says so beyond doubt.
///
/// # Errors
/// [`LabError`] where the model cannot be computed.
pub(super) fn by_own_third(
    machine: &dyn MachineUnderTest,
    (begin, there): (&Measurements, &Measurements),
    options: &DiagnoseOptions,
    open: &Diagnosis,
    terms: &[Term],
) -> Result<Measurements, LabError> {
    if there.quantity == Quantity::Force {
        return Ok(there.clone());
    }
    let camera = camera_of(machine, begin, terms)?;
    let cameras = camera.as_slice();
    let alone = DiagnoseOptions { recordings: Vec::new(), ..options.clone() };
    let clock = clock_of_part(machine, &begin.by_cameras(cameras, &[0]), &alone, open)?;
    let trials = |data: &Measurements| 0..data.trial.last().map_or(0, |last| *last as usize + 1);
    let clocks: Vec<ClockOffset> = clock
        .map(|own| {
            // The shift is that of the first third's middle; that of the whole is later.
            let later_s = there.middle_s(trials(there)) - begin.middle_s(trials(begin));
            ClockOffset { shift_s: own.shift_s + own.rate * later_s, ..own }
        })
        .into_iter()
        .collect();
    Ok(there.by_cameras(cameras, &[0]).by_clocks(&clocks, &[0]))
}

/// By which angles the camera sees all bends larger than these effects predict them; `None` where that is in doubt.
fn camera_of(
    machine: &dyn MachineUnderTest,
    begin: &Measurements,
    terms: &[Term],
) -> Result<Option<CameraOffset>, LabError> {
    // Where a tracker measures the tip, its place is sought in each recording already.
    if !begin.tip_frames.is_empty() {
        return Ok(None);
    }
    let problem = prepare(machine, begin)?.problem;
    let n = begin.n_outputs;
    let residual = problem.outputs_of(&problem.residual(terms)?);
    let rows: Vec<usize> = (0..begin.n_rows()).filter(|row| problem.weight[row * n] > 0.0).collect();
    let of_output = |values: &[f64], k: usize| rows.iter().map(|row| values[row * n + k]).collect::<Vec<f64>>();
    let mut left = vec![0.0; rows.len() * n];
    let (mut angles, mut errors) = (vec![0.0; n], vec![0.0; n]);
    for k in 0..n {
        let (residual, weight) = (of_output(&residual, k), of_output(&problem.weight, k));
        let squares: f64 = weight.iter().map(|w| w * w).sum();
        if squares <= 0.0 {
            return Ok(None);
        }
        angles[k] = residual.iter().zip(&weight).map(|(r, w)| r * w).sum::<f64>() / squares;
        for (i, (r, w)) in residual.iter().zip(&weight).enumerate() {
            left[i * n + k] = r - w * angles[k];
        }
        let spread = left.iter().skip(k).step_by(n).map(|own| own * own).sum::<f64>() / rows.len() as f64;
        errors[k] = (spread / squares).sqrt();
    }
    let of_times = autocorrelation_time(&left, n).sqrt();
    let squares = |values: &[f64]| values.iter().map(|own| own * own).sum::<f64>();
    let before: f64 = (0..n).map(|k| squares(&of_output(&residual, k))).sum();
    let pays = before - squares(&left) > LEAST_SHARE * before;
    let is_told = angles.iter().zip(&errors).any(|(angle, error)| angle.abs() > ERRORS * of_times * error);
    let is_believed = angles.iter().all(|angle| angle.to_degrees().abs() <= CameraOffset::MOST_DEG);
    Ok((pays && is_told && is_believed).then_some(CameraOffset(angles)))
}
