//! Screening: what each candidate would do to the residual, to first order, one simulation for each cell of its grid.

use crate::Problem;
use crate::fit::{Fit, dot, inverse};
use crate::machine::Candidate;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// One candidate at one place of its grid.
pub struct Cell {
    /// Place of the candidate.
    pub candidate: usize,
    /// Place in its grid.
    pub start: usize,
    /// What each amplitude does to the prediction, orthogonal to what the fit can do already; for a periodic candidate a sine
    /// and a cosine for each input, and none where they are not among its best.
    pub columns: Vec<Vec<f64>>,
    /// Scores of each block, and Gram matrices.
    pub blocks: Vec<(DVector<f64>, DMatrix<f64>)>,
    /// Factors on the columns that fit best.
    pub factors: DVector<f64>,
    /// Amplitudes that cannot change their sign.
    pub one_sided: bool,
    /// Sum of squares that is left, to first order.
    pub sum_of_squares: f64,
    /// Share of the columns' norm that the fit cannot already make.
    pub visible: f64,
}

/// All cells of the candidates that `fit` does not hold yet.
pub fn screen(problem: &Problem, fit: &Fit, candidates: &[Candidate]) -> Vec<Cell> {
    // What is known beside the data can hardly move, and hides no effect.
    cells(problem, fit, candidates, &orthonormal(&fit.free_slopes()))
}

/// The same with all that their columns do: beside which other columns they stand is still open.
pub(super) fn screen_beside(problem: &Problem, fit: &Fit, candidates: &[Candidate]) -> Vec<Cell> {
    cells(problem, fit, candidates, &[])
}

fn cells(problem: &Problem, fit: &Fit, candidates: &[Candidate], basis: &[Vec<f64>]) -> Vec<Cell> {
    let (n_own, of_joints) = (problem.machine.effects().len(), problem.machine.as_force().is_some());
    // A force's effect that the model has on one joint may be missing on another one.
    let known = |c: &Candidate, start: usize| {
        let joint = |values: &[f64]| values.first().copied().filter(|joint| of_joints && *joint > 0.0);
        let own = c.starts.get(start).and_then(|start| joint(start));
        fit.effects.iter().enumerate().any(|(place, term)| {
            let is_elsewhere = place < n_own && own.zip(joint(&term.values)).is_some_and(|(own, other)| own != other);
            term.label() == c.name && !is_elsewhere
        })
    };
    let jobs: Vec<(usize, usize)> = candidates
        .iter()
        .enumerate()
        .filter(|(_, c)| c.cannot.is_none() && c.periodic.is_none())
        .flat_map(|(k, c)| {
            (0..c.starts.len()).filter(|start| !known(c, *start)).map(|start| (k, start)).collect::<Vec<_>>()
        })
        .collect();
    let mut cells: Vec<Cell> = jobs
        .into_par_iter()
        .filter_map(|(candidate, start)| cell(problem, fit, basis, &candidates[candidate], candidate, start))
        .collect();
    let periodic = candidates.iter().enumerate().filter(|(_, c)| c.periodic.is_some() && !known(c, 0));
    cells.extend(periodic.flat_map(|(k, c)| super::periodic::cells(problem, fit, basis, c, k)));
    cells
}

fn cell(
    problem: &Problem,
    fit: &Fit,
    basis: &[Vec<f64>],
    c: &Candidate,
    candidate: usize,
    start: usize,
) -> Option<Cell> {
    let mut columns = Vec::with_capacity(c.amplitudes.len());
    for &amplitude in &c.amplitudes {
        let mut values = c.starts[start].clone();
        c.amplitudes.iter().filter(|other| **other != amplitude).for_each(|&other| values[other] = c.neutral[other]);
        let mut effects = fit.effects.clone();
        effects.push(c.term(values));
        let there = problem.residual(&effects).ok()?;
        columns.push(fit.residual.iter().zip(&there).map(|(a, b)| a - b).collect::<Vec<f64>>());
    }
    let one_sided = c.amplitudes.len() == 1 && c.one_sided;
    Some(of_columns(problem, fit, basis, columns, Place { candidate, start, one_sided }))
}

/// Where a cell stands.
#[derive(Clone, Copy)]
pub struct Place {
    /// Place of the candidate.
    pub candidate: usize,
    /// Place in its grid.
    pub start: usize,
    /// Whether its one amplitude cannot change its sign.
    pub one_sided: bool,
}

/// The cell of columns that say what each amplitude does to the prediction.
pub fn of_columns(problem: &Problem, fit: &Fit, basis: &[Vec<f64>], mut columns: Vec<Vec<f64>>, place: Place) -> Cell {
    let Place { candidate, start, one_sided } = place;
    let whole: f64 = columns.iter().map(|column| dot(column, column)).sum();
    columns.iter_mut().for_each(|column| remove(basis, column));
    let rest: f64 = columns.iter().map(|column| dot(column, column)).sum();
    let blocks = block_moments(problem, &columns, &fit.residual);
    let (score, gram) = total(&blocks);
    let factors = inverse(&gram) * &score;
    let gain = if one_sided && factors[0] <= 0.0 { 0.0 } else { score.dot(&factors) };
    Cell {
        candidate,
        start,
        columns,
        factors,
        one_sided,
        sum_of_squares: fit.sum_of_squares - gain,
        blocks,
        visible: if whole > 0.0 { (rest / whole).sqrt() } else { 0.0 },
    }
}

/// Sums over all blocks.
pub fn total(blocks: &[(DVector<f64>, DMatrix<f64>)]) -> (DVector<f64>, DMatrix<f64>) {
    let n = blocks.first().map_or(0, |(score, _)| score.len());
    blocks.iter().fold((DVector::zeros(n), DMatrix::zeros(n, n)), |(s, g), (score, gram)| (s + score, g + gram))
}

/// Score and Gram matrix of columns in each block.
pub fn block_moments(problem: &Problem, columns: &[Vec<f64>], residual: &[f64]) -> Vec<(DVector<f64>, DMatrix<f64>)> {
    let bounds = problem.block_bounds();
    let n = columns.len();
    let range = |b: usize| bounds[b]..bounds[b + 1];
    (0..problem.n_blocks)
        .map(|b| {
            let score = DVector::from_fn(n, |i, _| dot(&columns[i][range(b)], &residual[range(b)]));
            let mut gram = DMatrix::zeros(n, n);
            for i in 0..n {
                for j in 0..=i {
                    gram[(i, j)] = dot(&columns[i][range(b)], &columns[j][range(b)]);
                    gram[(j, i)] = gram[(i, j)];
                }
            }
            (score, gram)
        })
        .collect()
}

/// An orthonormal basis of what slopes span; directions that are nearly there already are left out.
pub fn orthonormal(slopes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for slope in slopes {
        let whole = dot(slope, slope).sqrt();
        let mut own = slope.clone();
        // Twice, because once leaves rounding of the size of what was removed.
        remove(&basis, &mut own);
        remove(&basis, &mut own);
        let norm = dot(&own, &own).sqrt();
        if norm > 1e-6 * whole && norm > 0.0 {
            own.iter_mut().for_each(|x| *x /= norm);
            basis.push(own);
        }
    }
    basis
}

/// Takes out of a column what a basis spans.
pub fn remove(basis: &[Vec<f64>], column: &mut [f64]) {
    for direction in basis {
        let along = dot(direction, column);
        column.iter_mut().zip(direction).for_each(|(x, d)| *x -= along * d);
    }
}
