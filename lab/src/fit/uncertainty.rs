//! How well data know fitted parameters: robust standard errors by blocks, and the error on blocks that a fit did not see.

use super::Fit;
use super::levenberg_marquardt::{dot, normal_equations};
use crate::Problem;
use crate::noise::autocorrelation;
use nalgebra::{DMatrix, DVector};

/// Standard errors of a fit's variables, in the parameters' units.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    /// The largest of three: A^-1 B A^-1 with B from the scores of blocks, widened for few blocks (noise that is larger at some
    /// places than at others); the same with B from the residual's own autocovariance (noise with a memory, of which few
    /// blocks know little); and `naive`.
    pub robust: Vec<f64>,
    /// As if all residuals were independent; what most tools print.
    pub naive: Vec<f64>,
}

/// Standard errors of a fit's variables.
pub fn uncertainty(problem: &Problem, fit: &Fit) -> Uncertainty {
    let (pull, _) = fit.pulls(problem);
    let (mut robust, mut naive) = standard_errors_with(problem, &fit.slopes, &fit.residual, &pull);
    for (k, variable) in fit.variables.iter().enumerate() {
        let unit = variable.unit_step(&fit.effects).abs();
        robust[k] *= unit;
        naive[k] *= unit;
    }
    Uncertainty { robust, naive }
}

/// Standard errors, robust and naive, of what has these slopes; the sandwich over blocks has the factor n/(n - p) for few blocks.
pub(crate) fn standard_errors(problem: &Problem, slopes: &[Vec<f64>], residual: &[f64]) -> (Vec<f64>, Vec<f64>) {
    standard_errors_with(problem, slopes, residual, &DVector::zeros(slopes.len()))
}

/// The same with what is known beside the data, as it stands in J'J.
fn standard_errors_with(
    problem: &Problem,
    slopes: &[Vec<f64>],
    residual: &[f64],
    pull: &DVector<f64>,
) -> (Vec<f64>, Vec<f64>) {
    let n = slopes.len();
    let (mut gram, _) = normal_equations(slopes, residual);
    gram.set_diagonal(&(gram.diagonal() + pull));
    // A known value is one more measurement: its score varies by its own part of J'J times the variance of a row.
    let known = DMatrix::from_diagonal(pull) * problem.noise.powi(2);
    let inverse = inverse(&gram);
    let scores = block_scores(problem, slopes, residual);
    let n_blocks = scores.len();
    let mean = scores.iter().fold(DVector::zeros(n), |sum, s| sum + s) / n_blocks.max(1) as f64;
    let spread = scores.iter().fold(DMatrix::zeros(n, n), |sum, s| {
        let off = s - &mean;
        sum + &off * off.transpose()
    }) * (n_blocks as f64 / n_blocks.saturating_sub(n).max(1) as f64);
    let sandwich = &inverse * (spread + &known) * &inverse;
    let variance = dot(residual, residual) / problem.n_scored.saturating_sub(n).max(1) as f64;
    let remembered = &inverse * (with_memory(problem, slopes, residual) * variance + known) * &inverse;
    let naive: Vec<f64> = (0..n).map(|k| (inverse[(k, k)] * variance).max(0.0).sqrt()).collect();
    let widened = student_over_normal(n_blocks.saturating_sub(n).max(2));
    let error = |matrix: &DMatrix<f64>, k: usize| matrix[(k, k)].max(0.0).sqrt();
    let robust = (0..n).map(|k| (widened * error(&sandwich, k)).max(error(&remembered, k)).max(naive[k])).collect();
    (robust, naive)
}

/// Pairs of rows in the sum over lags: of more, every so many rows stand for all.
const MOST_PAIRS: usize = 4_000_000;

/// Sum over rows t and s of rho(t - s) x_t x_s', with rho the residual's autocorrelation: what J'J is for white noise.
fn with_memory(problem: &Problem, slopes: &[Vec<f64>], residual: &[f64]) -> DMatrix<f64> {
    let (data, width) = (&problem.data, problem.width());
    let (n_rows, n) = (data.n_rows(), slopes.len());
    let rho = autocorrelation(residual, width);
    let stride = (n_rows * rho.len()).div_ceil(MOST_PAIRS).max(1);
    let mut sum = DMatrix::zeros(n, n);
    for row in (0..n_rows).step_by(stride) {
        for (lag, rho) in rho.iter().enumerate() {
            let Some(other) = row.checked_sub(lag).filter(|&other| data.trial[other] == data.trial[row]) else { break };
            // Each pair stands for itself and its mirror image.
            let twice = if lag == 0 { 1.0 } else { 2.0 } * rho * stride as f64;
            for i in 0..n {
                for j in 0..=i {
                    let (a, b) = (&slopes[i], &slopes[j]);
                    let product = |a: &[f64], b: &[f64]| dot(&a[row * width..][..width], &b[other * width..][..width]);
                    sum[(i, j)] += 0.5 * twice * (product(a, b) + product(b, a));
                }
            }
        }
    }
    sum.fill_upper_triangle_with_lower_triangle();
    sum
}

/// Two-sided 95 % quantile of Student's t over that of a normal variable (the first terms of Cornish and Fisher's expansion).
fn student_over_normal(freedom: usize) -> f64 {
    let (n, z) = (freedom as f64, 1.959_964_f64);
    let z2 = z * z;
    1.0 + (z2 + 1.0) / (4.0 * n) + (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * n * n)
}

/// Sum of squares of each block under parameters that did not see its fold: one Gauss-Newton step from the fit of all data.
///
/// Hysteresis keeps its memory through left-out rows; only their error is left out.
pub fn held_out_block_squares(problem: &Problem, fit: &Fit, n_folds: usize) -> Vec<f64> {
    let pieces = pieces(&problem.block_bounds(), &fit.slopes, &fit.residual);
    held_out(problem, fit, n_folds, &pieces, &pieces)
}

/// The same of the outputs alone, under parameters that loads took part in finding.
pub(crate) fn held_out_output_squares(problem: &Problem, fit: &Fit, n_folds: usize) -> Vec<f64> {
    held_out_outputs(problem, fit, n_folds, &problem.block_bounds())
}

/// The same of parts, each under parameters that did not see it; they begin at these rows, and the last ends with the data.
pub(crate) fn held_out_parts(problem: &Problem, fit: &Fit, first_rows: &[usize]) -> Vec<f64> {
    let ends = first_rows.iter().copied().chain([problem.data.n_rows()]);
    let bounds: Vec<usize> = ends.map(|row| row * problem.width()).collect();
    held_out_outputs(problem, fit, first_rows.len(), &bounds)
}

/// Squares of the outputs of each piece between these entries.
fn held_out_outputs(problem: &Problem, fit: &Fit, n_folds: usize, bounds: &[usize]) -> Vec<f64> {
    let seen = pieces(bounds, &fit.slopes, &fit.residual);
    if problem.loads().is_none() {
        return held_out(problem, fit, n_folds, &seen, &seen);
    }
    let n_outputs = problem.data.n_outputs;
    let outputs = |entries: &Vec<f64>| -> Vec<f64> {
        let own = |(k, x): (usize, &f64)| if k % problem.width() < n_outputs { *x } else { 0.0 };
        entries.iter().enumerate().map(own).collect()
    };
    let slopes: Vec<Vec<f64>> = fit.slopes.iter().map(outputs).collect();
    let residual = outputs(&fit.residual);
    held_out(problem, fit, n_folds, &seen, &pieces(bounds, &slopes, &residual))
}

/// J'J and J'r of one piece of the data, and the sum of its squares.
struct Piece {
    gram: DMatrix<f64>,
    gradient: DVector<f64>,
    squares: f64,
}

/// Pieces between these entries.
fn pieces(bounds: &[usize], slopes: &[Vec<f64>], residual: &[f64]) -> Vec<Piece> {
    bounds
        .windows(2)
        .map(|ends| {
            let slopes: Vec<Vec<f64>> = slopes.iter().map(|slope| slope[ends[0]..ends[1]].to_vec()).collect();
            let own = &residual[ends[0]..ends[1]];
            let (gram, gradient) = normal_equations(&slopes, own);
            Piece { gram, gradient, squares: dot(own, own) }
        })
        .collect()
}

/// Squares of the `judged` pieces under steps that the `seen` ones of the other folds ask for.
fn held_out(problem: &Problem, fit: &Fit, n_folds: usize, seen: &[Piece], judged: &[Piece]) -> Vec<f64> {
    let (pull, pull_gradient) = fit.pulls(problem);
    let mut squares = vec![0.0; judged.len()];
    for fold in 0..n_folds {
        let others = seen.iter().enumerate().filter(|(b, _)| b % n_folds != fold).map(|(_, piece)| piece);
        let start = (DMatrix::from_diagonal(&pull), pull_gradient.clone());
        let (gram, gradient) =
            others.fold(start, |(gram, gradient), piece| (gram + &piece.gram, gradient + &piece.gradient));
        let step = -inverse(&gram) * gradient;
        for b in (fold..judged.len()).step_by(n_folds) {
            let Piece { gram, gradient, squares: own } = &judged[b];
            squares[b] = own + 2.0 * gradient.dot(&step) + step.dot(&(gram * &step));
        }
    }
    squares
}

fn block_scores(problem: &Problem, slopes: &[Vec<f64>], residual: &[f64]) -> Vec<DVector<f64>> {
    let bounds = problem.block_bounds();
    let score = |b: usize, slope: &[f64]| dot(&slope[bounds[b]..bounds[b + 1]], &residual[bounds[b]..bounds[b + 1]]);
    (0..problem.n_blocks)
        .map(|b| DVector::from_iterator(slopes.len(), slopes.iter().map(|slope| score(b, slope))))
        .collect()
}

/// Inverse of a Gram matrix; directions that the data do not know count as known to be zero.
pub(crate) fn inverse(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let n = gram.nrows();
    if n == 0 {
        return DMatrix::zeros(0, 0);
    }
    if n == 1 {
        return DMatrix::from_element(1, 1, if gram[0] > 0.0 { gram[0].recip() } else { 0.0 });
    }
    let scale = DVector::from_fn(n, |k, _| if gram[(k, k)] > 0.0 { gram[(k, k)].sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] * scale[i] * scale[j]);
    let pseudo = scaled.pseudo_inverse(1e-10).unwrap_or_else(|_| DMatrix::zeros(n, n));
    DMatrix::from_fn(n, n, |i, j| pseudo[(i, j)] * scale[i] * scale[j])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_s_quantile_is_that_of_the_table() {
        for (freedom, quantile) in [(8, 2.306), (10, 2.228), (40, 2.021)] {
            assert!((1.959_964 * student_over_normal(freedom) - quantile).abs() < 0.01, "{freedom}");
        }
    }
}
