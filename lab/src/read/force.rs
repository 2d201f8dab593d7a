//! A recording of motion and force, filtered once: position, its derivatives, torque or current and load, all in step.
//!
//! Each trial is put on an even grid of time. One Gaussian filter, whose phase is zero, and its first two derivatives make angle,
//! speed and acceleration; the same filter makes force, load and sign of speed. What it does to the linear terms of the model it does
//! to both sides alike. Its cut-off follows the motion. Rows nearer to each other than the filter's memory would repeat
//! each other's noise, so that only every so many are kept; the filter's edges are dropped. Where the speed changes its sign within
//! the filter, may do so unseen, or rests, friction may have any value between both directions: such rows are not scored.

use super::ReadError;
use super::check::Place;
use crate::noise::bounds;
use crate::{Measurements, Names};
use krait_model::model_file::ForceMachine;
use std::path::PathBuf;

/// Cut-off (-3 dB) for each rms frequency of the speed.
const CUT_OFF: f64 = 8.0;
/// Gaussian: standard deviation in time, s, for each second of the cut-off's period: sqrt(ln 2)/(2 pi).
const SIGMA_OF_PERIOD: f64 = 0.132_5;
/// Narrowest filter, in rows.
const NARROWEST: f64 = 1.5;
/// The kernel ends so many standard deviations from its middle, ...
const REACH: f64 = 4.0;
/// ... and rows are kept so many apart: then their noise has less than 5 % in common.
const APART: f64 = 3.5;
/// Share of the filter's weight that must see one sign of speed.
const ONE_SIGN: f64 = 0.98;
/// A joint that turns back for less time than the filter remembers leaves a speed that only comes near zero: below this part of the
/// largest speed within the filter's reach the sign is not known. A parabola that just touches zero has a sixteenth.
const NEAR_ZERO: f64 = 0.125;
/// A joint slower than this part of its largest speed rests.
const RESTS: f64 = 1e-3;
/// A time between rows beyond so many typical ones is a gap, at which the filter begins anew.
const GAP: f64 = 5.0;
/// Motion of a joint below this, rad, shows nothing.
const LEAST_MOTION_RAD: f64 = 1e-3;

/// Name of a joint's column among the extra ones; the number counts from 1.
pub(crate) fn column(what: &str, joint: usize) -> String {
    format!("force.{what}{}", joint + 1)
}

/// Rows without a gap, of one trial.
struct Section {
    trial: u32,
    rows: std::ops::Range<usize>,
}

/// Filters and thins measurements that were recorded: what reading a file of this machine does.
///
/// # Errors
/// [`ReadError::TooLittle`]: a joint does not move, or its force does not change.
pub(crate) fn filtered(data: Measurements, machine: &ForceMachine) -> Result<Measurements, ReadError> {
    let path = PathBuf::from(&data.source);
    let [time, inputs, outputs] = ["time_s", "the angles", "the forces"].map(str::to_owned);
    let place = Place { path: &path, rows: format!("rows 1 to {}", data.n_rows()), time, inputs, outputs };
    prepare(&place, data, machine)
}

/// Filters and thins measurements as they were read.
pub(super) fn prepare(place: &Place, data: Measurements, machine: &ForceMachine) -> Result<Measurements, ReadError> {
    let n = machine.n;
    for joint in 0..n {
        let range = |values: &[f64]| {
            let (low, high) = bounds(values.iter().skip(joint).step_by(n).copied().filter(|v| v.is_finite()));
            high - low
        };
        let little = |what: String, expected, advice| ReadError::TooLittle {
            path: place.path.to_owned(),
            rows: place.rows.clone(),
            what,
            expected,
            advice,
        };
        if range(&data.inputs) < LEAST_MOTION_RAD {
            let what = format!("joint {} does not move", joint + 1);
            return Err(little(what, "an angle that changes by more than 0.001 rad", "record a motion with reversals"));
        }
        if range(&data.outputs) <= 0.0 {
            let what = format!("the force of joint {} never changes, although the joint moves", joint + 1);
            return Err(little(
                what,
                "a torque or a current that follows the motion",
                "check the sensor and its column",
            ));
        }
    }
    let step_s = typical_step_s(&data);
    let sections = sections(&data, step_s);
    let loads: Vec<Option<&[f64]>> = (0..n)
        .map(|joint| {
            let name = format!("load{}_nm", joint + 1);
            data.extra.iter().find(|(own, _)| own.eq_ignore_ascii_case(&name)).map(|(_, values)| values.as_slice())
        })
        .collect();
    let mut sigma = 2.0 * NARROWEST;
    for _ in 0..4 {
        sigma = wanted_sigma(&data, &sections, step_s, sigma).max(NARROWEST);
    }
    let kernels = Kernels::new(sigma);
    let stride = (APART * sigma).ceil() as usize;
    let mut out = Filtered::new(n, &loads);
    for section in &sections {
        out.add(&data, section, step_s, &kernels, stride, &loads);
    }
    let row_noise: Vec<f64> = (0..n).map(|joint| row_noise(&data, joint)).collect();
    // What the filter leaves of noise that is new in every row.
    let left = kernels.smooth.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    Ok(out.into_measurements(data, 1.0 / (step_s * sigma / SIGMA_OF_PERIOD), &row_noise, left))
}

/// Standard deviation of what changes from row to row of a joint's force before the filter: third differences, root mean square over 20.
fn row_noise(data: &Measurements, joint: usize) -> f64 {
    let n = data.n_outputs;
    let (mut sum, mut count) = (0.0, 0.0);
    for row in (3..data.n_rows()).filter(|row| (0..3).all(|back| !data.starts_trial(row - back))) {
        let at = |back: usize| data.outputs[(row - back) * n + joint];
        let third = at(0) - 3.0 * at(1) + 3.0 * at(2) - at(3);
        if third.is_finite() {
            sum += third * third / 20.0;
            count += 1.0;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}

/// One joint of filtered measurements, as the only joint of a machine.
pub(crate) fn of_joint(data: &Measurements, joint: usize) -> Measurements {
    let one = |values: &[f64], n: usize| values.iter().skip(joint).step_by(n).copied().collect();
    let name = |names: &[String]| names.get(joint).cloned().into_iter().collect();
    let is_of_some = |name: &str| COLUMNS.iter().any(|what| (0..data.n_outputs).any(|own| name == column(what, own)));
    let mut extra: Vec<(String, Vec<f64>)> = data.extra.iter().filter(|(name, _)| !is_of_some(name)).cloned().collect();
    let own = COLUMNS.iter().filter_map(|what| Some((column(what, 0), data.extra(&column(what, joint))?.to_vec())));
    extra.extend(own);
    Measurements {
        inputs: one(&data.inputs, data.n_inputs),
        n_inputs: 1,
        outputs: one(&data.outputs, data.n_outputs),
        n_outputs: 1,
        names: Names { inputs: name(&data.names.inputs), outputs: name(&data.names.outputs) },
        extra,
        ..data.clone()
    }
}

/// What the rows of filtered forces scattered by before the filter, in the forces' unit, root mean square over the joints; `None` for other
/// measurements.
pub(crate) fn scatter_before_filter(data: &Measurements) -> Option<f64> {
    scatter(data, ROW_NOISE)
}

/// The same behind the filter, where it is new in every row: slow noise passes the filter and is not in it.
pub(crate) fn scatter_behind_filter(data: &Measurements) -> Option<f64> {
    scatter(data, FILTERED_NOISE)
}

fn scatter(data: &Measurements, what: &str) -> Option<f64> {
    let of = |joint| data.extra(&column(what, joint))?.first().map(|noise| noise * noise);
    let squares = (0..data.n_outputs).map(of).collect::<Option<Vec<f64>>>()?;
    Some((squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt())
}

/// Standard deviation in time of the filter that these forces passed, s; `None` for other measurements.
pub(crate) fn filter_s(data: &Measurements) -> Option<f64> {
    let cut_off_hz = data.extra(CUT_OFF_HZ)?.first()?;
    Some(SIGMA_OF_PERIOD / cut_off_hz)
}

fn typical_step_s(data: &Measurements) -> f64 {
    let mut steps: Vec<f64> = (1..data.n_rows())
        .filter(|row| !data.starts_trial(*row))
        .map(|row| data.time_s[row] - data.time_s[row - 1])
        .collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().filter(|step| *step > 0.0).unwrap_or(1.0)
}

fn sections(data: &Measurements, step_s: f64) -> Vec<Section> {
    let n = data.n_rows();
    let breaks = |row: usize| data.starts_trial(row) || data.time_s[row] - data.time_s[row - 1] > GAP * step_s;
    let starts: Vec<usize> = (0..n).filter(|row| breaks(*row)).collect();
    let end = |k: usize| starts.get(k + 1).copied().unwrap_or(n);
    let section = |(k, &start): (usize, &usize)| Section { trial: data.trial[start], rows: start..end(k) };
    starts.iter().enumerate().map(section).collect()
}

/// A column on the even grid of a section, by straight lines between the rows that hold a number.
fn on_grid(data: &Measurements, section: &Section, step_s: f64, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let rows: Vec<usize> = section.rows.clone().filter(|row| value(*row).is_finite()).collect();
    let start_s = data.time_s[section.rows.start];
    let last_s = data.time_s[section.rows.end - 1];
    let n = ((last_s - start_s) / step_s).round() as usize + 1;
    let mut right = 0;
    (0..n)
        .map(|k| {
            let t = start_s + k as f64 * step_s;
            while right < rows.len() && data.time_s[rows[right]] < t {
                right += 1;
            }
            match (right.checked_sub(1).and_then(|left| rows.get(left)), rows.get(right)) {
                (Some(&a), Some(&b)) => {
                    let (from, to) = (data.time_s[a], data.time_s[b]);
                    if to - from > GAP * step_s {
                        return f64::NAN;
                    }
                    value(a) + (value(b) - value(a)) * (t - from) / (to - from)
                }
                (None, Some(&only)) | (Some(&only), None) => value(only),
                (None, None) => f64::NAN,
            }
        })
        .collect()
}

/// The Gaussian and its first two derivatives, in rows.
struct Kernels {
    reach: usize,
    smooth: Vec<f64>,
    slope: Vec<f64>,
    bend: Vec<f64>,
}

impl Kernels {
    fn new(sigma: f64) -> Self {
        let reach = (REACH * sigma).ceil() as usize;
        let at: Vec<f64> = (0..=2 * reach).map(|k| k as f64 - reach as f64).collect();
        let raw: Vec<f64> = at.iter().map(|x| (-0.5 * (x / sigma).powi(2)).exp()).collect();
        let total: f64 = raw.iter().sum();
        let smooth: Vec<f64> = raw.iter().map(|g| g / total).collect();
        // Exact on a straight line and on a parabola, whatever the kernel's end cuts off.
        let second: f64 = at.iter().zip(&smooth).map(|(x, g)| x * x * g).sum();
        let fourth: f64 = at.iter().zip(&smooth).map(|(x, g)| x.powi(4) * g).sum();
        let slope = at.iter().zip(&smooth).map(|(x, g)| x * g / second).collect();
        let scale = 2.0 / (fourth - second * second);
        let bend = at.iter().zip(&smooth).map(|(x, g)| (x * x - second) * g * scale).collect();
        Self { reach, smooth, slope, bend }
    }

    fn apply(&self, kernel: &[f64], values: &[f64], middle: usize) -> f64 {
        let from = middle - self.reach;
        kernel.iter().zip(&values[from..]).map(|(k, v)| k * v).sum()
    }
}

/// Sign of the speed in every row; zero where it is not known.
fn signs(q: &[f64], kernels: &Kernels) -> Vec<f64> {
    let mut speeds = vec![0.0; q.len()];
    let (low, high) = bounds(q.iter().copied().filter(|q| q.is_finite()));
    if high - low < LEAST_MOTION_RAD {
        return speeds;
    }
    let inner = kernels.reach..q.len().saturating_sub(kernels.reach);
    inner.for_each(|middle| speeds[middle] = kernels.apply(&kernels.slope, q, middle));
    let largest_of = |speeds: &[f64]| speeds.iter().fold(0.0, |most, speed| f64::max(most, speed.abs()));
    let rests_below = RESTS * largest_of(&speeds);
    let sign = |(row, speed): (usize, &f64)| {
        let near = row.saturating_sub(kernels.reach)..(row + kernels.reach + 1).min(speeds.len());
        let is_known = speed.abs() > rests_below && speed.abs() >= NEAR_ZERO * largest_of(&speeds[near]);
        if is_known { speed.signum() } else { 0.0 }
    };
    speeds.iter().enumerate().map(sign).collect()
}

/// The filter's standard deviation that the motion asks for, in rows: the fastest joint decides.
fn wanted_sigma(data: &Measurements, sections: &[Section], step_s: f64, sigma: f64) -> f64 {
    let kernels = Kernels::new(sigma);
    let n = data.n_inputs;
    let mut fastest = 0.0_f64;
    for joint in 0..n {
        let (mut slopes, mut bends) = (0.0, 0.0);
        for section in sections {
            let q = on_grid(data, section, step_s, |row| data.inputs[row * n + joint]);
            for middle in kernels.reach..q.len().saturating_sub(kernels.reach) {
                let (slope, bend) =
                    (kernels.apply(&kernels.slope, &q, middle), kernels.apply(&kernels.bend, &q, middle));
                if bend.is_finite() {
                    slopes += slope * slope;
                    bends += bend * bend;
                }
            }
        }
        if slopes > 0.0 {
            fastest = fastest.max((bends / slopes).sqrt() / core::f64::consts::TAU);
        }
    }
    if fastest > 0.0 { SIGMA_OF_PERIOD / (CUT_OFF * fastest) } else { sigma }
}

/// What comes out, row by row.
struct Filtered {
    n: usize,
    time_s: Vec<f64>,
    trial: Vec<u32>,
    angles: Vec<f64>,
    forces: Vec<f64>,
    /// Speeds, accelerations, directions and, where they were recorded, loads of each joint.
    extra: Vec<(String, Vec<f64>)>,
}

impl Filtered {
    fn new(n: usize, loads: &[Option<&[f64]>]) -> Self {
        let mut extra = Vec::new();
        for (joint, load) in loads.iter().enumerate() {
            for what in ["speed", "acceleration", "direction"].into_iter().chain(load.map(|_| "load")) {
                extra.push((column(what, joint), Vec::new()));
            }
        }
        Self { n, time_s: Vec::new(), trial: Vec::new(), angles: Vec::new(), forces: Vec::new(), extra }
    }

    fn add(
        &mut self,
        data: &Measurements,
        section: &Section,
        step_s: f64,
        kernels: &Kernels,
        stride: usize,
        loads: &[Option<&[f64]>],
    ) {
        let n = self.n;
        let start_s = data.time_s[section.rows.start];
        let mut columns = Vec::with_capacity(n);
        for (joint, load) in loads.iter().enumerate() {
            let q = on_grid(data, section, step_s, |row| data.inputs[row * n + joint]);
            let force = on_grid(data, section, step_s, |row| data.outputs[row * n + joint]);
            let load = load.map(|load| on_grid(data, section, step_s, |row| load[row]));
            let signs = signs(&q, kernels);
            columns.push((q, force, load, signs));
        }
        let n_grid = columns.first().map_or(0, |(q, ..)| q.len());
        for middle in (2 * kernels.reach..n_grid.saturating_sub(2 * kernels.reach)).step_by(stride) {
            let smooth = |values: &[f64]| kernels.apply(&kernels.smooth, values, middle);
            let angles: Vec<f64> = columns.iter().map(|(q, ..)| smooth(q)).collect();
            if angles.iter().any(|q| !q.is_finite()) {
                continue;
            }
            let directions: Vec<f64> = columns.iter().map(|(.., signs)| smooth(signs)).collect();
            let is_moving = |joint: usize| f64::abs(directions[joint]) >= ONE_SIGN;
            self.time_s.push(start_s + middle as f64 * step_s);
            self.trial.push(section.trial);
            self.angles.extend(&angles);
            let forces = columns.iter().enumerate();
            self.forces
                .extend(forces.map(|(joint, (_, force, ..))| if is_moving(joint) { smooth(force) } else { f64::NAN }));
            let mut own = Vec::with_capacity(self.extra.len());
            for ((q, _, load, _), direction) in columns.iter().zip(directions) {
                own.push(kernels.apply(&kernels.slope, q, middle) / step_s);
                own.push(kernels.apply(&kernels.bend, q, middle) / (step_s * step_s));
                own.push(direction);
                own.extend(load.as_deref().map(smooth));
            }
            self.extra.iter_mut().zip(own).for_each(|((_, values), value)| values.push(value));
        }
    }

    fn into_measurements(self, data: Measurements, cut_off_hz: f64, row_noise: &[f64], left: f64) -> Measurements {
        let n_rows = self.time_s.len();
        let mut extra = self.extra;
        extra.push((CUT_OFF_HZ.to_owned(), vec![cut_off_hz; n_rows]));
        for (joint, noise) in row_noise.iter().enumerate() {
            extra.push((column(ROW_NOISE, joint), vec![*noise; n_rows]));
            extra.push((column(FILTERED_NOISE, joint), vec![noise * left; n_rows]));
        }
        Measurements {
            time_s: self.time_s,
            inputs: self.angles,
            outputs: self.forces,
            trial: self.trial,
            loads_n: None,
            stem_angle_rad: None,
            temperature_c: None,
            sigma: None,
            extra,
            ..data
        }
    }
}

/// Name of the extra column that holds the filter's cut-off, Hz.
pub(crate) const CUT_OFF_HZ: &str = "force.cut_off_hz";
/// What the column holds that has the scatter of a joint's rows before the filter, in the forces' unit.
const ROW_NOISE: &str = "row_noise";
/// The same times what the filter leaves of it.
const FILTERED_NOISE: &str = "filtered_noise";
/// What the columns of a joint hold.
const COLUMNS: [&str; 6] = ["speed", "acceleration", "direction", "load", ROW_NOISE, FILTERED_NOISE];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sign_is_not_known_at_rest_nor_where_a_joint_may_have_turned_back_unseen() {
        let kernels = Kernels::new(4.0);
        let known = |q: &dyn Fn(f64) -> f64| {
            let q: Vec<f64> = (0..200).map(|k| q(f64::from(k) - 100.0)).collect();
            signs(&q, &kernels)
        };
        assert_eq!(known(&|_| 0.3), [0.0; 200]);
        // It goes, rests from row 100 on, and is never seen to turn.
        let stopping = known(&|t| t.min(0.0));
        assert_eq!((stopping[60], stopping[150]), (1.0, 0.0));
        // Speed t^2 - 4: back for four rows, which the filter does not see.
        let turning = known(&|t| t.powi(3) / 3.0 - 4.0 * t);
        assert_eq!((turning[60], turning[100], turning[140]), (1.0, 0.0, 1.0));
        // A slow joint moves as well as a fast one.
        assert!(known(&|t| 1e-4 * t)[20..180].iter().all(|sign| *sign == 1.0));
    }
}
