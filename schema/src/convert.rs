//! From the messages in shared memory to their protobuf mirrors and back, field for field and bit for bit.
//!
//! Enumerations keep the number that was sent, also one that no version of krait sends: a recording is evidence. Only a
//! mirror that holds what its message cannot (a raw axis beyond 16 bits, a reason beyond the last) is refused.

mod chain;
mod health;
mod marker;
mod recorder;

use crate::proto;

/// A message with a protobuf mirror.
pub(crate) trait Mirrored: Sized {
    /// The mirror.
    type Mirror: prost::Message + Default;
    /// The mirror of this message. Allocates only for [`krait_ipc::message::Health`].
    fn mirror(&self) -> Self::Mirror;
    /// The message of a mirror, or which field does not fit and why.
    fn restore(mirror: &Self::Mirror) -> Result<Self, String>;
}

fn lines([line_1, line_2, line_3]: [f64; 3]) -> Option<proto::Lines> {
    Some(proto::Lines { line_1, line_2, line_3 })
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
fn joints(values: [f64; 8]) -> Option<proto::Joints> {
    let [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_7, joint_8] = values;
    let are_none = values.iter().all(|value| value.to_bits() == f64::NAN.to_bits());
    (!are_none).then_some(proto::Joints { joint_1, joint_2, joint_3, joint_4, joint_5, joint_6, joint_7, joint_8 })
}

fn from_covariance(covariance: Option<proto::Covariance>) -> [f64; 3] {
    let proto::Covariance { xx, xy, yy } = covariance.unwrap_or_default();
    [xx, xy, yy]
}

fn from_joints(joints: Option<proto::Joints>) -> [f64; 8] {
    joints.map_or([f64::NAN; 8], |j| {
        [j.joint_1, j.joint_2, j.joint_3, j.joint_4, j.joint_5, j.joint_6, j.joint_7, j.joint_8]
    })
}

fn from_lines(lines: Option<proto::Lines>) -> [f64; 3] {
    let proto::Lines { line_1, line_2, line_3 } = lines.unwrap_or_default();
    [line_1, line_2, line_3]
}

fn from_bend(bend: Option<proto::Bend>) -> [f64; 2] {
    let proto::Bend { x, y } = bend.unwrap_or_default();
    [x, y]
}

fn from_vector3(vector: Option<proto::Vector3>) -> [f64; 3] {
    let proto::Vector3 { x, y, z } = vector.unwrap_or_default();
    [x, y, z]
}
