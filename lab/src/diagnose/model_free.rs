//! What a fit without any law leaves: a hint at how much of the rest can be explained at all. It is no bound: a chain of effects knows
//! the machine's memory better than columns do.
//!
//! Ridge regression and boosted trees behind it, on the inputs, their speeds, where plays of three widths would stand, the direction,
//! the temperature and time; the error is that on blocks which they did not see.

use super::accept::FOLDS;
use super::answer::Diagnosis;
use crate::machine::MachineUnderTest;
use crate::prepare::prepare;
use crate::stage::stage;
use crate::trees::{Binned, predicted};
use crate::{LabError, Measurements, Problem};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Rows that are asked at most.
const MOST_ROWS: usize = 3000;
/// Fewer rows than this learn nothing.
const FEWEST_ROWS: usize = 200;
/// Half-widths of the plays, as parts of an input's range.
const PLAYS: [f64; 3] = [0.02, 0.08, 0.25];
/// Speeds are differences over these times, s.
const SPEEDS_OVER_S: [f64; 2] = [0.05, 0.5];
/// What holds slopes of columns that say the same, as a part of the rows.
const RIDGE: f64 = 1e-3;

/// The error that a fit without a model leaves on blocks it did not see, in the unit of errors; `None` of few rows.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(super) fn model_free_rms(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    diagnosis: &Diagnosis,
) -> Result<Option<f64>, LabError> {
    stage("What a fit without a model leaves");
    let calibrated = diagnosis.calibrated.as_ref().map(|joints| joints as &dyn MachineUnderTest);
    let problem = prepare(calibrated.unwrap_or(machine), data)?.problem;
    let left = problem.outputs_of(&problem.residual(problem.machine.effects())?);
    let n_outputs = data.n_outputs;
    let is_scored = |row: &usize| problem.weight[row * n_outputs] > 0.0;
    let scored: Vec<usize> = (0..data.n_rows()).filter(is_scored).collect();
    let rows: Vec<usize> = scored.iter().copied().step_by(scored.len().div_ceil(MOST_ROWS).max(1)).collect();
    if rows.len() < FEWEST_ROWS || problem.n_blocks < FOLDS {
        return Ok(None);
    }
    let columns = columns(data, &rows);
    let squares: f64 = (0..n_outputs)
        .into_par_iter()
        .map(|k| {
            let target: Vec<f64> = rows.iter().map(|row| left[row * n_outputs + k]).collect();
            squares_left(&columns, &target, &problem, &rows)
        })
        .sum();
    let (_, scale) = machine.error_unit();
    Ok(Some((squares / rows.len() as f64).sqrt() * scale))
}

/// Squares that are left of a target on the blocks of each fold, by a fit to the others.
fn squares_left(columns: &[Vec<f64>], target: &[f64], problem: &Problem, rows: &[usize]) -> f64 {
    let binned = Binned::new(columns);
    (0..FOLDS)
        .map(|fold| {
            let (asked, known): (Vec<usize>, Vec<usize>) =
                (0..rows.len()).partition(|k| problem.block[rows[*k]] % FOLDS == fold);
            let linear = linear(columns, target, &known);
            let rest: Vec<f64> = target.iter().zip(&linear).map(|(own, linear)| own - linear).collect();
            let said = predicted(&binned, &rest, &known, &asked);
            // A fit that makes it worse is not taken: what has no law in these columns stays as it is.
            let square =
                |left: &dyn Fn(usize) -> f64| asked.iter().enumerate().map(|(n, _)| left(n).powi(2)).sum::<f64>();
            let with_trees = square(&|n| rest[asked[n]] - said[n]);
            with_trees.min(square(&|n| rest[asked[n]])).min(square(&|n| target[asked[n]]))
        })
        .sum()
}

/// What a straight line of the columns that is fitted to the known rows says of every row.
fn linear(columns: &[Vec<f64>], target: &[f64], known: &[usize]) -> Vec<f64> {
    let n = columns.len() + 1;
    let (mut gram, mut score) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let at = |row: usize| DVector::from_fn(n, |k, _| if k == 0 { 1.0 } else { columns[k - 1][row] });
    for &row in known {
        let x = at(row);
        gram.ger(1.0, &x, &x, 1.0);
        score.axpy(target[row], &x, 1.0);
    }
    let ridge = RIDGE * known.len() as f64;
    (1..n).for_each(|k| gram[(k, k)] += ridge);
    let solved = gram.cholesky().map_or_else(|| DVector::zeros(n), |own| own.solve(&score));
    (0..target.len()).map(|row| at(row).dot(&solved)).collect()
}

/// What may stand for the machine's state, of these rows, each with mean 0 and standard deviation 1.
fn columns(data: &Measurements, rows: &[usize]) -> Vec<Vec<f64>> {
    let pick = |all: &[f64]| -> Vec<f64> { rows.iter().map(|row| all[*row]).collect() };
    let mut columns = vec![pick(&data.time_s), rows.iter().map(|row| f64::from(data.trial[*row])).collect()];
    columns.extend(data.temperature_c.as_deref().map(pick));
    columns.extend(data.extra.iter().map(|(_, values)| pick(values)));
    columns.retain(|own| own.iter().all(|value| value.is_finite()));
    for k in 0..data.n_inputs {
        let input: Vec<f64> = (0..data.n_rows()).map(|row| data.input(row)[k]).collect();
        columns.push(pick(&input));
        for over_s in SPEEDS_OVER_S {
            columns.push(rows.iter().map(|row| speed(data, &input, *row, over_s)).collect());
        }
        let range = input.iter().fold((f64::MAX, f64::MIN), |(low, high), u| (low.min(*u), high.max(*u)));
        for part in PLAYS {
            let lag = play(data, &input, part * (range.1 - range.0));
            columns.push(rows.iter().map(|row| input[*row] - lag[*row]).collect());
        }
    }
    columns.into_iter().filter_map(standard).collect()
}

/// A column with mean 0 and standard deviation 1; `None` for one that stands still.
fn standard(column: Vec<f64>) -> Option<Vec<f64>> {
    let n = column.len() as f64;
    let mean = column.iter().sum::<f64>() / n;
    let deviation = (column.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    (deviation > 1e-12 * mean.abs().max(1e-300)).then(|| column.iter().map(|x| (x - mean) / deviation).collect())
}

/// Difference of an input over some time before a row, per second.
fn speed(data: &Measurements, input: &[f64], row: usize, over_s: f64) -> f64 {
    let is_near =
        |other: &usize| data.trial[*other] == data.trial[row] && data.time_s[row] - data.time_s[*other] <= over_s;
    let first = (0..row).rev().take_while(is_near).last().or(row.checked_sub(1)).unwrap_or(row);
    let seconds = data.time_s[row] - data.time_s[first];
    if data.trial[first] == data.trial[row] && seconds > 0.0 { (input[row] - input[first]) / seconds } else { 0.0 }
}

/// Where what is dragged along with a play of this half-width stands.
fn play(data: &Measurements, input: &[f64], half_width: f64) -> Vec<f64> {
    let mut place = 0.0;
    let follow = |(row, u): (usize, &f64)| {
        place = if data.starts_trial(row) { *u } else { f64::clamp(place, u - half_width, u + half_width) };
        place
    };
    input.iter().enumerate().map(follow).collect()
}
