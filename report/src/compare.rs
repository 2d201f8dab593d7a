//! Two recordings side by side: how well the snake followed, how long samples were under way, what states and faults there were.
//!
//! Both are laid on top of each other at the first setpoint that follows the operator; a recording without one at its first
//! setpoint. Samples that are nearest in time are compared.

use crate::joint_tracking::{JointScore, JointTracking, Lanes};
use crate::tracking::{self, Tracking, TrackingScore};
use crate::{LatencyLog, PeakBend, Quantiles, Spread};
use krait_ipc::message::{Actuators, JointValues, MAX_JOINTS, Marker, OperatingState, Shape, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_record::Pass;
use serde::Serialize;
use std::collections::BTreeMap;

/// Why a pass cannot be summed up.
#[derive(Debug, thiserror::Error)]
pub enum SideError {
    /// It holds no setpoint.
    #[error("it holds no setpoint, so there is nothing to compare; choose another pass or recording")]
    NoSetpoint,
    /// The histogram library refused its bounds, which are constants.
    #[error(transparent)]
    Histogram(#[from] hdrhistogram::CreationError),
}

/// What one pass of a recording shows.
#[derive(Clone, Debug, Serialize)]
pub struct Side {
    /// Samples of each channel.
    pub samples: BTreeMap<&'static str, usize>,
    /// From the first setpoint to the last, s.
    pub length_s: f64,
    /// Length of the difference between the measured and the commanded bend vector, deg; the window of [`TrackingScore`].
    pub tracking_error_deg: Option<Spread>,
    /// Largest bend commanded and measured; null for joints and segments, whose score has each one's.
    pub peak_bend_deg: Option<PeakBend>,
    /// The score of joints or segments, in their own unit; null for a snake.
    pub joints: Option<JointScore>,
    /// The score of a snake's gripper, as one joint; null without one.
    pub jaw: Option<JointScore>,
    #[serde(skip)]
    lanes: Option<Lanes>,
    /// Marks of the operator, in their order.
    pub marks: Vec<Mark>,
    /// The score counts from this long after the operator's first motion, s.
    pub scored_from_s: f64,
    /// Latency of each hop, microseconds; none where the replay's own time passed, in which nothing takes any.
    pub latency_us: BTreeMap<String, Quantiles>,
    /// Time in each operating state, s.
    pub operating_s: BTreeMap<&'static str, f64>,
    /// Time in which the slave followed, s.
    pub following_s: f64,
    /// How often the slave fell into FAULT.
    pub n_faults: u64,
    /// Commands that the slave refused.
    pub n_refused: u64,
    /// Slave states that named each reason, in the reason's own words.
    pub reasons: BTreeMap<&'static str, u64>,
    /// For pictures, each over the time since the first motion, s.
    #[serde(skip)]
    pub series: Series,
}

/// A word of the operator's about an instant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// Time since the first motion, s.
    pub at_s: f64,
    /// What was written.
    pub text: String,
}

/// Curves over time since the first motion, s.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Tracking error, deg; of joints that of the worst, deg or mm.
    pub error: Vec<(f64, f64)>,
    /// Bend of a snake's setpoint, deg.
    pub bend_deg: Vec<(f64, f64)>,
    /// Bend that was measured, deg.
    pub measured_deg: Vec<(f64, f64)>,
    /// Device to drive, microseconds.
    pub latency_us: Vec<(f64, f64)>,
    setpoints: Vec<(f64, [f64; 2])>,
    shapes: Vec<(f64, [f64; 2])>,
    joints: Vec<(f64, JointValues)>,
    measured_joints: Vec<(f64, JointValues)>,
    commands: Vec<(f64, Actuators)>,
}

/// How far two recordings are apart at the same time since the first motion.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Apart {
    /// Bend vectors of the setpoints, deg; null unless both are of snakes.
    pub setpoint_deg: Option<Spread>,
    /// Setpoints of joints, the largest difference of each instant, in the unit of the joints' score; null unless both are of
    /// joints that turn, both of joints that slide, or both of segments (then the largest length of a bend vector's).
    pub setpoint_joints: Option<Spread>,
    /// Measured bend vectors, deg; null unless both are of snakes that were seen at the same time.
    pub shape_deg: Option<Spread>,
    /// Measured joints, likewise in the unit of the joints' score.
    pub shape_joints: Option<Spread>,
    /// Actuator commands, the largest difference of each instant, mm.
    pub command_mm: Spread,
}

impl Side {
    /// Sums up a pass; `lanes` says of a machine that is no snake what it is.
    ///
    /// # Errors
    /// [`SideError`].
    pub fn of(pass: &Pass, lanes: Option<Lanes>) -> Result<Self, SideError> {
        let ends = pass.setpoints.first().zip(pass.setpoints.last());
        let Some((first, last)) = ends else { return Err(SideError::NoSetpoint) };
        let tracking = tracking_of(pass);
        let joints = joints_of(pass);
        let first_motion_ns = if lanes.is_some() { joints.first_motion_ns() } else { tracking.first_motion_ns() };
        let zero_ns = first_motion_ns.unwrap_or(first.sample_ns);
        let score: TrackingScore = tracking.score();
        let state = StateSums::of(&pass.states);
        let series = Series::of(pass, zero_ns, &tracking, lanes.map(|lanes| (&joints, lanes)));
        let mark = |mark: &Marker| Mark {
            at_s: seconds(zero_ns, mark.sample_ns),
            text: mark.text().unwrap_or("(no text)").to_owned(),
        };
        Ok(Self {
            samples: BTreeMap::from([
                ("input", pass.inputs.len()),
                ("setpoint", pass.setpoints.len()),
                ("command", pass.commands.len()),
                ("state", pass.states.len()),
                ("shape", pass.shapes.len()),
                ("model_update", pass.updates.len()),
            ]),
            length_s: seconds(first.sample_ns, last.sample_ns),
            tracking_error_deg: score.error_deg,
            peak_bend_deg: lanes.is_none().then(|| series.peak_bend_deg()),
            joints: lanes.and_then(|lanes| joints.score(lanes)),
            jaw: jaw_of(pass).score(Lanes::Turning),
            lanes,
            marks: pass.marks.iter().map(mark).collect(),
            scored_from_s: score.scored_from_s,
            latency_us: latencies(&pass.states)?,
            operating_s: state.operating_s,
            following_s: state.following_s,
            n_faults: state.n_faults,
            n_refused: pass.states.last().map_or(0, |state| state.n_refused),
            reasons: state.reasons,
            series,
        })
    }
}

impl Apart {
    /// Lays two sides on top of each other; instants that only one of them has do not count.
    pub fn of(a: &Side, b: &Side) -> Self {
        let deg = |x: &[f64; 2], y: &[f64; 2]| (x[0] - y[0]).hypot(x[1] - y[1]).to_degrees();
        let mm = |x: &Actuators, y: &Actuators| largest(x, y) * 1e3;
        let both_snakes = a.joints.is_none() && b.joints.is_none();
        let lanes = a.lanes.filter(|_| a.lanes == b.lanes);
        let between = |lanes: Lanes, x: &JointValues, y: &JointValues| {
            let differences = lanes.each_of(&core::array::from_fn(|k| x[k] - y[k]));
            largest(&differences, &[0.0; MAX_JOINTS]) * lanes.unit().1
        };
        let joints = |lanes| Spread::of(apart(&a.series.joints, &b.series.joints, |x, y| between(lanes, x, y)));
        let (measured_a, measured_b) = (&a.series.measured_joints, &b.series.measured_joints);
        let measured = |lanes| Spread::of_any(apart(measured_a, measured_b, |x, y| between(lanes, x, y)));
        let shapes = || Spread::of_any(apart(&a.series.shapes, &b.series.shapes, deg));
        Self {
            setpoint_deg: both_snakes.then(|| Spread::of(apart(&a.series.setpoints, &b.series.setpoints, deg))),
            setpoint_joints: lanes.map(joints),
            shape_deg: both_snakes.then(shapes).flatten(),
            shape_joints: lanes.and_then(measured),
            command_mm: Spread::of(apart(&a.series.commands, &b.series.commands, mm)),
        }
    }
}

/// The largest difference between values of the same place.
fn largest<const N: usize>(x: &[f64; N], y: &[f64; N]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

impl Series {
    fn of(pass: &Pass, zero_ns: i64, tracking: &Tracking, joints: Option<(&JointTracking, Lanes)>) -> Self {
        let at = |ns: i64| seconds(zero_ns, ns);
        let (mut latency_us, mut newest) = (Vec::new(), 0);
        for state in &pass.states {
            let (from_ns, to_ns) = (state.stamps.device_ns, state.stamps.drive_written_ns);
            if state.command_sequence > newest && from_ns > 0 && to_ns > from_ns {
                newest = state.command_sequence;
                latency_us.push((at(to_ns), seconds(from_ns, to_ns) * 1e6));
            }
        }
        let commands = pass.commands.iter().map(|c| (at(c.sample_ns), c.q_tilde_m)).collect();
        let seen = |shape: &Shape| Some((at(shape.sample_ns), shape.valid_bend_rad()?));
        let Some((joints, lanes)) = joints else {
            let length_deg = |bend_rad: [f64; 2]| bend_rad[0].hypot(bend_rad[1]).to_degrees();
            let shapes: Vec<(f64, [f64; 2])> = pass.shapes.iter().filter_map(seen).collect();
            return Self {
                error: tracking.errors().map(|(ns, rad)| (at(ns), rad.to_degrees())).collect(),
                bend_deg: pass.setpoints.iter().map(|s| (at(s.sample_ns), length_deg(s.bend_rad))).collect(),
                measured_deg: shapes.iter().map(|(at_s, bend_rad)| (*at_s, length_deg(*bend_rad))).collect(),
                latency_us,
                setpoints: pass.setpoints.iter().map(|s| (at(s.sample_ns), s.bend_rad)).collect(),
                shapes,
                commands,
                ..Self::default()
            };
        };
        let (_, per_si) = lanes.unit();
        let worst = |errors: &JointValues| {
            lanes.each_of(errors).iter().fold(0.0_f64, |most, error| most.max(error.abs())) * per_si
        };
        Self {
            error: joints.errors().map(|(ns, errors)| (at(ns), worst(&errors))).collect(),
            latency_us,
            joints: pass.setpoints.iter().map(|s| (at(s.sample_ns), s.joints_rad)).collect(),
            measured_joints: joints.measured().map(|(ns, joints)| (at(ns), joints)).collect(),
            commands,
            ..Self::default()
        }
    }
}

impl Series {
    fn peak_bend_deg(&self) -> PeakBend {
        let peak = |curve: &[(f64, f64)]| curve.iter().map(|(_, deg)| *deg).fold(0.0, f64::max);
        PeakBend {
            commanded: peak(&self.bend_deg),
            reached: (!self.measured_deg.is_empty()).then(|| peak(&self.measured_deg)),
        }
    }
}

/// Setpoints and measurements of joints; none of a snake.
fn joints_of(pass: &Pass) -> JointTracking {
    let mut joints = JointTracking::default();
    pass.setpoints.iter().filter(|setpoint| setpoint.n_joints > 0).for_each(|setpoint| joints.setpoint(setpoint));
    pass.shapes.iter().for_each(|shape| joints.shape(shape));
    joints
}

/// The same of a snake's gripper.
fn jaw_of(pass: &Pass) -> JointTracking {
    let mut jaw = JointTracking::default();
    pass.setpoints.iter().for_each(|setpoint| jaw.jaw_setpoint(setpoint));
    pass.shapes.iter().for_each(|shape| jaw.jaw_shape(shape));
    jaw
}

/// Setpoints and shapes in the order of their instants.
fn tracking_of(pass: &Pass) -> Tracking {
    let shapes = pass.shapes.iter().map(|shape| (shape.sample_ns, shape.bend_rad));
    Tracking::of(pass.setpoints.iter().map(tracking::wanted), shapes)
}

fn latencies(states: &[SlaveState]) -> Result<BTreeMap<String, Quantiles>, SideError> {
    let mut log = LatencyLog::new()?;
    for state in states {
        log.state(state);
    }
    if log.n_samples() == 0 {
        return Ok(BTreeMap::new());
    }
    let report = log.report();
    let hops = report.hops.iter().map(|hop| (format!("{} -> {}", hop.from, hop.to), hop.quantiles));
    Ok(hops.chain([("device -> drive".to_owned(), report.end_to_end)]).collect())
}

#[derive(Default)]
struct StateSums {
    operating_s: BTreeMap<&'static str, f64>,
    following_s: f64,
    n_faults: u64,
    reasons: BTreeMap<&'static str, u64>,
}

impl StateSums {
    fn of(states: &[SlaveState]) -> Self {
        let mut sums = Self::default();
        for pair in states.windows(2) {
            let time_s = seconds(pair[0].sample_ns, pair[1].sample_ns).max(0.0);
            let name = pair[0].operating().map_or("unknown", OperatingState::name);
            *sums.operating_s.entry(name).or_default() += time_s;
            if pair[0].flags & SlaveState::FOLLOWING != 0 {
                sums.following_s += time_s;
            }
            let is_fault = |state: &SlaveState| state.operating() == Some(OperatingState::Fault);
            sums.n_faults += u64::from(is_fault(&pair[1]) && !is_fault(&pair[0]));
        }
        for state in states {
            for reason in Reasons::from_bits(state.reasons).iter() {
                *sums.reasons.entry(Reason::sentence(reason)).or_default() += 1;
            }
        }
        sums
    }
}

/// The distance of each sample of `a` from the sample of `b` that is nearest in time, where both have one.
fn apart<T>(a: &[(f64, T)], b: &[(f64, T)], distance: impl Fn(&T, &T) -> f64) -> Vec<f64> {
    let Some((first_s, last_s)) = b.first().zip(b.last()).map(|((first, _), (last, _))| (*first, *last)) else {
        return Vec::new();
    };
    // Half a period of patience: two clocks never tick at the same instant.
    let both_s = first_s - 0.5e-3..=last_s + 0.5e-3;
    let mut found = Vec::with_capacity(a.len());
    for (time_s, value) in a.iter().filter(|(time_s, _)| both_s.contains(time_s)) {
        let after = b.partition_point(|(s, _)| s < time_s);
        let candidates = &b[after.saturating_sub(1)..(after + 1).min(b.len())];
        let nearest = candidates.iter().min_by(|(x, _), (y, _)| (x - time_s).abs().total_cmp(&(y - time_s).abs()));
        found.extend(nearest.map(|(_, other)| distance(value, other)));
    }
    found
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_instants_that_both_have_are_compared() {
        let a: Vec<(f64, f64)> = (0..10).map(|k| (f64::from(k) * 1e-3, 1.0)).collect();
        let b: Vec<(f64, f64)> = (5..20).map(|k| (f64::from(k) * 1e-3 + 1e-4, 3.0)).collect();
        let found = apart(&a, &b, |x, y| (x - y).abs());
        assert_eq!(found, vec![2.0; 5]);
        assert!(apart(&a, &[], |x: &f64, y| x - y).is_empty());
    }
}
