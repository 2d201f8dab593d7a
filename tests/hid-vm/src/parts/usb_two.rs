//! A mouse for a hand and a keyboard for a pedal, worked at once and each read by its own reader.

use super::usb_keyboard::{KEYBOARD, scene as keyboard_scene};
use super::usb_pointer::{MOUSE, mouse_scene};
use crate::qmp::Qmp;
use crate::spacemouse::DeviceFault;
use crate::usb_hand::{PATIENCE_NS, SILENCE_NS, Stranger, UsbHand, due, plugged, profile_for, unplugged};
use crate::verdict::PartVerdict;

/// Acts of both in turn, without waiting for what comes of the first; a fault leaves out one of the keyboard's.
pub fn two(qmp: &mut Qmp, fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let devices = [plugged(qmp, MOUSE.0, MOUSE.1)?, plugged(qmp, KEYBOARD.0, KEYBOARD.1)?];
    let mut strangers = [Stranger::at(&devices[0])?, Stranger::at(&devices[1])?];
    let mut hands =
        [UsbHand::take(profile_for("mouse", &devices[0])?)?, UsbHand::take(profile_for("keyboard", &devices[1])?)?];
    let scenes = [mouse_scene(), keyboard_scene()];
    let mut heard = [Vec::new(), Vec::new()];
    let n_steps = scenes[0].len().max(scenes[1].len());
    for idx in 0..n_steps {
        let is_spoiled = fault == DeviceFault::Drop && idx == scenes[1].len() / 2;
        for (acts, _) in [scenes[0].get(idx), scenes[1].get(idx).filter(|_| !is_spoiled)].into_iter().flatten() {
            qmp.act(acts)?;
        }
        for (hand, (scene, heard)) in hands.iter_mut().zip(scenes.iter().zip(&mut heard)) {
            let n_due = scene.get(idx).map_or(0, |(_, due)| due.len());
            heard.extend((0..n_due).map_while(|_| hand.next(PATIENCE_NS)));
        }
    }
    for (hand, heard) in hands.iter_mut().zip(&mut heard) {
        heard.extend(std::iter::from_fn(|| hand.next(SILENCE_NS)));
    }
    for (name, (heard, scene)) in ["mouse", "keyboard"].into_iter().zip(heard.iter().zip(&scenes)) {
        verdict.check(name, *heard == due(scene), format!("{}/{}", heard.len(), due(scene).len()));
    }
    let n_stolen = strangers.iter_mut().map(Stranger::heard).sum::<usize>();
    verdict.check("exclusive", n_stolen == 0, n_stolen);
    drop(hands);
    unplugged(qmp, MOUSE.0, MOUSE.1)?;
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    Ok(verdict)
}

/// A key that is left out is missed on the keyboard and nowhere else.
pub fn control(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let dropped = two(qmp, DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["keyboard"], dropped.join(","));
    Ok(verdict)
}
