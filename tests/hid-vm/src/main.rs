//! krait-hid-vm: runs inside the virtual machine, plays a hand controller through /dev/uhid and judges krait by what it does.

#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "the serial console is where the verdict is read")]

#[path = "../../vm/alarm.rs"]
mod alarm;
mod aside;
mod chain;
mod codes;
mod gamepad;
mod model;
mod parts;
mod pedal;
mod played;
mod qmp;
mod repeated;
mod spacemouse;
mod stick;
mod talking;
mod uhid;
mod usb_hand;
#[path = "../../vm/verdict.rs"]
mod verdict;

use anyhow::bail;
use qmp::Qmp;
use spacemouse::DeviceFault;
use std::cell::RefCell;
use std::process::ExitCode;
use std::rc::Rc;
use verdict::PartVerdict;

fn main() -> ExitCode {
    let all = match fault() {
        Ok(fault) if std::env::var("KRAIT_HID_VM_PARTS").as_deref() == Ok("usb") => run_usb_parts(fault),
        Ok(fault) => run_parts(fault),
        Err(error) => {
            println!("HID-VM arguments FAIL {error:#}");
            false
        }
    };
    println!("HID-VM verdict {}", if all { "PASS" } else { "FAIL" });
    if all { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// One part's name and what it does.
type Part = (&'static str, Box<dyn FnMut() -> anyhow::Result<PartVerdict>>);

fn run_parts(fault: DeviceFault) -> bool {
    let has_daemon = parts::has_spacenavd();
    if !has_daemon {
        println!("HID-VM spacenavd SKIPPED the daemon is not in this machine");
    }
    let daemon: [Part; 1] = [("spacenavd", Box::new(parts::spacenavd))];
    let others: [Part; 19] = [
        ("devices", Box::new(parts::devices)),
        ("chain", Box::new(move || parts::chain(fault))),
        ("control", Box::new(parts::control)),
        ("unplug", Box::new(parts::unplug)),
        ("replug", Box::new(parts::hid_replug)),
        ("replug_control", Box::new(parts::hid_replug_control)),
        ("receiver", Box::new(parts::receiver)),
        ("unreadable", Box::new(parts::unreadable)),
        ("malformed", Box::new(parts::malformed)),
        ("lights", Box::new(parts::lights)),
        ("rumble", Box::new(parts::rumble)),
        ("shipped_rumble", Box::new(parts::shipped_rumble)),
        ("stick", Box::new(move || parts::stick(fault))),
        ("stick_control", Box::new(parts::stick_control)),
        ("live", Box::new(move || parts::live(fault))),
        ("live_control", Box::new(parts::live_control)),
        ("two_hands", Box::new(move || parts::two_hands(fault))),
        ("pedal", Box::new(parts::pedal)),
        ("two_control", Box::new(parts::two_control)),
    ];
    are_known(&[names(&daemon), names(&others)].concat()) && (!has_daemon || run_all(daemon)) & run_all(others)
}

/// Those that need QEMU's own devices, in a machine that can ask for them.
fn run_usb_parts(fault: DeviceFault) -> bool {
    let qmp = match Qmp::open() {
        Ok(qmp) => Rc::new(RefCell::new(qmp)),
        Err(error) => {
            println!("HID-VM qmp FAIL {error:#}");
            return false;
        }
    };
    let part = |part: fn(&mut Qmp, DeviceFault) -> anyhow::Result<PartVerdict>| {
        let qmp = Rc::clone(&qmp);
        Box::new(move || part(&mut qmp.borrow_mut(), fault))
    };
    let all: [Part; 19] = [
        ("mouse", part(parts::mouse)),
        ("tablet", part(parts::tablet)),
        ("keyboard", part(parts::keyboard)),
        ("usb_control", part(|qmp, _| parts::usb_control(qmp))),
        ("usb_chain", part(|qmp, _| parts::usb_chain(qmp))),
        ("replug", part(|qmp, _| parts::replug(qmp))),
        ("mouse_replug", part(|qmp, _| parts::mouse_replug(qmp))),
        ("tablet_replug", part(|qmp, _| parts::tablet_replug(qmp))),
        ("replug_control", part(|qmp, _| parts::replug_control(qmp))),
        ("usb_two", part(parts::usb_two)),
        ("usb_two_control", part(|qmp, _| parts::usb_two_control(qmp))),
        ("usb_beside", part(parts::usb_beside)),
        ("usb_beside_control", part(|qmp, _| parts::usb_beside_control(qmp))),
        ("usb_lights", part(|qmp, _| parts::usb_lights(qmp))),
        ("usb_meters", part(|qmp, _| parts::usb_meters(qmp))),
        ("usb_restart", part(|qmp, _| parts::usb_restart(qmp))),
        ("mouse_repeated", part(|qmp, _| parts::mouse_repeated(qmp))),
        ("keyboard_repeated", part(|qmp, _| parts::keyboard_repeated(qmp))),
        ("tablet_repeated", part(|qmp, _| parts::tablet_repeated(qmp))),
    ];
    are_known(&names(&all)) && run_all(all)
}

fn names(parts: &[Part]) -> Vec<&'static str> {
    parts.iter().map(|(name, _)| *name).collect()
}

/// The names in `KRAIT_HID_VM_ONLY`, by commas; empty for all parts.
fn only() -> String {
    std::env::var("KRAIT_HID_VM_ONLY").unwrap_or_default()
}

/// Whether every part that is asked for by name is one of these: a rig that runs nothing has shown nothing.
fn are_known(names: &[&str]) -> bool {
    let unknown: Vec<String> =
        only().split(',').filter(|own| !own.is_empty() && !names.contains(own)).map(str::to_owned).collect();
    if !unknown.is_empty() {
        println!("HID-VM parts FAIL none is called {}; there are {}", unknown.join(","), names.join(","));
    }
    unknown.is_empty()
}

fn run_all<const N: usize>(parts: [Part; N]) -> bool {
    let mut all = true;
    let only = only();
    let is_wanted = |name: &str| only.is_empty() || only.split(',').any(|wanted| wanted == name);
    let Some((first, step)) = share(&std::env::var("KRAIT_HID_VM_SHARE").unwrap_or_default()) else {
        println!("HID-VM share FAIL KRAIT_HID_VM_SHARE is not as 1/2, the first half of the parts, or nothing");
        return false;
    };
    for (name, mut part) in parts.into_iter().skip(first).step_by(step).filter(|(name, _)| is_wanted(name)) {
        match alarm::watched("HID-VM", name, &mut part) {
            Ok(verdict) => {
                all &= verdict.passed();
                println!("HID-VM {name} {verdict}");
            }
            Err(error) => {
                all = false;
                println!("HID-VM {name} FAIL {}", format!("{error:#}").replace('\n', " / "));
            }
        }
    }
    all
}

/// The first part, from 0, and how many machines share the parts in turn: `1/2` is every second part from the first on.
fn share(text: &str) -> Option<(usize, usize)> {
    if text.is_empty() {
        return Some((0, 1));
    }
    let (own, all) = text.split_once('/')?;
    let (own, all): (usize, usize) = (own.parse().ok()?, all.parse().ok()?);
    (1..=all).contains(&own).then(|| (own - 1, all))
}

/// How `KRAIT_HID_VM_FAULT` spoils the device of the parts that heed it.
fn fault() -> anyhow::Result<DeviceFault> {
    match std::env::var("KRAIT_HID_VM_FAULT").as_deref() {
        Err(_) | Ok("") => Ok(DeviceFault::None),
        Ok("silent") => Ok(DeviceFault::Silent),
        Ok("drop") => Ok(DeviceFault::Drop),
        Ok("swap") => Ok(DeviceFault::Swap),
        Ok("flip") => Ok(DeviceFault::Flip),
        Ok(other) => {
            bail!("KRAIT_HID_VM_FAULT is {other:?}, expected \"silent\", \"drop\", \"swap\", \"flip\" or nothing")
        }
    }
}
