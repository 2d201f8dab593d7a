//! Debian's spacenavd between the device and krait: axes and buttons arrive in the hand's own frame, a held deflection bends the snake, and
//! an unplugging, of which the daemon tells nobody, ends the motion.

use crate::chain::{User, VmChain};
use crate::model::Model;
use crate::spacemouse::{SpaceMouse, wait_for};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_ipc::message::DeviceState;
use krait_master::{HidReport, HidSource, ReportSource, SourceEvent};
use std::path::Path;
use std::process::{Child, Command, Stdio};

const DAEMON: &str = "/bin/spacenavd";
const SOCKET: &str = "/run/spnav.sock";
const CONFIG: &str = "/tmp/spacenavd.toml";
const SILENCE_NS: i64 = 300_000_000;
const BRAKING_NS: i64 = 300_000_000;
const MOVED_DEG: f64 = 3.0;

/// The daemon, killed when it is dropped.
struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        if self.0.kill().is_ok() {
            drop(self.0.wait());
        }
    }
}

/// Whether this machine has the daemon.
pub fn is_there() -> bool {
    Path::new(DAEMON).exists()
}

/// One axis after the other, a button, and a chain.
pub fn spacenavd() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mut mouse = SpaceMouse::plug(Model::AbsoluteCompact)?;
    let mut command = Command::new(DAEMON);
    command.arg("-d").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let _daemon = Daemon(command.spawn().context(DAEMON)?);
    wait_for("the daemon's socket", || Path::new(SOCKET).exists())?;
    let mut source = HidSource::open_spacenavd(Path::new(SOCKET))?;
    // The device is looked for behind the socket.
    std::thread::sleep(std::time::Duration::from_millis(500));
    let (mut n_right, mut words) = (0, Vec::new());
    for axis in 0..6 {
        for counts in [200_i16, -200] {
            let mut sent = [0; 6];
            sent[axis] = counts;
            let [x, y, z, rx, ry, rz] = sent;
            mouse.send(HidReport::Translation([x, y, z]).encode().as_bytes())?;
            mouse.send(HidReport::Rotation([rx, ry, rz]).encode().as_bytes())?;
            let there = newest_axes(&mut source);
            mouse.send(HidReport::Translation([0; 3]).encode().as_bytes())?;
            mouse.send(HidReport::Rotation([0; 3]).encode().as_bytes())?;
            let back = newest_axes(&mut source);
            let is_alone = (0..6).all(|other| (other == axis) == (there[other] != 0));
            let is_right = is_alone && (there[axis] > 0) == (counts > 0) && back == [0; 6];
            n_right += u32::from(is_right);
            words.push(there[axis].to_string());
        }
    }
    verdict.check("axes", n_right == 12, format!("{n_right}/12:{}", words.join(",")));
    mouse.press(0)?;
    let buttons: Vec<u32> = std::iter::from_fn(|| next(&mut source))
        .filter_map(|report| if let HidReport::Buttons(buttons) = report { Some(buttons) } else { None })
        .collect();
    verdict.check("buttons", buttons == [1, 0], format!("{buttons:?}").replace(' ', ""));
    drop(source);

    std::fs::write(CONFIG, format!("[master]\nspacenavd = \"{SOCKET}\"\n")).context(CONFIG)?;
    let chain = VmChain::start_with("spacenavd", User::Root, 4.0, &["--config", CONFIG])?;
    let held_ns = clock::monotonic_ns();
    mouse.press(0)?;
    mouse.hold(200, 600)?;
    let unplugged_ns = clock::monotonic_ns();
    mouse.unplug()?;
    let (ended, journal) = chain.end()?;
    let moved_deg = journal.moved_deg(held_ns, unplugged_ns);
    verdict.check("moved_deg", moved_deg > MOVED_DEG, format!("{moved_deg:.1}"));
    let late_deg = journal.moved_deg(unplugged_ns + BRAKING_NS, i64::MAX);
    verdict.check("unplugged_deg", late_deg == 0.0, format!("{late_deg:.1}"));
    let last = journal.inputs.last().context("no input")?;
    verdict.check("lost", last.device() == Some(DeviceState::Lost), format!("{:?}", last.device()));
    verdict.check("refused", last.n_refused == 0, last.n_refused);
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    Ok(verdict)
}

/// The next report; none after silence.
fn next(source: &mut HidSource) -> Option<HidReport> {
    let until_ns = clock::monotonic_ns() + SILENCE_NS;
    while clock::monotonic_ns() < until_ns {
        source.wait_until(until_ns);
        if let Some(SourceEvent::HidReport { report, .. }) = source.next_event(clock::monotonic_ns()) {
            return HidReport::decode(report.as_bytes()).ok();
        }
    }
    None
}

/// Where the axes are by the newest of what has come; the daemon repeats a deflection, so this looks for a while only.
fn newest_axes(source: &mut HidSource) -> [i16; 6] {
    let until_ns = clock::monotonic_ns() + SILENCE_NS / 2;
    let mut axes = [0; 6];
    while clock::monotonic_ns() < until_ns {
        source.wait_until(until_ns);
        if let Some(SourceEvent::HidReport { report, .. }) = source.next_event(clock::monotonic_ns())
            && let Ok(HidReport::Motion(motion)) = HidReport::decode(report.as_bytes())
        {
            axes = motion;
        }
    }
    axes
}
