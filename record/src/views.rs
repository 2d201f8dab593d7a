//! What viewers draw without an extension: public Foxglove messages, derived from krait's own while they are written.
//!
//! Made by the recorder's writing thread, never in the chain, and at most `view_hz` times a second for each kind, so that
//! their cost stays small beside the channels themselves. They hold nothing that the krait channels do not hold; readers of
//! krait pass over them. Frames and names are those of `docs/NOTATION.md` and of CRTK.

mod body;
mod log;
mod scene;

pub use body::DrawnMachine;

use crate::wall_clock::WallClock;
use body::Body;
use krait_ipc::message::{Actuators, GRIPPER_WIRE, MAX_ACTUATORS, Setpoint, Shape, SlaveState, n_actuators};
use krait_model::ChainError;
use krait_model::segments::Bends;
use krait_schema::generated::foxglove;
use krait_schema::generated::google::protobuf::Timestamp;
use krait_schema::{Sample, View};
use prost::Message;

/// The frame that everything is drawn in.
const BASE: &str = "base";

/// Derives what viewers draw.
#[derive(Debug)]
pub struct Views {
    /// None: there is nothing to draw but actuators.
    body: Option<Body>,
    period_ns: i64,
    // The period in which a shape, a setpoint and a state were last drawn.
    shape_period: Option<i64>,
    setpoint_period: Option<i64>,
    state_period: Option<i64>,
    log: log::Log,
}

/// A derived message and its channel.
pub type Derived = (View, Vec<u8>);

impl Views {
    /// Draws a machine, if it can be drawn, and the actuators at most `rate_hz` times a second (at least 1); sentences come as they
    /// happen.
    ///
    /// # Errors
    /// [`ChainError`] for a machine that cannot be.
    pub fn new(machine: Option<&DrawnMachine>, rate_hz: u32) -> Result<Self, ChainError> {
        Ok(Self {
            body: machine.map(Body::new).transpose()?,
            period_ns: 1_000_000_000 / i64::from(rate_hz.max(1)),
            shape_period: None,
            setpoint_period: None,
            state_period: None,
            log: log::Log::default(),
        })
    }

    /// What there is to draw because of a sample; mostly nothing, and then nothing is allocated.
    pub fn of(&mut self, sample: &Sample, clock: WallClock) -> Vec<Derived> {
        let stamp = timestamp(clock.wall_ns(sample.sample_ns()));
        let mut derived = Vec::new();
        match sample {
            Sample::Shape(shape) if is_due(&mut self.shape_period, shape.sample_ns, self.period_ns) => {
                self.shape(shape, stamp, &mut derived);
            }
            Sample::Setpoint(setpoint) if is_due(&mut self.setpoint_period, setpoint.sample_ns, self.period_ns) => {
                self.setpoint(setpoint, stamp, &mut derived);
            }
            Sample::State(state) if is_due(&mut self.state_period, state.sample_ns, self.period_ns) => {
                joints(state, self.body.as_ref().is_some_and(Body::is_snake), stamp, &mut derived);
            }
            _ => {}
        }
        for line in self.log.lines(sample) {
            derived.push((View::Log, foxglove::Log { timestamp: Some(stamp), ..line }.encode_to_vec()));
        }
        derived
    }

    fn shape(&self, shape: &Shape, stamp: Timestamp, derived: &mut Vec<Derived>) {
        let Some(body) = &self.body else { return };
        let Some(bends_rad) = body.measured(shape) else { return };
        tip(body, View::MeasuredCp, "tip", &bends_rad, stamp, derived);
        let scene = scene::measured(body, &bends_rad, shape.valid_jaw_rad(), stamp);
        derived.push((View::Scene, scene.encode_to_vec()));
    }

    fn setpoint(&self, setpoint: &Setpoint, stamp: Timestamp, derived: &mut Vec<Derived>) {
        let Some(body) = &self.body else { return };
        let Some(bends_rad) = body.wanted(setpoint) else { return };
        tip(body, View::SetpointCp, "tip_setpoint", &bends_rad, stamp, derived);
        let scene = scene::wanted(body, &bends_rad, setpoint.jaw_rad(), stamp);
        derived.push((View::Scene, scene.encode_to_vec()));
    }
}

fn tip(body: &Body, view: View, frame: &str, bends_rad: &Bends, stamp: Timestamp, derived: &mut Vec<Derived>) {
    let base_from_tip = body.base_from_tip(bends_rad);
    let (at, turn) = (base_from_tip.translation.vector, base_from_tip.rotation.coords);
    let position = foxglove::Vector3 { x: at.x, y: at.y, z: at.z };
    let rotation = foxglove::Quaternion { x: turn.x, y: turn.y, z: turn.z, w: turn.w };
    let transform = foxglove::FrameTransform {
        timestamp: Some(stamp),
        parent_frame_id: BASE.to_owned(),
        child_frame_id: frame.to_owned(),
        translation: Some(position),
        rotation: Some(rotation),
    };
    let transforms = foxglove::FrameTransforms { transforms: vec![transform] };
    let pose = foxglove::Pose { position: Some(position), orientation: Some(rotation) };
    let pose = foxglove::PoseInFrame { timestamp: Some(stamp), frame_id: BASE.to_owned(), pose: Some(pose) };
    derived.push((View::Transforms, transforms.encode_to_vec()));
    derived.push((view, pose.encode_to_vec()));
}

fn joints(state: &SlaveState, is_snake: bool, stamp: Timestamp, derived: &mut Vec<Derived>) {
    let n_actuators = n_actuators(state.n_actuators).min(MAX_ACTUATORS);
    let mut add = |view, positions_m: Actuators, efforts_n: Option<Actuators>| {
        let joint = |idx: usize| foxglove::JointState {
            name: if is_snake && idx == GRIPPER_WIRE { "gripper_wire".to_owned() } else { format!("line_{}", idx + 1) },
            position: Some(positions_m[idx]),
            effort: efforts_n.map(|tau_n| tau_n[idx]).filter(|tau_n| !tau_n.is_nan()),
            ..foxglove::JointState::default()
        };
        let joints = foxglove::JointStates { timestamp: Some(stamp), joints: (0..n_actuators).map(joint).collect() };
        derived.push((view, joints.encode_to_vec()));
    };
    add(View::MeasuredJs, state.measured_q_m, Some(state.measured_tau_n));
    add(View::SetpointJs, state.setpoint_q_m, None);
}

/// Whether an instant is the first of its period. By numbered periods, not by the time since the last one, so that every
/// second frame of a camera at twice the rate is drawn although its period wavers.
fn is_due(last_period: &mut Option<i64>, now_ns: i64, period_ns: i64) -> bool {
    let period = Some(now_ns.div_euclid(period_ns));
    core::mem::replace(last_period, period) != period
}

fn timestamp(wall_ns: u64) -> Timestamp {
    const PER_S: u64 = 1_000_000_000;
    Timestamp { seconds: (wall_ns / PER_S).cast_signed(), nanos: (wall_ns % PER_S) as i32 }
}

#[cfg(test)]
mod tests;
