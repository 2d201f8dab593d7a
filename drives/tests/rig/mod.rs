//! What the tests of this crate share: three emulated servos of either make and the configuration that goes with them.
#![allow(dead_code, reason = "each test file uses a part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_drives::{BusDrive, ServoMake, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{ActuatorConfig, Drive, DriveConfig, DriveKind, DriveReading, Homing, SlaveConfig, Switching, lines};
use std::time::Duration;

/// Where zero is.
pub const ZERO: i32 = 2048;

/// A test with servos of each make, side by side: it waits for its bus more than it works.
pub fn on_each_make(test: impl Fn(ServoMake) + Sync) {
    let test = &test;
    std::thread::scope(|all| {
        let running = ServoMake::ALL.map(|make| (make, all.spawn(move || test(make))));
        for (make, own) in running {
            assert!(own.join().is_ok(), "with servos of make {make:?}, see above");
        }
    });
}

/// Three sound servos near their zero.
pub fn three(make: ServoMake) -> ServoWire {
    ServoWire::new((1..=3).map(|id| Servo::of(make, id, f64::from(ZERO) + f64::from(id))).collect())
}

/// Three actuators, with patience for a loaded machine: nothing here is about absolute times.
pub fn config(make: ServoMake, emulator: &Emulator) -> SlaveConfig {
    let actuator = |id| ActuatorConfig { id, zero_count: Some(ZERO), ..ActuatorConfig::default() };
    let drive = DriveConfig {
        kind: match make {
            ServoMake::Sts3215 => DriveKind::Sts3215,
            ServoMake::Xl330 => DriveKind::Xl330,
        },
        gives_up_ms: match make {
            ServoMake::Sts3215 => DriveConfig::default().gives_up_ms,
            ServoMake::Xl330 => 2000,
        },
        port: Some(emulator.path().to_owned()),
        period_ms: 40.0,
        timeout_ms: 35.0,
        wish_ms: 1000.0,
        actuator: (1..=3).map(actuator).collect(),
        ..DriveConfig::default()
    };
    SlaveConfig { drive, ..SlaveConfig::default() }
}

/// Torque per current with which loads are what a coupling gives, within a step of the current, where its largest is so many newtons
/// on the default spool.
pub fn newton_metre_per_ampere(make: ServoMake, largest_n: f64) -> f64 {
    let largest_a = match make {
        ServoMake::Sts3215 => 400.0 * 6.5e-3,
        ServoMake::Xl330 => 1.47,
    };
    largest_n * 0.008 / largest_a
}

/// A drive under power and homed, and the bus behind it.
pub struct Rig {
    pub emulator: Emulator,
    pub drive: BusDrive,
}

impl Rig {
    pub fn new(make: ServoMake) -> Self {
        let emulator = Emulator::start(three(make)).unwrap();
        let drive = open_drive(&config(make, &emulator), None).unwrap();
        Self { emulator, drive }
    }

    pub fn powered(make: ServoMake) -> Self {
        let mut rig = Self::new(make);
        rig.power_up();
        rig
    }

    pub fn power_up(&mut self) {
        let powered = (0..2000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            self.drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done
        });
        assert!(powered && self.drive.home(monotonic_ns()) == Ok(Homing::Done));
        assert!(self.emulator.wire().servos.iter().all(Servo::is_powered));
    }

    /// Ticks of the slave for so many cycles of the bus, each of which asks once.
    pub fn cycles(&mut self, n: u64) -> DriveReading {
        let end = self.emulator.wire().n_requests + 2 * n;
        for _ in 0..20_000 {
            std::thread::sleep(Duration::from_millis(1));
            self.drive.read(monotonic_ns()).unwrap();
            if self.emulator.wire().n_requests >= end || self.drive.failure().is_some() {
                break;
            }
        }
        self.drive.read(monotonic_ns()).unwrap()
    }

    /// Ticks of the slave in slow motion until something has failed.
    pub fn until_failure(&mut self) -> String {
        for k in 0..20_000 {
            std::thread::sleep(Duration::from_millis(1));
            if let Some(failure) = self.drive.failure() {
                return failure.to_string();
            }
            let q_m = 1e-3 + 2e-6 * f64::from(k);
            // Refused where there is no power; what has failed is seen above.
            let _refused = self.drive.write(monotonic_ns(), lines([q_m, -0.5 * q_m, -0.5 * q_m]));
            self.drive.read(monotonic_ns()).unwrap();
        }
        panic!("nothing has failed");
    }

    pub fn goals(&self) -> Vec<i32> {
        self.emulator.wire().servos.iter().map(Servo::goal).collect()
    }
}
