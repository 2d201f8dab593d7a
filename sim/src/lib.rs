//! krait-sim: simulated machines, drives like any other. The snake is a quasi-static plant with memory, encoders, line loads
//! and a camera.
//!
//! It shares no physics code with `krait-model`, so that agreement between the two means something.
//!
//! Frames and units: see `docs/NOTATION.md`. SI and radians; push is positive; the bend vector is b (cos delta, sin delta).
//!
//! ```
//! use krait_sim::{SimulatedSnake, Truth};
//! use krait_ipc::message::lines;
//! use krait_slave::Drive;
//! let mut snake = SimulatedSnake::new(&Truth::default());
//! snake.set_power(0, true)?;
//! snake.write(1_000_000, lines([-1e-3, 0.5e-3, 0.5e-3]))?; // pulls line 1: bends in the plane delta = 0
//! let [bend_x_rad, bend_y_rad] = snake.bend_rad();
//! assert!(bend_x_rad > 0.1 && bend_y_rad.abs() < 1e-6);
//! # Ok::<(), krait_slave::DriveError>(())
//! ```
#![forbid(unsafe_code)]

mod actuators;
mod bending;
mod cables;
mod camera;
mod cone;
mod encoders;
mod ends;
mod gripper;
mod hidden;
mod joint;
mod joints;
mod joints_truth;
mod line;
mod noise;
mod plant;
mod process;
mod recorded_time;
mod segment_drives;
mod segments;
mod segments_truth;
mod shutter;
mod sight;
mod snake;
mod solve;
mod truth;
mod truth_error;

pub use cables::CableSnake;
pub use gripper::GripperTruth;
pub use hidden::{BendingTruth, EncodersTruth, LinesTruth, SightTruth, SlowTruth};
pub use joints::SimulatedJoints;
pub use joints_truth::{JointCameraTruth, JointTruth, JointsTruth};
pub use process::{SegmentsOfModel, SimError, Simulation, run, simulated};
pub use recorded_time::run_in_recorded_time;
pub use segment_drives::SegmentDrives;
pub use segments::SimulatedSegments;
pub use segments_truth::{SegmentEffectsTruth, SegmentTruth, SegmentsTruth, SegmentsTruthError};
pub use snake::SimulatedSnake;
pub use truth::{CameraTruth, DriveTruth, EffectsTruth, MachineTruth, Truth};
pub use truth_error::TruthError;
