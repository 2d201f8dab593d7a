//! Screening of errors that are periodic in the inputs: a periodogram over the inputs, not over time.
//!
//! An error of the reading, reading_i = u_i + a sin(2 pi u_i/p + phase_i), changes the prediction by -(dy/du_i) a sin(...) to
//! first order. dy/du_i is one simulation for each input; a sine and a cosine for each input and period are products then, so
//! that a fine grid of periods costs little. Neighbouring periods are half a turn apart over the whole travel: the best one is
//! near enough for a fit.

use super::screen::{Cell, Place, of_columns};
use crate::Problem;
use crate::fit::Fit;
use crate::machine::{Candidate, Periodic};
use core::f64::consts::TAU;
use nalgebra::DVector;
use rayon::prelude::*;

/// Cells that keep their columns, and may be refined: the best periods.
const BEST: usize = 3;

/// A cell for each period of the candidate's grid; none where the fit's effects make no chain.
pub(super) fn cells(problem: &Problem, fit: &Fit, basis: &[Vec<f64>], c: &Candidate, candidate: usize) -> Vec<Cell> {
    let Some(periodic) = &c.periodic else { return Vec::new() };
    let Some(amplitude) = c.starts.first().map(|start| start[periodic.amplitude]) else { return Vec::new() };
    let responses: Option<Vec<Vec<f64>>> =
        (0..problem.data.n_inputs).into_par_iter().map(|input| response(problem, fit, input, amplitude)).collect();
    let Some(responses) = responses else { return Vec::new() };
    let cell = |(start, values): (usize, &Vec<f64>)| {
        let columns = columns(problem, &responses, values[periodic.period]);
        of_columns(problem, fit, basis, columns, Place { candidate, start, one_sided: false })
    };
    let mut cells: Vec<Cell> = c.starts.par_iter().enumerate().map(cell).collect();
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|&a, &b| cells[a].sum_of_squares.total_cmp(&cells[b].sum_of_squares));
    order.iter().skip(BEST).for_each(|&k| cells[k].columns = Vec::new());
    cells
}

/// What an amplitude of the reading's error does to the weighted prediction where the sine is one, entry by entry.
fn response(problem: &Problem, fit: &Fit, input: usize, amplitude: f64) -> Option<Vec<f64>> {
    let mut shifted = problem.data.clone();
    shifted.inputs.iter_mut().skip(input).step_by(problem.data.n_inputs).for_each(|u| *u -= amplitude);
    let there = problem.residual_at(&fit.effects, &shifted).ok()?;
    // Both are measured minus predicted.
    Some(fit.residual.iter().zip(&there).map(|(a, b)| a - b).collect())
}

fn columns(problem: &Problem, responses: &[Vec<f64>], period: f64) -> Vec<Vec<f64>> {
    let data = &problem.data;
    let mut columns = Vec::with_capacity(2 * responses.len());
    for (input, response) in responses.iter().enumerate() {
        let waves: Vec<(f64, f64)> =
            (0..data.n_rows()).map(|row| (TAU * data.input(row)[input] / period).sin_cos()).collect();
        let column = |wave: &dyn Fn(usize) -> f64| -> Vec<f64> {
            response.iter().enumerate().map(|(k, r)| r * wave(k / problem.width())).collect()
        };
        columns.push(column(&|row| waves[row].0));
        columns.push(column(&|row| waves[row].1));
    }
    columns
}

/// Amplitude and phases from the factors on sines and cosines, in the amplitude's unit that the values have.
pub(super) fn start(periodic: &Periodic, factors: &DVector<f64>, values: &mut [f64]) {
    let mut square = 0.0;
    for (k, &phase) in periodic.phases.iter().enumerate() {
        let [sine, cosine] = [factors[2 * k], factors[2 * k + 1]];
        values[phase] = cosine.atan2(sine);
        square += (sine * sine + cosine * cosine) / periodic.phases.len() as f64;
    }
    values[periodic.amplitude] *= square.sqrt().clamp(0.1, 5.0);
}

/// Cells that are worth a fit: those that kept their columns.
pub(super) fn without_hopeless(cells: &[Cell]) -> impl Iterator<Item = &Cell> {
    cells.iter().filter(|cell| !cell.columns.is_empty())
}
