//! A wireless receiver: several nodes under one vendor and product, and the hand on a later one.

use crate::chain::{User, VmChain};
use crate::model::Model;
use crate::spacemouse::{SpaceMouse, Switched};
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
    let switched = |device: &SpaceMouse, to| device.lit().iter().filter(|(_, what)| *what == to).count();
    let [unpaired_on, unpaired_off] = [Switched::On, Switched::Off].map(|to| switched(&unpaired, to));
    let (n_on, hand_lit) = (switched(&hand, Switched::On), hand.lit());
    let is_dark = hand_lit.last().is_some_and(|(_, what)| *what == Switched::Off);
    verdict.check("hand_lights", n_on > 0 && is_dark, format!("{n_on}/{}", hand_lit.len()));
    verdict.check("unpaired_lights", unpaired_on == unpaired_off, format!("{unpaired_on},{unpaired_off}"));
    verdict.check("mouse_lights", mouse.lit().is_empty(), mouse.lit().len());
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    for device in [unpaired, mouse, hand] {
        device.unplug()?;
    }
    Ok(verdict)
}
