//! The error of each row, and its parts along and across the measured bend.

use crate::{Measurements, Quantity};
use krait_report::Spread;

/// The error of a row, measured minus predicted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RowError {
    pub length: f64,
    /// Along the measured bend: positive where the machine bends further than predicted. For joints and segments 0.
    pub bend: f64,
    /// Across it, towards larger delta. For joints and segments 0.
    pub plane: f64,
}

/// A snake's error in its plane and out of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// Size of the error along the measured bend.
    pub bend: Spread,
    /// Its mean, with its sign: positive where the snake bends further than predicted.
    pub bend_mean: f64,
    /// Size of the error across the measured bend, as part of the bend vector.
    pub plane: Spread,
    /// Its mean, with its sign: positive where the snake's delta is larger than predicted.
    pub plane_mean: f64,
    /// Angle between the measured and the predicted plane where the bend is 15 deg or more, root mean square.
    pub azimuth_rms: f64,
    /// Rows with such a bend.
    pub n_azimuth: usize,
}

/// Below this bend the plane is too ill-defined for its angle to mean anything, rad.
const PLANE_FROM_BEND_RAD: f64 = 15.0 * core::f64::consts::PI / 180.0;

impl Parts {
    pub(super) fn of(
        data: &Measurements,
        predicted: &[f64],
        scored: &[usize],
        errors: &[RowError],
        scale: f64,
    ) -> Option<Self> {
        if data.quantity != Quantity::Snake {
            return None;
        }
        let n = errors.len().max(1) as f64;
        let angle = |&row: &usize| {
            let (measured, own) = (pair(data.output(row)), pair(&predicted[row * 2..]));
            let is_bent = measured[0].hypot(measured[1]).min(own[0].hypot(own[1])) >= PLANE_FROM_BEND_RAD;
            let cross = own[0] * measured[1] - own[1] * measured[0];
            is_bent.then(|| cross.atan2(own[0] * measured[0] + own[1] * measured[1]))
        };
        let angles: Vec<f64> = scored.iter().filter_map(angle).collect();
        let sum: f64 = angles.iter().map(|a| a * a).sum();
        Some(Self {
            bend: Spread::of(errors.iter().map(|e| e.bend.abs())),
            bend_mean: errors.iter().map(|e| e.bend).sum::<f64>() / n,
            plane: Spread::of(errors.iter().map(|e| e.plane.abs())),
            plane_mean: errors.iter().map(|e| e.plane).sum::<f64>() / n,
            azimuth_rms: scale * (sum / angles.len().max(1) as f64).sqrt(),
            n_azimuth: angles.len(),
        })
    }
}

/// The error of every scored row, in the unit of errors.
pub(super) fn errors(data: &Measurements, predicted: &[f64], scored: &[usize], scale: f64) -> Vec<RowError> {
    let width = data.n_outputs;
    let one = |&row: &usize| {
        let own = &predicted[row * width..(row + 1) * width];
        match data.quantity {
            Quantity::Snake => of_snake(pair(data.output(row)), pair(own), scale),
            Quantity::Segments | Quantity::Joints | Quantity::Force => {
                let square: f64 = data.output(row).iter().zip(own).map(|(y, f)| (y - f).powi(2)).sum();
                RowError { length: scale * square.sqrt(), bend: 0.0, plane: 0.0 }
            }
        }
    };
    scored.iter().map(one).collect()
}

pub(super) fn of_snake(measured: [f64; 2], own: [f64; 2], scale: f64) -> RowError {
    let error = [scale * (measured[0] - own[0]), scale * (measured[1] - own[1])];
    // A straight snake has no plane: then the predicted one counts.
    let [x, y] = if measured == [0.0; 2] { own } else { measured };
    let bend = x.hypot(y);
    let [x, y] = if bend > 0.0 { [x / bend, y / bend] } else { [1.0, 0.0] };
    let (bend, plane) = (error[0] * x + error[1] * y, error[1] * x - error[0] * y);
    RowError { length: error[0].hypot(error[1]), bend, plane }
}

/// Error of each output, root mean square.
pub(super) fn output_rms(data: &Measurements, predicted: &[f64], scored: &[usize], scale: f64) -> Vec<f64> {
    let mut sums = vec![0.0; data.n_outputs];
    for &row in scored {
        let own = &predicted[row * data.n_outputs..];
        for ((sum, y), f) in sums.iter_mut().zip(data.output(row)).zip(own) {
            *sum += (y - f).powi(2);
        }
    }
    sums.iter().map(|sum| scale * (sum / scored.len().max(1) as f64).sqrt()).collect()
}

pub(super) fn pair(values: &[f64]) -> [f64; 2] {
    [values[0], values[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_splits_along_and_across_the_measured_bend() {
        let error = of_snake([0.0, 0.5], [0.1, 0.3], 1.0);
        assert!((error.length - 0.05_f64.sqrt()).abs() < 1e-15);
        assert!((error.bend - 0.2).abs() < 1e-15, "bends further than predicted");
        assert!((error.plane - 0.1).abs() < 1e-15, "delta 90 deg is larger than predicted");
        assert_eq!(of_snake([0.0; 2], [0.0; 2], 1.0).length, 0.0);
    }
}
