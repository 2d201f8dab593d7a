//! Looks for drives on the CAN interfaces of this machine, and shows how they are. Only questions are sent.

use super::find::asked;
use crate::cli_drives::DrivesArgs;
use krait_drives::OpenError;
use krait_drives::cia402::{CanPort, CanReading, FoundDrive, State, has_torque, scan, state};
use krait_report::Table;
use serde::Serialize;

/// One node, as `--json` prints it. Without a reading it is a stranger, or did not answer twice.
#[derive(Serialize)]
pub(super) struct CanNode {
    interface: String,
    id: u8,
    profile: u16,
    vendor: u32,
    product: u32,
    serial: u32,
    most_motor_speed: Option<u32>,
    velocity_unit: Option<u32>,
    is_known: bool,
    reading: Option<Reading>,
    #[serde(skip)]
    speed: String,
}

/// How a drive is.
#[derive(Serialize)]
struct Reading {
    counts: i32,
    status: u16,
    state: &'static str,
    torque_permille: Option<i16>,
}

/// Nodes by their interface.
type Found<'a> = Vec<(&'a String, FoundDrive)>;

/// Looks at some interfaces.
pub(super) fn find<'a>(interfaces: &'a [String], args: &DrivesArgs, is_named: bool) -> Result<Found<'a>, OpenError> {
    asked(interfaces, is_named, |interface| scan(&mut CanPort::open(interface)?, args.last_id))
}

/// Reads all that are known; each interface is open only while it is read.
pub(super) fn read(found: &Found<'_>) -> Result<Vec<CanNode>, OpenError> {
    let mut nodes = Vec::new();
    for group in found.chunk_by(|(a, _), (b, _)| a == b) {
        let mut port = CanPort::open(group[0].0)?;
        for (interface, drive) in group {
            // A stranger's objects mean something else.
            let reading = if drive.is_known() { CanReading::of(&mut port, drive.id)? } else { None };
            nodes.push(CanNode {
                interface: (*interface).clone(),
                id: drive.id,
                profile: drive.profile,
                vendor: drive.vendor,
                product: drive.product,
                serial: drive.serial,
                most_motor_speed: drive.most_speed,
                velocity_unit: drive.velocity_unit,
                speed: speed_limit(drive),
                is_known: drive.is_known(),
                reading: reading.map(|CanReading { status, counts, torque_permille }| Reading {
                    counts,
                    status,
                    state: name(state(status)),
                    torque_permille,
                }),
            });
        }
    }
    Ok(nodes)
}

/// A drive's own limit of speed, with its unit where that is certain.
fn speed_limit(drive: &FoundDrive) -> String {
    match (drive.most_speed, drive.velocity_unit) {
        (None, _) => "-".to_owned(),
        (Some(most), _) if drive.is_in_turns_per_minute() => format!("{most} turns/min"),
        (Some(most), Some(unit)) => format!("{most} (unit 0x{unit:08X})"),
        (Some(most), None) => format!("{most} (its own unit)"),
    }
}

fn name(state: State) -> &'static str {
    match state {
        State::NotReady => "not ready",
        State::SwitchOnDisabled => "switch on disabled",
        State::ReadyToSwitchOn => "ready to switch on",
        State::SwitchedOn => "switched on",
        State::OperationEnabled => "operation enabled",
        State::QuickStopActive => "quick stop active",
        State::FaultReaction => "fault reaction",
        State::Fault => "fault",
    }
}

/// One row per node.
pub(super) fn table(nodes: &[CanNode]) -> Table {
    let heads = [
        "interface",
        "id",
        "drive",
        "vendor",
        "product",
        "serial",
        "own speed limit",
        "counts",
        "power",
        "state",
        "torque, of rated",
    ];
    let mut table = Table::new(&heads);
    for node in nodes {
        let kind = if node.is_known {
            "CiA 402".to_owned()
        } else {
            format!("stranger (profile {}), never moved", node.profile)
        };
        let mut row = vec![node.interface.clone(), node.id.to_string(), kind];
        row.extend([node.vendor, node.product, node.serial].map(|number| format!("0x{number:08X}")));
        row.push(node.speed.clone());
        match &node.reading {
            None => row.extend(["-", "-", "-", "-"].map(str::to_owned)),
            Some(reading) => row.extend([
                reading.counts.to_string(),
                if has_torque(reading.status) { "on" } else { "off" }.to_owned(),
                reading.state.to_owned(),
                reading
                    .torque_permille
                    .map_or("-".to_owned(), |permille| format!("{:.1} %", f64::from(permille) * 0.1)),
            ]),
        }
        table.row(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_shows_who_a_node_is_and_how_with_what_it_does_not_tell_as_a_dash_and_says_that_a_stranger_is_never_moved()
    {
        let known = CanNode {
            interface: "can0".to_owned(),
            id: 3,
            profile: 402,
            vendor: 0x555,
            product: 1,
            serial: 7,
            most_motor_speed: None,
            velocity_unit: None,
            is_known: true,
            reading: Some(Reading {
                counts: -40,
                status: 0x0237,
                state: "operation enabled",
                torque_permille: Some(-125),
            }),
            speed: "3000 turns/min".to_owned(),
        };
        let reading = Some(Reading { counts: 5, status: 0x0250, state: "switch on disabled", torque_permille: None });
        let silent = CanNode { interface: "can0".to_owned(), speed: "-".to_owned(), reading, ..known };
        let stranger = CanNode {
            interface: "can0".to_owned(),
            speed: "-".to_owned(),
            profile: 401,
            is_known: false,
            reading: None,
            ..known
        };
        let told = table(&[known, silent, stranger]);
        let rows: Vec<String> = told.rows().iter().map(|row| row.join("|")).collect();
        assert_eq!(
            rows,
            [
                "interface|id|drive|vendor|product|serial|own speed limit|counts|power|state|torque, of rated",
                "can0|3|CiA 402|0x00000555|0x00000001|0x00000007|3000 turns/min|-40|on|operation enabled|-12.5 %",
                "can0|3|CiA 402|0x00000555|0x00000001|0x00000007|-|5|off|switch on disabled|-",
                "can0|3|stranger (profile 401), never moved|0x00000555|0x00000001|0x00000007|-|-|-|-|-",
            ]
        );
    }
}
