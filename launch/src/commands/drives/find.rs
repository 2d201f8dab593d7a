//! Looks for servos on the serial ports and drives on the CAN interfaces of this machine, and shows how they are. Only questions
//! are sent.

use super::find_can::{self, CanNode};
use crate::cli::Common;
use crate::cli_drives::DrivesArgs;
use crate::config::Config;
use crate::{print, signals};
use core::time::Duration;
use krait_drives::cia402::interfaces;
use krait_drives::{ActuatorBus, FoundServo, OpenError, Seen, ServoBus, Trouble, ports, scan};
use krait_ipc::message::MAX_ACTUATORS;
use krait_report::Table;
use krait_slave::DriveKind;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// How long the answers of one question are waited for: adapters hold bytes for up to 16 ms.
const TIMEOUT: Duration = Duration::from_millis(40);
const WATCH_EVERY: Duration = Duration::from_millis(500);

/// One servo, as `--json` prints it. Without a reading it is a stranger, or did not answer twice.
#[derive(Serialize)]
struct Servo {
    port: String,
    baud: u32,
    id: u8,
    model: u16,
    /// Of one that krait knows how to move.
    name: Option<&'static str>,
    firmware: String,
    is_known: bool,
    reading: Option<Reading>,
}

/// How a servo is.
#[derive(Serialize)]
struct Reading {
    counts: i32,
    is_powered: bool,
    current_a: f64,
    temperature_celsius: f64,
    supply_v: f64,
    complaint: Option<String>,
}

/// Any actuator, as `--json` prints it.
#[derive(Serialize)]
#[serde(untagged)]
enum Found<'a> {
    Servo(&'a Servo),
    Can(&'a CanNode),
}

/// Where is looked, and whether the user named it.
struct Places {
    ports: Vec<PathBuf>,
    interfaces: Vec<String>,
    is_named: bool,
}

impl Places {
    /// Options first, then the configuration, then all that this machine has.
    fn of(common: &Common, args: &DrivesArgs) -> anyhow::Result<Self> {
        let named = |ports, interfaces| Ok(Self { ports, interfaces, is_named: true });
        let drive = Config::load(common.config.as_deref())?.slave.drive;
        match (&args.port, &args.interface, drive.kind) {
            (Some(port), ..) => named(vec![port.clone()], Vec::new()),
            (None, Some(interface), _) => named(Vec::new(), vec![interface.clone()]),
            (None, None, DriveKind::Cia402) if drive.interface.is_some() => {
                named(Vec::new(), drive.interface.into_iter().collect())
            }
            (None, None, _) if drive.port.is_some() => named(drive.port.into_iter().collect(), Vec::new()),
            _ => Ok(Self { ports: ports(), interfaces: interfaces(), is_named: false }),
        }
    }

    fn names(&self) -> String {
        let ports = self.ports.iter().map(|port| port.display().to_string());
        ports.chain(self.interfaces.iter().cloned()).collect::<Vec<_>>().join(", ")
    }
}

/// Lists every servo and drive, once or until Ctrl-C.
pub(super) fn run(common: &Common, args: &DrivesArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let places = Places::of(common, args)?;
    if places.ports.is_empty() && places.interfaces.is_empty() && !args.json {
        print::out(
            "no USB serial adapter and no CAN interface is on this machine; without one, `krait drives --emulate 3` plugs in an emulated bus\n",
        )?;
        return Ok(ExitCode::SUCCESS);
    }
    let found = asked(&places.ports, places.is_named, |port| scan(port, args.baud, args.last_id))?;
    let found_can = find_can::find(&places.interfaces, args, places.is_named)?;
    loop {
        let (servos, nodes) = (read(&found)?, find_can::read(&found_can)?);
        let is_empty = servos.is_empty() && nodes.is_empty();
        if args.json {
            let all: Vec<Found<'_>> = servos.iter().map(Found::Servo).chain(nodes.iter().map(Found::Can)).collect();
            print::json(&all)?;
        } else if is_empty {
            print::out(&format!("nobody answers on {}; check power and cable\n", places.names()))?;
        }
        if !args.json && !servos.is_empty() {
            print::out(&table(&servos).to_string())?;
        }
        if !args.json && !nodes.is_empty() {
            print::out(&find_can::table(&nodes).to_string())?;
        }
        if !args.watch || is_empty {
            return Ok(ExitCode::SUCCESS);
        }
        std::thread::sleep(WATCH_EVERY);
        if stop.load(Ordering::Relaxed) {
            return Ok(ExitCode::SUCCESS);
        }
    }
}

/// Asks at each place who is there; of several, one may be down or somebody else's, the one that was named may not.
pub(super) fn asked<P, T>(
    places: &[P],
    is_named: bool,
    ask: impl Fn(&P) -> Result<Vec<T>, OpenError>,
) -> Result<Vec<(&P, T)>, OpenError> {
    let mut found = Vec::new();
    for place in places {
        match ask(place) {
            Ok(own) => found.extend(own.into_iter().map(|one| (place, one))),
            Err(error) if !is_named => tracing::warn!("{error}"),
            Err(error) => return Err(error),
        }
    }
    Ok(found)
}

/// Reads all servos; each port is open only while it is read.
fn read(found: &[(&PathBuf, FoundServo)]) -> anyhow::Result<Vec<Servo>> {
    let mut servos = Vec::new();
    for group in found.chunk_by(|(a, b), (c, d)| (a, b.baud, b.identity.make) == (c, d.baud, d.identity.make)) {
        for part in group.chunks(MAX_ACTUATORS) {
            let (port, FoundServo { baud, identity }) = &part[0];
            let ids = part.iter().map(|(_, servo)| servo.identity.id).collect();
            let mut seen = Seen::default();
            ServoBus::to_read(identity.make, port, *baud, ids, TIMEOUT)?.ask(&mut seen)?;
            servos.extend(part.iter().enumerate().map(|(k, (port, servo))| described(port, servo, k, &seen)));
        }
    }
    Ok(servos)
}

fn described(port: &Path, FoundServo { baud, identity }: &FoundServo, k: usize, seen: &Seen) -> Servo {
    let reading = Reading {
        counts: seen.counts[k],
        is_powered: seen.is_powered[k],
        current_a: seen.current_a[k],
        temperature_celsius: seen.temperature_celsius[k],
        supply_v: seen.supply_v[k],
        complaint: match seen.trouble[k] {
            Trouble::None => None,
            Trouble::Limp => Some("overloaded, has let go".to_owned()),
            Trouble::Tripped { meaning, .. } => Some(meaning.to_owned()),
            Trouble::HardwareStop { .. } => Some("switched off by hardware, as by an emergency stop".to_owned()),
        },
    };
    Servo {
        port: port.display().to_string(),
        baud: *baud,
        id: identity.id,
        model: identity.model,
        name: identity.name(),
        firmware: identity.firmware.clone(),
        is_known: identity.is_known(),
        // A stranger's registers mean something else.
        reading: (seen.has_answered[k] && identity.is_known()).then_some(reading),
    }
}

fn table(servos: &[Servo]) -> Table {
    let heads =
        ["port", "baud", "id", "servo", "firmware", "counts", "power", "current A", "deg C", "supply V", "says"];
    let mut table = Table::new(&heads);
    for servo in servos {
        let stranger = || format!("stranger (model {}), never moved", servo.model);
        let kind = servo.name.map_or_else(stranger, str::to_owned);
        let mut row =
            vec![servo.port.clone(), servo.baud.to_string(), servo.id.to_string(), kind, servo.firmware.clone()];
        match &servo.reading {
            None => row.extend(["-", "-", "-", "-", "-", "-"].map(str::to_owned)),
            Some(reading) => row.extend([
                reading.counts.to_string(),
                if reading.is_powered { "on" } else { "off" }.to_owned(),
                format!("{:.3}", reading.current_a),
                format!("{:.0}", reading.temperature_celsius),
                format!("{:.1}", reading.supply_v),
                reading.complaint.clone().unwrap_or_else(|| "well".to_owned()),
            ]),
        }
        table.row(row);
    }
    table
}
