//! A device of the kernel's input system, mostly a USB device of QEMU's own, as krait's hand: krait's own code finds, takes and reads it, and a
//! stranger listens at the same node.

use crate::qmp::{Act, Qmp};
use crate::spacemouse::{DeviceFault, wait_for};
use anyhow::Context;
use krait_ipc::clock;
use krait_master::{HidReport, HidSource, InputDevice, Plug, Profile, ReportSource, SourceEvent, list_inputs};
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

/// How long something that must come is waited for, ns: a busy host may be slow.
pub const PATIENCE_NS: i64 = 2_000_000_000;
/// Silence after which nothing more comes, ns: many windows of a way.
pub const SILENCE_NS: i64 = 300_000_000;
/// Longer than the pause between two searches for a lost device, ns: a device that stays where it is neither goes nor comes by then.
const STAYED_NS: i64 = 1_500_000_000;
/// How long a loss and a return are waited for, ns.
const REPLUG_NS: i64 = 10_000_000_000;
/// Silence after which a device has said where it is, ns.
const SAID_NS: i64 = 100_000_000;

/// Plugs a device in and waits for its node.
///
/// # Errors
/// QEMU refuses, or the kernel makes no node of that name.
pub fn plugged(qmp: &mut Qmp, driver: &str, name: &str) -> anyhow::Result<InputDevice> {
    qmp.plug(driver)?;
    wait_for("the node of QEMU's device", || node_of(name).is_ok())?;
    node_of(name)
}

/// The device of that name that is there and may be opened.
///
/// # Errors
/// There is none.
pub fn node_of(name: &str) -> anyhow::Result<InputDevice> {
    let found = list_inputs().into_iter().find(|input| input.name.contains(name) && input.may_open);
    found.with_context(|| format!("no node of {name:?}"))
}

/// Pulls it out and waits until its node is gone.
///
/// # Errors
/// QEMU refuses, or the kernel keeps the node.
pub fn unplugged(qmp: &mut Qmp, driver: &str, name: &str) -> anyhow::Result<()> {
    qmp.unplug(driver)?;
    wait_for("the end of the node of QEMU's device", || !list_inputs().iter().any(|input| input.name.contains(name)))
}

/// A built-in profile for a device.
///
/// # Errors
/// The profile is bad.
pub fn profile_for(name: &str, device: &InputDevice) -> anyhow::Result<Profile> {
    Ok(Profile::of_device(Path::new(name), Some(&device.node))?)
}

/// The hand as krait reads it.
pub struct UsbHand {
    source: HidSource,
    /// The newest motion: a port repeats it, and that is no news.
    motion: Option<HidReport>,
    /// Whether the device was lost, and whether it was found again, since this was looked at.
    pub was_lost: bool,
    /// Whether it was found again.
    pub was_found: bool,
    /// How often it was lost, and found again, of those times that it was pulled out and put back.
    pub n_lost: i32,
    pub n_found: i32,
}

impl UsbHand {
    /// Takes the device of a profile.
    ///
    /// # Errors
    /// krait cannot.
    pub fn take(profile: Profile) -> anyhow::Result<Self> {
        let source = HidSource::open_profile(profile)?;
        Ok(Self { source, motion: None, was_lost: false, was_found: false, n_lost: 0, n_found: 0 })
    }

    /// The next report that says something new; none when the time is up, ns.
    pub fn next(&mut self, patience_ns: i64) -> Option<HidReport> {
        let until_ns = clock::monotonic_ns() + patience_ns;
        while clock::monotonic_ns() < until_ns {
            self.source.wait_until(until_ns.min(clock::monotonic_ns() + 20_000_000));
            match self.source.next_event(clock::monotonic_ns()) {
                Some(SourceEvent::HidReport { report, .. }) => {
                    // What krait cannot decode would be missing in the sequence.
                    let Ok(report) = HidReport::decode(report.as_bytes()) else { continue };
                    if report.is_motion() && self.motion.replace(report) == Some(report) {
                        continue;
                    }
                    return Some(report);
                }
                Some(SourceEvent::Plug { plug: Plug::Out, .. } | SourceEvent::GivenBack) => {
                    (self.was_lost, self.motion) = (true, None);
                }
                Some(SourceEvent::Plug { plug: Plug::In, .. }) => self.was_found = true,
                _ => {}
            }
        }
        None
    }

    /// The axes of the next motion, also where they are as before; none after silence.
    pub fn next_motion(&mut self) -> Option<[i16; 6]> {
        let until_ns = clock::monotonic_ns() + SILENCE_NS;
        loop {
            self.motion = None;
            match self.next(until_ns - clock::monotonic_ns())? {
                HidReport::Motion(axes) => return Some(axes),
                _ => continue,
            }
        }
    }

    /// Waits for something that is seen while reports go by.
    ///
    /// # Errors
    /// It does not come about.
    pub fn wait_for(&mut self, what: &str, done: impl Fn(&Self) -> bool) -> anyhow::Result<()> {
        wait_for(what, || {
            self.next(10_000_000);
            done(self)
        })
    }

    /// Passes by what the device says of where it is when it is taken.
    pub fn settle(&mut self) {
        while self.next(SAID_NS).is_some() {}
    }

    /// Pulls the device out while something of it is held, lets that go, and plugs it in again, and counts what krait noticed of both.
    ///
    /// # Errors
    /// QEMU refuses.
    pub fn replug(
        &mut self,
        qmp: &mut Qmp,
        (driver, name): (&str, &str),
        let_go: Act,
        fault: DeviceFault,
    ) -> anyhow::Result<()> {
        let stays = fault == DeviceFault::Stays;
        let patience_ns = if stays { STAYED_NS } else { REPLUG_NS };
        (self.was_lost, self.was_found) = (false, false);
        if !stays {
            unplugged(qmp, driver, name)?;
        }
        self.n_lost += i32::from(self.sees(patience_ns, |hand| hand.was_lost));
        qmp.act(&[let_go])?;
        if !stays {
            plugged(qmp, driver, name)?;
        }
        self.n_found += i32::from(self.sees(patience_ns, |hand| hand.was_found));
        Ok(())
    }

    /// Whether something is seen in time while reports go by.
    fn sees(&mut self, patience_ns: i64, done: impl Fn(&Self) -> bool) -> bool {
        let until_ns = clock::monotonic_ns() + patience_ns;
        while !done(self) && clock::monotonic_ns() < until_ns {
            self.next(10_000_000);
        }
        done(self)
    }

    /// Plays a scene: each act, and what krait must make of it before the next. Gives what it made of all of them, and what came
    /// behind the last. A fault leaves out the act in the middle.
    ///
    /// # Errors
    /// The device refuses an act.
    pub fn play<A>(
        &mut self,
        scene: &Scene<A>,
        fault: DeviceFault,
        act: impl FnMut(&A) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<HidReport>> {
        let mut heard = self.play_through(scene, fault, act)?;
        heard.extend(std::iter::from_fn(|| self.next(SILENCE_NS)));
        Ok(heard)
    }

    /// The same, and what comes behind the last is not waited for.
    ///
    /// # Errors
    /// As [`UsbHand::play`].
    pub fn play_through<A>(
        &mut self,
        scene: &Scene<A>,
        fault: DeviceFault,
        mut act: impl FnMut(&A) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<HidReport>> {
        let mut heard = Vec::new();
        for (idx, (acts, due)) in scene.iter().enumerate() {
            let is_spoiled = fault == DeviceFault::Drop && idx == scene.len() / 2;
            if !is_spoiled {
                act(acts)?;
            }
            heard.extend(due.iter().map_while(|_| self.next(PATIENCE_NS)));
        }
        Ok(heard)
    }
}

/// What a person does, and the reports that must come of it.
pub type Scene<A = Vec<Act>> = Vec<(A, Vec<HidReport>)>;

/// All reports of a scene.
pub fn due<A>(scene: &Scene<A>) -> Vec<HidReport> {
    scene.iter().flat_map(|(_, due)| due.iter().copied()).collect()
}

/// Another program that reads the same node, and may.
pub struct Stranger(File);

impl Stranger {
    /// Begins to listen.
    ///
    /// # Errors
    /// The node cannot be opened.
    pub fn at(device: &InputDevice) -> anyhow::Result<Self> {
        Self::at_node(&device.node)
    }

    /// The same at any node.
    ///
    /// # Errors
    /// As [`Stranger::at`].
    pub fn at_node(node: &Path) -> anyhow::Result<Self> {
        let file = File::options().read(true).custom_flags(libc::O_NONBLOCK).open(node);
        Ok(Self(file.with_context(|| node.display().to_string())?))
    }

    /// Bytes that came since, up to some kilobytes.
    pub fn heard(&mut self) -> usize {
        std::thread::sleep(Duration::from_millis(50));
        let mut bytes = [0; 4096];
        self.0.read(&mut bytes).unwrap_or(0)
    }
}
