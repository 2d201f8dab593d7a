//! QEMU's USB keyboard by the built-in profile: keys in order, a repeating key, and the way out.

use crate::qmp::{Act, Qmp};
use crate::spacemouse::DeviceFault;
use crate::usb_hand::{Scene, Stranger, UsbHand, due, plugged, profile_for, unplugged};
use crate::verdict::PartVerdict;
use anyhow::{Context, bail};
use krait_ipc::clock;
use krait_master::HidReport;
use std::thread::sleep;
use std::time::Duration;

pub const KEYBOARD: (&str, &str) = ("usb-kbd", "USB Keyboard");
/// Vendor and product of every USB device of QEMU's.
pub const QEMU_ID: (u16, u16) = (0x0627, 1);
/// Longer than the kernel waits before a key repeats (0.25 s), and than some repetitions.
const HELD: Duration = Duration::from_millis(800);
/// While a key is held nothing may be taken for so long.
const LOOKED_AT: Duration = Duration::from_millis(500);

fn key(key: &'static str, is_down: bool) -> Vec<Act> {
    vec![Act::Key(key, is_down)]
}

fn moved(axes: [i16; 6]) -> Vec<HidReport> {
    vec![HidReport::Motion(axes)]
}

/// Keys, alone and together; the space bar held until the kernel repeats it; Escape gives the keyboard back to a stranger.
pub fn keyboard(qmp: &mut Qmp, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let device = plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let lit = is_lit()?;
    verdict.check("dark_before", !lit, !lit);
    let profile = profile_for("keyboard", &device)?;
    let mut stranger = Stranger::at(&device)?;
    // Enter has started krait and is not let go yet.
    qmp.act(&key("ret", true))?;
    let taking = std::thread::Builder::new().spawn(move || UsbHand::take(profile))?;
    sleep(LOOKED_AT);
    verdict.check("waits_for_let_go", !taking.is_finished(), taking.is_finished());
    qmp.act(&key("ret", false))?;
    let Ok(taken) = taking.join() else { bail!("the thread that takes the keyboard died") };
    let mut hand = taken?;
    let n_enter = stranger.heard();
    verdict.check("enter_let_go", n_enter > 0, n_enter);

    let lit = is_lit()?;
    verdict.check("lit", lit, lit);
    let scene = scene();
    let heard = hand.play(&scene, fault, |acts| qmp.act(acts))?;
    verdict.check("in_order", heard == due(&scene), format!("{}/{}", heard.len(), due(&scene).len()));
    qmp.act(&key("spc", true))?;
    let begin_ns = clock::monotonic_ns();
    let mut presses = Vec::new();
    while clock::monotonic_ns() - begin_ns < HELD.as_nanos() as i64 {
        presses.extend(hand.next(50_000_000));
    }
    verdict.check("repeats_are_none", presses == [HidReport::Buttons(1)], presses.len());
    qmp.act(&key("spc", false))?;
    let let_go = hand.next(2_000_000_000);
    verdict.check("let_go", let_go == Some(HidReport::Buttons(0)), format!("{let_go:?}").replace(' ', ""));
    let n_stolen = stranger.heard();
    verdict.check("exclusive", n_stolen == 0, n_stolen);

    qmp.act(&key("right", true))?;
    hand.next(2_000_000_000);
    qmp.act(&key("esc", true))?;
    hand.wait_for("the end of the motion", |hand| hand.was_lost)?;
    for (name, is_down) in [("esc", false), ("right", false), ("a", true), ("a", false)] {
        qmp.act(&key(name, is_down))?;
    }
    let n_given_back = stranger.heard();
    verdict.check("given_back", n_given_back > 0, n_given_back);
    // Longer than the pause between two searches.
    let again = hand.next(1_500_000_000);
    verdict.check("not_taken_again", again.is_none() && !hand.was_found, hand.was_found);
    let lit = is_lit()?;
    verdict.check("dark_again", !lit, !lit);
    drop(hand);
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    Ok(verdict)
}

/// Whether the kernel has the light of the built-in profile on.
fn is_lit() -> anyhow::Result<bool> {
    let mut lights = std::fs::read_dir("/sys/class/leds")?.flatten();
    let light = lights.find(|light| light.file_name().to_string_lossy().ends_with("::numlock"));
    let path = light.context("the keyboard has no light")?.path().join("brightness");
    Ok(std::fs::read_to_string(path)?.trim() != "0")
}

pub fn scene() -> Scene {
    let mut scene: Scene = Vec::new();
    let axes = [("right", "left", 0), ("down", "up", 2), ("pgdn", "pgup", 1), ("e", "q", 5)];
    for (plus, minus, axis_idx) in axes {
        let along = |counts: i16| {
            let mut axes = [0; 6];
            axes[axis_idx] = counts;
            moved(axes)
        };
        // One, both, the other, none.
        scene.push((key(plus, true), along(175)));
        scene.push((key(minus, true), along(0)));
        scene.push((key(plus, false), along(-175)));
        scene.push((key(minus, false), along(0)));
    }
    scene.push((key("down", true), moved([0, 0, 175, 0, 0, 0])));
    scene.push((key("right", true), moved([175, 0, 175, 0, 0, 0])));
    scene.push((key("down", false), moved([175, 0, 0, 0, 0, 0])));
    scene.push((key("right", false), moved([0; 6])));
    for (name, bit) in [("spc", 1), ("shift", 2), ("m", 4)] {
        scene.push((key(name, true), vec![HidReport::Buttons(bit)]));
        scene.push((key(name, false), vec![HidReport::Buttons(0)]));
    }
    // A key that is nobody's.
    scene.push((key("z", true), Vec::new()));
    scene.push((key("z", false), Vec::new()));
    scene
}

/// A mouse, keyboard or tablet of which one event is left out must fail, for that reason and no other.
pub fn control(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mouse = super::usb_pointer::mouse(qmp, DeviceFault::Drop)?.failed();
    verdict.check("mouse_drop_fails", mouse == ["in_order"], mouse.join(","));
    let keys = keyboard(qmp, DeviceFault::Drop)?.failed();
    verdict.check("keyboard_drop_fails", keys == ["in_order"], keys.join(","));
    let places = super::usb_pointer::tablet(qmp, DeviceFault::Drop)?.failed();
    verdict.check("tablet_drop_fails", places == ["in_order"], places.join(","));
    Ok(verdict)
}
