//! A master that is killed is started again: it takes the keyboard again, but not one that its user has given back.

use crate::chain::{User, VmChain, pid_of, signal};
use crate::qmp::Qmp;
use crate::spacemouse::wait_for;
use crate::usb_hand::{Stranger, plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_ipc::message::DeviceState;
use std::thread::sleep;
use std::time::Duration;

const KEYBOARD: (&str, &str) = ("usb-kbd", "USB Keyboard");
/// Longer than a master takes to start and to take its device.
const STARTED: Duration = Duration::from_millis(1500);

/// Killed before Escape and after it.
pub fn restart(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let device = plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let node = device.node.display().to_string();
    let chain = VmChain::start_with("restart", User::Root, 12.0, &["--profile", "keyboard", "--node", &node])?;
    let mut stranger = Stranger::at(&device)?;
    kill_master()?;
    typed(qmp)?;
    let n_taken = stranger.heard();
    verdict.check("taken_again", n_taken == 0, n_taken);
    qmp.press("esc")?;
    sleep(Duration::from_millis(300));
    let escaped_ns = clock::monotonic_ns();
    stranger.heard();
    kill_master()?;
    typed(qmp)?;
    let n_free = stranger.heard();
    verdict.check("left_to_its_user", n_free > 0, n_free);
    let typed_ns = clock::monotonic_ns();
    let (ended, journal) = chain.end()?;
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    for (name, at_ns) in [("escaped", escaped_ns), ("restarted", typed_ns)] {
        let input = journal.input_at(at_ns).context("no input")?;
        let is_told = input.is_given_back() && input.device() == Some(DeviceState::Lost);
        verdict.check(name, is_told, format!("{:?}", input.device()));
    }
    let n_again = journal.inputs.windows(2).filter(|pair| pair[1].sequence < pair[0].sequence).count();
    verdict.check("restarts", n_again == 2, n_again);
    // 1: it ran, and two processes were lost on the way.
    verdict.check("exit_code", ended.code == Some(1), format!("{:?}", ended.code));
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    Ok(verdict)
}

fn kill_master() -> anyhow::Result<()> {
    let before = pid_of("master")?;
    signal("master", "KILL")?;
    wait_for("another master", || pid_of("master").is_ok_and(|pid| pid != before))?;
    sleep(STARTED);
    Ok(())
}

fn typed(qmp: &mut Qmp) -> anyhow::Result<()> {
    qmp.press("a")
}
