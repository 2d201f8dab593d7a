//! What the machine was doing in each row, from the history of its inputs alone, which has no camera noise.

use crate::noise::largest_range;
use crate::{Measurements, Quantity};

/// Motion of a row's inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Motion {
    /// Length of the inputs' velocity without what all lines share, input units per second.
    pub speed: f64,
    /// Whether anything moves.
    pub is_moving: bool,
    /// Whether the machine goes away from rest (1), back to it (-1), or around it (0).
    pub outward: i8,
    /// Time since the last motion, s; 0 while moving.
    pub rest_s: f64,
    /// Time of all trials before and of this one so far, s.
    pub elapsed_s: f64,
}

/// Motion is judged over this time: encoders step, and a row is too short to tell rest from slowness.
const WINDOW_S: f64 = 0.1;

/// Inputs that change by less than this share of their range within the window are at rest.
const STILL: f64 = 5e-4;

/// The motion of every row.
pub(crate) fn all(data: &Measurements) -> Vec<Motion> {
    let range = largest_range(data);
    let mut before = 0;
    let mut motions: Vec<Motion> = Vec::with_capacity(data.n_rows());
    for row in 0..data.n_rows() {
        let time_s = data.time_s[row];
        if data.starts_trial(row) {
            before = row;
            let elapsed_s = motions.last().map_or(0.0, |m| m.elapsed_s);
            motions.push(Motion { speed: 0.0, is_moving: false, outward: 0, rest_s: 0.0, elapsed_s });
            continue;
        }
        while before + 1 < row && time_s - data.time_s[before + 1] >= WINDOW_S {
            before += 1;
        }
        let (step, outward) = step(data, before, row);
        let is_moving = step > STILL * range;
        let step_s = time_s - data.time_s[row - 1];
        let last = motions[row - 1];
        motions.push(Motion {
            speed: step / (time_s - data.time_s[before]),
            is_moving,
            outward: if is_moving { outward } else { 0 },
            rest_s: if is_moving { 0.0 } else { last.rest_s + step_s },
            elapsed_s: last.elapsed_s + step_s,
        });
    }
    motions
}

/// Length of the step between two rows, and whether it goes outward.
fn step(data: &Measurements, from: usize, to: usize) -> (f64, i8) {
    let mean = |values: &[f64]| match data.quantity {
        Quantity::Snake => values.iter().sum::<f64>() / values.len().max(1) as f64,
        Quantity::Segments | Quantity::Joints | Quantity::Force => 0.0,
    };
    let (a, b) = (data.input(from), data.input(to));
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut square_a, mut square_b, mut square_step) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        (square_a, square_b, square_step) = (square_a + a * a, square_b + b * b, square_step + (b - a).powi(2));
    }
    let step = f64::sqrt(square_step);
    let radial = square_b.sqrt() - square_a.sqrt();
    // Within 45 deg of straight out or straight back.
    let outward = if radial.abs() < core::f64::consts::FRAC_1_SQRT_2 * step { 0 } else { radial.signum() as i8 };
    (step, outward)
}
