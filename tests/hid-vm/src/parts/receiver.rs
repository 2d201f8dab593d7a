//! A wireless receiver: several nodes under one vendor and product, and the hand on a later one.

use crate::chain::{User, VmChain};
use crate::model::Model;
use crate::spacemouse::SpaceMouse;
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_master::HidReport;

const MOVED_DEG: f64 = 5.0;

/// The first node is silent, a mouse talks on the second, the third moves the snake and is the only one that is read.
pub fn receiver() -> anyhow::Result<PartVerdict> {
    let unpaired = SpaceMouse::plug(Model::ReceiverHand)?;
    let mut mouse = SpaceMouse::plug(Model::ReceiverMouse)?;
    let mut hand = SpaceMouse::plug(Model::ReceiverHand)?;
    let chain = VmChain::start("receiver", User::Root, 2.0)?;
    let is_read = hand.wait_until_read();
    // To the decoder this is a push of the cap; krait must not even read it.
    let moved = HidReport::Translation([250, 0, 0]).encode();
    for _ in 0..3 {
        mouse.send(moved.as_bytes())?;
    }
    let begin_ns = clock::monotonic_ns();
    hand.press(0)?;
    hand.hold(250, 300)?;
    for _ in 0..3 {
        mouse.send(moved.as_bytes())?;
    }
    hand.release()?;
    let end_ns = clock::monotonic_ns();
    let (ended, journal) = chain.end()?;

    let mut verdict = PartVerdict::default();
    let last = journal.inputs.last().context("no input")?;
    let moved_deg = journal.moved_deg(begin_ns, end_ns);
    verdict.check("read", is_read.is_ok(), is_read.is_ok());
    verdict.check("moved_deg", moved_deg > MOVED_DEG, format!("{moved_deg:.1}"));
    verdict.check("reports", last.n_reports == hand.n_sent, format!("{}/{}", last.n_reports, hand.n_sent));
    verdict.check("refused", last.n_refused == 0, last.n_refused);
    let [[unpaired_on, unpaired_off, _], hand_lights] = [unpaired.lights(), hand.lights()];
    verdict.check("hand_lights", hand_lights == [1, 1, 0], format!("{hand_lights:?}").replace(' ', ""));
    verdict.check("unpaired_lights", unpaired_on == unpaired_off, format!("{unpaired_on},{unpaired_off}"));
    verdict.check("mouse_lights", mouse.lights() == [0; 3], format!("{:?}", mouse.lights()).replace(' ', ""));
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    for device in [unpaired, mouse, hand] {
        device.unplug()?;
    }
    Ok(verdict)
}
