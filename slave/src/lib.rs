//! krait-slave: the last line of defence before the actuators, the drives behind it, and the simulated snake.
//!
//! Purpose: execute actuator commands on a [`Drive`], refuse what must not be executed, stop by itself when nobody commands
//! any more, and report encoders and line loads. It is safe without any other process and computes no kinematics.
//!
//! Terms: the *setpoint* is where the drives were last told to be; to *follow* is to execute commands as they come; to be
//! *held* is to stand at the setpoint until a command comes that begins there; q~ are actuator positions.
//!
//! Frames and units: see `docs/NOTATION.md`. SI and radians; push is positive; the bend vector is b (cos delta, sin delta).
//!
//! ```
//! use krait_slave::{Drive, SimulatedSnake, Truth};
//! let mut snake = SimulatedSnake::new(&Truth::default());
//! snake.set_power(0, true)?;
//! snake.write(1_000_000, [-1e-3, 0.5e-3, 0.5e-3])?; // pulls line 1: bends in the plane delta = 0
//! let [bend_x_rad, bend_y_rad] = snake.bend_rad();
//! assert!(bend_x_rad > 0.1 && bend_y_rad.abs() < 1e-6);
//! # Ok::<(), krait_slave::DriveError>(())
//! ```
#![forbid(unsafe_code)]

mod config;
mod core_report;
mod drive;
mod findings;
mod latency;
mod limiter;
mod operating_state;
mod process;
mod recorded_time;
mod sim;
mod slave_core;
mod watchdog;

pub use config::{ConfigError, SlaveConfig};
pub use drive::{Drive, DriveError, DriveReading, Homing, ShapeReading};
pub use findings::{Findings, Note};
pub use limiter::{Limiter, Limits, Situation, Verdict};
pub use operating_state::{OperatingMachine, TransitionRefused};
pub use process::{SlaveError, run, run_with_drive};
pub use recorded_time::run_in_recorded_time;
pub use sim::{
    BendingTruth, CameraTruth, DriveTruth, EffectsTruth, EncodersTruth, LinesTruth, MachineTruth, SightTruth,
    SimulatedSnake, SlowTruth, Truth, TruthError,
};
pub use slave_core::SlaveCore;
pub use watchdog::{SmoothStop, Watchdog};
