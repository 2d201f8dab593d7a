//! krait-hid-vm: runs inside the virtual machine, plays a hand controller through /dev/uhid and judges krait by what it does.

#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "the serial console is where the verdict is read")]

mod chain;
mod model;
mod parts;
mod qmp;
mod spacemouse;
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
    run_all([
        ("devices", Box::new(parts::devices)),
        ("chain", Box::new(move || parts::chain(fault))),
        ("control", Box::new(parts::control)),
        ("unplug", Box::new(parts::unplug)),
        ("receiver", Box::new(parts::receiver)),
        ("unreadable", Box::new(parts::unreadable)),
        ("malformed", Box::new(parts::malformed)),
    ])
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
    run_all([
        ("mouse", part(parts::mouse)),
        ("tablet", part(|qmp, _| parts::tablet(qmp))),
        ("keyboard", part(parts::keyboard)),
        ("usb_control", part(|qmp, _| parts::usb_control(qmp))),
        ("usb_chain", part(|qmp, _| parts::usb_chain(qmp))),
        ("replug", part(|qmp, _| parts::replug(qmp))),
    ])
}

fn run_all<const N: usize>(parts: [Part; N]) -> bool {
    let mut all = true;
    for (name, mut part) in parts {
        match part() {
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

/// How `KRAIT_HID_VM_FAULT` spoils the device of the part `chain`.
fn fault() -> anyhow::Result<DeviceFault> {
    match std::env::var("KRAIT_HID_VM_FAULT").as_deref() {
        Err(_) | Ok("") => Ok(DeviceFault::None),
        Ok("silent") => Ok(DeviceFault::Silent),
        Ok("drop") => Ok(DeviceFault::Drop),
        Ok(other) => bail!("KRAIT_HID_VM_FAULT is {other:?}, expected \"silent\", \"drop\" or nothing"),
    }
}
