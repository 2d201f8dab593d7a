//! The SpaceMouse pulled out and plugged in again and again while its cap is held: each time it is lost, found, and heard whole and in order.

use crate::model::{Model, VENDOR_ID};
use crate::spacemouse::{DeviceFault, SpaceMouse, wait_for};
use crate::verdict::PartVerdict;
use krait_ipc::clock;
use krait_master::{DeviceChoice, HidReport, HidSource, Plug, ReportSource, SourceEvent};

/// How often it is pulled out, and how often in the control.
const N_PLUGS: i16 = 20;
const N_CONTROL: i16 = 3;
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

    /// Takes what comes until something is seen, or for ten seconds; whether it was seen.
    fn sees(&mut self, source: &mut HidSource, done: impl Fn(&Self) -> bool) -> bool {
        wait_for("what is judged below", || {
            self.take(source);
            done(self)
        })
        .is_ok()
    }
}

/// Through the master's own source of reports.
pub fn replug() -> anyhow::Result<PartVerdict> {
    replugged(N_PLUGS, DeviceFault::None)
}

/// A report that is left out once must be missed, and a device that stays where it is once must be neither lost nor found then.
pub fn control() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let dropped = replugged(N_CONTROL, DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["in_order"], dropped.join(","));
    let stayed = replugged(N_CONTROL, DeviceFault::Stays)?.failed();
    verdict.check("stay_fails", stayed == ["lost", "found"], stayed.join(","));
    Ok(verdict)
}

/// A fault spoils the time in the middle.
fn replugged(n_plugs: i16, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let model = Model::Compact;
    let choice = format!("{VENDOR_ID:04x}:{:04x}", model.product_id());
    let mut mouse = SpaceMouse::plug(model)?;
    let mut source = HidSource::open(&DeviceChoice::try_from(choice).map_err(anyhow::Error::msg)?)?;
    let (mut heard, mut due) = (Heard::default(), Vec::new());
    let (mut n_lost, mut n_found) = (0, 0);
    mouse.wait_until_read()?;
    for k in 0..n_plugs {
        let fault = if k == n_plugs / 2 { fault } else { DeviceFault::None };
        let n_before = heard.reports.len();
        for n in 0..N_REPORTS {
            let report = HidReport::Translation([k + 1, n, 0]);
            if fault != DeviceFault::Drop || n != N_REPORTS / 2 {
                mouse.send(report.encode().as_bytes())?;
            }
            due.push(report);
        }
        let n_after = n_before + N_REPORTS.unsigned_abs() as usize;
        let _judged_below = heard.sees(&mut source, |heard| heard.reports.len() >= n_after);
        let (n_lost_before, n_found_before) = (heard.n_lost, heard.n_found);
        let stayed = if fault == DeviceFault::Stays {
            Some(mouse)
        } else {
            mouse.unplug()?;
            None
        };
        n_lost += i16::from(heard.sees(&mut source, |heard| heard.n_lost > n_lost_before));
        mouse = match stayed {
            Some(mouse) => mouse,
            None => SpaceMouse::plug(model)?,
        };
        n_found += i16::from(heard.sees(&mut source, |heard| heard.n_found > n_found_before));
        mouse.wait_until_read()?;
    }
    drop(source);
    mouse.unplug()?;
    let mut verdict = PartVerdict::default();
    let (n_heard, n_due) = (heard.reports.len(), due.len());
    verdict.check("in_order", heard.reports == due, format!("{n_heard}/{n_due}"));
    verdict.check("lost", n_lost == n_plugs && heard.n_lost == n_plugs, format!("{n_lost}/{n_plugs}"));
    verdict.check("found", n_found == n_plugs && heard.n_found == n_plugs, format!("{n_found}/{n_plugs}"));
    Ok(verdict)
}
