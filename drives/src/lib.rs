//! krait-drives: actuators that people own, behind the slave's seam.
//!
//! Purpose: [`BusDrive`] is a drive over any [`ActuatorBus`]: it has the units, the age of readings, the judgement of each
//! actuator, and the stop that needs no slave. [`sts3215`] is such a bus; [`emulator`] is one without hardware.
//!
//! Frames and units: see `docs/NOTATION.md`. SI; q~ is push positive; counts are an encoder's own.
#![forbid(unsafe_code)]

mod bus;
mod bus_drive;
mod cycles;
pub mod emulator;
mod error;
mod exchange;
mod judge;
mod newest;
mod setup;
pub mod sts3215;
mod texts;
mod units;

pub use bus::{ActuatorBus, BusGone, Goals, PerActuator, Seen, Trouble};
pub use bus_drive::BusDrive;
pub use error::OpenError;
pub use newest::{Newest, Words};
pub use setup::Setup;
pub use units::Units;
