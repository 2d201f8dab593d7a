//! The slave process on a simulated machine.

use crate::{
    JointsTruth, SegmentDrives, SegmentTruth, SegmentsTruth, SegmentsTruthError, SimulatedJoints, SimulatedSnake,
    Truth, TruthError,
};
use core::sync::atomic::AtomicBool;
use krait_ipc::{Bus, IpcError};
use krait_slave::{ConfigError, SlaveConfig, SlaveError, run_with_drive};

/// Which machine is simulated.
#[derive(Clone, Debug, PartialEq)]
pub enum Simulation {
    /// A snake of three lines, and the metres of wire for one radian of the jaw as its model has them, where that has a gripper.
    Snake(Option<f64>),
    /// So many cable-driven joints.
    Joints(usize),
    /// Segments in series, which are these where no truth file describes others of as many lines.
    Segments(SegmentsOfModel),
}

/// Dimensions and lines of segments, as the model of the chain has them.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentsOfModel {
    /// From the base to the tip.
    pub segments: Vec<SegmentTruth>,
    /// φ: angle of each of the cone's two arcs, rad.
    pub phi_rad: f64,
}

/// The slave on a simulated machine could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The slave refused its configuration or a channel failed.
    #[error(transparent)]
    Slave(#[from] SlaveError),
    /// The truth file was refused.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// Segments like the model's cannot be simulated.
    #[error("segments with the dimensions of the model cannot be simulated: {0}")]
    Segments(#[from] SegmentsTruthError),
    /// The limiter would allow what the simulated drives cannot do.
    #[error(
        "slave configuration: limits.stroke_m is {stroke_m}, expected at most the travel {travel_m} m of the simulated drives; lower it, or raise drive.travel_m in the truth file"
    )]
    StrokeBeyondTravel {
        /// The limit, m.
        stroke_m: f64,
        /// Distance of the hard stops, m.
        travel_m: f64,
    },
}

impl From<ConfigError> for SimError {
    fn from(error: ConfigError) -> Self {
        Self::Slave(error.into())
    }
}

impl From<IpcError> for SimError {
    fn from(error: IpcError) -> Self {
        Self::Slave(error.into())
    }
}

/// Runs the slave on a simulated machine until `stop`, as [`run_with_drive`] does on any drive.
///
/// # Errors
/// [`SimError`]; whatever happens the drives are stopped smoothly and disabled first.
pub fn run(bus: &Bus, config: &SlaveConfig, machine: Simulation, stop: &AtomicBool) -> Result<(), SimError> {
    match machine {
        Simulation::Snake(gripper) => run_with_drive(bus, config, simulated(config, gripper)?, stop)?,
        Simulation::Joints(n) => run_with_drive(bus, config, simulated_joints(config, n)?, stop)?,
        Simulation::Segments(own) => run_with_drive(bus, config, simulated_segments(config, &own)?, stop)?,
    }
    Ok(())
}

/// The simulated snake that a configuration asks for, with a gripper where the model has one ([`Simulation::Snake`]).
///
/// # Errors
/// [`SimError`] when configuration or truth file are refused, or do not fit each other.
pub fn simulated(config: &SlaveConfig, gripper: Option<f64>) -> Result<SimulatedSnake, SimError> {
    config.check()?;
    let truth = match &config.truth {
        Some(path) => Truth::load(path)?,
        None => Truth::default(),
    };
    check_travel(config, truth.drive.travel_m)?;
    Ok(gripper.map_or_else(|| SimulatedSnake::new(&truth), |wire| SimulatedSnake::with_gripper(&truth, wire)))
}

/// The simulated joints that a configuration asks for.
///
/// # Errors
/// As [`simulated`].
pub(crate) fn simulated_joints(config: &SlaveConfig, n: usize) -> Result<SimulatedJoints, SimError> {
    config.check()?;
    let truth = match &config.truth {
        Some(path) => JointsTruth::load(path, n)?,
        None => JointsTruth::of(n),
    };
    check_travel(config, truth.drive.travel_m)?;
    Ok(SimulatedJoints::new(&truth))
}

/// The simulated segments that a configuration asks for.
///
/// # Errors
/// As [`simulated`], and [`SimError::Segments`].
pub(crate) fn simulated_segments(config: &SlaveConfig, own: &SegmentsOfModel) -> Result<SegmentDrives, SimError> {
    config.check()?;
    let truth = match &config.truth {
        Some(path) => SegmentsTruth::load(path, own)?,
        None => SegmentsTruth::of(own),
    };
    check_travel(config, truth.drive.travel_m)?;
    Ok(SegmentDrives::new(&truth)?)
}

fn check_travel(config: &SlaveConfig, travel_m: f64) -> Result<(), SimError> {
    let stroke_m = config.limits.stroke_m;
    if stroke_m > travel_m {
        return Err(SimError::StrokeBeyondTravel { stroke_m, travel_m });
    }
    Ok(())
}
