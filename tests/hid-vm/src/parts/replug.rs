//! The SpaceMouse pulled out and plugged in again and again while its cap is held: each time it is lost, found, and heard whole and in order.

use crate::model::{Model, VENDOR_ID};
use crate::spacemouse::{SpaceMouse, wait_for};
use crate::verdict::PartVerdict;
use krait_ipc::clock;
use krait_master::{DeviceChoice, HidReport, HidSource, Plug, ReportSource, SourceEvent};

const N_PLUGS: i16 = 20;
/// Reports of the held cap each time.
const N_REPORTS: i16 = 5;

/// What came of the device since, in order.
#[derive(Default)]
struct Heard {
    reports: Vec<HidReport>,
    n_lost: i16,
    n_found: i16,
}

impl Heard {
    fn take(&mut self, source: &mut HidSource) {
        source.wait_until(clock::monotonic_ns() + 5_000_000);
        while let Some(event) = source.next_event(clock::monotonic_ns()) {
            match event {
                SourceEvent::HidReport { report, .. } => self.reports.extend(HidReport::decode(report.as_bytes()).ok()),
                SourceEvent::Plug { plug: Plug::Out, .. } => self.n_lost += 1,
                SourceEvent::Plug { plug: Plug::In, .. } => self.n_found += 1,
                _ => {}
            }
        }
    }
}

/// Through the master's own source of reports.
pub fn replug() -> anyhow::Result<PartVerdict> {
    let model = Model::Compact;
    let choice = format!("{VENDOR_ID:04x}:{:04x}", model.product_id());
    let mut mouse = SpaceMouse::plug(model)?;
    let mut source = HidSource::open(&DeviceChoice::try_from(choice).map_err(anyhow::Error::msg)?)?;
    let (mut heard, mut due) = (Heard::default(), Vec::new());
    for k in 1..=N_PLUGS {
        mouse.wait_until_read()?;
        for n in 0..N_REPORTS {
            let report = HidReport::Translation([k, n, 0]);
            mouse.send(report.encode().as_bytes())?;
            due.push(report);
        }
        wait_for("the reports of the cap", || {
            heard.take(&mut source);
            heard.reports.len() >= due.len()
        })?;
        mouse.unplug()?;
        wait_for("the loss of the SpaceMouse", || {
            heard.take(&mut source);
            heard.n_lost >= k
        })?;
        mouse = SpaceMouse::plug(model)?;
        wait_for("the return of the SpaceMouse", || {
            heard.take(&mut source);
            heard.n_found >= k
        })?;
    }
    drop(source);
    mouse.unplug()?;
    let mut verdict = PartVerdict::default();
    let (n_heard, n_due) = (heard.reports.len(), due.len());
    verdict.check("in_order", heard.reports == due, format!("{n_heard}/{n_due}"));
    verdict.check("lost", heard.n_lost == N_PLUGS, format!("{}/{N_PLUGS}", heard.n_lost));
    verdict.check("found", heard.n_found == N_PLUGS, format!("{}/{N_PLUGS}", heard.n_found));
    Ok(verdict)
}
