//! The counts of the configured actuators where they stand now, as zeros for the configuration. Nothing moves.

use super::{alone, described};
use crate::cli::Common;
use crate::{print, signals};
use anyhow::Context;
use krait_drives::Units;
use krait_drives::sts3215::{COUNTS_PER_TURN, Sts3215};
use krait_slave::ActuatorConfig;
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
    // Zeros of before must not keep anybody from new ones.
    let mut drive = config.drive.clone();
    drive.actuator.iter_mut().for_each(|actuator| actuator.zero_count = None);
    let (_port, seen) = Sts3215::open(&drive)?;
    let mut zeros = Vec::new();
    for (k, actuator) in drive.actuator.iter().enumerate() {
        let zero_count = seen.counts[k];
        let count = u32::try_from(zero_count).context("an encoder gave a negative count")?;
        Units::new(&ActuatorConfig { zero_count: Some(count), ..actuator.clone() }, k + 1, COUNTS_PER_TURN)?;
        zeros.push(Zero { actuator: k + 1, id: actuator.id, zero_count });
    }
    if json {
        print::json(&zeros)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text =
        String::from("Where the actuators stand now; if that is zero, put each line into its actuator's table:\n");
    for Zero { actuator, id, zero_count } in &zeros {
        text += &format!("zero_count = {zero_count}  # actuator {actuator}, id {id}\n");
    }
    print::out(&text)?;
    Ok(ExitCode::SUCCESS)
}
