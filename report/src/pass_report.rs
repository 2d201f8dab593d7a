//! What one pass of a recording shows: tracking error, largest bend, what was learnt, what changed.
//!
//! Everything here is computed from the recording alone, so that anyone with the file gets the same figures.

use crate::joint_tracking::{JointScore, JointTracking, Lanes};
use crate::tracking::{self, Seen, Tracking, TrackingScore, Wanted, length};
use krait_ipc::message::{LearningState, ModelUpdate, Setpoint, Shape};
use krait_model::{ChangeKind, LearntParameter};
use serde::Serialize;

/// Largest bend commanded and reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PeakBend {
    /// Of the setpoint, deg.
    pub commanded: f64,
    /// Of the measured shape, deg; null where none was measured.
    pub reached: Option<f64>,
}

/// What one pass showed.
#[derive(Clone, Debug, Serialize)]
pub struct PassReport {
    /// off, naive, estimated, or model for a model file.
    pub compensation: String,
    /// Tracking error.
    #[serde(flatten)]
    pub tracking: TrackingScore,
    /// Largest bend over the whole pass; null for joints and segments, whose score has each one's.
    pub peak_bend_deg: Option<PeakBend>,
    /// How joints or segments followed, in their own unit; null for a snake.
    pub joints: Option<JointScore>,
    /// How the jaw of a snake's gripper followed, as one joint; null without one.
    pub jaw: Option<JointScore>,
    /// What was learnt by the end of the pass, in the order of the model file.
    pub learnt: Vec<LearntReport>,
    /// Whether the watch for changes had learnt what is normal before the pass ended.
    pub watched_for_changes: bool,
    /// Changes of the machine that were seen.
    pub changes: Vec<ChangeReport>,
}

/// What became of one learnt parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearntReport {
    /// `effect.parameter`.
    pub name: String,
    /// Unit of the three numbers; `1` for none.
    pub unit: String,
    /// Value in the model file.
    pub start: f64,
    /// Value at the end.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// How learning went: `learnt`, `not observable in this motion`, or `at its bound`.
    pub state: &'static str,
    /// The parameter that the motion could not tell it from.
    pub not_told_from: Option<String>,
}

impl LearntReport {
    /// The parameters of an update, named by the model that it is of.
    pub fn of(update: &ModelUpdate, names: &[LearntParameter]) -> Vec<Self> {
        let named = names.iter().zip(update.learnt());
        let report = |(own, now): (&LearntParameter, &krait_ipc::message::LearntValue)| Self {
            name: own.name.clone(),
            unit: own.unit.clone(),
            start: own.start,
            value: now.value,
            sd: now.sd,
            state: match now.state() {
                Some(LearningState::Learning) => "learnt",
                Some(LearningState::NotObservable) => "not observable in this motion",
                Some(LearningState::AtBound) => "at its bound",
                None => "of a state that this program does not know",
            },
            not_told_from: usize::from(now.tied_to).checked_sub(1).and_then(|k| names.get(k)).map(|n| n.name.clone()),
        };
        named.map(report).collect()
    }

    /// One line of text.
    pub fn sentence(&self) -> String {
        let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        let mut text = match self.state {
            "learnt" => format!("{} {:.5e}{unit} +- {:.1e}", self.name, self.value, self.sd),
            "at its bound" => format!("{} {:.5e}{unit}, at its bound", self.name, self.value),
            other => format!("{}: {other}", self.name),
        };
        if let Some(other) = &self.not_told_from {
            text += &format!(" (this motion cannot tell it from {other})");
        }
        text
    }
}

/// A change that the estimator saw: the model no longer explained the measured shape as it did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChangeReport {
    /// Exposure of the shape that showed it, after the pass's first setpoint, s.
    pub at_s: f64,
    /// What it looks like.
    pub looks_like: &'static str,
    /// The segment that showed it, from 1; none of a snake.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segment: Option<u32>,
}

/// One stretch of a recording in which one chain ran.
#[derive(Debug, Default)]
pub struct PassLog {
    setpoints: Vec<Wanted>,
    shapes: Vec<Seen>,
    joints: JointTracking,
    jaw: JointTracking,
    last_update: Option<ModelUpdate>,
    /// Exposure, kind, segment.
    changes: Vec<(i64, u32, u32)>,
    watched: bool,
}

impl PassLog {
    /// Takes a setpoint.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        self.jaw.jaw_setpoint(setpoint);
        match setpoint.n_joints {
            0 => self.setpoints.push(tracking::wanted(setpoint)),
            _ => self.joints.setpoint(setpoint),
        }
    }

    /// Takes a measured shape.
    pub fn shape(&mut self, shape: &Shape) {
        self.joints.shape(shape);
        self.jaw.jaw_shape(shape);
        if let Some(bend_rad) = shape.valid_bend_rad() {
            self.shapes.push((shape.sample_ns, bend_rad));
        }
    }

    /// Takes a model update.
    pub fn update(&mut self, update: &ModelUpdate) {
        self.last_update = Some(*update);
        self.watched |= update.is_watching == 1;
        if update.changed_ns != 0 && self.changes.last().is_none_or(|(ns, ..)| *ns != update.changed_ns) {
            self.changes.push((update.changed_ns, update.change_kind, update.changed_segment));
        }
    }

    fn change_reports(&self) -> Vec<ChangeReport> {
        let start_ns = self.setpoints.first().map_or(0, |(ns, ..)| *ns);
        let report = |&(ns, kind, segment): &(i64, u32, u32)| ChangeReport {
            segment: Some(segment).filter(|segment| *segment > 0),
            at_s: (ns - start_ns) as f64 * 1e-9,
            looks_like: ChangeKind::from_number(kind)
                .map_or("of a kind that this program does not know", ChangeKind::sentence),
        };
        self.changes.iter().map(report).collect()
    }

    /// What the pass showed; `names` are the parameters that the model of the pass learns, `lanes` says of a
    /// machine that is no snake what it is.
    pub fn report(&self, compensation: &str, names: &[LearntParameter], lanes: Option<Lanes>) -> PassReport {
        let peak = |bends: &mut dyn Iterator<Item = [f64; 2]>| bends.map(length).fold(0.0, f64::max).to_degrees();
        PassReport {
            compensation: compensation.to_owned(),
            tracking: Tracking::of(self.setpoints.iter().copied(), self.shapes.iter().copied()).score(),
            peak_bend_deg: lanes.is_none().then(|| PeakBend {
                commanded: peak(&mut self.setpoints.iter().map(|(_, bend, _)| *bend)),
                reached: (!self.shapes.is_empty()).then(|| peak(&mut self.shapes.iter().map(|(_, bend)| *bend))),
            }),
            joints: lanes.and_then(|lanes| self.joints.score(lanes)),
            jaw: self.jaw.score(Lanes::Turning),
            learnt: self.last_update.as_ref().map_or_else(Vec::new, |update| LearntReport::of(update, names)),
            watched_for_changes: self.watched,
            changes: self.change_reports(),
        }
    }
}
