//! QEMU's USB devices pulled out while a key or button is down, and plugged in again: each time lost, found, heard in order and by nobody else.

use super::usb_keyboard::{KEYBOARD, QEMU_ID};
use super::usb_pointer::{MOUSE, PLACE_MAX, REST, TABLET, counts, tablet_profile, there};
use crate::qmp::{Act, Qmp};
use crate::spacemouse::DeviceFault;
use crate::usb_hand::{Scene, Stranger, UsbHand, due, node_of, plugged, profile_for, unplugged};
use crate::verdict::PartVerdict;
use krait_master::{HidReport, InputDevice, Profile, ProfileDevice};

/// How often each is pulled out, and how often in a control.
const N_PLUGS: i32 = 20;
const N_CONTROL: i32 = 3;

/// A device, and what is done with it each time before it is pulled out.
#[derive(Clone, Copy)]
struct Held {
    device: (&'static str, &'static str),
    profile: fn(&InputDevice) -> anyhow::Result<Profile>,
    scene: fn(i32) -> Scene,
    /// What is let go while it is out.
    let_go: Act,
}

const HELD_KEY: Held = Held {
    device: KEYBOARD,
    profile: |device| profile_for("keyboard", device),
    scene: |_| vec![(vec![Act::Key("right", true)], vec![HidReport::Motion([175, 0, 0, 0, 0, 0])])],
    let_go: Act::Key("right", false),
};

const HELD_MOUSE: Held = Held {
    device: MOUSE,
    profile: |device| profile_for("mouse", device),
    scene: |k| {
        let moved = HidReport::Motion([counts(5 + k), 0, 0, 0, 0, 0]);
        vec![(vec![Act::Move("x", 5 + k)], vec![moved, REST]), pressed()]
    },
    let_go: Act::Button("left", false),
};

const HELD_TABLET: Held = Held {
    device: TABLET,
    profile: tablet_profile,
    scene: |k| {
        // Every time another place, off the middle on either axis.
        let [x, y] = [PLACE_MAX / 2 + 700 * (k + 1), PLACE_MAX / 2 - 500 * (k + 1)];
        vec![(vec![Act::Place("x", x), Act::Place("y", y)], vec![there(x, y)]), pressed()]
    },
    let_go: Act::Button("left", false),
};

fn pressed() -> (Vec<Act>, Vec<HidReport>) {
    (vec![Act::Button("left", true)], vec![HidReport::Buttons(1)])
}

pub fn keyboard(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    replug(qmp, HELD_KEY, N_PLUGS, DeviceFault::None)
}

pub fn mouse(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    replug(qmp, HELD_MOUSE, N_PLUGS, DeviceFault::None)
}

pub fn tablet(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    replug(qmp, HELD_TABLET, N_PLUGS, DeviceFault::None)
}

/// An act that is left out once must be missed of each device, and a device that stays where it is once must be neither lost nor found then.
pub fn control(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    for (name, held) in
        [("keyboard_drop_fails", HELD_KEY), ("mouse_drop_fails", HELD_MOUSE), ("tablet_drop_fails", HELD_TABLET)]
    {
        let dropped = replug(qmp, held, N_CONTROL, DeviceFault::Drop)?.failed();
        verdict.check(name, dropped == ["in_order"], dropped.join(","));
    }
    let stayed = replug(qmp, HELD_MOUSE, N_CONTROL, DeviceFault::Stays)?.failed();
    verdict.check("stay_fails", stayed == ["lost", "found"], stayed.join(","));
    Ok(verdict)
}

/// A fault spoils the time in the middle.
fn replug(qmp: &mut Qmp, held: Held, n_plugs: i32, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mut profile = (held.profile)(&plugged(qmp, held.device.0, held.device.1)?)?;
    profile.device = ProfileDevice::Id(QEMU_ID.0, QEMU_ID.1);
    let mut hand = UsbHand::take(profile)?;
    let (mut n_in_order, mut n_stolen) = (0, 0);
    for k in 0..n_plugs {
        let fault = if k == n_plugs / 2 { fault } else { DeviceFault::None };
        let mut stranger = Stranger::at(&node_of(held.device.1)?)?;
        hand.settle();
        let scene = (held.scene)(k);
        let heard = hand.play_through(&scene, fault, |acts| qmp.act(acts))?;
        n_in_order += i32::from(heard == due(&scene));
        n_stolen += stranger.heard();
        hand.replug(qmp, held.device, held.let_go, fault)?;
    }
    for (name, n) in [("in_order", n_in_order), ("lost", hand.n_lost), ("found", hand.n_found)] {
        verdict.check(name, n == n_plugs, format!("{n}/{n_plugs}"));
    }
    verdict.check("exclusive", n_stolen == 0, n_stolen);
    drop(hand);
    unplugged(qmp, held.device.0, held.device.1)?;
    Ok(verdict)
}
