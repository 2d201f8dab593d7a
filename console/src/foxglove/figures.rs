//! What no channel has as such: the tracking error, and every bend in degrees (joints in the unit that people read).

use crate::facts::Facts;
use crate::tracking::LiveTracking;
use krait_ipc::message::{Command, Setpoint, Shape};
use krait_schema::Sample;
use serde_json::{Map, Value, json};

/// The newest of what figures are made of.
#[derive(Default)]
pub(super) struct Figures {
    tracking: LiveTracking,
    setpoint: Option<Setpoint>,
    command: Option<Command>,
    shape: Option<Shape>,
}

impl Figures {
    /// Takes a sample; whether there is something new to say.
    pub(super) fn take(&mut self, sample: &Sample) -> bool {
        match sample {
            Sample::Setpoint(setpoint) => {
                self.tracking.setpoint(setpoint);
                self.setpoint = Some(*setpoint);
            }
            Sample::Command(command) => self.command = Some(*command),
            Sample::Shape(shape) => {
                self.tracking.shape(shape);
                self.shape = Some(*shape);
                return true;
            }
            _ => {}
        }
        false
    }

    /// The tracking error at the newest shape, and over the last second; null where nothing was measured.
    pub(super) fn error(&self, facts: &Facts) -> Value {
        let now_ns = self.shape.as_ref().map_or(0, |shape| shape.sample_ns);
        let shown = |value: Option<f64>| value.map(|value| value * facts.per_si);
        let unit = facts.unit;
        json!({ format!("newest_{unit}"): shown(self.tracking.newest()), format!("rms_1s_{unit}"): shown(self.tracking.rms(now_ns)) })
    }

    /// Every bend with its components and its plane, or every joint.
    pub(super) fn bends(&self, facts: &Facts) -> Value {
        let mut all = Map::new();
        if let Some(n) = facts.joints.as_ref().map(|joints| joints.low.len()) {
            let setpoint = self.setpoint.as_ref().and_then(|of| of.joints_rad.get(..n));
            let measured = self.shape.as_ref().and_then(Shape::valid_joints_rad);
            for (name, joints) in [("setpoint", setpoint), ("measured", measured)] {
                for joint in 0..n {
                    let value = joints.and_then(|joints| joints.get(joint)).map(|value| value * facts.per_si);
                    all.insert(format!("{name}_joint{}_{}", joint + 1, facts.unit), json!(value));
                }
            }
            return Value::Object(all);
        }
        let bends = [
            self.setpoint.map(|of| of.bend_rad),
            self.command.map(|of| of.bend_rad),
            self.shape.as_ref().and_then(Shape::valid_bend_rad),
        ];
        for (name, bend_rad) in BENDS.into_iter().zip(bends) {
            let parts = bend_rad.map(|[x, y]| [x, y, x.hypot(y), y.atan2(x)].map(f64::to_degrees));
            for (place, part) in PARTS.into_iter().enumerate() {
                all.insert(format!("{name}{part}_deg"), json!(parts.map(|parts| parts[place])));
            }
        }
        Value::Object(all)
    }
}

/// Whose bend it is: what is asked for, what the command aims at, what the camera saw.
const BENDS: [&str; 3] = ["setpoint", "command", "measured"];
/// Components in `base`, length, and plane counted from x to y.
const PARTS: [&str; 4] = ["_x", "_y", "", "_plane"];

/// The schema of [`Figures::error`].
pub(super) fn error_schema(unit: &str) -> Value {
    schema([format!("newest_{unit}"), format!("rms_1s_{unit}")].into_iter())
}

/// The schema of [`Figures::bends`].
pub(super) fn bends_schema(unit: &str, n_joints: usize) -> Value {
    let joints = ["setpoint", "measured"].into_iter();
    let joints = joints.flat_map(|name| (1..=n_joints).map(move |joint| format!("{name}_joint{joint}_{unit}")));
    let bends = BENDS.into_iter().flat_map(|name| PARTS.map(|part| format!("{name}{part}_deg")));
    if n_joints > 0 { schema(joints) } else { schema(bends) }
}

fn schema(names: impl Iterator<Item = String>) -> Value {
    let properties: Map<String, Value> = names.map(|name| (name, json!({ "type": ["number", "null"] }))).collect();
    json!({ "type": "object", "properties": properties })
}
