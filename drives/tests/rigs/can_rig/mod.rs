//! What the tests on emulated CAN drives share: three of them and the configuration that goes with them.
#![allow(dead_code, reason = "each test file uses a part")]

use krait_drives::emulator::{CanBus, CanDrive};
use krait_slave::{ActuatorConfig, DriveConfig, DriveKind, SlaveConfig};

/// Where zero is.
pub const ZERO: i32 = 100_000;
/// Counts of a metre: 4096 a turn, 2 mm lead.
pub const PER_M: f64 = 2_048_000.0;

/// Three sound drives near their zero.
pub fn three() -> CanBus {
    CanBus::new((1..=3).map(|id| CanDrive::new(id, f64::from(ZERO) + f64::from(id))).collect())
}

/// A configuration with patience for a loaded machine: nothing here is about absolute times.
pub fn config() -> SlaveConfig {
    let actuator = |id| ActuatorConfig {
        id,
        zero_count: Some(ZERO),
        lead_m: Some(0.002),
        vendor: Some(0x555),
        product: Some(1),
        ..ActuatorConfig::default()
    };
    let drive = DriveConfig {
        kind: DriveKind::Cia402,
        interface: Some("vcan0".to_owned()),
        period_ms: 10.0,
        timeout_ms: 9.0,
        wish_ms: 1000.0,
        gives_up_ms: 2000,
        speed_counts_per_s: 200_000.0,
        actuator: (1..=3).map(actuator).collect(),
        ..DriveConfig::default()
    };
    SlaveConfig { drive, ..SlaveConfig::default() }
}
