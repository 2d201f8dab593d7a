//! Whether measurements as a whole hold enough to compare anything with.

use super::ReadError;
use crate::Measurements;
use crate::noise::{bounds, is_still};
use std::path::Path;

/// Rows with a measured shape below which no rms means anything.
const MIN_SCORED: usize = 10;

/// Blocks of noise are judged in pieces of two seconds; below that there is not one.
const MIN_DURATION_S: f64 = 2.0;

/// Where measurements stand in their file, for sentences.
pub(super) struct Place<'a> {
    pub path: &'a Path,
    /// `lines 2 to 61`.
    pub rows: String,
    /// Names of columns.
    pub time: String,
    pub inputs: String,
    pub outputs: String,
}

/// Refuses a file with too few measurements, of too short a time, of a machine that never moves, or of a sensor that is stuck.
pub(super) fn enough(place: &Place, data: &Measurements) -> Result<(), ReadError> {
    let little = |what: String, expected, advice| {
        let (path, rows) = (place.path.to_owned(), place.rows.clone());
        Err(ReadError::TooLittle { path, rows, what, expected, advice })
    };
    let Place { time, inputs, outputs, .. } = place;
    let duration_s = data.duration_s();
    if duration_s < MIN_DURATION_S {
        let what = format!("the trials in {time} last {duration_s:.3} s together");
        return little(what, "2 s or more", "record a longer run");
    }
    if ranges(&data.inputs, data.n_inputs).all(is_still) {
        let what = format!("one single pose was found in {inputs}");
        return little(what, "a machine that moves", "record a motion with reversals");
    }
    let n_scored = (0..data.n_rows()).filter(|&row| data.is_scored(row)).count();
    if n_scored < MIN_SCORED {
        let what = format!("{n_scored} rows have values in {outputs}");
        return little(what, "10 rows or more", "record a longer run, or check the camera");
    }
    if ranges(&data.outputs, data.n_outputs).all(|(low, high)| low == high) {
        let what = format!("nothing ever changes in {outputs}, although the machine moves");
        return little(what, "measurements that follow the motion", "check the sensor and its cable");
    }
    Ok(())
}

/// Least and largest measured value of each column.
fn ranges(values: &[f64], width: usize) -> impl Iterator<Item = (f64, f64)> {
    let column = move |k| values.iter().skip(k).step_by(width).filter(|v| v.is_finite());
    (0..width).map(move |k| bounds(column(k).copied()))
}
