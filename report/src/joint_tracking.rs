//! How well joints or segments followed: each measured position or bend against the setpoint of its instant, in its own unit.
//!
//! The window is that of a snake's score: from [`SCORED_FROM_S`] after the first motion on.

use crate::tracking::is_motion;
use crate::{SCORED_FROM_S, Spread, Tracking};
use krait_ipc::message::{JointValues, MAX_JOINTS, Setpoint, Shape};
use serde::Serialize;

/// What stands in the places of a message that carry joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    /// Joints that turn.
    Turning,
    /// Joints that slide: their positions are lengths.
    Sliding,
    /// Segments in series: two places each, its bend vector.
    Segments,
}

impl Lanes {
    /// Of joints, by whether they slide.
    pub fn of_joints(slides: bool) -> Self {
        if slides { Self::Sliding } else { Self::Turning }
    }

    /// The unit in which they are shown, and how many of it are one of SI.
    pub fn unit(self) -> (&'static str, f64) {
        joint_unit(self == Self::Sliding)
    }

    /// What one of them is called.
    pub fn each(self) -> &'static str {
        if self == Self::Segments { "segment" } else { "joint" }
    }

    /// How many there are in so many places.
    pub fn count(self, n_places: usize) -> usize {
        if self == Self::Segments { n_places / 2 } else { n_places }
    }

    /// One number for each: a joint's own, or the length of a segment's vector; zeros behind the last.
    pub fn each_of(self, values: &JointValues) -> JointValues {
        match self {
            Self::Turning | Self::Sliding => *values,
            Self::Segments => core::array::from_fn(|k| match values.get(2 * k..2 * k + 2) {
                Some([x, y]) => x.hypot(*y),
                _ => 0.0,
            }),
        }
    }
}

/// The score of joints or segments in one pass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointScore {
    /// Unit of every number here: `deg`, or `mm` where the joints slide.
    pub unit: &'static str,
    /// What each entry of `joints` is: `joint` or `segment`.
    pub each: &'static str,
    /// Measured less commanded position over all joints, or length of the difference of the bend vectors over all segments; null where
    /// there was too little motion.
    pub error: Option<Spread>,
    /// The same for each joint or segment, with how far it went.
    pub joints: Vec<JointFigure>,
    /// Measurements that the score rests on.
    pub scored_shapes: usize,
}

/// What one joint or segment did; of a segment distances are bends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JointFigure {
    /// Measured less commanded position.
    pub error: Option<Spread>,
    /// Largest commanded distance from zero over the whole pass.
    pub peak_commanded: f64,
    /// Largest measured one.
    pub peak_reached: f64,
}

/// The unit in which joints are shown, and how many of it are one of SI: mm where they slide, degrees where they turn.
pub fn joint_unit(slides: bool) -> (&'static str, f64) {
    if slides { ("mm", 1e3) } else { ("deg", 1f64.to_degrees()) }
}

/// How well a machine followed, whichever it is.
#[derive(Clone, Debug, Default)]
pub struct Tracked {
    /// A snake's bend vector.
    pub bend: Tracking,
    joints: JointTracking,
}

impl Tracked {
    /// Takes a setpoint; they come in order.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        if setpoint.n_joints == 0 {
            self.bend.setpoint(setpoint);
        } else {
            self.joints.setpoint(setpoint);
        }
    }

    /// Takes a shape, after the setpoints of its instant of exposure.
    pub fn shape(&mut self, shape: &Shape) {
        self.bend.shape(shape);
        self.joints.shape(shape);
    }

    /// The score of joints or segments; none for a snake.
    pub fn joints(&self, lanes: Lanes) -> Option<JointScore> {
        self.joints.score(lanes)
    }
}

/// Setpoints and measurements of joints, in the order of their instants.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointTracking {
    setpoints: Vec<(i64, JointValues)>,
    measured: Vec<(i64, JointValues)>,
    first_motion_ns: Option<i64>,
    n: usize,
}

impl JointTracking {
    /// Takes a setpoint of joints.
    pub(crate) fn setpoint(&mut self, setpoint: &Setpoint) {
        self.n = (setpoint.n_joints as usize).min(MAX_JOINTS);
        self.setpoints.push((setpoint.sample_ns, setpoint.joints_rad));
        if is_motion(setpoint) {
            self.first_motion_ns.get_or_insert(setpoint.sample_ns);
        }
    }

    /// Takes where the jaw of a snake's gripper shall be, as one joint.
    pub(crate) fn jaw_setpoint(&mut self, setpoint: &Setpoint) {
        if let Some(jaw_rad) = setpoint.jaw_rad() {
            self.setpoint(&Setpoint { n_joints: 1, joints_rad: one(jaw_rad), ..*setpoint });
        }
    }

    /// Takes a measurement of the jaw, if it is one.
    pub(crate) fn jaw_shape(&mut self, shape: &Shape) {
        self.measured.extend(shape.valid_jaw_rad().map(|jaw_rad| (shape.sample_ns, one(jaw_rad))));
    }

    /// When the first setpoint moved as an operator wanted, ns.
    pub(crate) fn first_motion_ns(&self) -> Option<i64> {
        self.first_motion_ns
    }

    /// Takes a measurement, if it is one of joints.
    pub(crate) fn shape(&mut self, shape: &Shape) {
        if shape.valid_joints_rad().is_some() {
            self.measured.push((shape.sample_ns, shape.joints_rad));
        }
    }

    /// Every measurement, rad (m of a sliding joint).
    pub(crate) fn measured(&self) -> impl Iterator<Item = (i64, JointValues)> {
        self.measured.iter().copied()
    }

    /// Every measurement with its errors against the setpoint of its instant, rad (m of a sliding joint).
    pub(crate) fn errors(&self) -> impl Iterator<Item = (i64, JointValues)> {
        self.measured.iter().filter_map(|(ns, measured)| {
            let after = self.setpoints.partition_point(|(at_ns, _)| at_ns <= ns);
            let (_, wanted) = self.setpoints.get(after.checked_sub(1)?)?;
            Some((*ns, core::array::from_fn(|k| measured[k] - wanted[k])))
        })
    }

    /// The score; none where there were no joints and no segments.
    pub(crate) fn score(&self, lanes: Lanes) -> Option<JointScore> {
        if self.n == 0 {
            return None;
        }
        let (unit, per_si) = lanes.unit();
        let n = lanes.count(self.n);
        let from_ns = self.first_motion_ns.map(|first_ns| first_ns.saturating_add((SCORED_FROM_S * 1e9) as i64));
        let is_scored = |ns: i64| from_ns.is_some_and(|from_ns| ns >= from_ns);
        let scored: Vec<JointValues> = self
            .errors()
            .filter(|(ns, _)| is_scored(*ns))
            .map(|(_, errors)| lanes.each_of(&errors).map(|error| error * per_si))
            .collect();
        let peak = |all: &[(i64, JointValues)], k: usize| {
            all.iter().map(|(_, joints)| lanes.each_of(joints)[k].abs()).fold(0.0, f64::max) * per_si
        };
        let joint = |k: usize| JointFigure {
            error: Spread::of_any(scored.iter().map(|errors| errors[k])),
            peak_commanded: peak(&self.setpoints, k),
            peak_reached: peak(&self.measured, k),
        };
        Some(JointScore {
            unit,
            each: lanes.each(),
            error: Spread::of_any(scored.iter().flat_map(|errors| errors.iter().copied().take(n))),
            joints: (0..n).map(joint).collect(),
            scored_shapes: scored.len(),
        })
    }
}

/// The values of one joint.
fn one(value: f64) -> JointValues {
    let mut values = [0.0; MAX_JOINTS];
    values[0] = value;
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sliding_joints_are_scored_in_mm_and_turning_ones_in_degrees_each_by_itself() {
        let mut log = JointTracking::default();
        let s = 1_000_000_000_i64;
        let mut joints_rad = [0.0; MAX_JOINTS];
        (joints_rad[0], joints_rad[1]) = (1e-3, -2e-3);
        for ms in 0..15_000_i64 {
            log.setpoints.push((ms * s / 1000, joints_rad));
        }
        (log.n, log.first_motion_ns) = (2, Some(0));
        for k in 0..15 * 60_i64 {
            log.shape(&Shape::of_joints(k as u64 + 1, k * s / 60, k * s / 60, &[1.5e-3, -2e-3]));
        }
        let slides = log.score(Lanes::Sliding).expect("two joints");
        assert_eq!((slides.unit, slides.scored_shapes, slides.joints.len()), ("mm", 300, 2));
        let error = slides.joints[0].error.expect("5 s");
        assert!((error.rms - 0.5).abs() < 1e-9 && slides.joints[1].error.expect("5 s").rms < 1e-12, "{slides:?}");
        assert!((slides.joints[1].peak_commanded - 2.0).abs() < 1e-12);
        let turns = log.score(Lanes::Turning).expect("two joints");
        assert_eq!(turns.unit, "deg");
        assert!((turns.joints[0].error.expect("5 s").rms - 0.5e-3_f64.to_degrees()).abs() < 1e-9);
        assert!(JointTracking::default().score(Lanes::Turning).is_none());
        let segment = log.score(Lanes::Segments).expect("one segment");
        assert_eq!((segment.each, segment.joints.len()), ("segment", 1));
        let bend_deg = 1e-3_f64.hypot(2e-3).to_degrees();
        assert!((segment.joints[0].peak_commanded - bend_deg).abs() < 1e-12, "{segment:?}");
    }
}
