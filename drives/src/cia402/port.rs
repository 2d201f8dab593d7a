//! A CAN interface of the kernel: frames in and out, one program of this machine at a time, never waited for longer than said.

use super::frame::Frame;
use super::wire::Wire;
use crate::bus::BusGone;
use crate::error::OpenError;
use crate::texts::{BUS_OFF, CAN_BLOCKED, CAN_DOWN, CAN_GONE, CAN_IN_USE, CAN_STILL_GONE};
use krait_ipc::clock::monotonic_ns;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::Errno;
use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Id, Socket, SocketOptions, StandardId};
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// Where the kernel tells of its interfaces.
const NET: &str = "/sys/class/net";
/// The kernel's number for an interface that is CAN.
const ARPHRD_CAN: &str = "280";
/// The kernel's bit for an interface that is up.
const IFF_UP: u32 = 1;
/// The kernel's bit for "the controller has left the bus".
const CAN_ERR_BUSOFF: u32 = 0x40;
/// How long the interface may take to accept a frame.
const WRITE_PATIENCE_NS: i64 = 20_000_000;

/// An open CAN interface.
#[derive(Debug)]
pub struct CanPort {
    interface: String,
    /// None while it is gone, so that nothing is sent on an interface that others may have taken meanwhile.
    held: Option<Held>,
}

/// What is held of an interface.
#[derive(Debug)]
struct Held {
    socket: CanSocket,
    /// Held while the port is open, so that no two programs are master here.
    _lock: OwnedFd,
}

impl CanPort {
    /// Opens an interface for this program alone.
    ///
    /// # Errors
    /// [`OpenError`] where it cannot be had.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        Ok(Self { interface: interface.to_owned(), held: Some(hold(interface)?) })
    }

    fn socket(&self) -> Result<&CanSocket, BusGone> {
        self.held.as_ref().map(|held| &held.socket).ok_or(BusGone { what: CAN_STILL_GONE })
    }
}

/// An interface that others may use too: to listen beside a master, as a rig does.
#[derive(Debug)]
pub struct CanListener {
    socket: CanSocket,
}

impl CanListener {
    /// Opens an interface, whoever else has it.
    ///
    /// # Errors
    /// [`OpenError`] where it cannot be had.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        Ok(Self { socket: socket(interface)? })
    }

    /// The next frame, waited for until an instant; `None`: there was none.
    ///
    /// # Errors
    /// [`BusGone`] when the interface cannot be used any more.
    pub fn receive(&self, until_ns: i64) -> Result<Option<Frame>, BusGone> {
        receive(&self.socket, until_ns)
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// As [`CanListener::receive`].
    pub fn send(&self, frame: &Frame) -> Result<(), BusGone> {
        send(&self.socket, frame)
    }
}

fn hold(interface: &str) -> Result<Held, OpenError> {
    let lock = lock(&place(interface)?, interface)?;
    let socket = socket(interface)?;
    let refused = |source| OpenError::Can { interface: interface.to_owned(), source };
    socket.set_error_filter(CAN_ERR_BUSOFF).map_err(refused)?;
    Ok(Held { socket, _lock: lock })
}

/// Why an interface that was gone cannot be had again.
fn still_gone(error: &OpenError) -> BusGone {
    let what = match error {
        OpenError::InterfaceDown { .. } => CAN_DOWN,
        OpenError::InterfaceBusOff { .. } => BUS_OFF,
        OpenError::InterfaceInUse { .. } => CAN_IN_USE,
        _ => CAN_STILL_GONE,
    };
    BusGone { what }
}

/// A socket on an interface that is fit for use, without a lock and without word of this machine's controller: for who is no master, as
/// emulated drives, which have controllers of their own.
pub(crate) fn socket(interface: &str) -> Result<CanSocket, OpenError> {
    check(&place(interface)?, interface)?;
    let refused = |error: io::Error| match Errno::from_io_error(&error) {
        Some(Errno::AFNOSUPPORT | Errno::PROTONOSUPPORT) => OpenError::NoCan,
        _ => OpenError::Can { interface: interface.to_owned(), source: error },
    };
    let socket = CanSocket::open(interface).map_err(refused)?;
    socket.set_nonblocking(true).map_err(refused)?;
    Ok(socket)
}

/// Where the kernel tells of an interface, which must be there.
fn place(interface: &str) -> Result<PathBuf, OpenError> {
    let is_name = !interface.is_empty() && interface.len() < 16 && !interface.contains(['/', '\0', '.']);
    let place = Path::new(NET).join(if is_name { interface } else { "none such" });
    if place.exists() {
        return Ok(place);
    }
    let names = interfaces();
    let there =
        if names.is_empty() { "this machine has none".to_owned() } else { format!("there are {}", names.join(", ")) };
    Err(OpenError::NoSuchInterface { interface: interface.to_owned(), there })
}

fn lock(place: &Path, interface: &str) -> Result<OwnedFd, OpenError> {
    let refused = |error: Errno| match error {
        Errno::WOULDBLOCK => OpenError::InterfaceInUse { interface: interface.to_owned() },
        error => OpenError::Can { interface: interface.to_owned(), source: error.into() },
    };
    let file = open(place.join("type"), OFlags::RDONLY | OFlags::CLOEXEC, Mode::empty()).map_err(refused)?;
    flock(&file, FlockOperation::NonBlockingLockExclusive).map_err(refused)?;
    Ok(file)
}

/// Whether what the kernel tells of an interface makes it fit for use.
fn check(place: &Path, interface: &str) -> Result<(), OpenError> {
    let read = |name: &str| std::fs::read_to_string(place.join(name)).map(|text| text.trim().to_owned()).ok();
    let interface = interface.to_owned();
    if read("type").as_deref() != Some(ARPHRD_CAN) {
        return Err(OpenError::NotCan { interface });
    }
    let flags = read("flags").and_then(|flags| u32::from_str_radix(flags.trim_start_matches("0x"), 16).ok());
    if flags.is_some_and(|flags| flags & IFF_UP == 0) {
        return Err(OpenError::InterfaceDown { interface });
    }
    // The kernel takes the carrier from a controller that has left the bus.
    if read("carrier").as_deref() == Some("0") {
        return Err(OpenError::InterfaceBusOff { interface });
    }
    Ok(())
}

/// The CAN interfaces of this machine, by name.
pub fn interfaces() -> Vec<String> {
    let entries = std::fs::read_dir(NET).into_iter().flatten().flatten();
    let is_can = |path: &Path| std::fs::read_to_string(path.join("type")).is_ok_and(|kind| kind.trim() == ARPHRD_CAN);
    let mut names: Vec<String> = entries
        .filter(|entry| is_can(&entry.path()))
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Whether there is something, waited for until an instant.
pub(crate) fn wait(socket: &CanSocket, what: PollFlags, until_ns: i64) -> Result<bool, Errno> {
    let left_ns = until_ns.saturating_sub(monotonic_ns()).max(0);
    let left = Timespec { tv_sec: left_ns / 1_000_000_000, tv_nsec: left_ns % 1_000_000_000 };
    match poll(&mut [PollFd::new(socket, what)], Some(&left)) {
        Ok(n) => Ok(n > 0),
        Err(Errno::INTR) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Sends a frame, or says why not.
pub(crate) fn send(socket: &CanSocket, frame: &Frame) -> Result<(), BusGone> {
    // Eleven bits and at most eight bytes always make a frame.
    let frame = StandardId::new(frame.id()).and_then(|id| CanFrame::new(id, frame.data()));
    let Some(frame) = frame else { return Err(BusGone { what: CAN_BLOCKED }) };
    let until_ns = monotonic_ns() + WRITE_PATIENCE_NS;
    loop {
        match socket.write_frame(&frame).map_err(|error| Errno::from_io_error(&error)) {
            Ok(()) => return Ok(()),
            Err(Some(Errno::INTR)) => {}
            Err(Some(Errno::AGAIN | Errno::NOBUFS)) if monotonic_ns() < until_ns => {
                wait(socket, PollFlags::OUT, monotonic_ns() + WRITE_PATIENCE_NS / 20).map_err(|e| gone(Some(e)))?;
            }
            Err(error) => return Err(gone(error)),
        }
    }
}

/// The next data frame with an 11-bit number; others are passed over.
pub(crate) fn receive(socket: &CanSocket, until_ns: i64) -> Result<Option<Frame>, BusGone> {
    loop {
        match socket.read_frame().map_err(|error| Errno::from_io_error(&error)) {
            Ok(CanFrame::Data(frame)) => {
                if let Id::Standard(id) = frame.id() {
                    return Ok(Some(Frame::new(id.as_raw(), frame.data())));
                }
            }
            Ok(CanFrame::Remote(_)) => {}
            Ok(CanFrame::Error(frame)) if frame.error_bits() & CAN_ERR_BUSOFF != 0 => {
                return Err(BusGone { what: BUS_OFF });
            }
            Ok(CanFrame::Error(_)) => {}
            Err(Some(Errno::AGAIN)) => {
                if monotonic_ns() >= until_ns || !wait(socket, PollFlags::IN, until_ns).map_err(|e| gone(Some(e)))? {
                    return Ok(None);
                }
            }
            Err(Some(Errno::INTR)) => {}
            Err(error) => return Err(gone(error)),
        }
    }
}

fn gone(error: Option<Errno>) -> BusGone {
    let what = match error {
        Some(Errno::NETDOWN) => CAN_DOWN,
        Some(Errno::NOBUFS | Errno::AGAIN) => CAN_BLOCKED,
        _ => CAN_GONE,
    };
    BusGone { what }
}

impl Wire for CanPort {
    fn send(&mut self, frame: &Frame) -> Result<(), BusGone> {
        send(self.socket()?, frame)
    }

    fn receive(&mut self, until_ns: i64) -> Result<Option<Frame>, BusGone> {
        receive(self.socket()?, until_ns)
    }

    fn come_back(&mut self) -> Result<(), BusGone> {
        // The old lock is given back first, so that it is not in its own way.
        self.held = None;
        let held = hold(&self.interface).map_err(|error| {
            tracing::warn!("{error}");
            still_gone(&error)
        })?;
        self.held = Some(held);
        Ok(())
    }

    fn now_ns(&self) -> i64 {
        monotonic_ns()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interfaces_that_are_none_or_are_not_can_are_named_with_what_to_do() {
        for name in ["can77", "", "../../etc", "a-name-that-is-too-long"] {
            let sentence = CanPort::open(name).unwrap_err().to_string();
            assert!(sentence.contains("no CAN interface") && sentence.contains("ip link"), "{sentence}");
        }
        let sentence = CanPort::open("lo").unwrap_err().to_string();
        assert!(sentence.contains("lo is no CAN interface"), "{sentence}");
    }

    #[test]
    fn what_the_kernel_tells_of_an_interface_makes_it_fit_or_names_what_is_wrong() {
        let place = std::env::temp_dir().join(format!("krait-net-{}", std::process::id()));
        std::fs::create_dir_all(&place).expect("a folder");
        let look = |kind: &str, flags: &str, carrier: Option<&str>| {
            for (name, text) in [("type", Some(kind)), ("flags", Some(flags)), ("carrier", carrier)] {
                let _was_not_there = std::fs::remove_file(place.join(name));
                text.map_or(Ok(()), |text| std::fs::write(place.join(name), format!("{text}\n"))).expect("written");
            }
            check(&place, "can0").map_err(|error| error.to_string())
        };
        look("280", "0x40041", Some("1")).unwrap();
        // Virtual ones have no carrier to tell of.
        look("280", "0x40041", None).unwrap();
        let down = look("280", "0x40040", None).unwrap_err();
        assert!(down.contains("can0 is down") && down.contains("sudo ip link set can0 up type can bitrate"), "{down}");
        let off = look("280", "0x40041", Some("0")).unwrap_err();
        assert!(off.contains("bus-off") && off.contains("termination"), "{off}");
        assert!(look("1", "0x1003", Some("1")).unwrap_err().contains("is no CAN interface"));
        std::fs::remove_dir_all(&place).expect("removed");
    }

    #[test]
    fn an_interface_is_for_one_program_at_a_time() {
        let lo = Path::new(NET).join("lo");
        let first = lock(&lo, "lo").unwrap();
        let second = lock(&lo, "lo").unwrap_err().to_string();
        assert!(second.contains("in use by another program"), "{second}");
        drop(first);
        lock(&lo, "lo").unwrap();
    }
}
