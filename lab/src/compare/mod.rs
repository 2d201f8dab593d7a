//! How far model and measurement are apart, in what parts, and where: a forward prediction from the history of the inputs.
//!
//! The error of a row is the length of the difference between the measured and the predicted output, a snake's bend vector. Its
//! part along the measured bend is the bend error (in-plane), the part across it the plane error (out-of-plane).

mod bins;
mod circumstances;
mod common_mode;
mod json;
pub(crate) mod motion;
mod parts;
mod worst;

pub use bins::Bin;
pub use common_mode::CommonMode;
pub use parts::Parts;

use crate::cells::load_cells;
use crate::diagnose::{LoadCell, number_name};
use crate::joint::hides_gain;
use crate::machine::{JointsLab, MachineUnderTest, OpenNumber};
use crate::noise::NoiseFloor;
use crate::prepare::{Prepared, prepare};
use crate::{LabError, Measurements, Problem, TipFrame};
use krait_model::model_file::Known;
use krait_report::Spread;
use serde::Serialize;

/// How far model and measurement are apart. Errors are in the machine's unit for errors (degrees for angles).
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The measurements' file.
    pub source: String,
    /// SHA-256 of that file.
    pub sha256: String,
    /// Unit of errors.
    pub unit: String,
    /// Rows of the file.
    pub n_rows: usize,
    /// Rows with a measurement.
    pub n_scored: usize,
    /// Length of the error, after calibration of what the model leaves out.
    pub error: Spread,
    /// The same root mean square with what the model leaves out at its default.
    pub as_given_rms: f64,
    /// Gain and offset of each joint as used; empty for a machine without such numbers. An open gain of a joint that does not move is none.
    pub calibration: Vec<Calibrated>,
    /// Joints, from 1, that do not move, so that the gain that the model leaves open cannot be seen.
    pub still_joints: Vec<usize>,
    /// Bend and plane apart; `None` for joints.
    pub parts: Option<Parts>,
    /// Error of each output, root mean square.
    pub output_rms: Vec<f64>,
    /// Distance between the measured and the predicted position, root mean square, m; `None` where outputs are no positions.
    pub position_rms_m: Option<f64>,
    /// Where each recording's tracker stands, of bends that are made of tip positions.
    pub tip_frames: Vec<TipFrame>,
    /// What three lines share and no shape shows; `None` for joints.
    pub common_mode: Option<CommonMode>,
    /// The load cells beside the model's loads; `None` where none were recorded, or none that follow the model's.
    pub loads: Option<Vec<LoadCell>>,
    /// Length of the error that the measurement's own noise gives, root mean square; `None` if the data do not tell.
    pub noise_floor: Option<f64>,
    /// How the floor was found.
    pub noise_source: &'static str,
    /// The noise of one output, found in three ways.
    pub noise: Noise,
    /// Where the error is how large; the largest first.
    pub bins: Vec<Bin>,
    /// Where it is worst.
    pub worst: String,
}

/// A number of the machine as the comparison used it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibrated {
    /// gain or offset; of a snake its key in the model file.
    pub name: String,
    /// The joint, from 1; `None` for a snake.
    pub joint: Option<usize>,
    /// Value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Whether the model file holds it.
    pub held: bool,
}

/// Standard deviation of one output's noise, found in three ways, in the unit of errors; `None` where the data do not tell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Noise {
    /// From differences of neighbouring rows: the fast part alone.
    pub by_differences: Option<f64>,
    /// From rests: fast and slow.
    pub at_rest: Option<f64>,
    /// Time at rest that this is made of, s.
    pub rest_time_s: f64,
    /// From visits to the same place in the same direction: also what does not repeat, hysteresis of another history included.
    pub on_visits: Option<f64>,
    /// Pairs of visits.
    pub n_visits: usize,
}

/// Compares a machine with its own effects to measurements.
///
/// # Errors
/// [`LabError::Chain`] where the model's effects make no chain for these columns.
pub fn compare(machine: &dyn MachineUnderTest, data: &Measurements) -> Result<Comparison, LabError> {
    let predicted = machine.predict(machine.effects(), data)?;
    let given = compare_prediction(machine, data, &predicted);
    let Some(calibrated) = machine.calibrated_on(data)? else {
        return Ok(Comparison { loads: loads(machine, data)?, ..given });
    };
    let own = calibrated.as_ref();
    let (calibration, still_joints) = match own.as_joints() {
        Some(joints) => {
            let (still, seen): (Vec<_>, _) = (0..data.n_inputs).partition(|k| hides_gain(joints, data, *k, &[]));
            (gains_and_offsets(joints, seen), still.iter().map(|k| k + 1).collect())
        }
        None => (open_numbers(own)?, Vec::new()),
    };
    let (as_given_rms, loads) = (given.error.rms, loads(own, data)?);
    let predicted = own.predict(own.effects(), data)?;
    Ok(Comparison { as_given_rms, calibration, still_joints, loads, ..compare_prediction(own, data, &predicted) })
}

/// What a snake's model file leaves open, with the values of a calibrated machine.
fn open_numbers(calibrated: &dyn MachineUnderTest) -> Result<Vec<Calibrated>, LabError> {
    let number = |open: OpenNumber| {
        let entry = &calibrated.effects()[open.effect];
        let parameter = calibrated.parameters(entry)?.swap_remove(open.parameter);
        let name = number_name(entry, &parameter.name);
        Ok(Calibrated { name, joint: None, value: entry.values[open.parameter], unit: parameter.unit, held: false })
    };
    calibrated.open_numbers().into_iter().map(number).collect()
}

/// The load cells, where loads were recorded that follow the model's.
fn loads(machine: &dyn MachineUnderTest, data: &Measurements) -> Result<Option<Vec<LoadCell>>, LabError> {
    // What stands before a fit costs as much as the comparison itself.
    if data.counted_loads_n().is_none() {
        return Ok(None);
    }
    let Prepared { problem, loads, .. } = prepare(machine, data)?;
    let (Some(rows), Some(cells)) = (problem.loads(), loads.cells()) else { return Ok(None) };
    let (_, predicted_n) = machine.predict_with_loads(machine.effects(), data)?;
    Ok(predicted_n.map(|own| load_cells(rows, cells, &own, &own)))
}

fn gains_and_offsets(calibrated: &JointsLab, of: Vec<usize>) -> Vec<Calibrated> {
    let own = calibrated.joints();
    let gain_unit = format!("{}/{}", own.y_unit, own.u_unit);
    let (unit, scale) = calibrated.error_unit();
    let one = |k: usize| {
        let held = |known: &Known| *known == Known::Held;
        let joint = Some(k + 1);
        let gain = own.gain[k][k];
        let offset = own.offset[k] * scale;
        [
            Calibrated {
                name: "gain".to_owned(),
                joint,
                value: gain,
                unit: gain_unit.clone(),
                held: held(&own.gain_known[k]),
            },
            Calibrated {
                name: "offset".to_owned(),
                joint,
                value: offset,
                unit: unit.to_owned(),
                held: held(&own.offset_known[k]),
            },
        ]
    };
    of.into_iter().flat_map(one).collect()
}

/// The same for outputs that are already predicted.
pub fn compare_prediction(machine: &dyn MachineUnderTest, data: &Measurements, predicted: &[f64]) -> Comparison {
    let (unit, scale) = machine.error_unit();
    let floor = noise_floor(machine, data, predicted);
    let sigma = floor.sigma();
    let scored: Vec<usize> = (0..data.n_rows()).filter(|&row| data.is_scored(row)).collect();
    let errors = parts::errors(data, predicted, &scored, scale);
    let lengths: Vec<f64> = errors.iter().map(|error| error.length).collect();
    let error = Spread::of(lengths);
    let bins = bins::all(machine, data, predicted, &scored, &errors);
    let position_rms_m =
        position_rms_m(machine, data, predicted, &scored).or_else(|| (unit == "m").then_some(error.rms));
    Comparison {
        source: data.source.clone(),
        sha256: data.sha256.clone(),
        unit: unit.to_owned(),
        n_rows: data.n_rows(),
        n_scored: scored.len(),
        parts: parts::Parts::of(data, predicted, &scored, &errors, scale),
        output_rms: parts::output_rms(data, predicted, &scored, scale),
        position_rms_m,
        tip_frames: data.tip_frames.clone(),
        common_mode: CommonMode::of(data),
        loads: None,
        noise_floor: sigma.map(|(sigma, _)| scale * sigma * (data.n_outputs as f64).sqrt()),
        noise_source: sigma.map_or("the data do not tell", |(_, source)| source.label()),
        noise: Noise {
            by_differences: floor.differences.map(|sigma| scale * sigma),
            at_rest: floor.rest.map(|sigma| scale * sigma),
            rest_time_s: floor.rest_time_s,
            on_visits: floor.visits.map(|sigma| scale * sigma),
            n_visits: floor.n_visits,
        },
        as_given_rms: error.rms,
        calibration: Vec::new(),
        still_joints: Vec::new(),
        worst: worst::sentence(&bins, error.rms, unit),
        bins,
        error,
    }
}

/// The noise, from what the model leaves: it follows the motion closely enough to take it out.
fn noise_floor(machine: &dyn MachineUnderTest, data: &Measurements, predicted: &[f64]) -> NoiseFloor {
    let problem = Problem::new(machine, data.clone(), &[], f64::INFINITY);
    let residual = problem.weigh(predicted);
    NoiseFloor::new(&problem, &residual)
}

fn position_rms_m(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    predicted: &[f64],
    scored: &[usize],
) -> Option<f64> {
    let mut sum = 0.0;
    for &row in scored {
        let measured = machine.tip_pos_m(data.output(row))?;
        let own = machine.tip_pos_m(predicted.get(row * data.n_outputs..)?)?;
        sum += measured.iter().zip(own).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    }
    Some((sum / scored.len().max(1) as f64).sqrt())
}
