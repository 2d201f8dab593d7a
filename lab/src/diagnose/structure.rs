//! Is anything left that no known effect makes? A dictionary of shapes that names no physics, group by group.
//!
//! Each group's columns are made orthogonal to what the fit can do and tested by sign flips of blocks, all groups together.
//! The share of the residual's variance that a group explains on blocks it was not fitted to says what the rest looks like.

use super::force_rest;
use super::screen::{Cell, block_moments, remove, total};
use super::sign_flip::sign_flip;
use crate::fit::inverse;
use crate::{Problem, Quantity};
use nalgebra::{DMatrix, DVector};

/// What is left.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Probability of the strongest group's statistic by chance.
    pub p_value: f64,
    /// Groups with the share of variance that each explains on left-out blocks, and its own p-value.
    pub groups: Vec<GroupShare>,
    /// Share of variance that all groups together explain on left-out blocks.
    pub explained: f64,
}

/// One group's share.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupShare {
    /// What its columns depend on.
    pub name: &'static str,
    /// Share of the residual's variance on left-out blocks; negative where it explains nothing.
    pub share: f64,
    /// Family-wise p-value.
    pub p_value: f64,
}

/// A group of columns.
#[derive(Clone)]
pub(super) struct Group {
    pub name: &'static str,
    pub columns: Vec<Vec<f64>>,
}

/// Tests what a fit leaves; `residual` weighted, `basis` orthonormal, `predicted` the outputs that the fit predicts.
pub fn structure(problem: &Problem, residual: &[f64], basis: &[Vec<f64>], predicted: &[f64], seed: u64) -> Structure {
    of_groups(problem, residual, basis, dictionary(problem, predicted, true), seed)
}

/// What a rest is looked for in; `predicted` outputs say where the machine is and how it moves. `with_steady`: of a force's friction also
/// what is the same everywhere.
pub(super) fn dictionary(problem: &Problem, predicted: &[f64], with_steady: bool) -> Vec<Group> {
    match problem.data.quantity {
        Quantity::Force => force_rest::groups(&problem.data, with_steady),
        Quantity::Snake | Quantity::Segments | Quantity::Joints => groups(problem, predicted),
    }
}

/// The same for these groups.
pub(super) fn of_groups(
    problem: &Problem,
    residual: &[f64],
    basis: &[Vec<f64>],
    mut groups: Vec<Group>,
    seed: u64,
) -> Structure {
    for column in groups.iter_mut().flat_map(|group| &mut group.columns) {
        column.iter_mut().zip(&problem.weight).for_each(|(x, w)| *x *= w);
        remove(basis, column);
    }
    let cells: Vec<Cell> = groups.iter().map(|group| cell(problem, group, residual)).collect();
    let test = sign_flip(&cells, seed);
    let shares = cells.iter().zip(&groups).zip(&test.p_of_cell).map(|((cell, group), &p_value)| GroupShare {
        name: group.name,
        share: held_out_share(problem, &cell.blocks, residual),
        p_value,
    });
    let mut shares: Vec<GroupShare> = shares.collect();
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    let all: Vec<Vec<f64>> = groups.into_iter().flat_map(|group| group.columns).collect();
    let explained = held_out_share(problem, &block_moments(problem, &all, residual), residual);
    Structure { p_value: test.p_value, groups: shares, explained }
}

fn cell(problem: &Problem, group: &Group, residual: &[f64]) -> Cell {
    let blocks = block_moments(problem, &group.columns, residual);
    let (score, gram) = total(&blocks);
    Cell {
        candidate: 0,
        start: 0,
        columns: Vec::new(),
        factors: inverse(&gram) * score,
        blocks,
        one_sided: false,
        sum_of_squares: 0.0,
        visible: 1.0,
    }
}

/// 1 - (error after the columns) / (error before) on folds that the factors did not see.
pub(crate) fn held_out_share(problem: &Problem, blocks: &[(DVector<f64>, DMatrix<f64>)], residual: &[f64]) -> f64 {
    const FOLDS: usize = 6;
    let before: f64 = problem.block_sums(|k| residual[k] * residual[k]).iter().sum();
    let (score, gram) = total(blocks);
    let mut gained = 0.0;
    for fold in 0..FOLDS {
        let own = blocks.iter().skip(fold).step_by(FOLDS);
        let (own_score, own_gram) =
            own.fold((&score * 0.0, &gram * 0.0), |(s, g), (score, gram)| (s + score, g + gram));
        // A little ridge: a group's columns may be almost the same on one machine's path.
        let mut seen = &gram - &own_gram;
        let ridge = 1e-6 * seen.trace() / seen.nrows().max(1) as f64;
        (0..seen.nrows()).for_each(|k| seen[(k, k)] += ridge);
        let factors = inverse(&seen) * (&score - &own_score);
        gained += 2.0 * own_score.dot(&factors) - factors.dot(&(&own_gram * &factors));
    }
    if before > 0.0 { gained / before } else { 0.0 }
}

/// Columns by what they depend on; for a snake along and across the bend, for joints for each output.
fn groups(problem: &Problem, predicted: &[f64]) -> Vec<Group> {
    let frame = Frame::new(problem, predicted);
    let n = frame.n_axes();
    let each = |features: &dyn Fn(usize, &mut Vec<f64>)| -> Vec<Vec<f64>> { frame.columns(features, n) };
    let fixed = Frame { fixed: true, ..Frame::new(problem, predicted) };
    let names: [(&'static str, Vec<Vec<f64>>); 7] = [
        ("the pose", each(&|row, f| frame.pose(row, f))),
        ("the plane of bending", each(&|row, f| frame.plane(row, f))),
        ("direction of motion", each(&|row, f| frame.direction(row, f))),
        ("speed", each(&|row, f| frame.speed(row, f))),
        ("travel since a reversal", each(&|row, f| frame.travel(row, f))),
        ("earlier poses (seconds to a minute)", each(&|row, f| frame.past(row, f))),
        ("time", fixed.columns(&|row, f| fixed.time(row, f), n)),
    ];
    names.into_iter().map(|(name, columns)| Group { name, columns }).collect()
}

/// Directions in which errors are looked at, and what they may depend on, row by row.
struct Frame<'a> {
    problem: &'a Problem<'a>,
    predicted: &'a [f64],
    /// Axes are the outputs themselves, not along and across the bend.
    fixed: bool,
    /// Half the range of the largest output.
    scale: f64,
    /// Velocity of the outputs, per second, smoothed over neighbours.
    velocity: Vec<f64>,
    /// Outputs low-passed with 1, 8 and 60 s.
    past: [Vec<f64>; 3],
    /// Outputs behind plays of three widths.
    plays: [Vec<f64>; 3],
    duration_s: f64,
}

impl<'a> Frame<'a> {
    fn new(problem: &'a Problem<'a>, predicted: &'a [f64]) -> Self {
        let scale = predicted.iter().fold(0.0_f64, |m, y| m.max(y.abs())).max(1e-12);
        let data = &problem.data;
        let first = data.time_s.first().copied().unwrap_or(0.0);
        let last = data.time_s.last().copied().unwrap_or(1.0);
        Self {
            problem,
            predicted,
            fixed: problem.data.quantity != Quantity::Snake,
            scale,
            velocity: velocity(problem, predicted),
            past: [1.0, 8.0, 60.0].map(|time_s| low_pass(problem, predicted, time_s)),
            plays: [0.01, 0.03, 0.1].map(|width| play(problem, predicted, width * scale)),
            duration_s: (last - first).max(1e-9),
        }
    }

    fn width(&self) -> usize {
        self.problem.data.n_outputs
    }

    fn n_axes(&self) -> usize {
        self.width()
    }

    /// One column for each feature and each axis: along and across the bend, or output by output.
    fn columns(&self, features: &dyn Fn(usize, &mut Vec<f64>), n_axes: usize) -> Vec<Vec<f64>> {
        let width = self.width();
        let mut own = Vec::new();
        features(0, &mut own);
        let n = own.len();
        let mut columns = vec![vec![0.0; self.predicted.len()]; n * n_axes];
        for row in 0..self.problem.data.n_rows() {
            own.clear();
            features(row, &mut own);
            for (k, value) in own.iter().enumerate() {
                for axis in 0..n_axes {
                    for (output, part) in self.axis(row, axis).into_iter().enumerate().take(width) {
                        columns[k * n_axes + axis][row * width + output] = value * part;
                    }
                }
            }
        }
        columns
    }

    /// Direction of an axis at a row, one number for each output (16 at most).
    fn axis(&self, row: usize, axis: usize) -> [f64; 16] {
        let mut direction = [0.0; 16];
        if !self.fixed {
            let [x, y] = [self.output(row, 0), self.output(row, 1)];
            let bend = x.hypot(y).max(1e-3);
            let radial = [x / bend, y / bend];
            direction[..2].copy_from_slice(&if axis == 0 { radial } else { [-radial[1], radial[0]] });
        } else if let Some(own) = direction.get_mut(axis) {
            *own = 1.0;
        }
        direction
    }

    fn output(&self, row: usize, k: usize) -> f64 {
        self.predicted[row * self.width() + k]
    }

    /// Distance from rest position, 0 to about 1.
    fn size(&self, row: usize) -> f64 {
        (0..self.width()).map(|k| self.output(row, k).powi(2)).sum::<f64>().sqrt() / self.scale
    }

    fn pose(&self, row: usize, f: &mut Vec<f64>) {
        if self.problem.data.quantity == Quantity::Segments {
            f.push(1.0);
            for k in (0..self.width()).step_by(2) {
                let b = self.output(row, k).hypot(self.output(row, k + 1)) / self.scale;
                f.extend([b, b * b, b * b * b]);
            }
            return;
        }
        let b = self.size(row);
        f.extend([1.0, b, b * b, b * b * b]);
    }

    fn plane(&self, row: usize, f: &mut Vec<f64>) {
        let n_bends = if self.problem.data.quantity == Quantity::Segments { self.width() } else { 2 };
        for k in (0..n_bends).step_by(2) {
            let (x, y) = (self.output(row, k), self.output(row, k + self.width().min(2) - 1));
            let angle = y.atan2(x);
            f.extend([
                angle.cos(),
                angle.sin(),
                (2.0 * angle).cos(),
                (2.0 * angle).sin(),
                (3.0 * angle).cos(),
                (3.0 * angle).sin(),
            ]);
        }
    }

    fn direction(&self, row: usize, f: &mut Vec<f64>) {
        let [along, across] = self.heading(row);
        let b = self.size(row);
        f.extend([along, along * b, across, across * b]);
    }

    fn speed(&self, row: usize, f: &mut Vec<f64>) {
        let [along, across] = self.heading(row);
        let speed = self.speed_of(row);
        f.extend([along * speed, across * speed, speed]);
    }

    fn travel(&self, row: usize, f: &mut Vec<f64>) {
        for play in &self.plays {
            let lag = |k: usize| self.output(row, k) - play[row * self.width() + k];
            f.push(self.along(row, &lag));
        }
    }

    fn past(&self, row: usize, f: &mut Vec<f64>) {
        for past in &self.past {
            let lag = |k: usize| self.output(row, k) - past[row * self.width() + k];
            f.push(self.along(row, &lag));
        }
    }

    fn time(&self, row: usize, f: &mut Vec<f64>) {
        let data = &self.problem.data;
        let t = (data.time_s[row] - data.time_s[0]) / self.duration_s;
        // A slope, and a level for each quarter but the first: what drifts, and what jumps.
        f.push(t - 0.5);
        f.extend([1.0, 2.0, 3.0].map(|quarter| if t >= 0.25 * quarter { 1.0 } else { 0.0 }));
    }

    fn along(&self, row: usize, vector: &dyn Fn(usize) -> f64) -> f64 {
        let axis = self.axis(row, 0);
        (0..self.width()).map(|k| axis[k.min(15)] * vector(k)).sum::<f64>() / self.scale
    }

    /// Direction of motion along and across the bend, -1 to 1, zero at rest.
    fn heading(&self, row: usize) -> [f64; 2] {
        let speed = self.speed_of(row);
        if speed < 1e-3 {
            return [0.0; 2];
        }
        let part = |axis: usize| {
            let axis = self.axis(row, axis);
            (0..self.width()).map(|k| axis[k.min(15)] * self.velocity[row * self.width() + k]).sum::<f64>()
                / (speed * self.scale)
        };
        [part(0), if self.width() > 1 { part(1) } else { 0.0 }]
    }

    /// Speed in ranges per second.
    fn speed_of(&self, row: usize) -> f64 {
        let width = self.width();
        self.velocity[row * width..(row + 1) * width].iter().map(|v| v * v).sum::<f64>().sqrt() / self.scale
    }
}

fn velocity(problem: &Problem, predicted: &[f64]) -> Vec<f64> {
    let (data, width) = (&problem.data, problem.data.n_outputs);
    let n = data.n_rows();
    let mut velocity = vec![0.0; predicted.len()];
    for row in 0..n {
        let before = if row > 0 && !data.starts_trial(row) { row - 1 } else { row };
        let after = if row + 1 < n && !data.starts_trial(row + 1) { row + 1 } else { row };
        let dt_s = data.time_s[after] - data.time_s[before];
        for k in 0..width {
            let step = predicted[after * width + k] - predicted[before * width + k];
            velocity[row * width + k] = if dt_s > 0.0 { step / dt_s } else { 0.0 };
        }
    }
    velocity
}

fn low_pass(problem: &Problem, predicted: &[f64], time_s: f64) -> Vec<f64> {
    let (data, width) = (&problem.data, problem.data.n_outputs);
    let mut out = predicted.to_vec();
    for row in (1..data.n_rows()).filter(|&row| !data.starts_trial(row)) {
        let keep = (-(data.time_s[row] - data.time_s[row - 1]) / time_s).exp();
        for k in 0..width {
            out[row * width + k] = predicted[row * width + k] * (1.0 - keep) + out[(row - 1) * width + k] * keep;
        }
    }
    out
}

fn play(problem: &Problem, predicted: &[f64], half_width: f64) -> Vec<f64> {
    let (data, width) = (&problem.data, problem.data.n_outputs);
    let mut out = predicted.to_vec();
    for row in (1..data.n_rows()).filter(|&row| !data.starts_trial(row)) {
        for k in 0..width {
            let y = predicted[row * width + k];
            out[row * width + k] = out[(row - 1) * width + k].clamp(y - half_width, y + half_width);
        }
    }
    out
}
