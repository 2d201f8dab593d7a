//! The counts of the configured actuators where they stand now, as zeros for the configuration. Nothing moves, but actuators that look for
//! their stop ([`super::homing`]).
//!
//! An incremental encoder on CAN has no such count: it is told that what the configuration says is where it stands.

use super::{alone, described, homing};
use crate::cli::Common;
use crate::{print, signals};
use krait_drives::cia402::{CanPort, Cia402, home_here};
use krait_drives::{OpenError, Seen, ServoBus, ServoMake, Units};
use krait_slave::{ActuatorConfig, DriveKind, SlaveConfig};
use serde::Serialize;
use std::process::ExitCode;

/// One zero, as `--json` prints it.
#[derive(Serialize)]
struct Zero {
    actuator: usize,
    id: u32,
    zero_count: i32,
}

/// Prints the zeros, which must leave room for the travel.
pub(super) fn run(common: &Common, json: bool) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let _bus = alone(common, &stop)?;
    let config = described(common)?;
    let has_stops = homing::is_wanted(&config);
    if has_stops {
        homing::check(&config)?;
        homing::consent(&config)?;
    }
    let seen = match config.drive.kind {
        DriveKind::Cia402 if config.drive.actuator.iter().any(|actuator| !actuator.is_absolute) => {
            return tell_drives(&config, json);
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
    if json {
        print::json(&zeros)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text = String::from(match has_stops {
        true => "Actuators with a stop stand where their zero is now. Put each line into its actuator's table:\n",
        false => "Where the actuators stand now; if that is zero, put each line into its actuator's table:\n",
    });
    for Zero { actuator, id, zero_count } in &zeros {
        text += &format!("zero_count = {zero_count}  # actuator {actuator}, id {id}\n");
    }
    print::out(&text)?;
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

/// Makes the configured zeros what drives with incremental encoders read where they stand.
fn tell_drives(config: &SlaveConfig, json: bool) -> anyhow::Result<ExitCode> {
    home_here(config)?;
    let actuators = config.drive.actuator.iter().enumerate();
    let zeros: Vec<Zero> = actuators
        .filter_map(|(k, actuator)| Some(Zero { actuator: k + 1, id: actuator.id, zero_count: actuator.zero_count? }))
        .collect();
    if json {
        print::json(&zeros)?;
    } else {
        print::out("The drives read their zero_count where they stand now, until they lose their power.\n")?;
    }
    Ok(ExitCode::SUCCESS)
}
