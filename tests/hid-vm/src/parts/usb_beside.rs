//! A SpaceMouse on hidraw and QEMU's USB keyboard, as its pedal, in one master of a real chain: every report of either arrives, in order, and
//! the file of both gives the same inputs and commands again.

use super::usb_keyboard::KEYBOARD;
use crate::chain::{User, VmChain};
use crate::model::Model;
use crate::qmp::{Act, Qmp};
use crate::repeated;
use crate::spacemouse::{DeviceFault, SLOT_NS, SpaceMouse};
use crate::usb_hand::{plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_master::{HidRecording, HidReport, MasterConfig, Presence, RecordedEvent};
use std::path::Path;
use std::time::Duration;

/// Reports of the hand, and after how many of them the pedal's buttons change.
const N_REPORTS: i16 = 400;
const PER_CHANGE: i16 = 24;
const CHAIN_S: f64 = 8.0;
const MOVED_DEG: f64 = 2.0;
const PROFILE: (&str, &str) = (
    "/tmp/usb-beside-pedal.toml",
    "name = \"Pedal\"\nid = \"0627:0001\"\nrelease = \"KEY_ESC\"\n[[button]]\nof = 0\nfrom = \"KEY_SPACE\"\n[[button]]\nof = 1\nfrom = \"KEY_LEFTSHIFT\"\n[[button]]\nof = 9\nfrom = \"KEY_M\"\n",
);
/// The pedal's keys and the bits of their buttons: presence, clutch, and one that does nothing.
const KEYS: [(&str, u32); 3] = [("spc", 1 << 0), ("shift", 1 << 1), ("m", 1 << 9)];
const CONFIG: &str = "/tmp/usb-beside.toml";
const REPORTS: &str = "/tmp/usb-beside.krr";

/// Both in one chain; a fault leaves out one report of the hand.
pub fn beside(qmp: &mut Qmp, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    std::fs::write(PROFILE.0, PROFILE.1).context(PROFILE.0)?;
    let pedal = format!("[[master.beside]]\nprofile = \"{}\"\n", PROFILE.0);
    std::fs::write(CONFIG, format!("[master]\npresence = \"hold:0\"\nrecord_reports = \"{REPORTS}\"\n{pedal}"))
        .context(CONFIG)?;
    plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let mut mouse = SpaceMouse::plug(Model::Compact)?;
    let chain = VmChain::start_with("usb-beside", User::Root, CHAIN_S, &["--config", CONFIG])?;
    mouse.wait_until_read()?;
    let begun_ns = clock::monotonic_ns();
    let due = play(qmp, &mut mouse, fault)?;
    let played_ns = clock::monotonic_ns();
    let (ended, journal, recording) = chain.end_with_recording()?;
    mouse.unplug()?;
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;

    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    let moved_deg = journal.moved_deg(begun_ns, played_ns);
    verdict.check("moved_deg", moved_deg > MOVED_DEG, format!("{moved_deg:.1}"));
    let file = HidRecording::load(Path::new(REPORTS))?;
    let (mut heard, mut stamps) = ([Vec::new(), Vec::new()], Vec::new());
    for (stamp_ns, device, event) in file.events() {
        let RecordedEvent::Report(report) = event else { continue };
        heard.get_mut(device).context("a third device")?.extend(HidReport::decode(report.as_bytes()).ok());
        stamps.push(stamp_ns);
    }
    for ((name, heard), due) in ["hand", "pedal"].into_iter().zip(&heard).zip(&due) {
        verdict.check(name, heard == due, format!("{}/{}", heard.len(), due.len()));
    }
    verdict.check("stamps_in_order", stamps.is_sorted(), stamps.len());
    let config = MasterConfig { presence: Presence::Hold(0), ..MasterConfig::default() };
    repeated::judge_inputs(&mut verdict, &journal.inputs, &config, Path::new(REPORTS))?;
    repeated::judge_commands(&mut verdict, &recording)?;
    std::fs::remove_file(REPORTS).context(REPORTS)?;
    Ok(verdict)
}

/// Works both at once; what each has to tell.
fn play(qmp: &mut Qmp, mouse: &mut SpaceMouse, fault: DeviceFault) -> anyhow::Result<[Vec<HidReport>; 2]> {
    let (mut due, mut buttons, mut n_changes) = ([Vec::new(), Vec::new()], 0, 0);
    for n in 0..N_REPORTS {
        // No two are alike, to one side in their first half and to the other in their second.
        let x = if n < N_REPORTS / 2 { 100 + n } else { -n / 2 };
        let report = HidReport::Translation([x, 0, n % 2]);
        due[0].push(report);
        if !(fault == DeviceFault::Drop && n == N_REPORTS / 2) {
            mouse.send(report.encode().as_bytes())?;
        }
        if n % PER_CHANGE == 0 && n / PER_CHANGE < 16 {
            // One key at a time, through all eight states of three and back to none, twice.
            let k = [0, 1, 0, 2, 0, 1, 0, 2][n_changes % 8];
            let (key, bit) = KEYS[k];
            buttons ^= bit;
            qmp.act(&[Act::Key(key, buttons & bit != 0)])?;
            due[1].push(HidReport::Buttons(buttons));
            n_changes += 1;
        }
        std::thread::sleep(Duration::from_nanos(SLOT_NS.unsigned_abs()));
    }
    Ok(due)
}

/// A report of the hand that is left out is missed, and nothing else.
pub fn control(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let dropped = beside(qmp, DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["hand"], dropped.join(","));
    Ok(verdict)
}
