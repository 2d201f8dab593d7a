//! A serial port: raw bytes, one program at a time, never waited for longer than said.

use crate::bus::BusGone;
use crate::error::OpenError;
use crate::texts::{PORT_BLOCKED, PORT_GONE};
use core::ops::RangeInclusive;
use krait_ipc::clock::monotonic_ns;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, Mode, OFlags, flock, fstat, major, open};
use rustix::io::{Errno, read, write};
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, Termios, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush, tcgetattr,
    tcsetattr,
};
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// How long a port may take to accept a packet.
const WRITE_PATIENCE_NS: i64 = 100_000_000;
/// Where lasting names of serial ports are.
const BY_ID: &str = "/dev/serial/by-id";

/// Major numbers of the pseudo-terminals that programs open.
const PSEUDO_TERMINALS: RangeInclusive<u32> = 136..=143;

/// An open serial port.
#[derive(Debug)]
pub(crate) struct Port {
    file: OwnedFd,
}

/// Whether a program plays the device, as an emulated bus does. Its end stays open, so that the kernel's exclusive mode would outlast
/// whoever asked for it, and nobody but root could open the port again.
fn is_pseudo_terminal(file: &OwnedFd) -> bool {
    fstat(file).is_ok_and(|found| PSEUDO_TERMINALS.contains(&major(found.st_rdev)))
}

impl Port {
    /// Opens a port for this program alone.
    pub(crate) fn open(path: &Path, baud: u32) -> Result<Self, OpenError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = open(path, flags, Mode::empty()).map_err(|error| refused(path, error))?;
        // The kernel's own exclusive mode does not hold for root; the lock does, among programs that ask for it.
        flock(&file, FlockOperation::NonBlockingLockExclusive).map_err(|error| refused(path, error))?;
        let mut settings = tcgetattr(&file).map_err(|error| refused(path, error))?;
        make_plain(&mut settings, baud).map_err(|error| refused(path, error))?;
        tcsetattr(&file, OptionalActions::Now, &settings).map_err(|error| refused(path, error))?;
        if !is_pseudo_terminal(&file) {
            ioctl_tiocexcl(&file).map_err(|error| refused(path, error))?;
        }
        tcflush(&file, QueueSelector::IOFlush).map_err(|error| refused(path, error))?;
        Ok(Self { file })
    }

    /// Opens it anew. The old one is given back first, so that it is not in its own way.
    pub(crate) fn reopen(&mut self, path: &Path, baud: u32) -> Result<(), OpenError> {
        // One that is gone refuses both, and is in nobody's way.
        flock(&self.file, FlockOperation::Unlock).and_then(|()| ioctl_tiocnxcl(&self.file)).ok();
        *self = Self::open(path, baud)?;
        Ok(())
    }

    /// Throws away what was received.
    pub(crate) fn forget(&self) -> Result<(), BusGone> {
        tcflush(&self.file, QueueSelector::IFlush).map_err(gone)
    }

    /// Sends bytes, all of them.
    pub(crate) fn send(&self, mut bytes: &[u8]) -> Result<(), BusGone> {
        let until_ns = monotonic_ns() + WRITE_PATIENCE_NS;
        while !bytes.is_empty() {
            match write(&self.file, bytes) {
                Ok(n) => bytes = &bytes[n..],
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) if monotonic_ns() >= until_ns => return Err(BusGone { what: PORT_BLOCKED }),
                Err(Errno::AGAIN) => drop(self.wait(PollFlags::OUT, until_ns)?),
                Err(error) => return Err(gone(error)),
            }
        }
        Ok(())
    }

    /// Receives what there is behind what was received, waiting for some until an instant; whether there was any.
    pub(crate) fn receive(&self, bytes: &mut Vec<u8>, until_ns: i64) -> Result<bool, BusGone> {
        if !self.wait(PollFlags::IN, until_ns)? {
            return Ok(false);
        }
        let mut piece = [0; 512];
        match read(&self.file, &mut piece) {
            // A terminal that is there has no end.
            Ok(0) => Err(BusGone { what: PORT_GONE }),
            Ok(n) => {
                bytes.extend_from_slice(&piece[..n]);
                Ok(true)
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(false),
            Err(error) => Err(gone(error)),
        }
    }

    fn wait(&self, what: PollFlags, until_ns: i64) -> Result<bool, BusGone> {
        let left_ns = until_ns.saturating_sub(monotonic_ns()).max(0);
        let left = Timespec { tv_sec: left_ns / 1_000_000_000, tv_nsec: left_ns % 1_000_000_000 };
        let mut files = [PollFd::new(&self.file, what)];
        match poll(&mut files, Some(&left)) {
            Ok(n) => Ok(n > 0),
            Err(Errno::INTR) => Ok(false),
            Err(error) => Err(gone(error)),
        }
    }
}

fn make_plain(settings: &mut Termios, baud: u32) -> Result<(), Errno> {
    settings.make_raw();
    settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    settings.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
    settings.set_speed(baud)
}

fn gone(_: Errno) -> BusGone {
    BusGone { what: PORT_GONE }
}

fn refused(path: &Path, error: Errno) -> OpenError {
    let port = path.to_owned();
    match error {
        Errno::NOENT | Errno::NXIO | Errno::NODEV => OpenError::NoSuchPort { port, there: what_is_there() },
        Errno::ACCESS | Errno::PERM => OpenError::NoPermission { advice: advice(path), port },
        Errno::BUSY | Errno::WOULDBLOCK => OpenError::InUse { port },
        Errno::NOTTY | Errno::ISDIR | Errno::INVAL => OpenError::NotSerial { port },
        error => OpenError::Io { port, source: error.into() },
    }
}

/// Every serial port of this machine that a servo adapter may be: by its lasting name, where it has one.
pub fn ports() -> Vec<PathBuf> {
    let entries = |folder: &str| std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<PathBuf> = entries(BY_ID).collect();
    let named: Vec<PathBuf> = found.iter().filter_map(|path| path.canonicalize().ok()).collect();
    let is_adapter = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        name.starts_with("ttyUSB") || name.starts_with("ttyACM")
    };
    found.extend(entries("/dev").filter(is_adapter).filter(|path| !named.contains(path)));
    found.sort();
    found
}

fn what_is_there() -> String {
    let ports = ports();
    if ports.is_empty() {
        return "no USB serial adapter is on this machine, is it plugged in?".to_owned();
    }
    let names: Vec<String> = ports.iter().map(|path| path.display().to_string()).collect();
    format!("there are {}", names.join(", "))
}

/// Rights of a group to read and write.
const GROUP_READS_AND_WRITES: u32 = 0o060;
/// Where the udev rule belongs: before 73-seat-late.rules, which acts upon the `uaccess` tag.
const RULES: &str = "/etc/udev/rules.d/70-krait-serial.rules";

/// What opens a port that may not be opened: its group where the group may and is not root's, a udev rule where not.
fn advice(path: &Path) -> String {
    let Ok(found) = std::fs::metadata(path) else { return "look at its rights with `ls -l`".to_owned() };
    let group = group_named(found.gid());
    if found.gid() != 0 && found.mode() & GROUP_READS_AND_WRITES == GROUP_READS_AND_WRITES {
        return format!(
            "it belongs to the group {group}; join it with `sudo usermod -aG {group} $USER` and log in anew"
        );
    }
    let name = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = name.strip_prefix("/dev").unwrap_or(&name).display().to_string();
    let rule = match usb_ids(Path::new(SYSFS), &name) {
        Some([vendor, product]) => {
            format!("SUBSYSTEM==\"tty\", ATTRS{{idVendor}}==\"{vendor}\", ATTRS{{idProduct}}==\"{product}\"")
        }
        None => format!("SUBSYSTEM==\"tty\", KERNEL==\"{name}\""),
    };
    format!(
        "no group that you could join may read and write it (group {group}, rights {:03o}); write the line {rule}, MODE=\"0660\", TAG+=\"uaccess\" into {RULES} and plug the adapter in anew",
        found.mode() & 0o777
    )
}

/// Where the kernel shows its terminals.
const SYSFS: &str = "/sys/class/tty";

/// Maker and product of the USB device that a terminal is of.
fn usb_ids(sysfs: &Path, name: &str) -> Option<[String; 2]> {
    let device = sysfs.join(name).join("device").canonicalize().ok()?;
    let read = |folder: &Path, key: &str| Some(std::fs::read_to_string(folder.join(key)).ok()?.trim().to_owned());
    device.ancestors().find_map(|folder| Some([read(folder, "idVendor")?, read(folder, "idProduct")?]))
}

/// Name of a group, or its number.
fn group_named(gid: u32) -> String {
    let gid = gid.to_string();
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let named = groups.lines().map(|line| line.split(':').collect::<Vec<_>>());
    let name = named.into_iter().find(|fields| fields.get(2) == Some(&gid.as_str())).map(|fields| fields[0].to_owned());
    name.unwrap_or(gid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_that_cannot_be_had_are_refused_with_the_reason_and_what_to_do() {
        let missing = Port::open(Path::new("/dev/no-such-port"), 1_000_000).unwrap_err();
        assert!(matches!(missing, OpenError::NoSuchPort { .. }), "{missing}");
        let file = Port::open(Path::new("/dev/null"), 1_000_000).unwrap_err();
        assert!(matches!(file, OpenError::NotSerial { .. }), "{file}");
        // That the kernel refuses is for tests/tests/drives/permission.rs. Nobody joins the group root.
        let refused = refused(Path::new("/dev/null"), Errno::ACCESS).to_string();
        let rule = "SUBSYSTEM==\"tty\", KERNEL==\"null\", MODE=\"0660\", TAG+=\"uaccess\"";
        assert!(refused.contains(rule) && !refused.contains("usermod"), "{refused}");
    }

    #[test]
    fn a_rule_names_the_adapter_by_the_usb_device_above_its_terminal() {
        let root = std::env::temp_dir().join(format!("krait-tty-{}", std::process::id()));
        let (usb, class) = (root.join("usb1/1-2"), root.join("class/ttyUSB0"));
        std::fs::create_dir_all(usb.join("1-2:1.0/ttyUSB0")).expect("a folder");
        std::fs::create_dir_all(&class).expect("a folder");
        for (key, value) in [("idVendor", "1a86\n"), ("idProduct", "7523\n")] {
            std::fs::write(usb.join(key), value).expect("written");
        }
        std::os::unix::fs::symlink(usb.join("1-2:1.0/ttyUSB0"), class.join("device")).expect("a link");
        let found = usb_ids(&root.join("class"), "ttyUSB0");
        std::fs::remove_dir_all(&root).expect("removed");
        assert_eq!(found, Some(["1a86", "7523"].map(str::to_owned)));
        assert_eq!(usb_ids(&root.join("class"), "ttyS0"), None);
    }
}
