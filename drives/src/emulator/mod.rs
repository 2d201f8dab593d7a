//! An emulated bus of STS3215 or XL330 servos behind a pseudo-terminal: to try krait without hardware, and with every fault that we know.
//! [`CanBus`] is one of CiA 402 drives.
//!
//! Bytes take their time on the wire, servos theirs to answer and to move, the USB adapter its own. The host's bit rate is read
//! from the terminal. What a fault does is in [`Faults`].

mod can;
mod coupling;
mod dynamixel;
mod registers;
mod servo;
mod wire;

pub use can::{CanBus, CanDrive, CanDrives, CanFaults, CanWire, look_at as look_at_can, serve as serve_can};
pub use coupling::Coupling;
pub use servo::{Faults, Servo, ToldGoal};
pub use wire::ServoWire;

use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{Errno, read, write};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// How often the thread looks whether it shall end.
const PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
/// The kernel may sleep for so much longer than it was asked to; the rest is waited for awake.
const OVERSLEEP_NS: i64 = 60_000;

/// A bus that runs; dropping it is unplugging the adapter.
#[derive(Debug)]
pub struct Emulator {
    path: PathBuf,
    wire: Arc<Mutex<ServoWire>>,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Emulator {
    /// Plugs the bus in.
    ///
    /// # Errors
    /// What the kernel says when it gives no pseudo-terminal.
    pub fn start(wire: ServoWire) -> io::Result<Self> {
        let host = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&host)?;
        unlockpt(&host)?;
        let mut settings = tcgetattr(&host)?;
        settings.make_raw();
        tcsetattr(&host, OptionalActions::Now, &settings)?;
        let name = ptsname(&host, Vec::new())?;
        let path = PathBuf::from(name.to_string_lossy().into_owned());
        // The host's end stays open, so that programs may come and go.
        let kept = OpenOptions::new().read(true).write(true).open(&path)?;
        let wire = Arc::new(Mutex::new(wire));
        let ends = Arc::new(AtomicBool::new(false));
        let (theirs, their_end) = (Arc::clone(&wire), Arc::clone(&ends));
        let thread = std::thread::Builder::new().name("emulator".to_owned()).spawn(move || {
            // A terminal that is gone ends the emulation, as an adapter that is pulled out.
            if let Err(error) = serve(&host, &kept, &theirs, &their_end) {
                tracing::debug!(%error, "the emulated bus has ended");
            }
        })?;
        Ok(Self { path, wire, ends, thread: Some(thread) })
    }

    /// The serial port that a host opens.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The bus, to look at it or to break it.
    pub fn wire(&self) -> MutexGuard<'_, ServoWire> {
        self.wire.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread of the emulated bus has panicked");
        }
    }
}

fn serve(host: &OwnedFd, _kept: &File, wire: &Mutex<ServoWire>, ends: &AtomicBool) -> io::Result<()> {
    let mut pending = Vec::new();
    let mut buffer = [0; 4096];
    while !ends.load(Ordering::Relaxed) {
        match poll(&mut [PollFd::new(host, PollFlags::IN)], Some(&PATIENCE)) {
            Ok(0) | Err(Errno::INTR) => continue,
            Ok(_) => {}
            Err(error) => return Err(error.into()),
        }
        let n = read(host, &mut buffer)?;
        let arrived_ns = monotonic_ns();
        pending.extend_from_slice(&buffer[..n]);
        let baud = tcgetattr(host)?.output_speed();
        while let Some(request) = wire::next_request(&mut pending) {
            let replies = {
                let mut wire = wire.lock().unwrap_or_else(PoisonError::into_inner);
                wire.replies(&request, baud, arrived_ns)
            };
            for piece in replies {
                sleep_until(piece.due_ns);
                send(host, &piece.bytes)?;
            }
        }
    }
    Ok(())
}

fn send(host: &OwnedFd, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        bytes = &bytes[write(host, bytes)?..];
    }
    Ok(())
}

fn sleep_until(due_ns: i64) {
    let left_ns = due_ns.saturating_sub(monotonic_ns());
    if left_ns > OVERSLEEP_NS {
        std::thread::sleep(Duration::from_nanos((left_ns - OVERSLEEP_NS).unsigned_abs()));
    }
    while monotonic_ns() < due_ns {
        std::hint::spin_loop();
    }
}
