//! A chain in the hand of QEMU's mouse, and one in that of its keyboard: what it made of their reports is what the file of them makes.

use crate::chain::{User, VmChain};
use crate::qmp::{Act, Qmp};
use crate::repeated;
use crate::usb_hand::{plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

const PAUSE: Duration = Duration::from_millis(40);
const MOVED_DEG: f64 = 2.0;

/// The mouse.
pub fn mouse(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut scene = vec![vec![Act::Button("left", true)], vec![Act::Button("left", false)]];
    scene.extend((0..40).map(|k| vec![Act::Move("x", 10 + k % 7), Act::Move("y", k - 20)]));
    scene.extend([vec![Act::Button("right", true)], vec![Act::Move("x", 20)], vec![Act::Button("right", false)]]);
    scene.extend((0..10).map(|_| vec![Act::Move("x", -30)]));
    judge(qmp, ("usb-mouse", "USB Mouse"), "mouse", &scene)
}

/// The keyboard.
pub fn keyboard(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut scene = Vec::new();
    for keys in [&["spc"][..], &["right"], &["down", "right"], &["shift", "left"], &["left"], &["pgup", "e"], &["up"]] {
        for is_down in [true, false] {
            scene.extend(keys.iter().map(|key| vec![Act::Key(key, is_down)]));
            scene.extend(vec![Vec::new(); 6]);
        }
    }
    judge(qmp, ("usb-kbd", "USB Keyboard"), "keyboard", &scene)
}

fn judge(
    qmp: &mut Qmp,
    (driver, name): (&str, &str),
    profile: &str,
    scene: &[Vec<Act>],
) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let device = plugged(qmp, driver, name)?;
    let [config, reports] = [format!("/tmp/{profile}-repeated.toml"), format!("/tmp/{profile}-repeated.krr")];
    std::fs::write(&config, format!("[master]\nrecord_reports = \"{reports}\"\n")).context("a configuration")?;
    let node = device.node.display().to_string();
    let more = ["--profile", profile, "--node", &node, "--config", &config];
    let chain = VmChain::start_with(&format!("repeated-{profile}"), User::Root, 7.0, &more)?;
    let begun_ns = clock::monotonic_ns();
    for acts in scene {
        if !acts.is_empty() {
            qmp.act(acts)?;
        }
        sleep(PAUSE);
    }
    let played_ns = clock::monotonic_ns();
    let (ended, journal, recording) = chain.end_with_recording()?;
    let moved_deg = journal.moved_deg(begun_ns, played_ns);
    verdict.check("moved_deg", moved_deg > MOVED_DEG, format!("{moved_deg:.1}"));
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    repeated::judge(&mut verdict, &journal, Path::new(&reports), &recording)?;
    unplugged(qmp, driver, name)?;
    Ok(verdict)
}
