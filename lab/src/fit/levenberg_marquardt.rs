//! Levenberg and Marquardt's method on whole simulations: bounded, scaled, with normal equations of the free parameters only.
//!
//! Derivatives are difference quotients of whole simulations. Thresholds of hysteresis make the residual piecewise smooth;
//! a quotient over a hundredth of the parameter's scale averages over the corners that a tangent would sit on.

use super::Variable;
use crate::{LabError, Problem, Term};
use nalgebra::{DMatrix, DVector};

/// A fitted list of effects.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The effects with their fitted values.
    pub effects: Vec<Term>,
    /// What was free.
    pub variables: Vec<Variable>,
    /// Weighted residuals, row after row.
    pub residual: Vec<f64>,
    /// d residual / d step of each variable, row after row.
    pub slopes: Vec<Vec<f64>>,
    /// Sum of squares of the residuals, and of the pulls of known values in units of a row's noise.
    pub sum_of_squares: f64,
}

impl Fit {
    /// The slopes of what nothing but the data says.
    pub(crate) fn free_slopes(&self) -> Vec<Vec<f64>> {
        let free = self.slopes.iter().zip(&self.variables).filter(|(_, own)| own.prior.is_none());
        free.map(|(slope, _)| slope.clone()).collect()
    }

    /// What known values add to J'J and J'r, in the same units.
    pub(crate) fn pulls(&self, problem: &Problem) -> (DVector<f64>, DVector<f64>) {
        let noise = problem.noise.powi(2);
        let n = self.variables.len();
        let slope = |k: usize| self.variables[k].pull_per_step(&self.effects);
        let gram = DVector::from_fn(n, |k, _| noise * slope(k).powi(2));
        (gram, DVector::from_fn(n, |k, _| noise * slope(k) * self.variables[k].pull(&self.effects)))
    }
}

/// Sum of squares of the pulls of known values, in units of a row's noise.
fn pulled(problem: &Problem, effects: &[Term], variables: &[Variable]) -> f64 {
    problem.noise.powi(2) * variables.iter().map(|own| own.pull(effects).powi(2)).sum::<f64>()
}

/// How far a difference quotient reaches, in units of the variable's scale.
const REACH: f64 = 0.01;
const MAX_TRIES: u32 = 5;

/// Fits variables to a problem from the values in `effects`, until a step takes away less than `tolerance` of the sum of squares.
///
/// # Errors
/// [`LabError::Chain`] where the start makes no chain.
pub fn fit(
    problem: &Problem,
    effects: &[Term],
    variables: &[Variable],
    max_iterations: u32,
    tolerance: f64,
) -> Result<Fit, LabError> {
    let residual = problem.residual(effects)?;
    let mut here = Fit {
        effects: effects.to_vec(),
        variables: variables.to_vec(),
        sum_of_squares: square(&residual) + pulled(problem, effects, variables),
        slopes: slopes(problem, effects, variables, &residual),
        residual,
    };
    let mut damping = 1e-3;
    for _ in 0..max_iterations {
        let Some(next) = improve(problem, &here, &mut damping) else { break };
        let gain = 1.0 - next.sum_of_squares / here.sum_of_squares;
        let before = core::mem::replace(&mut here, next);
        if gain < tolerance {
            // So short a last step leaves the slopes what they are, and they are most of the work.
            here.slopes = before.slopes;
            break;
        }
        here.slopes = slopes(problem, &here.effects, variables, &here.residual);
    }
    Ok(here)
}

/// The same to the end, for what is written down: not for a search.
///
/// # Errors
/// As [`fit`].
pub(crate) fn fit_to_end(problem: &Problem, effects: &[Term], variables: &[Variable]) -> Result<Fit, LabError> {
    fit(problem, effects, variables, 30, 1e-6)
}

/// One step that reduces the sum of squares, or none.
fn improve(problem: &Problem, here: &Fit, damping: &mut f64) -> Option<Fit> {
    let (mut gram, mut gradient) = normal_equations(&here.slopes, &here.residual);
    let (pull, pull_gradient) = here.pulls(problem);
    gram.set_diagonal(&(gram.diagonal() + pull));
    gradient += pull_gradient;
    for _ in 0..MAX_TRIES {
        let step = solve(here, &gram, &gradient, *damping)?;
        let mut effects = here.effects.clone();
        for (variable, step) in here.variables.iter().zip(step.iter()) {
            variable.step(&mut effects, *step);
        }
        if let Ok(residual) = problem.residual(&effects) {
            let sum_of_squares = square(&residual) + pulled(problem, &effects, &here.variables);
            if sum_of_squares < here.sum_of_squares {
                *damping = (*damping * 0.2).max(1e-9);
                let variables = here.variables.clone();
                return Some(Fit { effects, variables, residual, slopes: Vec::new(), sum_of_squares });
            }
        }
        *damping = damping.max(1e-4) * 10.0;
    }
    None
}

/// (G + damping diag G) step = -gradient, variables that a bound holds left out.
fn solve(here: &Fit, gram: &DMatrix<f64>, gradient: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let n = gradient.len();
    let held = |k: usize| {
        let variable = &here.variables[k];
        let value = variable.value(&here.effects);
        (value <= variable.low && gradient[k] > 0.0) || (value >= variable.high && gradient[k] < 0.0)
    };
    let mut matrix = gram.clone();
    let mut right = -gradient;
    for k in 0..n {
        matrix[(k, k)] = matrix[(k, k)] * (1.0 + damping) + 1e-300;
        if held(k) || gram[(k, k)] <= 0.0 {
            matrix.row_mut(k).fill(0.0);
            matrix.column_mut(k).fill(0.0);
            matrix[(k, k)] = 1.0;
            right[k] = 0.0;
        }
    }
    // Unit diagonal, so that the test of rank means the same for every parameter.
    let scale = DVector::from_fn(n, |k, _| matrix[(k, k)].sqrt().recip());
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let step = scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
    step.iter().all(|s| s.is_finite()).then_some(step)
}

/// J'J and J'r.
pub(crate) fn normal_equations(slopes: &[Vec<f64>], residual: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let n = slopes.len();
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let product = dot(&slopes[i], &slopes[j]);
            gram[(i, j)] = product;
            gram[(j, i)] = product;
        }
    }
    (gram, DVector::from_fn(n, |k, _| dot(&slopes[k], residual)))
}

/// d residual / d step of each variable, by difference quotients towards the inside of its bounds.
fn slopes(problem: &Problem, effects: &[Term], variables: &[Variable], residual: &[f64]) -> Vec<Vec<f64>> {
    let moved = |variable: &Variable, reach: f64| {
        let mut moved = effects.to_vec();
        variable.step(&mut moved, reach);
        moved
    };
    let reached: Vec<f64> = variables
        .iter()
        .map(|variable| {
            let inside = variable.value(&moved(variable, REACH)) < variable.high;
            if inside { REACH } else { -REACH }
        })
        .collect();
    let lists: Vec<Vec<Term>> = variables.iter().zip(&reached).map(|(v, &reach)| moved(v, reach)).collect();
    let there = problem.residuals(&lists);
    let quotient = |(there, reach): (Option<Vec<f64>>, &f64)| match there {
        Some(there) => there.iter().zip(residual).map(|(a, b)| (a - b) / reach).collect(),
        None => vec![0.0; residual.len()],
    };
    there.into_iter().zip(&reached).map(quotient).collect()
}

pub(crate) fn square(residual: &[f64]) -> f64 {
    dot(residual, residual)
}

/// Four sums side by side: one chain of additions would wait for each.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    sums[0] + sums[1] + sums[2] + sums[3] + tail
}
