//! How well the snake followed: the measured shape against the setpoint of its instant of exposure.
//!
//! One window for every command: from [`SCORED_FROM_S`] after the first motion on. A pass that ends before has no score.

use crate::Spread;
use krait_ipc::message::{Phase, Setpoint, Shape};
use serde::Serialize;
use std::collections::VecDeque;

/// The score counts from this long after the operator's first motion: the estimator has seen a few reversals by then.
pub const SCORED_FROM_S: f64 = 10.0;
/// What is said in place of the score of a pass that has none.
pub const TOO_SHORT: &str = "too short: 10 s needed";
/// Below this bend the bending plane is too ill-defined for its error to mean anything, rad.
const PLANE_FROM_BEND_RAD: f64 = 15.0 * core::f64::consts::PI / 180.0;
/// Setpoints kept for pairing: a camera's latency is far below a second, ns.
const KEPT_NS: i64 = 1_000_000_000;

/// The score of a pass; every spread is absent (null) where there was less than [`SCORED_FROM_S`] of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TrackingScore {
    /// Length of the difference between the measured and the commanded bend vector, deg.
    pub error_deg: Option<Spread>,
    /// Difference of the bend angles alone, deg.
    pub bend_error_deg: Option<Spread>,
    /// Difference of the bending planes, where the bend is at least 15 deg, deg.
    pub plane_error_deg: Option<Spread>,
    /// Shapes that the score rests on.
    pub scored_shapes: usize,
    /// The score counts from this long after the operator's first motion, s.
    pub scored_from_s: f64,
}

/// Pairs shapes with setpoints as they come; from the first motion on, every pair counts.
#[derive(Clone, Debug, Default)]
pub struct Tracking {
    setpoints: VecDeque<(i64, [f64; 2])>,
    first_motion_ns: Option<i64>,
    errors: Vec<(i64, ShapeError)>,
}

/// A setpoint as far as tracking needs it: its instant, ns, its bend vector, rad, and whether it moves as an operator wants.
pub(crate) type Wanted = (i64, [f64; 2], bool);
/// A shape as far as tracking needs it: its instant of exposure, ns, and the measured bend vector, rad.
pub(crate) type Seen = (i64, [f64; 2]);

/// What is kept of a setpoint.
pub(crate) fn wanted(setpoint: &Setpoint) -> Wanted {
    (setpoint.sample_ns, setpoint.bend_rad, is_motion(setpoint))
}

/// Whether a setpoint moves as an operator wants. A hand that has taken hold and rests is no motion yet: a replay takes hold before it plays,
/// and its first motion is the recording's.
pub(crate) fn is_motion(setpoint: &Setpoint) -> bool {
    let mut rates = setpoint.bend_vel_rad_per_s.iter().chain(&setpoint.joints_vel_rad_per_s);
    // The bend of joints is NaN.
    setpoint.phase() == Some(Phase::Following) && rates.any(|rate| rate.abs() > 0.0)
}

impl Tracking {
    /// Pairs a whole pass; both in the order of their instants.
    pub(crate) fn of(setpoints: impl Iterator<Item = Wanted>, shapes: impl Iterator<Item = Seen>) -> Self {
        let mut tracking = Self::default();
        let mut setpoints = setpoints.peekable();
        for shape in shapes {
            while let Some(setpoint) = setpoints.next_if(|(ns, ..)| *ns <= shape.0) {
                tracking.want(setpoint);
            }
            tracking.see(shape);
        }
        for setpoint in setpoints {
            tracking.want(setpoint);
        }
        tracking
    }

    /// Takes a setpoint; they come in order.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        self.want(wanted(setpoint));
    }

    /// Takes a shape, after the setpoints of its instant of exposure.
    pub fn shape(&mut self, shape: &Shape) {
        if let Some(bend_rad) = shape.valid_bend_rad() {
            self.see((shape.sample_ns, bend_rad));
        }
    }

    fn want(&mut self, (sample_ns, bend_rad, is_motion): Wanted) {
        if is_motion {
            self.first_motion_ns.get_or_insert(sample_ns);
        }
        self.setpoints.push_back((sample_ns, bend_rad));
        while self.setpoints.front().is_some_and(|(ns, _)| *ns < sample_ns.saturating_sub(KEPT_NS)) {
            self.setpoints.pop_front();
        }
    }

    fn see(&mut self, (sample_ns, measured): Seen) {
        let is_seen = measured.iter().all(|bend| bend.is_finite());
        if !is_seen || self.first_motion_ns.is_none_or(|first_ns| sample_ns < first_ns) {
            return;
        }
        let after = self.setpoints.partition_point(|(ns, _)| *ns <= sample_ns);
        if let Some((_, commanded)) = after.checked_sub(1).and_then(|idx| self.setpoints.get(idx)) {
            self.errors.push((sample_ns, ShapeError::between(measured, *commanded)));
        }
    }

    /// Instant of the first setpoint that moves as an operator wants, ns.
    pub fn first_motion_ns(&self) -> Option<i64> {
        self.first_motion_ns
    }

    /// Instant of exposure, ns, and length of the difference of the bend vectors, rad, of every pair since the first motion.
    pub fn errors(&self) -> impl Iterator<Item = (i64, f64)> {
        self.errors.iter().map(|(ns, error)| (*ns, error.vector_rad))
    }

    /// The score of what has come so far.
    pub fn score(&self) -> TrackingScore {
        let from_ns = self.first_motion_ns.map(|first_ns| first_ns.saturating_add((SCORED_FROM_S * 1e9) as i64));
        let scored: Vec<&ShapeError> = self
            .errors
            .iter()
            .filter(|(ns, _)| from_ns.is_some_and(|from_ns| *ns >= from_ns))
            .map(|(_, e)| e)
            .collect();
        let spread = |pick: fn(&ShapeError) -> Option<f64>| {
            Spread::of_any(scored.iter().filter_map(|error| pick(error)).map(f64::to_degrees))
        };
        TrackingScore {
            error_deg: spread(|e| Some(e.vector_rad)),
            bend_error_deg: spread(|e| Some(e.bend_rad)),
            plane_error_deg: spread(|e| e.plane_rad),
            scored_shapes: scored.len(),
            scored_from_s: SCORED_FROM_S,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct ShapeError {
    vector_rad: f64,
    bend_rad: f64,
    plane_rad: Option<f64>,
}

impl ShapeError {
    fn between(measured: [f64; 2], commanded: [f64; 2]) -> Self {
        let [mx, my] = measured;
        let [cx, cy] = commanded;
        let plane_rad =
            (length(commanded) >= PLANE_FROM_BEND_RAD).then(|| (cx * my - cy * mx).atan2(cx * mx + cy * my));
        Self { vector_rad: length([mx - cx, my - cy]), bend_rad: length(measured) - length(commanded), plane_rad }
    }
}

pub(crate) fn length(bend: [f64; 2]) -> f64 {
    bend[0].hypot(bend[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn the_error_is_the_length_of_the_difference_of_the_bend_vectors() {
        let error = ShapeError::between([0.0, 0.5], [0.5, 0.0]);
        assert!((error.vector_rad - 0.5f64.hypot(0.5)).abs() < 1e-15);
        assert_eq!(error.bend_rad, 0.0);
        assert!((error.plane_rad.expect("far from straight") - core::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!(ShapeError::between([0.1, 0.0], [0.1, 0.1]).plane_rad.is_none(), "too straight to have a plane");
    }

    #[test]
    fn the_score_begins_ten_seconds_after_the_first_motion_and_a_shorter_pass_has_none() {
        let pass = |seconds: i64| {
            // Standing for 3 s, then moving; the error is 0.2 rad in the first 10 s of motion and 0.1 rad afterwards.
            let setpoints = (0..seconds * 1000).map(|ms| (ms * S / 1000, [0.3, 0.0], ms >= 3000));
            let shapes = (0..seconds * 50).map(|k| (k * S / 50, [if k < 13 * 50 { 0.5 } else { 0.4 }, 0.0]));
            Tracking::of(setpoints, shapes)
        };
        assert_eq!(pass(20).first_motion_ns(), Some(3 * S));
        let score = pass(20).score();
        let error = score.error_deg.expect("17 s of motion");
        assert_eq!((error.n, score.scored_shapes), (7 * 50, 7 * 50));
        assert!((error.rms - 0.1_f64.to_degrees()).abs() < 1e-9 && (error.max - error.rms).abs() < 1e-9, "{error:?}");
        let short = pass(12).score();
        assert_eq!((short.error_deg, short.bend_error_deg, short.plane_error_deg), (None, None, None));
        assert!(TOO_SHORT.contains(&format!("{SCORED_FROM_S:.0} s")));
    }

    #[test]
    fn a_hand_that_has_taken_hold_and_rests_is_no_motion() {
        let resting = Setpoint {
            sequence: 1,
            sample_ns: S,
            input_sequence: 1,
            state_sequence: 1,
            bend_rad: [0.3, 0.0],
            motion_scale: 1.0,
            phase: Phase::Following as u32,
            ..Setpoint::default()
        };
        let mut joints = Setpoint { bend_vel_rad_per_s: [f64::NAN; 2], ..resting };
        assert!(!is_motion(&resting) && !is_motion(&joints));
        joints.joints_vel_rad_per_s[1] = -1e-3;
        let bending = Setpoint { bend_vel_rad_per_s: [0.0, 1e-3], ..resting };
        assert!(is_motion(&joints) && is_motion(&bending));
        assert!(!is_motion(&Setpoint { phase: Phase::Holding as u32, ..bending }), "what comes to rest");
    }

    #[test]
    fn shapes_as_they_come_and_a_whole_pass_give_the_same_score() {
        let setpoints: Vec<Wanted> = (0..20_000).map(|ms| (ms * S / 1000, [1e-5 * ms as f64, 0.0], true)).collect();
        let shapes: Vec<Seen> = (0..1200).map(|k| (k * S / 60, [0.2, 1e-4 * k as f64])).collect();
        let whole = Tracking::of(setpoints.iter().copied(), shapes.iter().copied()).score();
        let mut live = Tracking::default();
        let mut shapes = shapes.into_iter().peekable();
        for setpoint in setpoints {
            live.want(setpoint);
            // A camera's latency of 30 ms.
            while let Some(shape) = shapes.next_if(|(ns, _)| ns + 30_000_000 <= setpoint.0) {
                live.see(shape);
            }
        }
        shapes.for_each(|shape| live.see(shape));
        assert_eq!(live.score(), whole);
    }
}
