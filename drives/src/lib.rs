//! krait-drives: actuators that people own, behind the slave's seam.
//!
//! Purpose: [`BusDrive`] is a drive over any [`ActuatorBus`]: it has the units, the age of readings and the judgement of each actuator.
//!
//! Frames and units: see `docs/NOTATION.md`. SI; q~ is push positive; counts are an encoder's own.
#![forbid(unsafe_code)]

mod bus;
mod bus_drive;
pub mod cia402;
mod cycles;
pub mod emulator;
mod error;
mod exchange;
mod handover;
mod judge;
mod newest;
mod recorded;
mod relax;
mod repeated;
mod ring;
mod serial;
mod setup;
mod sts3215;
mod texts;
mod units;
mod xl330;

pub use bus::{ActuatorBus, BusGone, Goals, PerActuator, Seen, Trouble};
pub use bus_drive::BusDrive;
pub use error::OpenError;
pub use newest::{AsWords, Newest};
pub use recorded::RecordedDrive;
pub use repeated::{CycleDifference, Repeated};
pub use serial::{FoundServo, Identity, ServoBus, ServoMake, ports, scan};
pub use setup::BusSetup;
pub use units::Units;

use core::sync::atomic::AtomicBool;
use krait_ipc::{Beside, Bus};
use krait_slave::{DriveKind, SlaveConfig, SlaveError, run_with_drive};

/// The drives of a configuration, whatever their bus; nothing moves yet. `beside`: as for [`BusDrive::start`].
///
/// # Errors
/// [`OpenError`].
pub fn open_drive(config: &SlaveConfig, beside: Option<Beside>) -> Result<BusDrive, OpenError> {
    match config.drive.kind {
        DriveKind::Sim => Err(OpenError::NoBus),
        DriveKind::Sts3215 | DriveKind::Xl330 => serial::open_drive(config, beside),
        DriveKind::Cia402 => cia402::open_drive(config, beside),
    }
}

/// Runs the slave on drives that are open until `stop`, as [`run_with_drive`] does on any: its step is compiled with this crate, to be fast.
///
/// # Errors
/// As [`run_with_drive`].
pub fn run(bus: &Bus, config: &SlaveConfig, drive: BusDrive, stop: &AtomicBool) -> Result<(), SlaveError> {
    run_with_drive(bus, config, drive, stop)
}

/// Units, period and limits of a configuration's drives, whatever their bus; nothing is opened.
///
/// # Errors
/// [`OpenError`] where the configuration does not fit the kind of drive, or names none.
pub fn setup_of(config: &SlaveConfig) -> Result<BusSetup, OpenError> {
    match config.drive.kind {
        DriveKind::Sim => Err(OpenError::NoBus),
        DriveKind::Sts3215 | DriveKind::Xl330 => serial::setup(config),
        DriveKind::Cia402 => cia402::setup(config),
    }
}
