//! Two hands of different makes at once, a thousand reports a second each: each is heard whole, in order, and by its own reader only.

use crate::model::{Model, VENDOR_ID};
use crate::spacemouse::{DeviceFault, SpaceMouse};
use crate::verdict::PartVerdict;
use anyhow::bail;
use krait_ipc::clock;
use krait_master::{DeviceChoice, HidReport, HidSource, ReportSource, SourceEvent};
use std::thread::JoinHandle;
use std::time::Duration;

/// Reports of each, one a millisecond, unless `KRAIT_HID_VM_SECONDS` says another length.
const DEFAULT_S: i32 = 6;
/// Longest that reports of one device are told apart, s.
const MOST_S: i32 = 90;
const PERIOD_NS: i64 = 1_000_000;
const PATIENCE_NS: i64 = 3_000_000_000;

/// Both at once; a fault leaves out one report of the first.
pub fn two_hands(fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let n_reports = 1000 * seconds()?;
    let mut verdict = PartVerdict::default();
    let mut devices = [SpaceMouse::plug(Model::Compact)?, SpaceMouse::plug(Model::ReceiverHand)?];
    let mut readers = Vec::new();
    for model in [Model::Compact, Model::ReceiverHand] {
        readers.push(read(model, n_reports)?);
    }
    for device in &devices {
        device.wait_until_read()?;
    }
    let begin_ns = clock::monotonic_ns();
    for n in 0..n_reports {
        while clock::monotonic_ns() < begin_ns + i64::from(n) * PERIOD_NS {
            std::thread::sleep(Duration::from_micros(100));
        }
        for (idx, device) in devices.iter_mut().enumerate() {
            let is_spoiled = fault == DeviceFault::Drop && idx == 0 && n == n_reports / 2;
            if !is_spoiled {
                device.send(sent(idx, n).encode().as_bytes())?;
            }
        }
    }
    let took_ms = (clock::monotonic_ns() - begin_ns) / 1_000_000;
    for (idx, (reader, name)) in readers.into_iter().zip(["first", "second"]).enumerate() {
        let Ok(heard) = reader.join() else { bail!("a thread that reads died") };
        let due: Vec<HidReport> = (0..n_reports).map(|n| sent(idx, n)).collect();
        verdict.check(name, heard == due, format!("{}/{}", heard.len(), due.len()));
    }
    // A thousand a second: as many virtual ms as reports, and little more.
    verdict.check(
        "virtual_ms",
        ((i64::from(n_reports) - 1)..=i64::from(n_reports) * 21 / 20).contains(&took_ms),
        took_ms,
    );
    for device in devices {
        device.unplug()?;
    }
    Ok(verdict)
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

/// A report of which no two of one device are alike, nor any two of both.
fn sent(idx: usize, n: i32) -> HidReport {
    // Below 300 both, as `MOST_S` bounds them.
    let axes = [(n % 300) as i16, (n / 300) as i16, 0];
    if idx == 0 { HidReport::Translation(axes) } else { HidReport::Motion([axes[0], axes[1], -1, 0, 0, 0]) }
}

/// Reads one of them until as many reports as due have come, or none for long.
fn read(model: Model, n_reports: i32) -> anyhow::Result<JoinHandle<Vec<HidReport>>> {
    let choice =
        DeviceChoice::try_from(format!("{VENDOR_ID:04x}:{:04x}", model.product_id())).map_err(anyhow::Error::msg)?;
    let mut source = HidSource::open(&choice)?;
    Ok(std::thread::Builder::new().spawn(move || {
        let (mut heard, mut until_ns) = (Vec::new(), clock::monotonic_ns() + 4 * PATIENCE_NS);
        while heard.len() < n_reports.unsigned_abs() as usize && clock::monotonic_ns() < until_ns {
            source.wait_until(until_ns);
            while let Some(event) = source.next_event(clock::monotonic_ns()) {
                if let SourceEvent::HidReport { report, .. } = event
                    && let Ok(report) = HidReport::decode(report.as_bytes())
                {
                    heard.push(report);
                    until_ns = clock::monotonic_ns() + PATIENCE_NS;
                }
            }
        }
        heard
    })?)
}

/// One report of the first that is left out must be missed there, and nowhere else.
pub fn control() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let dropped = two_hands(DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["first"], dropped.join(","));
    Ok(verdict)
}
