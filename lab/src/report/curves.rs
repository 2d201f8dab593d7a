//! The residual as numbers, for a page that draws it itself: over time, and over the position with the direction of motion.

use super::picture::short;
use super::rows::Rows;
use crate::machine::MachineUnderTest;
use crate::{LabError, Measurements};
use serde::Serialize;

/// Rows that a curve has at most.
const MOST_ROWS: usize = 1500;
/// Axes that a page shows; a snake has two.
const MOST_AXES: usize = 4;

/// What the model leaves of the measurement, row by row, thinned to 1500 rows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResidualCurves {
    /// Time of each row, s.
    pub time_s: Vec<f64>,
    /// Unit of residuals and positions.
    pub unit: String,
    /// What the two directions of motion are called, rising first.
    pub directions: [&'static str; 2],
    /// A snake's bend in its plane and across it; else one for each output, of which the first four are given.
    pub axes: Vec<AxisCurve>,
}

/// The residual along one axis; every list has one value a row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisCurve {
    /// What it is called.
    pub name: String,
    /// Measured minus predicted; NaN (null in JSON) where a snake is too straight to have a plane.
    pub residual: Vec<f64>,
    /// Where the machine is: a snake's predicted bend, an output's own prediction.
    pub position: Vec<f64>,
    /// Direction of motion: 1, -1; 0 before the first motion.
    pub direction: Vec<i8>,
}

/// The residual of a machine with its own effects, after calibration of what the model leaves out, as in [`super::comparison_page`].
///
/// # Errors
/// [`LabError::Chain`] where the model's effects make no chain for these columns.
pub fn residual_curves(machine: &dyn MachineUnderTest, data: &Measurements) -> Result<ResidualCurves, LabError> {
    let calibrated = machine.calibrated_on(data)?;
    let machine = calibrated.as_deref().unwrap_or(machine);
    let rows = Rows::new(machine, data, vec![("model".to_owned(), machine.predict(machine.effects(), data)?)], None);
    let step = rows.scored.len().div_ceil(MOST_ROWS).max(1);
    let shown: Vec<usize> = rows.scored.iter().copied().step_by(step).collect();
    let axis = |(k, name): (usize, String)| {
        let travel = rows.travel(k);
        AxisCurve {
            name,
            residual: shown.iter().map(|&row| short(rows.residual(0, row, k))).collect(),
            position: shown.iter().map(|&row| short(rows.position(row, k))).collect(),
            direction: shown.iter().map(|&row| travel[row].0).collect(),
        }
    };
    Ok(ResidualCurves {
        time_s: shown.iter().map(|&row| short(data.time_s[row])).collect(),
        axes: rows.axes().into_iter().enumerate().take(MOST_AXES).map(axis).collect(),
        directions: rows.directions(),
        unit: rows.unit,
    })
}
