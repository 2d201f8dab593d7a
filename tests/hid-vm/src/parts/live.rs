//! `krait devices` on a real node: `--live` follows a joystick and a SpaceMouse, `--calibrate` finds what the joystick sends and a chain drives by
//! the profile that it writes, `--write-udev` writes the rule and says what to do with it.

use super::stick::PROFILE;
use crate::chain::{User, VmChain, VmEnded};
use crate::model::Model;
use crate::spacemouse::{DeviceFault, SpaceMouse};
use crate::stick::{NAME, PRODUCT_ID, Stick, StickPose, VENDOR_ID, node};
use crate::talking::Talking;
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_master::{HidReport, Profile, RULES_FILE};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

const PAUSE: Duration = Duration::from_millis(30);
/// What `--live` must say of a pose: counts as they were sent, the deflection that the shipped profile makes of them, and the buttons.
const SHOWN: [(StickPose, [&str; 4]); 3] = [
    (
        StickPose { x: 1023, y: 0, twist: 255, buttons: 0b1 },
        ["ABS_X  1023 = x +100 %", "ABS_Y     0 = z -100 %", "ABS_RZ   255 = rz +100 %", "buttons BTN_TRIGGER"],
    ),
    (
        StickPose { x: 736, y: 288, twist: 64, buttons: 0b110 },
        [
            "ABS_X   736 = x  +36 %",
            "ABS_Y   288 = z  -36 %",
            "ABS_RZ    64 = rz  -43 %",
            "buttons BTN_THUMB BTN_THUMB2",
        ],
    ),
    (StickPose::REST, ["ABS_X   512 = x   +0 %", "ABS_Y   512 = z   +0 %", "ABS_RZ   128 = rz   +0 %", "no button"]),
];
/// The noise of the hand at rest, far enough apart that the kernel does not smooth it, and the ends that it is moved to.
const NOISE: [StickPose; 2] = [
    StickPose { x: 504, y: 500, twist: 124, ..StickPose::REST },
    StickPose { x: 520, y: 524, twist: 132, ..StickPose::REST },
];
const ENDS: [StickPose; 2] = [
    StickPose { x: 20, y: 10, twist: 3, ..StickPose::REST },
    StickPose { x: 1001, y: 1010, twist: 250, ..StickPose::REST },
];
/// Range, rest and noise that follow: rest is the middle of the noise, noise 1.5 times half of it, rounded up, and a count.
const MEASURED: [([i32; 2], i32, i32); 3] = [([20, 1001], 512, 13), ([10, 1010], 512, 19), ([3, 250], 128, 7)];
const CALIBRATED: &str = "/tmp/calibrated.toml";
const MOVED_DEG: f64 = 2.0;

/// A fault leaves out a pose that is shown and stays short of one of the ends; no chain then drives by the written profile.
pub fn live(fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mut stick = Stick::plug()?;
    let node = node().context("the joystick has no node")?.node.display().to_string();
    shown(&mut verdict, &mut stick, &node, fault)?;
    cap_shown(&mut verdict)?;
    let is_measured = calibrated(&mut verdict, &mut stick, &node, fault)?;
    if is_measured {
        driven(&mut verdict, &mut stick)?;
    }
    udev_written(&mut verdict)?;
    Ok(verdict)
}

/// What is left out, and the end that is not reached, must be missed there, and nowhere else.
pub fn control() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let dropped = live(DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["follows", "measured"], dropped.join(","));
    Ok(verdict)
}

fn shown(verdict: &mut PartVerdict, stick: &mut Stick, node: &str, fault: DeviceFault) -> anyhow::Result<()> {
    let live = Talking::start(&["devices", "--live", "--node", node, "--profile", PROFILE])?;
    verdict.check("begins", live.comes_to_say(&SHOWN[2].1), live.said().lines().count());
    let mut n_shown = 0;
    for (idx, (pose, words)) in SHOWN.into_iter().enumerate() {
        if fault != DeviceFault::Drop || idx != SHOWN.len() / 2 {
            stick.hold(pose)?;
        }
        n_shown += usize::from(live.comes_to_say(&words));
    }
    let newest = live.said().lines().last().unwrap_or_default().to_owned();
    live.interrupt()?;
    let ended = live.end()?;
    let is_all = n_shown == SHOWN.len();
    verdict.check("follows", is_all, format!("{n_shown}/{}{}", SHOWN.len(), if is_all { "" } else { &newest }));
    verdict.check("ctrl_c", ended.code == Some(0), format!("{:?}{}", ended.code, ended.stderr));
    Ok(())
}

/// Without a node it is the SpaceMouse.
fn cap_shown(verdict: &mut PartVerdict) -> anyhow::Result<()> {
    let mut mouse = SpaceMouse::plug(Model::Compact)?;
    let live = Talking::start(&["devices", "--live"])?;
    let begins = live.comes_to_say(&["x   +0 %", "no button"]);
    for report in [HidReport::Translation([250, 0, -175]), HidReport::Rotation([0, 0, 350]), HidReport::Buttons(0b10)] {
        mouse.send(report.encode().as_bytes())?;
    }
    let follows = live.comes_to_say(&["x  +71 %", "z  -50 %", "rz +100 %", "buttons 1"]);
    live.interrupt()?;
    let ended = live.end()?;
    let newest = ended.stdout.lines().last().unwrap_or_default();
    verdict.check("cap_follows", begins && follows, if follows { "yes" } else { newest });
    mouse.unplug()
}

/// The hand at rest, until something is over.
fn rests(stick: &mut Stick, mut is_over: impl FnMut() -> bool) -> anyhow::Result<()> {
    let until_ns = clock::monotonic_ns() + 20_000_000_000;
    for pose in NOISE.into_iter().cycle() {
        if is_over() || clock::monotonic_ns() > until_ns {
            break;
        }
        stick.hold(pose)?;
        sleep(PAUSE);
    }
    Ok(())
}

/// Whether the profile tells what was sent.
fn calibrated(verdict: &mut PartVerdict, stick: &mut Stick, node: &str, fault: DeviceFault) -> anyhow::Result<bool> {
    let arguments = ["devices", "--calibrate", CALIBRATED, "--node", node, "--profile", PROFILE, "--seconds", "5"];
    if std::fs::exists(CALIBRATED)? {
        std::fs::remove_file(CALIBRATED).context(CALIBRATED)?;
    }
    let mut calibrating = Talking::start(&arguments)?;
    rests(stick, || calibrating.said().contains("Move every axis"))?;
    let short = if fault == DeviceFault::Drop { StickPose { x: 900, ..ENDS[1] } } else { ENDS[1] };
    for pose in [ENDS[0], short] {
        stick.hold(pose)?;
        sleep(PAUSE);
    }
    rests(stick, || calibrating.is_over())?;
    let ended = calibrating.end()?;
    let profile = Profile::load(Path::new(CALIBRATED));
    verdict.check("written", ended.code == Some(0) && profile.is_ok(), format!("{:?}{}", ended.code, ended.stderr));
    let profile = profile?;
    let found: Vec<_> = profile.axes.iter().filter_map(|axis| axis.place()).collect();
    let due = MEASURED.map(|(range, rest, noise)| (Some(range), Some(rest), Some(noise)));
    let is_measured = found.iter().map(|place| (place.range, place.rest, place.noise)).eq(due);
    let said = ended.stdout.lines().filter(|line| line.starts_with("ABS_")).collect::<Vec<_>>().join(";");
    verdict.check("measured", is_measured, said);
    Ok(is_measured)
}

/// By the written profile the noise moves nothing, and an end bends the snake.
fn driven(verdict: &mut PartVerdict, stick: &mut Stick) -> anyhow::Result<()> {
    let chain = VmChain::start_with("calibrated", User::Root, 2.5, &["--profile", CALIBRATED])?;
    for buttons in [1, 0] {
        stick.hold(StickPose { buttons, ..NOISE[0] })?;
        sleep(PAUSE);
    }
    let noisy_ns = clock::monotonic_ns();
    let until_ns = noisy_ns + 400_000_000;
    rests(stick, || clock::monotonic_ns() > until_ns)?;
    let pushed_ns = clock::monotonic_ns();
    stick.hold(ENDS[1])?;
    sleep(Duration::from_millis(500));
    let held_ns = clock::monotonic_ns();
    stick.hold(StickPose::REST)?;
    let (ended, journal) = chain.end()?;
    let (noisy_deg, pushed_deg) = (journal.moved_deg(noisy_ns, pushed_ns), journal.moved_deg(pushed_ns, held_ns));
    verdict.check("noise_moved_deg", noisy_deg == 0.0, noisy_deg);
    verdict.check("end_moved_deg", pushed_deg > MOVED_DEG, format!("{pushed_deg:.1}"));
    let complaint = if ended.code == Some(0) { "" } else { &ended.stderr };
    verdict.check("chain_exit_code", ended.code == Some(0), format!("{:?}{complaint}", ended.code));
    Ok(())
}

/// For a user who may not open the node: the rule by its ids, written once, and what to do with it.
fn udev_written(verdict: &mut PartVerdict) -> anyhow::Result<()> {
    let folder = "/tmp/udev";
    if std::fs::exists(folder)? {
        std::fs::remove_dir_all(folder).context(folder)?;
    }
    std::fs::create_dir(folder).context(folder)?;
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o777)).context(folder)?;
    let file = format!("{folder}/70-krait.rules");
    let ended = VmEnded::of(User::Nobody, &["devices", "--write-udev", &file])?;
    let text = std::fs::read_to_string(&file).unwrap_or_default();
    let rule = format!(
        "KERNEL==\"event*\", ATTRS{{id/vendor}}==\"{VENDOR_ID:04x}\", ATTRS{{id/product}}==\"{PRODUCT_ID:04x}\", ATTRS{{name}}==\"{NAME}\", MODE=\"0660\", TAG+=\"uaccess\""
    );
    let rules: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    verdict.check("rule", ended.code == Some(0) && rules == [rule.as_str()], rules.len());
    let says = format!("sudo cp {file} {RULES_FILE} && sudo udevadm control --reload && sudo udevadm trigger");
    let is_said = ended.stderr.contains(&says) && ended.stdout.contains(&rule);
    verdict.check("says_what_next", is_said, if is_said { "yes" } else { &ended.stderr });
    let again = VmEnded::of(User::Nobody, &["devices", "--write-udev", &file])?;
    let is_kept = again.code == Some(1) || again.code == Some(2);
    verdict.check(
        "never_over_a_file",
        is_kept && again.stderr.contains("name a new file"),
        format!("{:?}", again.code),
    );
    Ok(())
}
