//! The slave process on the simulated snake.

use crate::{SimulatedSnake, Truth, TruthError};
use core::sync::atomic::AtomicBool;
use krait_ipc::{Bus, IpcError};
use krait_slave::{ConfigError, SlaveConfig, SlaveError, run_with_drive};

/// The slave on the simulated snake could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The slave refused its configuration or a channel failed.
    #[error(transparent)]
    Slave(#[from] SlaveError),
    /// The truth file was refused.
    #[error(transparent)]
    Truth(#[from] TruthError),
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

/// Runs the slave on the simulated snake until `stop`, as [`run_with_drive`] does on any drive.
///
/// # Errors
/// [`SimError`]; whatever happens the drives are stopped smoothly and disabled first.
pub fn run(bus: &Bus, config: &SlaveConfig, stop: &AtomicBool) -> Result<(), SimError> {
    Ok(run_with_drive(bus, config, simulated(config)?, stop)?)
}

/// The simulated snake that a configuration asks for.
///
/// # Errors
/// [`SimError`] when configuration or truth file are refused, or do not fit each other.
pub fn simulated(config: &SlaveConfig) -> Result<SimulatedSnake, SimError> {
    config.check()?;
    let truth = match &config.truth {
        Some(path) => Truth::load(path)?,
        None => Truth::default(),
    };
    let (stroke_m, travel_m) = (config.limits.stroke_m, truth.drive.travel_m);
    if stroke_m > travel_m {
        return Err(SimError::StrokeBeyondTravel { stroke_m, travel_m });
    }
    Ok(SimulatedSnake::new(&truth))
}
