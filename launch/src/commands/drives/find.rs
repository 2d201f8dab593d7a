//! Looks for servos on the serial ports of this machine, and shows how they are. Only questions are sent.

use crate::cli::Common;
use crate::cli_drives::DrivesArgs;
use crate::config::Config;
use crate::{print, signals};
use core::time::Duration;
use krait_drives::sts3215::{BAUDS, FoundServo, Sts3215, ports, scan};
use krait_drives::{ActuatorBus, Seen, Trouble};
use krait_ipc::message::MAX_ACTUATORS;
use krait_report::Table;
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

/// Lists every servo, once or until Ctrl-C.
pub(super) fn run(common: &Common, args: &DrivesArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let configured = Config::load(common.config.as_deref())?.slave.drive.port;
    let named = args.port.clone().or(configured);
    let ports: Vec<PathBuf> = named.clone().map_or_else(ports, |port| vec![port]);
    if ports.is_empty() && !args.json {
        print::out(
            "no USB serial adapter is on this machine; without one, `krait drives --emulate 3` plugs in an emulated bus\n",
        )?;
        return Ok(ExitCode::SUCCESS);
    }
    let one = args.baud.map(|baud| vec![baud]);
    let bauds = one.as_deref().unwrap_or(&BAUDS);
    let mut found = Vec::new();
    for port in &ports {
        match scan(port, bauds, args.last_id) {
            Ok(servos) => found.extend(servos.into_iter().map(|servo| (port.as_path(), servo))),
            // Of several ports one may be somebody else's; the one that was named may not.
            Err(error) if named.is_none() => tracing::warn!("{error}"),
            Err(error) => return Err(error.into()),
        }
    }
    loop {
        let servos = read(&found)?;
        if args.json {
            print::json(&servos)?;
        } else if servos.is_empty() {
            let names: Vec<String> = ports.iter().map(|port| port.display().to_string()).collect();
            print::out(&format!("no servo answers on {}; check power and cable\n", names.join(", ")))?;
        } else {
            print::out(&table(&servos).to_string())?;
        }
        if !args.watch || servos.is_empty() {
            return Ok(ExitCode::SUCCESS);
        }
        std::thread::sleep(WATCH_EVERY);
        if stop.load(Ordering::Relaxed) {
            return Ok(ExitCode::SUCCESS);
        }
    }
}

/// Reads all servos; each port is open only while it is read.
fn read(found: &[(&Path, FoundServo)]) -> anyhow::Result<Vec<Servo>> {
    let mut servos = Vec::new();
    for group in found.chunk_by(|(a, b), (c, d)| (a, b.baud) == (c, d.baud)) {
        for part in group.chunks(MAX_ACTUATORS) {
            let (port, FoundServo { baud, .. }) = part[0];
            let ids = part.iter().map(|(_, servo)| servo.identity.id).collect();
            let mut seen = Seen::default();
            Sts3215::to_read(port, baud, ids, TIMEOUT)?.ask(&mut seen)?;
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
        },
    };
    Servo {
        port: port.display().to_string(),
        baud: *baud,
        id: identity.id,
        model: identity.model,
        firmware: format!("{}.{}", identity.firmware[0], identity.firmware[1]),
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
        let kind = if servo.is_known {
            "STS3215".to_owned()
        } else {
            format!("stranger (model {}), never moved", servo.model)
        };
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
