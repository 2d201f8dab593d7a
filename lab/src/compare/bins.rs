//! Rows sorted into bins by what the machine was doing, and the error in each bin.

use super::circumstances::{Dimension, Part, dimensions};
use super::parts::{RowError, of_snake, pair};
use crate::Measurements;
use crate::machine::MachineUnderTest;

/// The error where something holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Bin {
    /// What the rows are sorted by: bend, plane, direction, speed, time, rest, load, trial, ...
    pub by: String,
    /// Which of them these are.
    pub bin: String,
    /// Length of the error, root mean square.
    pub rms: f64,
    /// Mean of the error along the measured bend, or of the joint's error, with its sign.
    pub mean: Option<f64>,
    /// Mean of the error across the measured bend, with its sign.
    pub plane_mean: Option<f64>,
    /// Rows.
    pub n_rows: usize,
}

/// Bins with less than this share of the rows, or fewer rows than [`FEWEST_ROWS`], stand behind all others.
const SMALLEST_SHARE: f64 = 0.01;

/// See [`SMALLEST_SHARE`].
const FEWEST_ROWS: usize = 20;

impl Bin {
    /// Whether there are rows enough to rank it among `n_scored`.
    pub fn is_large(&self, n_scored: usize) -> bool {
        self.n_rows >= FEWEST_ROWS && self.n_rows as f64 >= SMALLEST_SHARE * n_scored as f64
    }
}

/// All bins that hold a row, the largest error first.
pub(super) fn all(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    predicted: &[f64],
    scored: &[usize],
    errors: &[RowError],
) -> Vec<Bin> {
    let (_, scale) = machine.error_unit();
    let mut bins = Vec::new();
    for dimension in dimensions(machine, data, scored) {
        match dimension.part {
            Part::Whole => bins.extend(fill(&dimension, scored, |k, _| of_row(&errors[k]))),
            Part::Segment(segment) => bins.extend(fill(&dimension, scored, |_, row| {
                let own = &predicted[row * data.n_outputs + 2 * segment..];
                of_row(&of_snake(pair(&data.output(row)[2 * segment..]), pair(own), scale))
            })),
            Part::Output(output) => bins.extend(fill(&dimension, scored, |_, row| {
                let own = predicted[row * data.n_outputs + output];
                let error = scale * (data.output(row)[output] - own);
                [error * error, error, 0.0]
            })),
        }
    }
    bins.sort_by(|a, b| {
        (b.is_large(scored.len()), b.rms)
            .partial_cmp(&(a.is_large(scored.len()), a.rms))
            .unwrap_or(core::cmp::Ordering::Equal)
    });
    bins
}

fn of_row(error: &RowError) -> [f64; 3] {
    [error.length * error.length, error.bend, error.plane]
}

/// Sums square, signed error and plane error of each row, given as place among the scored and as row, into its bin.
fn fill(dimension: &Dimension, scored: &[usize], error: impl Fn(usize, usize) -> [f64; 3]) -> Vec<Bin> {
    let mut sums = vec![(0_usize, [0.0; 3]); dimension.labels.len()];
    for (k, &row) in scored.iter().enumerate() {
        let Some((n, sum)) = (dimension.place)(row).and_then(|place| sums.get_mut(place)) else { continue };
        *n += 1;
        let [square, mean, plane] = error(k, row);
        *sum = [sum[0] + square, sum[1] + mean, sum[2] + plane];
    }
    let filled = dimension.labels.iter().zip(sums).filter(|(_, (n, _))| *n > 0);
    let bin = |(label, (n, [square, mean, plane])): (&String, (usize, [f64; 3]))| Bin {
        by: dimension.by.clone(),
        bin: label.clone(),
        rms: (square / n as f64).sqrt(),
        mean: dimension.has_mean.then_some(mean / n as f64),
        plane_mean: (dimension.has_mean && !matches!(dimension.part, Part::Output(_))).then_some(plane / n as f64),
        n_rows: n,
    };
    filled.map(bin).collect()
}
