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
        Errno::ACCESS | Errno::PERM => OpenError::NoPermission { group: group_of(path), port },
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

/// Name of the group that a file belongs to, or its number.
fn group_of(path: &Path) -> String {
    let Ok(gid) = std::fs::metadata(path).map(|meta| meta.gid().to_string()) else { return "dialout".to_owned() };
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
        // Which group it is; that the kernel says so is for tests/tests/drives/permission.rs.
        let refused = refused(Path::new("/dev/null"), Errno::ACCESS).to_string();
        assert!(refused.contains("group root") && refused.contains("usermod -aG root"), "{refused}");
    }
}
