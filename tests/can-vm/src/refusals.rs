//! What is refused, and with which sentence: an interface that is down, one that is taken, another master.

use crate::chain::RigChain;
use crate::verdict::PartVerdict;
use crate::world::{DriveMake, Drives, INTERFACE, config};
use anyhow::{Context, ensure};
use core::time::Duration;
use krait_drives::cia402::{CanListener, CanPort, Frame, open_drive};
use krait_slave::Drive;
use socketcan::{CanErrorFrame, CanSocket, Socket};
use std::process::Command;

/// The kernel's bit for "the controller has left the bus".
const CAN_ERR_BUSOFF: u32 = 0x40;

/// Sets the interface up or down.
pub fn set(state: &str) -> anyhow::Result<()> {
    let status = Command::new("/bin/ip").args(["link", "set", INTERFACE, state]).status()?;
    ensure!(status.success(), "ip link set {state}");
    Ok(())
}

/// Tells whoever asked for it that the controller has left the bus, as its driver would: a virtual interface passes an error frame of
/// anybody on.
fn cry_bus_off() -> anyhow::Result<()> {
    let frame = CanErrorFrame::new_error(CAN_ERR_BUSOFF, &[0; 8])?;
    CanSocket::open(INTERFACE)?.write_frame(&frame).context("an error frame")
}

fn check(verdict: &mut PartVerdict, name: &'static str, sentence: &str, words: &str) {
    let is_met = sentence.contains(words);
    verdict.check(name, is_met, if is_met { "named".to_owned() } else { sentence.replace(' ', "_") });
}

/// All refusals.
pub fn all() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let opened =
        || open_drive(&config(1.0), None).map(drop).err().map_or("opened".to_owned(), |error| error.to_string());
    check(&mut verdict, "nobody", &opened(), "no drive answers on vcan0");
    set("down")?;
    check(&mut verdict, "down", &opened(), "vcan0 is down; `sudo ip link set vcan0 up");
    set("up")?;
    let taken = CanPort::open(INTERFACE)?;
    check(&mut verdict, "taken", &opened(), "in use by another program");
    drop(taken);

    let _drives = Drives::start(DriveMake::Own)?;
    let other = CanListener::open(INTERFACE)?;
    let sentence = std::thread::scope(|scope| {
        let opening = scope.spawn(opened);
        for _ in 0..10 {
            std::thread::sleep(Duration::from_millis(5));
            if let Err(gone) = other.send(&Frame::new(0x080, &[])) {
                return gone.to_string();
            }
        }
        opening.join().unwrap_or_else(|_| "it panicked".to_owned())
    });
    check(&mut verdict, "second_master", &sentence, "another master is on the CAN bus: it sends SYNC");
    let mut chain = RigChain::powered(1.0)?;
    chain.go(50)?;
    other.send(&Frame::new(0x080, &[]))?;
    let sentence = chain.until_failure(50)?.to_string();
    check(&mut verdict, "second_master_in_motion", &sentence, "does what only a master does");
    drop(chain);

    let mut chain = RigChain::powered(1.0)?;
    chain.go(50)?;
    cry_bus_off()?;
    let sentence = chain.until_failure(50)?.to_string();
    check(&mut verdict, "bus_off_in_motion", &sentence, "its CAN interface is bus-off after too many errors");
    // A controller that is on the bus again by itself moves nothing.
    chain.go(100)?;
    let at = chain.monitor.counts;
    chain.go(100)?;
    let way = (0..3).map(|k| chain.monitor.counts[k].abs_diff(at[k])).max().unwrap_or(u32::MAX);
    verdict.check("bus_off_then_moved_counts", way == 0 && at[0] != 0, way);
    drop(chain);

    let mut chain = RigChain::powered(1.0)?;
    chain.go(50)?;
    set("down")?;
    // Nothing can be watched any more.
    for _ in 0..50 {
        std::thread::sleep(Duration::from_millis(1));
        chain.drive.read(krait_ipc::clock::monotonic_ns())?;
    }
    let sentence = chain.drive.failure().map_or("nothing failed".to_owned(), |failure| failure.to_string());
    check(&mut verdict, "down_in_motion", &sentence, "its CAN interface is down");
    Ok(verdict)
}
