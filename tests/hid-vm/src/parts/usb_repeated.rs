//! A chain in the hand of QEMU's mouse, one in that of its keyboard and one in that of its tablet: what it made of their reports is what the file of them makes.

use super::usb_keyboard::KEYBOARD;
use super::usb_pointer::{MOUSE, PLACE_MAX, TABLET, TABLET_PROFILE};
use crate::qmp::{Act, Qmp};
use crate::repeated;
use crate::usb_hand::{plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use std::thread::sleep;
use std::time::Duration;

/// A busy host makes QEMU slow to answer.
const CHAIN_S: f64 = 7.0;
const PAUSE: Duration = Duration::from_millis(40);

/// The mouse.
pub fn mouse(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut scene = vec![vec![Act::Button("left", true)], vec![Act::Button("left", false)]];
    scene.extend((0..40).map(|k| vec![Act::Move("x", 10 + k % 7), Act::Move("y", k - 20)]));
    scene.extend([vec![Act::Button("right", true)], vec![Act::Move("x", 20)], vec![Act::Button("right", false)]]);
    scene.extend((0..10).map(|_| vec![Act::Move("x", -30)]));
    judge(qmp, MOUSE, ("mouse", "mouse"), &scene)
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
    judge(qmp, KEYBOARD, ("keyboard", "keyboard"), &scene)
}

/// The tablet, from its middle to all sides.
pub fn tablet(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let profile = "/tmp/tablet.toml";
    std::fs::write(profile, TABLET_PROFILE).context(profile)?;
    let place = |x: i32, y: i32| vec![Act::Place("x", x), Act::Place("y", y)];
    let middle = PLACE_MAX / 2;
    let mut scene = vec![place(middle, middle), vec![Act::Button("left", true)], vec![Act::Button("left", false)]];
    scene.extend((0..40).map(|k| place(middle + 300 * k, middle - 200 * k)));
    scene.extend((0..20).map(|k| place(PLACE_MAX - 1500 * k, 1500 * k)));
    scene.push(place(middle, middle));
    judge(qmp, TABLET, ("tablet", profile), &scene)
}

fn judge(
    qmp: &mut Qmp,
    (driver, device): (&str, &str),
    (name, profile): (&str, &str),
    scene: &[Vec<Act>],
) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let node = plugged(qmp, driver, device)?.node.display().to_string();
    repeated::chain(&mut verdict, name, (&["--profile", profile, "--node", &node], CHAIN_S), || {
        for acts in scene {
            if !acts.is_empty() {
                qmp.act(acts)?;
            }
            sleep(PAUSE);
        }
        Ok(())
    })?;
    unplugged(qmp, driver, device)?;
    Ok(verdict)
}
