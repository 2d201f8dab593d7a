//! From the messages in shared memory to their protobuf mirrors and back, field for field and bit for bit.
//!
//! Enumerations keep the number that was sent, also one that no version of krait sends: a recording is evidence. Only a
//! mirror that holds what its message cannot (a raw axis beyond 16 bits, a reason beyond the last) is refused.

mod chain;
mod drive_cycle;
mod health;
mod marker;
mod recorder;

use crate::proto;
use krait_ipc::message::{self, Actuators, JointValues, MAX_JOINTS};

/// A message with a protobuf mirror.
pub(crate) trait Mirrored: Sized {
    /// The mirror.
    type Mirror: prost::Message + Default;
    /// The mirror of this message. Allocates only for [`krait_ipc::message::Health`].
    fn mirror(&self) -> Self::Mirror;
    /// The message of a mirror, or which field does not fit and why.
    fn restore(mirror: &Self::Mirror) -> Result<Self, String>;
}

/// Three lines of a message that has no more.
fn three_lines(of: [f64; 3]) -> Option<proto::Lines> {
    lines(message::lines(of))
}

fn lines(of: Actuators) -> Option<proto::Lines> {
    let [line_1, line_2, line_3, line_4, line_5, line_6, line_7, line_8, line_9, line_10, line_11, line_12] = of;
    Some(proto::Lines {
        line_1,
        line_2,
        line_3,
        line_4,
        line_5,
        line_6,
        line_7,
        line_8,
        line_9,
        line_10,
        line_11,
        line_12,
    })
}

fn bend([x, y]: [f64; 2]) -> Option<proto::Bend> {
    Some(proto::Bend { x, y })
}

fn vector3([x, y, z]: [f64; 3]) -> Option<proto::Vector3> {
    Some(proto::Vector3 { x, y, z })
}

fn covariance([xx, xy, yy]: [f64; 3]) -> Option<proto::Covariance> {
    Some(proto::Covariance { xx, xy, yy })
}

/// Joints that are all NaN, as of a machine that has none, take no room.
fn joints(values: JointValues) -> Option<proto::Joints> {
    let [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_7, joint_8] = values;
    let are_none = values.iter().all(|value| value.to_bits() == f64::NAN.to_bits());
    (!are_none).then_some(proto::Joints { joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_7, joint_8 })
}

fn from_covariance(covariance: Option<proto::Covariance>) -> [f64; 3] {
    let proto::Covariance { xx, xy, yy } = covariance.unwrap_or_default();
    [xx, xy, yy]
}

fn from_joints(joints: Option<proto::Joints>) -> JointValues {
    joints.map_or([f64::NAN; MAX_JOINTS], |j| {
        [j.joint_1, j.joint_2, j.joint_3, j.joint_4, j.joint_5, j.joint_6, j.joint_7, j.joint_8]
    })
}

fn from_three_lines(lines: Option<proto::Lines>) -> [f64; 3] {
    message::three(&from_lines(lines))
}

fn from_lines(lines: Option<proto::Lines>) -> Actuators {
    let proto::Lines {
        line_1,
        line_2,
        line_3,
        line_4,
        line_5,
        line_6,
        line_7,
        line_8,
        line_9,
        line_10,
        line_11,
        line_12,
    } = lines.unwrap_or_default();
    [line_1, line_2, line_3, line_4, line_5, line_6, line_7, line_8, line_9, line_10, line_11, line_12]
}

/// Joints that are zero where there are none; all zero, as of a snake, they take no room.
fn wanted_joints(values: JointValues) -> Option<proto::Joints> {
    let [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_7, joint_8] = values;
    let are_none = values.iter().all(|value| value.to_bits() == 0);
    (!are_none).then_some(proto::Joints { joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_7, joint_8 })
}

fn from_wanted_joints(joints: Option<proto::Joints>) -> JointValues {
    joints.map_or([0.0; MAX_JOINTS], |joints| from_joints(Some(joints)))
}

fn from_bend(bend: Option<proto::Bend>) -> [f64; 2] {
    let proto::Bend { x, y } = bend.unwrap_or_default();
    [x, y]
}

fn from_vector3(vector: Option<proto::Vector3>) -> [f64; 3] {
    let proto::Vector3 { x, y, z } = vector.unwrap_or_default();
    [x, y, z]
}
