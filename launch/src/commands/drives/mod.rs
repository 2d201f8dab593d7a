//! `krait drives`: which actuators are there, how they are, their zeros, single steps, their directions; and an emulated bus without hardware.

mod calibrate;
mod directions;
mod emulate;
mod find;
mod find_can;
mod homing;
mod jog;
mod led;
mod loads;
mod motion;
mod numbers;
mod stop;
mod zero;

pub(super) use led::LedDrives;

use crate::cli::Common;
use crate::cli_drives::DrivesArgs;
use crate::config::Config;
use crate::supervisor;
use anyhow::ensure;
use krait_ipc::Bus;
use krait_slave::{DriveKind, DriveMode, SlaveConfig};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Its name among the members of an instance.
const NAME: &str = "drives";

/// Does what the options say; without any it looks for actuators and moves nothing.
pub fn run(common: &Common, args: &DrivesArgs) -> anyhow::Result<ExitCode> {
    match (args.emulate, args.jog) {
        (Some(n), _) => match &args.interface {
            Some(interface) => emulate::run_can(n, interface),
            None => emulate::run(n, args.servo.make()),
        },
        (None, Some(actuator)) => jog::run(common, actuator, args.step_mm),
        (None, None) if args.calibrate => calibrate::run(common, args),
        (None, None) if args.zero => zero::run(common, args),
        (None, None) => find::run(common, args),
    }
}

/// The slave's configuration, which must describe real drives.
fn described(common: &Common) -> anyhow::Result<SlaveConfig> {
    let config = Config::load(common.config.as_deref())?;
    real(&config)?;
    Ok(config.slave)
}

/// Refuses a configuration without real drives.
fn real(config: &Config) -> anyhow::Result<()> {
    ensure!(
        config.slave.drive.kind != DriveKind::Sim,
        "the configuration describes no real drives; name one with --config whose [slave.drive] does (docs/drives.md)"
    );
    Ok(())
}

/// Refuses a dry run where motion is what the command is for.
fn live(config: &SlaveConfig, what: &str) -> anyhow::Result<()> {
    ensure!(
        config.drive.mode == DriveMode::Live,
        "[slave.drive] mode = \"dry\": nothing would move; set it to \"live\" for {what}"
    );
    Ok(())
}

/// Joins the instance alone, so that no chain runs or starts meanwhile.
fn alone(common: &Common, stop: &AtomicBool) -> anyhow::Result<Bus> {
    let bus = Bus::open_unless(&common.instance, NAME, stop)?;
    supervisor::refuse_company(&bus)?;
    Ok(bus)
}
