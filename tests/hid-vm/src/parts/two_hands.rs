//! A hand and a pedal in one master, as the program reads them, a thousand reports a second each: both are heard whole, in order, and what is
//! handed on is in the order of its stamps.

use crate::model::Model;
use crate::pedal::Pedal;
use crate::spacemouse::{DeviceFault, SpaceMouse};
use crate::verdict::PartVerdict;
use anyhow::{Context, bail};
use krait_ipc::clock;
use krait_master::{BesideConfig, HidReport, JoinedSource, MasterConfig, ReportSource, SourceEvent};
use std::thread::JoinHandle;
use std::time::Duration;

/// Reports of each, one a millisecond, unless `KRAIT_HID_VM_SECONDS` says another length.
const DEFAULT_S: i32 = 6;
/// Longest that reports of one device are told apart, s.
const MOST_S: i32 = 90;
/// How long a control takes, s.
const CONTROL_S: i32 = 1;
const PERIOD_NS: i64 = 1_000_000;
const PATIENCE_NS: i64 = 3_000_000_000;
/// Names of both in the verdict, by their place in the master.
const NAMES: [&str; 2] = ["hand", "pedal"];
const PROFILE: &str = "/tmp/two-hands.toml";
/// Three buttons beside each other.
const PROFILE_TEXT: &str = "name = \"Pedal\"\nid = \"05f3:00ff\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n[[button]]\nof = 1\nfrom = \"BTN_THUMB\"\n[[button]]\nof = 2\nfrom = \"BTN_THUMB2\"\n";

/// What the master's source has handed on.
#[derive(Default)]
struct Heard {
    reports: [Vec<HidReport>; 2],
    /// How often a stamp was before the one that was handed on before it.
    n_backwards: u32,
}

/// Both at once; a fault spoils the hand.
pub fn two_hands(fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    played(1000 * seconds()?, fault, 0)
}

/// Plays both; a fault spoils the device at that place.
fn played(n_reports: i32, fault: DeviceFault, spoilt: usize) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let (mut mouse, mut pedal) = (SpaceMouse::plug(Model::Compact)?, Pedal::plug()?);
    let reader = read(n_reports)?;
    mouse.wait_until_read()?;
    let begin_ns = clock::monotonic_ns();
    for n in 0..n_reports {
        while clock::monotonic_ns() < begin_ns + i64::from(n) * PERIOD_NS {
            std::thread::sleep(Duration::from_micros(100));
        }
        let [of_hand, of_pedal] =
            [0, 1].map(|idx| sent(n, n_reports, if idx == spoilt { fault } else { DeviceFault::None }));
        if let Some(Sent { n, flip }) = of_hand {
            let mut bytes = hand_report(n).encode().as_bytes().to_vec();
            // Behind the report's number the first axis begins.
            bytes[1] ^= flip;
            mouse.send(&bytes)?;
        }
        if let Some(Sent { n, flip }) = of_pedal {
            pedal.hold(pedal_buttons(n) ^ flip)?;
        }
    }
    let took_ms = (clock::monotonic_ns() - begin_ns) / 1_000_000;
    let Ok(heard) = reader.join() else { bail!("the thread that reads died") };
    let due: [Vec<HidReport>; 2] = [
        (0..n_reports).map(hand_report).collect(),
        (0..n_reports).map(|n| HidReport::Buttons(pedal_buttons(n).into())).collect(),
    ];
    for ((name, heard), due) in NAMES.into_iter().zip(&heard.reports).zip(&due) {
        verdict.check(name, heard == due, format!("{}/{}", heard.len(), due.len()));
    }
    verdict.check("stamps_backwards", heard.n_backwards == 0, heard.n_backwards);
    // A thousand a second: as many virtual ms as reports, and little more.
    if fault == DeviceFault::None {
        let all = (i64::from(n_reports) - 1)..=i64::from(n_reports) * 21 / 20;
        verdict.check("virtual_ms", all.contains(&took_ms), took_ms);
    }
    mouse.unplug()?;
    Ok(verdict)
}

/// A report that is sent: which, and bits of it that are turned round.
struct Sent {
    n: i32,
    flip: u8,
}

/// What a device sends when its `n`-th report is due; a fault spoils what is in the middle.
fn sent(n: i32, n_reports: i32, fault: DeviceFault) -> Option<Sent> {
    let middle = n_reports / 2;
    let whole = |n| Some(Sent { n, flip: 0 });
    match fault {
        DeviceFault::Silent => None,
        DeviceFault::Drop if n == middle => None,
        DeviceFault::Swap if n == middle => whole(n + 1),
        DeviceFault::Swap if n == middle + 1 => whole(n - 1),
        DeviceFault::Flip if n == middle => Some(Sent { n, flip: 1 }),
        _ => whole(n),
    }
}

/// How long, s.
fn seconds() -> anyhow::Result<i32> {
    let text = std::env::var("KRAIT_HID_VM_SECONDS").unwrap_or_default();
    match text.parse() {
        Ok(seconds) if (1..=MOST_S).contains(&seconds) => Ok(seconds),
        _ if text.is_empty() => Ok(DEFAULT_S),
        _ => bail!("KRAIT_HID_VM_SECONDS is {text:?}, expected 1 to {MOST_S}"),
    }
}

/// Of the hand no two reports are alike; below 300 both axes, as `MOST_S` bounds them.
fn hand_report(n: i32) -> HidReport {
    HidReport::Translation([(n % 300) as i16, (n / 300) as i16, 0])
}

/// The pedal's three buttons, from the first report on another one of them each time: the kernel tells what changes.
fn pedal_buttons(n: i32) -> u8 {
    let k = ((n + 1) % 8) as u8;
    k ^ k >> 1
}

/// Reads both through one master's source until as many reports as due have come of each, or none for long.
fn read(n_reports: i32) -> anyhow::Result<JoinHandle<Heard>> {
    std::fs::write(PROFILE, PROFILE_TEXT).context(PROFILE)?;
    let beside = vec![BesideConfig { profile: PROFILE.into(), node: None }];
    let mut source = JoinedSource::open(&MasterConfig { beside, ..MasterConfig::default() })?;
    let n_reports = n_reports.unsigned_abs() as usize;
    Ok(std::thread::Builder::new().spawn(move || {
        let (mut heard, mut newest_ns) = (Heard::default(), i64::MIN);
        let mut until_ns = clock::monotonic_ns() + 4 * PATIENCE_NS;
        let is_whole = |heard: &Heard| heard.reports.iter().all(|reports| reports.len() >= n_reports);
        while !is_whole(&heard) && clock::monotonic_ns() < until_ns {
            source.wait_until(until_ns);
            while let Some(event) = source.next_event(clock::monotonic_ns()) {
                let SourceEvent::HidReport { device, stamp_ns, report } = event else { continue };
                heard.n_backwards += u32::from(stamp_ns < newest_ns);
                newest_ns = stamp_ns;
                if let (Ok(report), Some(reports)) =
                    (HidReport::decode(report.as_bytes()), heard.reports.get_mut(device))
                {
                    reports.push(report);
                    until_ns = clock::monotonic_ns() + PATIENCE_NS;
                }
            }
        }
        heard
    })?)
}

/// One report of either that is left out, one that changes places with the next, and one with a bit turned round: each must be missed on that
/// device, and on no other.
pub fn control() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let faults = [
        (DeviceFault::Drop, ["hand_drop_fails", "pedal_drop_fails"]),
        (DeviceFault::Swap, ["hand_swap_fails", "pedal_swap_fails"]),
        (DeviceFault::Flip, ["hand_flip_fails", "pedal_flip_fails"]),
    ];
    for (fault, names) in faults {
        for (idx, name) in names.into_iter().enumerate() {
            let failed = played(1000 * CONTROL_S, fault, idx)?.failed();
            verdict.check(name, failed == [NAMES[idx]], failed.join(","));
        }
    }
    Ok(verdict)
}
