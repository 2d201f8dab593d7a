//! Drives as processes on the virtual interface, krait's own or independent ones, and the configuration that fits both.

use anyhow::{Context, ensure};
use krait_drives::cia402::{CanPort, Frame, Wire};
use krait_drives::emulator::{CanBus, CanDrive, serve_can};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{ActuatorConfig, DriveConfig, DriveKind, SlaveConfig};
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;

pub const INTERFACE: &str = "vcan0";
/// Counts of a metre of either kind: 0.1 um.
pub const PER_M: f64 = 1e7;
/// Time without krait's heartbeat after which drives stop by themselves, ms.
pub const GIVES_UP_MS: u32 = 100;
/// The drive to which things happen, counted from 0.
pub const BROKEN: usize = 1;
const INDEPENDENT: &str = "/bin/fake402";
const CANOPEN: &str = "/bin/canopen_drive";
const N: u8 = 3;
/// The file that lets a spare process begin.
const GO: &str = "/tmp/go";
/// How long processes may take to say that they have started, ns.
const BOOT_NS: i64 = 10_000_000_000;

/// Who wrote the drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveMake {
    Own,
    Independent,
    /// On python-canopen's local node.
    Canopen,
}

impl DriveMake {
    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Independent => "independent",
            Self::Canopen => "canopen",
        }
    }

    pub fn is_there(self) -> bool {
        match self {
            Self::Own => true,
            Self::Independent => Path::new(INDEPENDENT).exists(),
            Self::Canopen => Path::new(CANOPEN).exists(),
        }
    }

    /// Period of the bus in which they stop and start, ms: an interpreter takes its time.
    pub fn period_ms(self) -> f64 {
        match self {
            Self::Own | Self::Independent => 1.0,
            Self::Canopen => 10.0,
        }
    }

    /// Whether a part can be done with these drives: only the independent ones trip and jam by a signal.
    pub fn can(self, part: &str) -> bool {
        match part {
            "trip" | "jam" => self == Self::Independent,
            "csp_10ms" => self == Self::Canopen,
            "csp_1ms" | "csp_2ms" | "thread" | "thread_2ms" => self != Self::Canopen,
            _ => true,
        }
    }
}

/// The configuration of three drives that count 0.1 um.
pub fn config(period_ms: f64) -> SlaveConfig {
    let actuator = |id| ActuatorConfig {
        id,
        zero_count: Some(0),
        // They begin at 0 wherever they are, and the rig does not home them.
        is_absolute: true,
        vendor: Some(0x555),
        product: Some(1),
        counts_per_turn: 20_000,
        lead_m: Some(0.002),
        rated_torque_nm: 0.1,
        // The independent ones have no object 6072.
        torque_limit: 1.0,
        ..ActuatorConfig::default()
    };
    let drive = DriveConfig {
        kind: DriveKind::Cia402,
        interface: Some(INTERFACE.to_owned()),
        period_ms,
        timeout_ms: 0.9 * period_ms,
        heartbeat_ms: 10,
        gives_up_ms: GIVES_UP_MS,
        speed_counts_per_s: 600_000.0,
        actuator: (1..=u32::from(N)).map(actuator).collect(),
        ..DriveConfig::default()
    };
    SlaveConfig { drive, ..SlaveConfig::default() }
}

/// Three drives.
pub struct Drives {
    kind: DriveMake,
    children: Vec<Child>,
    spare: Option<Child>,
}

impl Drives {
    /// Starts them and waits until each has said so.
    pub fn start(kind: DriveMake) -> anyhow::Result<Self> {
        let mut port = CanPort::open(INTERFACE)?;
        let mut drives = Self { kind, children: Vec::new(), spare: None };
        for id in 1..=N {
            drives.children.push(drives.spawn(id, false)?);
        }
        let (until_ns, mut has_booted) = (monotonic_ns() + BOOT_NS, [false; N as usize]);
        while has_booted != [true; N as usize] {
            let frame = port.receive(until_ns)?.with_context(|| format!("they did not all start: {has_booted:?}"))?;
            let node = usize::from(frame.id() & 0x7F);
            if frame.id() & 0x780 == 0x700 && frame.data() == [0] && (1..=usize::from(N)).contains(&node) {
                has_booted[node - 1] = true;
            }
        }
        if kind == DriveMake::Independent {
            for id in 1..=N {
                rest_own_motion(&mut port, id)?;
            }
        }
        Ok(drives)
    }

    /// A process below the bus's thread. The machine has one processor, and drives have one each: the second, to which things
    /// happen, must not hold up the others when it begins or catches up.
    fn spawn(&self, id: u8, is_spare: bool) -> anyhow::Result<Child> {
        let priority = if usize::from(id) == BROKEN + 1 { ["-o", "0"] } else { ["-f", "40"] };
        let program = match self.kind {
            DriveMake::Own => format!("/bin/krait-can-vm drive {id}"),
            DriveMake::Independent => format!("{INDEPENDENT} {id} {INTERFACE} /drive.eds follow"),
            DriveMake::Canopen => format!("{CANOPEN} {id} {INTERFACE}"),
        };
        let waits = if is_spare { format!("until [ -e {GO} ]; do sleep 0.02; done; ") } else { String::new() };
        let mut command = Command::new("/bin/chrt");
        command
            .args(priority)
            .args(["/bin/sh", "-c", &format!("{waits}exec {program}")])
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command.spawn().context("a drive's process")
    }

    /// Sends a signal to a drive's process, counted from 0; when.
    pub fn signal(&self, k: usize, signal: Signal) -> anyhow::Result<i64> {
        kill(&self.children[k], signal)?;
        Ok(monotonic_ns())
    }

    /// Has a second process for the drive at hand, so that to start it while others move costs them nothing.
    pub fn prepare_spare(&mut self) -> anyhow::Result<()> {
        if Path::new(GO).exists() {
            std::fs::remove_file(GO)?;
        }
        self.spare = Some(self.spawn(BROKEN as u8 + 1, true)?);
        Ok(())
    }

    /// Lets the second process take the place of the one that was killed.
    pub fn power_back(&mut self) -> anyhow::Result<()> {
        let spare = self.spare.take().context("no spare process")?;
        self.children[BROKEN].wait()?;
        self.children[BROKEN] = spare;
        std::fs::write(GO, "").context("the sign to begin")
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        for child in self.children.iter_mut().chain(&mut self.spare) {
            // It may have ended by itself; either way it is gone afterwards.
            if child.kill().is_ok() {
                drop(child.wait());
            }
        }
    }
}

/// Sends a signal to a child.
pub fn kill(child: &Child, signal: Signal) -> anyhow::Result<()> {
    let pid = Pid::from_raw(child.id().cast_signed()).context("a child's number")?;
    kill_process(pid, signal).context("a signal")
}

/// The independent drives' own cyclic motion works in whole thousands of counts; limits of 0 and 0 put it to rest.
fn rest_own_motion(port: &mut CanPort, id: u8) -> anyhow::Result<()> {
    for sub in [1, 2] {
        port.send(&Frame::new(0x600 + u16::from(id), &[0x23, 0x7D, 0x60, sub, 0, 0, 0, 0]))?;
        let until_ns = monotonic_ns() + 500_000_000;
        loop {
            let frame = port.receive(until_ns)?.context("no answer about object 607D")?;
            if frame.id() == 0x580 + u16::from(id) {
                ensure!(frame.data().first() == Some(&0x60), "object 607D is refused: {:?}", frame.data());
                break;
            }
        }
    }
    Ok(())
}

/// One emulated drive, until it is killed.
pub fn be_drive(id: &str) -> anyhow::Result<bool> {
    let bus = CanBus::new(vec![CanDrive::new(id.parse().context("a drive's number")?, 0.0)]);
    serve_can(INTERFACE, &bus, &AtomicBool::new(false))?;
    Ok(true)
}
