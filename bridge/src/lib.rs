//! krait-bridge: between the operator and the actuators.
//!
//! Purpose: `resolve` (tip velocity in the view frame -> bend-vector setpoint), `compensate` (setpoint -> actuator
//! positions q~ = q + eps) and `estimate` (measured shape -> learnt values of the model). Each has a core that is a pure function of the
//! samples it is given, and a loop that feeds it from shared memory.
//!
//! Terms: *following* = the setpoint moves with the operator; *holding* = it stands still, for reasons that are named;
//! *easing in* = a difference to the slave's own setpoint is let go slowly, so that nothing ever jumps.
//!
//! Frames and units: see `docs/NOTATION.md`. The bend vector is `b (cos delta, sin delta)` in rad.
//!
//! Invariant: a core never reads a clock. It integrates with the stamps of its samples, and every other thing that it
//! depends on is named in its output by sequence number, so that recorded input gives byte-identical commands.

mod blend;
mod changes;
mod compensate;
mod compensate_jaw;
mod compensate_joints;
mod compensate_segments;
mod config;
mod cued;
mod estimate;
mod estimate_joints;
mod estimate_segments;
mod feed;
mod hop;
mod joint_machine;
mod joints_error;
mod learning;
mod ledger;
mod live;
mod live_model;
mod mismatch;
mod pairing;
mod reach;
mod resolve;
mod resolve_jaw;
mod resolve_joints;
mod resolve_segments;
mod step;
mod watch_segments;

pub use compensate::{CompensateCore, run_compensate};
pub use compensate_joints::JointCompensateCore;
pub use compensate_segments::SegmentCompensateCore;
pub use config::{CompensateConfig, EstimateConfig, GripperConfig, JointsConfig, ResolveConfig};
pub use estimate::EstimateCore;
pub use estimate_joints::JointEstimateCore;
pub use estimate_segments::SegmentEstimateCore;
pub use feed::Feed;
pub use joint_machine::JointMachine;
pub use joints_error::JointsError;
pub use learning::{EstimatorCore, run_estimate};
pub use live_model::{JointModel, LiveModel, SegmentModel, Unit};
pub use resolve::{ResolveCore, run_resolve};
pub use resolve_joints::JointResolveCore;
pub use resolve_segments::SegmentResolveCore;
pub use step::{BridgeError, Refused};
