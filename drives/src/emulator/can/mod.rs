//! An emulated CAN bus of CiA 402 drives: in this process, with the machine's clock or one of its own, or on an interface.

mod drive;
mod objects;

pub use drive::{CanDrive, CanFaults};

use crate::bus::BusGone;
use crate::cia402::port::{receive, send, socket};
use crate::cia402::{Frame, SYNC, Wire};
use crate::emulator::Coupling;
use crate::error::OpenError;
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How often drives look at the time, ns.
const TICK_NS: i64 = 1_000_000;
/// How often they look whether an interface that was down is up again, ns.
const LOOK_NS: i64 = 20_000_000;

/// What a bus holds: its drives, and frames on their way to the master.
#[derive(Debug, Default)]
pub struct CanDrives {
    /// The drives.
    pub drives: Vec<CanDrive>,
    /// What the master hears next.
    to_master: VecDeque<Frame>,
    /// What their axes pull at; none: each keeps the load that it was given.
    pub coupling: Option<Coupling>,
    /// Number of frames that the master has sent.
    pub n_frames: u64,
    /// What every send and receive fails with, as of an interface that is down.
    pub gone: Option<BusGone>,
    /// How often its interface was opened again.
    pub n_reopened: u32,
}

/// An emulated bus, to look at it or to break it; all copies are the same one.
#[derive(Clone, Debug, Default)]
pub struct CanBus {
    drives: Arc<Mutex<CanDrives>>,
}

/// The master's end of an emulated bus.
#[derive(Debug)]
pub struct CanWire {
    bus: CanBus,
    clock: Clock,
    stepped_ns: i64,
}

/// Whose time it is.
#[derive(Clone, Debug)]
enum Clock {
    Machine,
    /// Goes on only while the master waits.
    Own(Arc<AtomicI64>),
}

impl CanDrives {
    /// A frame that somebody else than the drives sends.
    pub fn inject(&mut self, frame: Frame) {
        self.to_master.push_back(frame);
    }

    /// Gives one drive, counted from 0, what has to be said to the bus, such as a trip.
    pub fn with(&mut self, k: usize, act: impl FnOnce(&mut CanDrive, &mut Vec<Frame>)) {
        let mut out = Vec::new();
        if let Some(drive) = self.drives.get_mut(k) {
            act(drive, &mut out);
        }
        self.to_master.extend(out);
    }

    /// Lets time pass up to an instant without a master.
    pub fn step_to(&mut self, now_ns: i64) {
        let mut out = Vec::new();
        self.step(now_ns, &mut out);
        self.to_master.extend(out);
    }

    fn take(&mut self, frame: &Frame, now_ns: i64, out: &mut Vec<Frame>) {
        self.n_frames += 1;
        for drive in &mut self.drives {
            drive.take(frame, now_ns, out);
        }
        // Axes move at a SYNC.
        if frame.id() == SYNC {
            self.couple();
        }
    }

    fn couple(&mut self) {
        if let Some(coupling) = &self.coupling {
            let places: Vec<f64> = self.drives.iter().map(|drive| drive.place).collect();
            let loads = coupling.loads(&places);
            self.drives.iter_mut().zip(loads).for_each(|(drive, load)| drive.load = load);
        }
    }

    fn step(&mut self, now_ns: i64, out: &mut Vec<Frame>) {
        for drive in &mut self.drives {
            drive.step(now_ns, out);
        }
    }
}

impl CanBus {
    /// A bus with drives.
    pub fn new(drives: Vec<CanDrive>) -> Self {
        Self { drives: Arc::new(Mutex::new(CanDrives { drives, ..CanDrives::default() })) }
    }

    /// The drives.
    pub fn lock(&self) -> MutexGuard<'_, CanDrives> {
        self.drives.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A master's end with the machine's clock.
    pub fn wire(&self) -> CanWire {
        CanWire { bus: self.clone(), clock: Clock::Machine, stepped_ns: monotonic_ns() }
    }

    /// A master's end with a clock of its own, and that clock, ns.
    pub fn own_time(&self) -> (CanWire, Arc<AtomicI64>) {
        let clock = Arc::new(AtomicI64::new(TICK_NS));
        (CanWire { bus: self.clone(), clock: Clock::Own(Arc::clone(&clock)), stepped_ns: 0 }, clock)
    }
}

impl CanWire {
    /// Lets the drives see the time that has passed, tick by tick.
    fn pass(&mut self, until_ns: i64) {
        let mut out = Vec::new();
        let mut drives = self.bus.lock();
        while self.stepped_ns + TICK_NS <= until_ns {
            // The machine's clock may have gone on for long.
            self.stepped_ns = (self.stepped_ns + TICK_NS).max(until_ns - 1000 * TICK_NS);
            drives.step(self.stepped_ns, &mut out);
        }
        drives.to_master.extend(out);
    }

    fn next(&self) -> Result<Option<Frame>, BusGone> {
        let mut drives = self.bus.lock();
        drives.gone.map_or_else(|| Ok(drives.to_master.pop_front()), Err)
    }
}

impl Wire for CanWire {
    fn send(&mut self, frame: &Frame) -> Result<(), BusGone> {
        let now_ns = self.now_ns();
        let mut drives = self.bus.lock();
        if let Some(gone) = drives.gone {
            return Err(gone);
        }
        let mut out = Vec::new();
        drives.take(frame, now_ns, &mut out);
        drives.to_master.extend(out);
        Ok(())
    }

    fn receive(&mut self, until_ns: i64) -> Result<Option<Frame>, BusGone> {
        self.pass(self.now_ns());
        loop {
            if let Some(frame) = self.next()? {
                return Ok(Some(frame));
            }
            let now_ns = self.now_ns();
            if now_ns >= until_ns {
                return Ok(None);
            }
            let next_ns = until_ns.min(now_ns + TICK_NS);
            match &self.clock {
                Clock::Own(clock) => clock.store(next_ns, Ordering::Relaxed),
                Clock::Machine => std::thread::sleep(Duration::from_nanos((next_ns - now_ns).unsigned_abs())),
            }
            self.pass(next_ns);
        }
    }

    fn come_back(&mut self) -> Result<(), BusGone> {
        let mut drives = self.bus.lock();
        if let Some(gone) = drives.gone {
            return Err(gone);
        }
        drives.n_reopened += 1;
        drives.to_master.clear();
        Ok(())
    }

    fn now_ns(&self) -> i64 {
        match &self.clock {
            Clock::Machine => monotonic_ns(),
            Clock::Own(clock) => clock.load(Ordering::Relaxed),
        }
    }
}

/// Whether emulated drives could live on an interface.
///
/// # Errors
/// [`OpenError`] where the interface cannot be used.
pub fn look_at(interface: &str) -> Result<(), OpenError> {
    socket(interface).map(drop)
}

/// Lets emulated drives live on an interface of this machine until `ends`; each says that it has started. While the interface is down
/// they live on unheard, as drives do whose cable was pulled.
///
/// # Errors
/// [`OpenError`] where the interface cannot be used, or goes away.
pub fn serve(interface: &str, bus: &CanBus, ends: &AtomicBool) -> Result<(), OpenError> {
    let mut line = Some(socket(interface)?);
    let mut out = Vec::new();
    bus.lock().drives.iter_mut().for_each(|drive| drive.power_loss(&mut out));
    let (mut due_ns, mut look_ns) = (monotonic_ns(), 0);
    while !ends.load(Ordering::Relaxed) {
        match line.as_ref().map(|line| receive(line, due_ns)) {
            Some(Ok(Some(frame))) => bus.lock().take(&frame, monotonic_ns(), &mut out),
            Some(Ok(None)) => {}
            Some(Err(_)) => line = None,
            None => std::thread::sleep(Duration::from_nanos((due_ns - monotonic_ns()).max(0).unsigned_abs())),
        }
        let now_ns = monotonic_ns();
        if now_ns >= due_ns {
            due_ns = now_ns + TICK_NS;
            let mut drives = bus.lock();
            drives.step(now_ns, &mut out);
            out.extend(drives.to_master.drain(..));
        }
        if line.is_none() && now_ns >= look_ns {
            look_ns = now_ns + LOOK_NS;
            line = match socket(interface) {
                Ok(line) => Some(line),
                Err(OpenError::InterfaceDown { .. }) => None,
                Err(error) => return Err(error),
            };
        }
        for frame in out.drain(..) {
            // What nobody hears is lost.
            let is_gone = line.as_ref().is_some_and(|line| send(line, &frame).is_err());
            if is_gone {
                line = None;
            }
        }
    }
    Ok(())
}
