//! The whole chain in the hand of a USB keyboard: it says what it takes, a key bends the snake, and the plug and Escape end the motion.

use crate::chain::{User, VmChain};
use crate::qmp::{Act, Qmp};
use crate::usb_hand::{Stranger, plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_ipc::message::DeviceState;
use krait_master::{HidRecording, HidReport, Profile, ProfileDevice};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

const KEYBOARD: (&str, &str) = ("usb-kbd", "USB Keyboard");
const PROFILE: &str = "/tmp/keys.toml";
const CONFIG: &str = "/tmp/keys-chain.toml";
const REPORTS: &str = "/tmp/keys.krr";
/// How long a key is held that shall bend the snake, and how long it is looked at afterwards.
const HELD: Duration = Duration::from_millis(700);
const LOOKED_AT: Duration = Duration::from_millis(700);
/// The slowest way from a loss to a snake at rest on a busy host, ns.
const BRAKING_NS: i64 = 400_000_000;
/// Longer than the pause between two searches for a lost device.
const FOUND: Duration = Duration::from_millis(1500);
const MOVED_DEG: f64 = 3.0;

/// Plug and Escape while an arrow key bends the snake.
pub fn chain(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let device = plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let mut profile = Profile::load(Path::new("keyboard"))?;
    profile.device = ProfileDevice::Id(device.vendor_id, device.product_id);
    std::fs::write(PROFILE, profile.to_text()).context(PROFILE)?;
    std::fs::write(CONFIG, format!("[master]\nrecord_reports = \"{REPORTS}\"\n")).context(CONFIG)?;
    let chain = VmChain::start_with("keys", User::Root, 8.0, &["--profile", PROFILE, "--config", CONFIG])?;

    // Presence, an arrow, and the plug.
    let bent_ns = clock::monotonic_ns();
    qmp.press("spc")?;
    qmp.act(&[Act::Key("right", true)])?;
    sleep(HELD);
    let unplugged_ns = clock::monotonic_ns();
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    qmp.act(&[Act::Key("right", false)])?;
    sleep(LOOKED_AT);
    let plugged_ns = clock::monotonic_ns();
    let device = plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    sleep(FOUND);
    // An arrow without presence, then both, and the way out.
    let unpressed_ns = clock::monotonic_ns();
    qmp.act(&[Act::Key("left", true)])?;
    sleep(HELD);
    let pressed_ns = clock::monotonic_ns();
    qmp.press("spc")?;
    sleep(HELD);
    let escaped_ns = clock::monotonic_ns();
    let mut stranger = Stranger::at(&device)?;
    qmp.press("esc")?;
    sleep(LOOKED_AT);
    let looked_ns = clock::monotonic_ns();
    qmp.press("a")?;
    let n_given_back = stranger.heard();
    qmp.act(&[Act::Key("left", false)])?;
    let (ended, journal) = chain.end()?;
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;

    let is_warned = ended.stderr.contains("not even Ctrl-C") && ended.stderr.contains("KEY_ESC ends the motion");
    verdict.check("said_at_start", is_warned, is_warned);
    let mut moved = |name, from_ns, to_ns, is_moving: bool| {
        let deg = journal.moved_deg(from_ns, to_ns);
        verdict.check(name, if is_moving { deg > MOVED_DEG } else { deg == 0.0 }, format!("{deg:.1}"));
    };
    moved("bent_deg", bent_ns, unplugged_ns, true);
    moved("unplugged_deg", unplugged_ns + BRAKING_NS, plugged_ns, false);
    moved("unpressed_deg", unpressed_ns, pressed_ns, false);
    moved("pressed_deg", pressed_ns, escaped_ns, true);
    moved("escaped_deg", escaped_ns + BRAKING_NS, looked_ns, false);
    for (name, at_ns) in [("lost", plugged_ns), ("given_up", looked_ns)] {
        let device = journal.input_at(at_ns).context("no input")?.device();
        verdict.check(name, device == Some(DeviceState::Lost), format!("{device:?}"));
    }
    verdict.check("given_back", n_given_back > 0, n_given_back);
    // What the chain recorded of the hand is all that it took.
    let (recording, n_taken) =
        (HidRecording::load(Path::new(REPORTS))?, journal.inputs.last().map(|input| input.n_reports));
    let n_recorded = recording.n_reports() as u64;
    let is_whole =
        n_taken == Some(n_recorded) && recording.reports().all(|(_, bytes)| HidReport::decode(bytes).is_ok());
    verdict.check("recorded", is_whole, format!("{n_recorded}/{n_taken:?}"));
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    Ok(verdict)
}
