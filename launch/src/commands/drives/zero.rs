//! The counts of the configured actuators where they stand now, as zeros of the configuration, which `--out` writes. Nothing moves, but actuators that look for
//! their stop ([`super::homing`]).
//!
//! An incremental encoder on CAN has no such count: it is told that what the configuration says is where it stands, under power for a
//! moment, which a dry run refuses.

use super::numbers::{self, ZERO_COUNT};
use super::{alone, homing, real};
use crate::cli::Common;
use crate::cli_drives::DrivesArgs;
use crate::config::Config;
use crate::{print, signals};
use anyhow::Context;
use krait_drives::cia402::{CanPort, Cia402, home_here};
use krait_drives::{OpenError, Seen, ServoBus, ServoMake, Units};
use krait_slave::{ActuatorConfig, DriveKind, SlaveConfig};
use serde::Serialize;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// One zero, as `--json` prints it.
#[derive(Serialize)]
struct Zero {
    actuator: usize,
    id: u32,
    zero_count: i32,
}

/// Prints the zeros, which must leave room for the travel, and writes the configuration with them.
pub(super) fn run(common: &Common, args: &DrivesArgs) -> anyhow::Result<ExitCode> {
    let path = common.config.as_deref().context("which actuators? name their configuration with --config")?;
    numbers::refuse_out(args)?;
    let stop = signals::stop_flag()?;
    let _bus = alone(common, &stop)?;
    let text = Config::text(path)?;
    let config = Config::read(&text, path)?;
    real(&config)?;
    let config = config.slave;
    let has_stops = homing::is_wanted(&config);
    if has_stops {
        homing::check(&config)?;
        homing::consent(&config)?;
    }
    let seen = match config.drive.kind {
        DriveKind::Cia402 if config.drive.actuator.iter().any(|actuator| !actuator.is_absolute) => {
            return tell_drives(&config, &text, args, &stop);
        }
        _ => counts(config.clone())?,
    };
    let mut counts = seen.counts[..config.drive.actuator.len()].to_vec();
    if has_stops {
        counts = homing::zeros(&config, &counts, &stop)?;
    }
    let mut zeros = Vec::new();
    for (k, actuator) in config.drive.actuator.iter().enumerate() {
        let zero_count = counts[k];
        let actuator = ActuatorConfig { zero_count: Some(zero_count), ..actuator.clone() };
        match config.drive.kind {
            DriveKind::Cia402 => Units::endless(&actuator, k + 1)?,
            _ => Units::new(&actuator, k + 1, ServoMake::COUNTS_PER_TURN)?,
        };
        zeros.push(Zero { actuator: k + 1, id: actuator.id, zero_count });
    }
    let n_changed = numbers::write(args, &text, &ZERO_COUNT, &counts)?;
    if args.json {
        print::json(&zeros)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut said = String::from(match has_stops {
        true => "Actuators with a stop stand where their zero is now; each line belongs into its actuator's table:\n",
        false => "Where the actuators stand now; if that is zero, each line belongs into its actuator's table:\n",
    });
    for Zero { actuator, id, zero_count } in &zeros {
        said += &format!("zero_count = {zero_count}  # actuator {actuator}, id {id}\n");
    }
    print::out(&(said + &numbers::sentence(args.out.as_deref(), n_changed, "zeros")))?;
    Ok(ExitCode::SUCCESS)
}

/// What encoders read that keep their count without power.
fn counts(mut config: SlaveConfig) -> Result<Seen, OpenError> {
    // Zeros of before must not keep anybody from new ones.
    config.drive.actuator.iter_mut().for_each(|actuator| actuator.zero_count = None);
    match (config.drive.kind, &config.drive.interface) {
        (DriveKind::Cia402, Some(interface)) => Ok(Cia402::open(&config, CanPort::open(interface)?)?.1),
        _ => Ok(ServoBus::open(&config.drive)?.1),
    }
}

/// Makes the configured zeros what drives with incremental encoders read where they stand; of those that keep their count, what they
/// read is the zero.
fn tell_drives(config: &SlaveConfig, text: &str, args: &DrivesArgs, stop: &AtomicBool) -> anyhow::Result<ExitCode> {
    let seen = home_here(config, stop)?;
    let actuators = config.drive.actuator.iter().zip(seen.counts).enumerate();
    let zeros: Vec<Zero> = actuators
        .map(|(k, (actuator, zero_count))| {
            let zero_count = if actuator.is_absolute { zero_count } else { actuator.zero_count.unwrap_or(zero_count) };
            Zero { actuator: k + 1, id: actuator.id, zero_count }
        })
        .collect();
    let counts: Vec<i32> = zeros.iter().map(|zero| zero.zero_count).collect();
    let n_changed = numbers::write(args, text, &ZERO_COUNT, &counts)?;
    if args.json {
        print::json(&zeros)?;
    } else {
        let mut said =
            "The drives read their zero_count where they stand now, until they lose their power.\n".to_owned();
        for (Zero { actuator, id, zero_count }, own) in zeros.iter().zip(&config.drive.actuator) {
            if own.is_absolute {
                said += &format!("zero_count = {zero_count}  # actuator {actuator}, id {id}, which keeps its count\n");
            }
        }
        print::out(&(said + &numbers::sentence(args.out.as_deref(), n_changed, "zeros")))?;
    }
    Ok(ExitCode::SUCCESS)
}
