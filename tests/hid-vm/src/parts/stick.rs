//! A joystick by the profile that krait ships for it: taken, each report decoded and in order, and a chain that makes of them what their file makes.

use crate::chain::{User, VmEnded};
use crate::repeated;
use crate::spacemouse::DeviceFault;
use crate::stick::{PRODUCT_ID, Stick, StickPose};
use crate::usb_hand::{Scene, UsbHand, due};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_master::{HidReport, Profile};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

/// The profile, as a user names it.
pub const PROFILE: &str = "extreme-3d-pro";
/// What that profile calls the device.
const KNOWN_AS: &str = "Logitech Extreme 3D Pro";
/// Buttons that it takes, a bit each.
const TAKEN_BUTTONS: u16 = 0b111;
const N_POSES: u32 = 240;
/// How long a chain runs, s: the poses take 3 s.
const CHAIN_S: f64 = 4.0;
/// Between two reports to the chain.
const PAUSE: Duration = Duration::from_millis(12);

/// A fault leaves out one report, and then no chain is run.
pub fn stick(fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mut stick = Stick::plug()?;
    let listed = VmEnded::of(User::Root, &["devices", "--json"])?.json()?;
    let listed = listed.as_array().context("no list of devices")?;
    let is_node = |device: &&serde_json::Value| {
        device["product_id"] == PRODUCT_ID
            && device["path"].as_str().is_some_and(|path| path.starts_with("/dev/input/"))
    };
    let known_as = listed.iter().find(is_node).map(|device| &device["known_as"]);
    verdict.check("known_as", known_as.is_some_and(|name| name == KNOWN_AS), format!("{known_as:?}"));
    let mut hand = UsbHand::take(Profile::load(Path::new(PROFILE))?)?;
    hand.settle();
    let scene = scene();
    let heard = hand.play(&scene, fault, |pose| stick.hold(*pose))?;
    let (n_heard, n_due) = (heard.len(), due(&scene).len());
    verdict.check("in_order", heard == due(&scene), format!("{n_heard}/{n_due}of{N_POSES}"));
    drop(hand);
    if fault == DeviceFault::None {
        stick.hold(StickPose::REST)?;
        repeated::chain(&mut verdict, "stick", (&["--profile", PROFILE], CHAIN_S), || {
            sleep(PAUSE);
            // Presence, and then motion.
            let pressed = StickPose { buttons: 1, ..StickPose::REST };
            for pose in [pressed, StickPose::REST].into_iter().chain(scene.iter().map(|(pose, _)| *pose)) {
                stick.hold(pose)?;
                sleep(PAUSE);
            }
            Ok(())
        })?;
    }
    Ok(verdict)
}

/// A report that is left out must be missed, and be all that is.
pub fn control() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let dropped = stick(DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["in_order"], dropped.join(","));
    Ok(verdict)
}

/// Far from pose to pose, since the kernel smooths small steps of such an axis; each of the twelve buttons in turn.
fn scene() -> Scene<StickPose> {
    let (mut motion, mut buttons) = (StickPose::REST.motion(), 0);
    (1..=N_POSES)
        .map(|k| {
            let pressed = if k % 4 < 2 { 1 << (k / 4 % 12) } else { 0 };
            let pose = StickPose {
                x: (k * 389 % 1024) as u16,
                y: ((k * 277 + 100) % 1024) as u16,
                twist: (k * 71 % 256) as u8,
                buttons: pressed,
            };
            let is_moved = std::mem::replace(&mut motion, pose.motion()) != motion;
            let taken = pressed & TAKEN_BUTTONS;
            let is_pressed = std::mem::replace(&mut buttons, taken) != buttons;
            let moved = is_moved.then_some(motion);
            (pose, moved.into_iter().chain(is_pressed.then(|| HidReport::Buttons(taken.into()))).collect())
        })
        .collect()
}
