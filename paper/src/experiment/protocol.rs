//! What an experiment does: poses in their order, how each is approached, and from which side the play is taken up.

use crate::bench::bend_rad;
use anyhow::{Context, bail, ensure};
use core::fmt;
use core::ops::RangeInclusive;
use krait_ipc::input;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Spacing of the places on the way, deg of the bend vector.
const WAY_DEG: f64 = 0.5;
/// What a pose may bend, deg: below it nothing is measured that noise does not hide, above it the model does not hold.
const BEND_DEG: RangeInclusive<f64> = 1.0..=90.0;
/// Largest bend of Fig. 12 that the default stroke and loads allow with compensation, deg.
const LISTED_DEG: f64 = 80.0;
const MOST_POSES: usize = 2000;
/// Longest list of poses that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;
/// Bends and planes of the motion before the first pose from which a model learns, deg.
const LEARNING_BEND_DEG: f64 = 45.0;
const LEARNING_PLANES_DEG: [f64; 3] = [0.0, 60.0, 120.0];

/// Which figure of the paper is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FigureKind {
    /// Bends in the plane delta = 0, up and back.
    Fig10,
    /// One bend in every plane.
    Fig11,
    /// Single poses, Fig. 12.
    Poses,
}

/// From which side the play of the lines is taken up whenever the snake sets out from straight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ApproachSide {
    /// The snake bends the other way first and comes up through straight: every line already moves as it will.
    Below,
    /// It bends this way first and comes back: every line turns round at straight.
    Above,
    /// It sets out from where homing left it.
    None,
}

/// A part of an experiment that is judged by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// Larger and larger bends.
    Up,
    /// Smaller and smaller ones.
    Back,
    /// The plane turns at one bend.
    Turn,
    /// Each plane is bent from straight.
    FromStraight,
    /// Single poses, each from straight.
    Pose,
}

impl Part {
    /// Every part, in the order in which they are shown.
    pub const ALL: [Self; 5] = [Self::Up, Self::Back, Self::Turn, Self::FromStraight, Self::Pose];

    /// The word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Back => "back",
            Self::Turn => "turning",
            Self::FromStraight => "from straight",
            Self::Pose => "poses",
        }
    }
}

impl fmt::Display for ApproachSide {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Below => "below",
            Self::Above => "above",
            Self::None => "none",
        })
    }
}

/// One pose that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WantedPose {
    /// What it belongs to, which says how it is approached.
    pub part: Part,
    /// Its bend, deg.
    pub bend_deg: f64,
    /// Its plane, deg.
    pub delta_deg: f64,
}

/// An experiment before it is run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// What is measured.
    pub figure: FigureKind,
    /// From which side the play is taken up.
    pub side: ApproachSide,
    /// Bend by which it is, deg.
    pub take_up_deg: f64,
    /// How often a model that learns is led through the planes to learn from, before the first pose.
    pub n_learning_rounds: u32,
    /// The poses, numbered from 1 in this order.
    pub poses: Vec<WantedPose>,
}

/// What comes before the poses.
#[derive(Clone, Copy, Debug)]
pub struct Before {
    /// See [`Protocol::side`].
    pub side: ApproachSide,
    /// See [`Protocol::take_up_deg`].
    pub take_up_deg: f64,
    /// See [`Protocol::n_learning_rounds`].
    pub n_learning_rounds: u32,
}

/// A way to a stop, as bend vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// The pose that is measured at its end, from 1; 0: none is.
    pub pose: u32,
    /// The places on the way, rad, the end last; never empty.
    pub bends_rad: Vec<Vector2<f64>>,
}

impl Protocol {
    /// Bends up to `to_deg` in equal steps in the plane delta = 0, and the same without the last on the way back.
    pub fn fig_10(step_deg: f64, to_deg: f64, before: Before) -> anyhow::Result<Self> {
        ensure!(
            BEND_DEG.contains(&to_deg) && (0.5..=to_deg).contains(&step_deg),
            "the largest bend is {to_deg} deg and the step {step_deg} deg, expected at most 90 deg and a step of 0.5 deg up to that; correct --to or --step"
        );
        let n = (to_deg / step_deg).round().max(1.0) as u32;
        let pose = |part, k: u32| WantedPose { part, bend_deg: to_deg * f64::from(k) / f64::from(n), delta_deg: 0.0 };
        let up = (1..=n).map(|k| pose(Part::Up, k));
        let poses: Vec<_> = up.chain((1..n).rev().map(|k| pose(Part::Back, k))).collect();
        Self::after(before, FigureKind::Fig10, poses).checked()
    }

    /// One bend in every plane: turning without a return, each plane from straight, or first the one and then the other.
    pub fn fig_11(bend_deg: f64, parts: &[Part], step_deg: f64, before: Before) -> anyhow::Result<Self> {
        ensure!(
            (1.0..=180.0).contains(&step_deg),
            "the step of the plane is {step_deg} deg, expected 1 to 180; correct --step"
        );
        let n = (360.0 / step_deg).round() as u32;
        let mut poses = Vec::new();
        for part in parts {
            let planes = if *part == Part::Turn { 1..=n } else { 0..=n - 1 };
            let delta_deg = |k: u32| 360.0 * f64::from(k) / f64::from(n);
            poses.extend(planes.map(|k| WantedPose { part: *part, bend_deg, delta_deg: delta_deg(k) }));
        }
        Self::after(before, FigureKind::Fig11, poses).checked()
    }

    /// Single poses: those of a table with the columns `bend_deg,delta_deg`, or Fig. 12's but for the one of 90 deg.
    pub fn poses(table: Option<&Path>, before: Before) -> anyhow::Result<Self> {
        let list = match table {
            None => crate::fig_12::POSES_DEG.into_iter().filter(|(bend_deg, _)| *bend_deg <= LISTED_DEG).collect(),
            Some(path) => {
                let named = || format!("the list of poses {} could not be read", path.display());
                listed(&path.display().to_string(), &input::text(path, MAX_BYTES).with_context(named)?)?
            }
        };
        let pose = |(bend_deg, delta_deg)| WantedPose { part: Part::Pose, bend_deg, delta_deg };
        Self::after(before, FigureKind::Poses, list.into_iter().map(pose).collect()).checked()
    }

    fn after(before: Before, figure: FigureKind, poses: Vec<WantedPose>) -> Self {
        let Before { side, take_up_deg, n_learning_rounds } = before;
        Self { figure, side, take_up_deg, n_learning_rounds, poses }
    }

    /// The same, if it can be run.
    pub(super) fn checked(self) -> anyhow::Result<Self> {
        ensure!(
            (1..=MOST_POSES).contains(&self.poses.len()),
            "an experiment has 1 to {MOST_POSES} poses, and this one {}; choose another step or list",
            self.poses.len()
        );
        ensure!(
            self.n_learning_rounds <= 100,
            "a model learns over {} rounds, expected at most 100; correct --learning-rounds",
            self.n_learning_rounds
        );
        ensure!(
            (0.0..=60.0).contains(&self.take_up_deg),
            "play is taken up over {} deg, expected 0 to 60; correct --take-up-deg",
            self.take_up_deg
        );
        for (k, pose) in self.poses.iter().enumerate() {
            // Written so that NaN is refused.
            ensure!(
                BEND_DEG.contains(&pose.bend_deg) && pose.delta_deg.abs() <= 720.0,
                "pose {} bends {} deg in the plane {} deg, expected 1 to 90 deg and a plane within 720; correct it",
                k + 1,
                pose.bend_deg,
                pose.delta_deg
            );
        }
        Ok(self)
    }

    /// The largest bend that is gone through, deg.
    pub fn largest_bend_deg(&self, learns: bool) -> f64 {
        let before = if learns && self.n_learning_rounds > 0 { LEARNING_BEND_DEG } else { 0.0 };
        self.poses.iter().map(|pose| pose.bend_deg).fold(self.take_up_deg.max(before), f64::max)
    }

    /// Every way in turn, from straight to straight. A model that learns is given something to learn from first.
    pub fn legs(&self, learns: bool) -> Vec<Leg> {
        let mut way = Way::default();
        for plane_deg in LEARNING_PLANES_DEG.repeat(if learns { self.n_learning_rounds as usize } else { 0 }) {
            for bend_deg in [LEARNING_BEND_DEG, -LEARNING_BEND_DEG, 0.0] {
                way.line(0, bend_deg, plane_deg);
            }
        }
        let mut before = None;
        for (number, pose) in (1..).zip(&self.poses) {
            let goes_on = match pose.part {
                Part::Up | Part::Turn => before == Some(pose.part),
                Part::Back => before == Some(Part::Up) || before == Some(Part::Back),
                Part::FromStraight | Part::Pose => false,
            };
            before = Some(pose.part);
            if !goes_on {
                // A turn begins with its bend in the plane 0.
                let plane_deg = if pose.part == Part::Turn { 0.0 } else { pose.delta_deg };
                self.set_out(&mut way, plane_deg);
                if pose.part == Part::Turn {
                    way.line(0, pose.bend_deg, 0.0);
                }
            }
            if pose.part == Part::Turn {
                way.arc(number, pose.delta_deg);
            } else {
                way.line(number, pose.bend_deg, pose.delta_deg);
            }
        }
        way.line(0, 0.0, way.plane_deg);
        way.legs
    }

    /// From wherever it is back to straight, and play taken up from the side.
    fn set_out(&self, way: &mut Way, plane_deg: f64) {
        way.line(0, 0.0, way.plane_deg);
        match self.side {
            ApproachSide::Below => way.line(0, -self.take_up_deg, plane_deg),
            ApproachSide::Above => {
                way.line(0, self.take_up_deg, plane_deg);
                way.line(0, 0.0, plane_deg);
            }
            ApproachSide::None => {}
        }
    }
}

/// Legs under construction.
#[derive(Default)]
struct Way {
    /// The bend along the plane, deg; less than nothing on its other side.
    bend_deg: f64,
    plane_deg: f64,
    legs: Vec<Leg>,
}

impl Way {
    /// Straight on within a plane that the snake is in, or from straight.
    fn line(&mut self, pose: u32, bend_deg: f64, plane_deg: f64) {
        let from_deg = self.bend_deg;
        (self.bend_deg, self.plane_deg) = (bend_deg, plane_deg);
        let n = ((bend_deg - from_deg).abs() / WAY_DEG).ceil() as u32;
        if n == 0 && pose == 0 {
            return;
        }
        let at = |k: u32| bend_rad(from_deg + (bend_deg - from_deg) * f64::from(k) / f64::from(n.max(1)), plane_deg);
        self.legs.push(Leg { pose, bends_rad: (1..=n.max(1)).map(at).collect() });
    }

    /// On at the same bend to another plane.
    fn arc(&mut self, pose: u32, to_deg: f64) {
        let (from_deg, bend_deg) = (self.plane_deg, self.bend_deg);
        self.plane_deg = to_deg;
        let n = ((to_deg - from_deg).abs().to_radians() * bend_deg / WAY_DEG).ceil().max(1.0) as u32;
        let at = |k: u32| bend_rad(bend_deg, from_deg + (to_deg - from_deg) * f64::from(k) / f64::from(n));
        self.legs.push(Leg { pose, bends_rad: (1..=n).map(at).collect() });
    }
}

/// Bends and planes of a table, deg.
fn listed(file: &str, text: &str) -> anyhow::Result<Vec<(f64, f64)>> {
    let mut rows = Vec::new();
    let mut has_header = false;
    for (idx, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if !std::mem::replace(&mut has_header, true) {
            ensure!(
                fields == ["bend_deg", "delta_deg"],
                "the list of poses {file}, line {}: expected the heading bend_deg,delta_deg, found {line:.60?}; correct it",
                idx + 1
            );
            continue;
        }
        let number = |field: &str| field.parse::<f64>().ok().filter(|number| number.is_finite());
        let [Some(bend_deg), Some(delta_deg)] = (match fields[..] {
            [bend, delta] => [number(bend), number(delta)],
            _ => [None, None],
        }) else {
            bail!(
                "the list of poses {file}, line {}: expected two finite numbers, bend and plane in deg, found {line:.60?}; correct that line",
                idx + 1
            )
        };
        rows.push((bend_deg, delta_deg));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn before(side: ApproachSide, take_up_deg: f64) -> Before {
        Before { side, take_up_deg, n_learning_rounds: 2 }
    }

    #[test]
    fn fig_10_goes_up_and_back_and_ends_straight_with_play_taken_up_from_the_other_side() {
        let protocol = Protocol::fig_10(20.0, 80.0, before(ApproachSide::Below, 10.0)).expect("a protocol");
        let parts: Vec<_> = protocol.poses.iter().map(|p| (p.part, p.bend_deg)).collect();
        let up = [20.0, 40.0, 60.0, 80.0].map(|b| (Part::Up, b));
        assert_eq!(parts[..4], up);
        assert_eq!(parts[4..], [60.0, 40.0, 20.0].map(|b| (Part::Back, b)));
        let legs = protocol.legs(false);
        let end_deg = |leg: &Leg| leg.bends_rad.last().expect("an end").x.to_degrees();
        let ends: Vec<f64> = legs.iter().map(end_deg).map(f64::round).collect();
        assert_eq!(ends, [-10.0, 20.0, 40.0, 60.0, 80.0, 60.0, 40.0, 20.0, 0.0]);
        assert_eq!(legs.iter().map(|leg| leg.pose).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6, 7, 0]);
        assert_eq!(protocol.legs(true).len(), legs.len() + 18);
    }

    #[test]
    fn no_way_jumps_and_every_pose_is_where_it_was_wanted() {
        let both = [Part::Turn, Part::FromStraight];
        for side in [ApproachSide::Below, ApproachSide::Above, ApproachSide::None] {
            for protocol in [
                Protocol::fig_10(30.0, 60.0, before(side, 15.0)).expect("Fig. 10"),
                Protocol::fig_11(30.0, &both, 60.0, before(side, 15.0)).expect("Fig. 11"),
                Protocol::poses(None, before(side, 15.0)).expect("Fig. 12"),
            ] {
                let mut at = Vector2::zeros();
                for leg in protocol.legs(true) {
                    for bend in &leg.bends_rad {
                        assert!((bend - at).norm().to_degrees() <= 1.01 * WAY_DEG, "{side}: from {at} to {bend}");
                        at = *bend;
                    }
                    let Some(idx) = leg.pose.checked_sub(1) else { continue };
                    let wanted = protocol.poses[idx as usize];
                    assert!((at - bend_rad(wanted.bend_deg, wanted.delta_deg)).norm() < 1e-9, "{wanted:?}");
                }
                assert!(at.norm() < 1e-9, "straight at the end");
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused_in_one_sentence() {
        assert!(Protocol::fig_10(10.0, 95.0, before(ApproachSide::Below, 10.0)).is_err());
        assert!(Protocol::fig_10(f64::NAN, 80.0, before(ApproachSide::Below, 10.0)).is_err());
        assert!(Protocol::fig_11(f64::NAN, &[Part::Turn], 30.0, before(ApproachSide::Below, 10.0)).is_err());
        for (text, words) in [
            ("bend,delta\n1,2\n", "line 1"),
            ("bend_deg,delta_deg\n30,0\n# half\n30,nan\n", "line 4"),
            ("bend_deg,delta_deg\n30\n", "line 2"),
        ] {
            let error = listed("poses.csv", text).expect_err(text).to_string();
            assert!(error.contains("poses.csv") && error.contains(words), "{error}");
        }
        assert_eq!(listed("", "\u{feff}bend_deg, delta_deg\n# x\n30, -90\n").expect("a list"), [(30.0, -90.0)]);
    }
}
