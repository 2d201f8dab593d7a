//! QEMU's USB mouse and USB tablet, by the built-in profile and by one of the user's own.

use crate::chain::{User, VmEnded};
use crate::qmp::{Act, Qmp};
use crate::spacemouse::DeviceFault;
use crate::usb_hand::{Scene, Stranger, UsbHand, due, plugged, profile_for, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_master::{AXIS_LIMIT_COUNTS, HidReport, InputDevice, Profile, ProfileDevice};
use std::thread::sleep;
use std::time::Duration;

pub const MOUSE: (&str, &str) = ("usb-mouse", "USB Mouse");
pub const TABLET: (&str, &str) = ("usb-tablet", "USB Tablet");
/// Full speed of the built-in profile, counts/s, and the window, s.
const FULL_COUNTS_PER_S: f64 = 2000.0;
const WINDOW_S: f64 = 0.016;
/// Largest place that QEMU tells.
pub const PLACE_MAX: i32 = 32767;
const N_MOVES: i32 = 40;
/// Moves of a count each in one go, and the pause between two: half of the full speed at most, so that no window is cut off.
const N_FAST: i32 = 400;
const FAST_PAUSE: Duration = Duration::from_millis(1);

const LIMIT: f64 = AXIS_LIMIT_COUNTS as f64;
pub const REST: HidReport = HidReport::Motion([0; 6]);

/// The mouse: each move is one deflection that ends, each press one button, all in order; nobody else hears it; no count is lost.
pub fn mouse(qmp: &mut Qmp, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let device = plugged(qmp, MOUSE.0, MOUSE.1)?;
    let listed = VmEnded::of(User::Root, &["devices", "--json"])?.json()?;
    let listed = listed
        .as_array()
        .context("no list")?
        .iter()
        .find(|d| device.node.as_os_str() == d["path"].as_str().unwrap_or(""));
    let listed = listed.context("the mouse is not listed")?;
    verdict.check("could_be", listed["could_be"] == "mouse" && listed["known_as"].is_null(), &listed["could_be"]);
    let mut stranger = Stranger::at(&device)?;
    let mut hand = UsbHand::take(profile_for("mouse", &device)?)?;

    let scene = mouse_scene();
    let heard = hand.play(&scene, fault, |acts| qmp.act(acts))?;
    verdict.check("in_order", heard == due(&scene), format!("{}/{}", heard.len(), due(&scene).len()));
    // A way in one go is cut into windows, and QEMU may join two moves; every count is in one of them.
    for _ in 0..N_FAST {
        qmp.act(&[Act::Move("x", 1)])?;
        sleep(FAST_PAUSE);
    }
    let mut sum = 0.0;
    let mut n_windows = 0;
    // Windows of the same speed are told again, so all motion counts here.
    while let Some(counts) = hand.next_motion() {
        sum += f64::from(counts[0]) / LIMIT * FULL_COUNTS_PER_S * WINDOW_S;
        n_windows += u32::from(counts[0] != 0);
    }
    let all = f64::from(N_FAST);
    let rounding = f64::from(n_windows) * 0.5 / LIMIT * FULL_COUNTS_PER_S * WINDOW_S;
    verdict.check("fast_counts", (sum - all).abs() <= rounding, format!("{sum:.1}/{all}in{n_windows}"));
    let n_stolen = stranger.heard();
    verdict.check("exclusive", n_stolen == 0, n_stolen);
    drop(hand);
    qmp.act(&[Act::Move("x", 5)])?;
    let n_given_back = stranger.heard();
    verdict.check("given_back", n_given_back > 0, n_given_back);
    unplugged(qmp, MOUSE.0, MOUSE.1)?;
    Ok(verdict)
}

/// What the built-in profile makes of a move in one window.
pub fn counts(moved: i32) -> i16 {
    (f64::from(moved) / (FULL_COUNTS_PER_S * WINDOW_S) * LIMIT).round().clamp(-LIMIT, LIMIT) as i16
}

pub fn mouse_scene() -> Scene {
    let mut scene: Scene = (1..=N_MOVES)
        .map(|k| {
            // Every step another, some of them beyond the full speed.
            let [x, y] = [k, -2 * k + 20];
            let moved = HidReport::Motion([counts(x), 0, counts(y), 0, 0, 0]);
            (vec![Act::Move("x", x), Act::Move("y", y)], vec![moved, REST])
        })
        .collect();
    for (button, bit) in [("left", 1), ("right", 2), ("middle", 4)] {
        scene.push((vec![Act::Button(button, true)], vec![HidReport::Buttons(bit)]));
        scene.push((vec![Act::Button(button, false)], vec![HidReport::Buttons(0)]));
    }
    for (button, y) in [("wheel-up", -350), ("wheel-down", 350)] {
        let notch = HidReport::Motion([0, y, 0, 0, 0, 0]);
        scene.push((vec![Act::Button(button, true)], vec![notch, REST]));
        scene.push((vec![Act::Button(button, false)], Vec::new()));
    }
    scene
}

/// A profile of one's own for the tablet.
pub const TABLET_PROFILE: &str = "name = \"Tablet\"\nid = \"0627:0001\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\n[[axis]]\nof = \"z\"\nfrom = \"ABS_Y\"\n[[button]]\nof = 0\nfrom = \"BTN_LEFT\"\n";

/// The same of one node.
pub fn tablet_profile(device: &InputDevice) -> anyhow::Result<Profile> {
    let mut profile = Profile::parse("own", TABLET_PROFILE)?;
    profile.device = ProfileDevice::Path(device.node.clone());
    Ok(profile)
}

/// What it makes of a place.
pub fn there(x: i32, y: i32) -> HidReport {
    let rest = f64::from(PLACE_MAX) / 2.0;
    let counts = |place: i32| ((f64::from(place) - rest) / rest * LIMIT).round() as i16;
    HidReport::Motion([counts(x), 0, counts(y), 0, 0, 0])
}

/// The tablet: places on a range whose middle is rest, and no motion of its own back to it.
pub fn tablet(qmp: &mut Qmp, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let device = plugged(qmp, TABLET.0, TABLET.1)?;
    let mut stranger = Stranger::at(&device)?;
    let mut hand = UsbHand::take(tablet_profile(&device)?)?;
    // Where it was before anybody moved it is not known; from there it goes to the middle.
    qmp.act(&[Act::Place("x", PLACE_MAX / 2), Act::Place("y", PLACE_MAX / 2)])?;
    hand.settle();
    let mut scene: Scene = Vec::new();
    for k in 0..=20 {
        let [x, y] = [k * PLACE_MAX / 20, PLACE_MAX - k * PLACE_MAX / 20];
        scene.push((vec![Act::Place("x", x), Act::Place("y", y)], vec![there(x, y)]));
    }
    scene.push((vec![Act::Button("left", true)], vec![HidReport::Buttons(1)]));
    scene.push((vec![Act::Button("left", false)], vec![HidReport::Buttons(0)]));
    let heard = hand.play(&scene, fault, |acts| qmp.act(acts))?;
    verdict.check("in_order", heard == due(&scene), format!("{}/{}", heard.len(), due(&scene).len()));
    verdict.check("stays", hand.next_motion() == Some([350, 0, -350, 0, 0, 0]), "deflected");
    let n_stolen = stranger.heard();
    verdict.check("exclusive", n_stolen == 0, n_stolen);
    drop(hand);
    unplugged(qmp, TABLET.0, TABLET.1)?;
    Ok(verdict)
}
