//! The linear part of a fit: gain, offset and every amplitude are solved for; what is held stays, what is known pulls.

use super::signal::{Number, Signal};
use super::simulate::{Member, Run};
use crate::fit::dot;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// What a list predicts: offset and gain of each recording, then the members' columns.
#[derive(Clone, Debug)]
pub(super) struct Design {
    /// The position behind every member.
    pub passed: Vec<f64>,
    /// Columns of the members one after the other.
    pub columns: Vec<Vec<f64>>,
}

/// The solution of the linear part.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// Offset of each recording.
    pub offsets: Vec<f64>,
    /// Gain of each recording.
    pub gains: Vec<f64>,
    /// Amplitudes of the columns.
    pub amplitudes: Vec<f64>,
    /// Measured less predicted, rows of the loss, counted or not.
    pub residual: Vec<f64>,
    /// Sum of squares of rows that count.
    pub square: f64,
    /// Free columns, and the factor of their normal equations.
    free: Vec<Vec<f64>>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl Design {
    pub fn new(signal: &Signal, run: &Run) -> Self {
        Self { passed: run.passed_on_rows(signal), columns: run.columns.iter().flatten().cloned().collect() }
    }

    /// What amplitudes, gains and offsets predict.
    fn predict(&self, signal: &Signal, solution: &Solution) -> Vec<f64> {
        (0..self.passed.len())
            .map(|i| {
                let recording = signal.recording(signal.rows[i]);
                let added: f64 = self.columns.iter().zip(&solution.amplitudes).map(|(c, a)| a * c[i]).sum();
                solution.offsets[recording] + solution.gains[recording] * self.passed[i] + added
            })
            .collect()
    }

    /// How the prediction changes from this design to another with the amplitudes of a solution.
    pub fn change(&self, other: &Self, signal: &Signal, solution: &Solution) -> Vec<f64> {
        let (a, b) = (self.predict(signal, solution), other.predict(signal, solution));
        b.iter().zip(&a).map(|(b, a)| b - a).collect()
    }
}

/// Solves; rows of weight zero do not count. `noise` is the variance of a row, which says how strongly known numbers pull.
pub(super) fn solve(signal: &Signal, design: &Design, weight: &[f64], noise: f64) -> Solution {
    let n = signal.rows.len();
    let mut target: Vec<f64> = signal.rows.iter().map(|&row| signal.measured[row]).collect();
    let masked = |value: &dyn Fn(usize) -> f64, recording: usize| -> Vec<f64> {
        (0..n).map(|i| if signal.recording(signal.rows[i]) == recording { value(i) } else { 0.0 }).collect()
    };
    // Free columns with what they are drawn to.
    let mut free: Vec<Vec<f64>> = Vec::new();
    let mut pulls: Vec<Option<(f64, f64)>> = Vec::new();
    for (number, is_gain) in [(signal.offset, false), (signal.gain, true)] {
        let value = |i: usize| if is_gain { design.passed[i] } else { 1.0 };
        match number {
            Number::Held(held) => (0..n).for_each(|i| target[i] -= held * value(i)),
            Number::Free | Number::Near(..) => {
                for recording in 0..signal.n_recordings {
                    free.push(if signal.n_recordings == 1 {
                        (0..n).map(value).collect()
                    } else {
                        masked(&value, recording)
                    });
                    pulls.push(if let Number::Near(near, se) = number { Some((near, se)) } else { None });
                }
            }
        }
    }
    let n_own = free.len();
    free.extend(design.columns.iter().cloned());
    let p = free.len();
    let (mut gram, mut right) = weighted_normal(&free, &target, weight);
    for (k, pull) in pulls.iter().enumerate() {
        if let Some((near, se)) = pull {
            let strength = noise / (se * se);
            gram[(k, k)] += strength;
            right[k] += strength * near;
        }
    }
    let scale: Vec<f64> = (0..p).map(|k| gram[(k, k)].max(1e-300).sqrt().recip()).collect();
    let scaled = DMatrix::from_fn(p, p, |i, j| gram[(i, j)] * scale[i] * scale[j] + if i == j { 1e-10 } else { 0.0 });
    let factor = scaled.cholesky();
    let beta: Vec<f64> = match &factor {
        Some(factor) => {
            let solved = factor.solve(&DVector::from_fn(p, |k, _| right[k] * scale[k]));
            (0..p).map(|k| solved[k] * scale[k]).collect()
        }
        None => vec![0.0; p],
    };
    let mut residual = target;
    for (column, beta) in free.iter().zip(&beta) {
        residual.iter_mut().zip(column).for_each(|(r, x)| *r -= beta * x);
    }
    let square = residual.iter().zip(weight).map(|(r, w)| w * r * r).sum();
    let own = |number: Number, from: usize| match number {
        Number::Held(held) => vec![held; signal.n_recordings],
        _ => beta[from..from + signal.n_recordings].to_vec(),
    };
    let offsets = own(signal.offset, 0);
    let gains = own(signal.gain, if matches!(signal.offset, Number::Held(_)) { 0 } else { signal.n_recordings });
    for (column, scale) in free.iter_mut().zip(&scale) {
        column.iter_mut().for_each(|x| *x *= scale);
    }
    Solution { offsets, gains, amplitudes: beta[n_own..].to_vec(), residual, square, free, factor }
}

impl Solution {
    /// X'WD (X'WX)^-1 X'WD, what the linear part takes from changes of the nonlinear parameters.
    pub fn taken(&self, changes: &[Vec<f64>], weight: &[f64]) -> DMatrix<f64> {
        let (p, q) = (self.free.len(), changes.len());
        let Some(factor) = self.factor.as_ref().filter(|_| p > 0) else { return DMatrix::zeros(q, q) };
        let cross = DMatrix::from_fn(p, q, |i, j| weighted_dot(&self.free[i], &changes[j], weight));
        cross.transpose() * factor.solve(&cross)
    }

    /// Takes what the linear part can make out of a column.
    pub fn project(&self, column: &mut [f64], weight: &[f64]) {
        let Some(factor) = self.factor.as_ref().filter(|_| !self.free.is_empty()) else { return };
        let cross = DVector::from_fn(self.free.len(), |i, _| weighted_dot(&self.free[i], column, weight));
        let beta = factor.solve(&cross);
        for (own, beta) in self.free.iter().zip(beta.iter()) {
            column.iter_mut().zip(own).for_each(|(x, f)| *x -= beta * f);
        }
    }
}

fn weighted_dot(a: &[f64], b: &[f64], weight: &[f64]) -> f64 {
    a.iter().zip(b).zip(weight).map(|((a, b), w)| a * b * w).sum()
}

/// X'WX and X'Wy.
pub(super) fn weighted_normal(columns: &[Vec<f64>], right: &[f64], weight: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let p = columns.len();
    let mut gram = DMatrix::zeros(p, p);
    let mut product = DVector::zeros(p);
    let mut weighted = vec![0.0; right.len()];
    for i in 0..p {
        weighted.iter_mut().zip(&columns[i]).zip(weight).for_each(|((own, x), w)| *own = x * w);
        product[i] = dot(&weighted, right);
        for j in 0..=i {
            let value = dot(&weighted, &columns[j]);
            gram[(i, j)] = value;
            gram[(j, i)] = value;
        }
    }
    (gram, product)
}

/// A list and a signal to the linear solution.
pub(super) fn evaluate(signal: &Signal, members: &[Member], weight: &[f64], noise: f64) -> (Run, Design, Solution) {
    let run = Run::new(signal, members);
    let design = Design::new(signal, &run);
    let solution = solve(signal, &design, weight, noise);
    (run, design, solution)
}
