//! krait-slave: the last line of defence before the actuators, and the seam to the drives behind it.
//!
//! Purpose: execute actuator commands on a [`Drive`], refuse what must not be executed, stop by itself when nobody commands
//! any more, and report encoders and line loads. It is safe without any other process and computes no kinematics.
//!
//! Terms: the *setpoint* is where the drives were last told to be; to *follow* is to execute commands as they come; to be
//! *held* is to stand at the setpoint until a command comes that begins there; *engaged* is a slave whose operator has asked
//! for motion and whom nothing has stopped since; q~ are actuator positions.
//!
//! Frames and units: see `docs/NOTATION.md`. SI and radians; push is positive; the bend vector is b (cos delta, sin delta).
#![forbid(unsafe_code)]

mod bus_cycles;
mod config;
mod core_report;
mod drive;
mod drive_config;
mod drive_error;
mod drive_traits;
mod engagement;
mod findings;
mod gate;
mod gates;
mod giving_way;
mod homing_config;
mod jaw;
mod latency;
mod limiter;
mod load_uncertainty;
mod operating_state;
mod own_limits;
mod power;
mod process;
mod relaxing;
mod shapes;
mod slave_core;
mod stops;
mod watchdog;

pub use config::{ConfigError, SlaveConfig};
pub use drive::{ActuatorState, Drive, DriveError, DriveReading, Homing, SeenShape, ShapeReading, Switching};
pub use drive_config::{ActuatorConfig, DriveConfig, DriveKind, DriveMode, OnDisable};
pub use drive_traits::{DriveTraits, OnFault};
pub use engagement::Engagement;
pub use findings::{Findings, Note};
pub use gate::{Gate, GateLimits, Write};
pub use giving_way::{GivingWay, RelaxLimits};
pub use homing_config::{HomingConfig, HomingDirection, HomingMethod};
pub use krait_ipc::message::{Actuators, lines, three};
pub use limiter::{Limiter, LimiterVerdict, Limits, Situation};
pub use operating_state::{OperatingMachine, TransitionRefused};
pub use process::{SlaveError, run_with_drive};
pub use shapes::{ShapeSource, Shapes};
pub use slave_core::SlaveCore;
pub use stops::Stops;
pub use watchdog::Watchdog;
