//! Is any of it more than chance? Sign flips of blocks, the largest statistic of all cells: one p-value for the whole search.
//!
//! Under the null hypothesis a block's score is as likely to be negative as positive, whatever the noise's colour within the
//! block; the same flips for every cell make the largest statistic's distribution account for the search.
//!
//! The statistic is T = S' [sum s_b s_b']^-1 S with S = sum s_b. Signs do not change the matrix, and T never exceeds the number of
//! blocks that carry the effect: one block alone is never evidence. (Recentring the blocks by what the fitted effect makes of
//! them gains a little power, but where few blocks carry a direction the replicates' variance vanishes and T has no bound.)
//! Statistics of p columns are made comparable by Wilson and Hilferty's cube root, for which chi-square is nearly normal.

use super::screen::Cell;
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

/// Replicates.
const N_FLIPS: usize = 999;

/// What the test says.
#[derive(Clone, Debug, PartialEq)]
pub struct SignFlip {
    /// Probability of a largest statistic as large as this by chance.
    pub p_value: f64,
    /// The same for each cell's own statistic against the largest of all: family-wise.
    pub p_of_cell: Vec<f64>,
}

/// Tests all cells together.
pub fn sign_flip(cells: &[Cell], seed: u64) -> SignFlip {
    let Some(n_blocks) = cells.first().map(|cell| cell.blocks.len()) else {
        return SignFlip { p_value: 1.0, p_of_cell: Vec::new() };
    };
    let signs = flips(n_blocks, seed);
    let ones = vec![1.0; n_blocks];
    let statistics: Vec<(f64, Vec<f64>)> = cells
        .par_iter()
        .map(|cell| {
            let test = Prepared::new(cell);
            (test.statistic(&ones), signs.iter().map(|w| test.statistic(w)).collect())
        })
        .collect();
    let mut largest: Vec<f64> = (0..signs.len())
        .map(|k| statistics.iter().map(|(_, flipped)| flipped[k]).fold(f64::NEG_INFINITY, f64::max))
        .collect();
    largest.sort_by(f64::total_cmp);
    let p = |t: f64| {
        let n_above = largest.len() - largest.partition_point(|own| *own < t);
        (1 + n_above) as f64 / (1 + largest.len()) as f64
    };
    let p_of_cell: Vec<f64> = statistics.iter().map(|(t, _)| p(*t)).collect();
    SignFlip { p_value: p_of_cell.iter().copied().fold(1.0, f64::min), p_of_cell }
}

/// All sign patterns of few blocks, else random ones.
fn flips(n_blocks: usize, seed: u64) -> Vec<Vec<f64>> {
    if n_blocks <= 9 {
        let sign = |pattern: usize, b: usize| if pattern >> b & 1 == 1 { -1.0 } else { 1.0 };
        return (1..1 << n_blocks).map(|pattern| (0..n_blocks).map(|b| sign(pattern, b)).collect()).collect();
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..N_FLIPS).map(|_| (0..n_blocks).map(|_| if random.next_u32() & 1 == 1 { -1.0 } else { 1.0 }).collect()).collect()
}

struct Prepared<'a> {
    cell: &'a Cell,
    /// [sum s s']^-1.
    inverse: DMatrix<f64>,
}

impl<'a> Prepared<'a> {
    fn new(cell: &'a Cell) -> Self {
        let n = cell.factors.len();
        let mut spread = DMatrix::zeros(n, n);
        for (score, _) in &cell.blocks {
            spread.ger(1.0, score, score, 1.0);
        }
        Self { cell, inverse: crate::fit::inverse(&spread) }
    }

    /// The statistic for scores with these signs, on the scale of a normal variable; minus infinity for the wrong sign.
    fn statistic(&self, signs: &[f64]) -> f64 {
        let n = self.inverse.nrows();
        let score = self.cell.blocks.iter().zip(signs).fold(DVector::zeros(n), |sum, ((s, _), w)| sum + s * *w);
        if self.cell.one_sided && score[0] <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let p = n.max(1) as f64;
        let spread = 2.0 / (9.0 * p);
        ((score.dot(&(&self.inverse * &score)) / p).cbrt() - (1.0 - spread)) / spread.sqrt()
    }
}
