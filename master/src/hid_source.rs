//! The live device: a thread of its own sleeps on the device and hands every report on at once, so that the kernel's ring,
//! which keeps the oldest and drops the newest, never fills.

use crate::evdev_host::EvdevHost;
use crate::hid::{HidHost, OpenPort, ReadFailure, SystemHost};
use crate::lights::Lights;
use crate::source::sleep_until;
use crate::spacenavd::SpacenavHost;
use crate::{DeviceChoice, MasterError, Plug, Profile, RawReport, ReportSource, SourceEvent};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded};
use krait_ipc::{Standing, clock};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU16, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// The device of a source that reads one.
const HAND: usize = 0;
/// Events that may wait for the process loop: two seconds of the fastest SpaceMouse.
const QUEUE: usize = 256;
/// How long the thread sleeps on a silent device before it looks whether it shall end.
const READ_TIMEOUT: Duration = Duration::from_millis(50);
/// Pause between two searches for a device that was unplugged. A search takes 13 to 260 ms of one core.
const SEARCH_PAUSE: Duration = Duration::from_millis(500);
/// Pause after a loss was told, before anything else is done about it, so that nothing on the same core delays the end of the motion.
const TOLD_PAUSE: Duration = Duration::from_millis(20);

/// Reads a live device.
#[derive(Debug)]
pub struct HidSource {
    events: Receiver<SourceEvent>,
    early: Option<SourceEvent>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    vid_pid: (u16, u16),
}

/// What the process loop and the reading thread share besides the queue.
#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    n_drained: AtomicU64,
    // An unplugging or plugging in went with the oldest events.
    missed_plug: AtomicBool,
    /// [`Lights::bits`] that the device shall show.
    lights: AtomicU16,
}

impl HidSource {
    /// Finds and opens the device and starts the thread that reads it. When the device is unplugged later, that thread looks
    /// for it (by the same choice) until it is there and may be opened again.
    ///
    /// # Errors
    /// [`MasterError::NoDevice`], [`MasterError::Unreadable`], [`MasterError::HandInUse`], [`MasterError::Hid`] or
    /// [`MasterError::Thread`].
    pub fn open(choice: &DeviceChoice) -> Result<Self, MasterError> {
        Self::open_on(Box::new(SystemHost), choice, SEARCH_PAUSE, None)
    }

    /// The same for the device of a profile, in the kernel's input system.
    ///
    /// # Errors
    /// [`MasterError::NoInput`], [`MasterError::Unreadable`], [`MasterError::Input`], [`MasterError::Profile`] or
    /// [`MasterError::Thread`].
    pub fn open_profile(profile: Profile) -> Result<Self, MasterError> {
        Self::open_on(Box::new(EvdevHost { profile }), &DeviceChoice::Any, SEARCH_PAUSE, None)
    }

    /// The same for the hand behind spacenavd, which listens at a path.
    ///
    /// # Errors
    /// [`MasterError::Spacenavd`] or [`MasterError::Thread`].
    pub fn open_spacenavd(socket: &Path) -> Result<Self, MasterError> {
        let host = Box::new(SpacenavHost { socket: socket.to_owned() });
        Self::open_on(host, &DeviceChoice::Any, SEARCH_PAUSE, None)
    }

    /// The same for any host, one of several whose reader waits for all of them by `wake`.
    pub(crate) fn open_joined(
        host: Box<dyn HidHost>,
        choice: &DeviceChoice,
        wake: Sender<()>,
    ) -> Result<Self, MasterError> {
        Self::open_on(host, choice, SEARCH_PAUSE, Some(wake))
    }

    /// Whether an event waits.
    pub(crate) fn has_event(&self) -> bool {
        let has_missed = self.shared.missed_plug.load(Ordering::Relaxed);
        self.early.is_some()
            || !self.events.is_empty()
            || has_missed
            || self.shared.n_drained.load(Ordering::Relaxed) > 0
    }

    /// Events that wait.
    #[cfg(test)]
    pub(crate) fn n_events(&self) -> usize {
        self.events.len()
    }

    /// Whether the device is not read any more.
    #[cfg(test)]
    pub(crate) fn is_over(&self) -> bool {
        self.thread.as_ref().is_some_and(JoinHandle::is_finished)
    }

    /// Lets the device go, a moment later and for good; nobody waits for it.
    pub(crate) fn let_go(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    pub(crate) fn open_on(
        mut host: Box<dyn HidHost>,
        choice: &DeviceChoice,
        pause: Duration,
        wake: Option<Sender<()>>,
    ) -> Result<Self, MasterError> {
        let opened = host.open(choice)?;
        let (sender, events) = bounded(QUEUE);
        let shared = Arc::new(Shared { lights: Lights::default().bits().into(), ..Shared::default() });
        let vid_pid = opened.vid_pid;
        let choice = choice.clone();
        let (oldest, standing) = (events.clone(), Standing::of_this_thread());
        let reader =
            Reader { events: sender, oldest, shared: Arc::clone(&shared), host, choice, pause, wake, standing };
        let thread = std::thread::Builder::new()
            .name("krait-hid".to_owned())
            .spawn(move || reader.run(opened))
            .map_err(|source| MasterError::Thread { name: "krait-hid", source })?;
        Ok(Self { events, early: None, shared, thread: Some(thread), vid_pid })
    }
}

impl ReportSource for HidSource {
    fn start(&mut self, _now_ns: i64) {}

    fn wait_until(&mut self, deadline_ns: i64) {
        let left_ns = deadline_ns.saturating_sub(clock::monotonic_ns());
        if self.early.is_some() || left_ns <= 0 {
            return;
        }
        match self.events.recv_timeout(Duration::from_nanos(left_ns.unsigned_abs())) {
            Ok(event) => self.early = Some(event),
            Err(RecvTimeoutError::Timeout) => {}
            // The thread is gone and can wake nobody any more.
            Err(RecvTimeoutError::Disconnected) => sleep_until(deadline_ns),
        }
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        if self.shared.missed_plug.swap(false, Ordering::Relaxed) {
            return Some(SourceEvent::Plug { device: HAND, stamp_ns: now_ns, plug: Plug::In });
        }
        match self.shared.n_drained.swap(0, Ordering::Relaxed) {
            0 => self.early.take().or_else(|| self.events.try_recv().ok()),
            n_drained => Some(SourceEvent::Drained(n_drained)),
        }
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        Some(self.vid_pid)
    }

    fn show(&mut self, lights: Lights) {
        self.shared.lights.store(lights.bits(), Ordering::Relaxed);
    }
}

impl Drop for HidSource {
    fn drop(&mut self) {
        self.let_go();
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            tracing::error!("the thread that reads the hand controller died");
        }
    }
}

/// Why a device is not read any more.
enum ReadEnd {
    /// The source is closed.
    Stopped,
    /// Its user has given it back.
    GivenBack,
    /// It is gone, in the words of the system.
    Gone(String),
}

struct Reader {
    events: Sender<SourceEvent>,
    // The same queue from the other end: where it is full, the oldest makes room for the newest.
    oldest: Receiver<SourceEvent>,
    shared: Arc<Shared>,
    host: Box<dyn HidHost>,
    choice: DeviceChoice,
    pause: Duration,
    // Wakes whoever waits for several devices at once.
    wake: Option<Sender<()>>,
    // That of the process, which waits for what is read here.
    standing: Standing,
}

impl Reader {
    fn run(mut self, mut opened: OpenPort) {
        loop {
            if let Err(error) = self.standing.take() {
                tracing::warn!(%error, "the thread that reads the hand controller is not given the priority of its process");
            }
            match self.read_until_gone(&mut opened) {
                ReadEnd::Stopped => {
                    opened.port.rest_lights();
                    return;
                }
                ReadEnd::GivenBack => {
                    self.push(SourceEvent::GivenBack);
                    opened.port.rest_lights();
                    tracing::warn!(
                        "the hand controller was given back by its key; nothing moves, and it is taken again only by another start"
                    );
                    return;
                }
                ReadEnd::Gone(source_text) => {
                    self.tell(Plug::Out);
                    // What follows is slow.
                    if let Err(error) = self.standing.leave() {
                        tracing::debug!(%error, "the priority stays");
                    }
                    std::thread::park_timeout(TOLD_PAUSE.min(self.pause));
                    let (vendor_id, product_id) = opened.vid_pid;
                    let device = format_args!("{vendor_id:04x}:{product_id:04x}");
                    tracing::warn!(%device, %source_text, "the hand controller was lost; looking for it");
                }
            }
            drop(opened);
            match self.search() {
                Some(found) => opened = found,
                None => return,
            }
            self.tell(Plug::In);
        }
    }

    fn read_until_gone(&self, opened: &mut OpenPort) -> ReadEnd {
        let port = opened.port.as_mut();
        let mut buffer = [0_u8; RawReport::MAX_BYTES];
        let mut shown = None;
        while !self.is_stopped() {
            let lights = Lights::from_bits(self.shared.lights.load(Ordering::Relaxed));
            if shown.replace(lights) != Some(lights) {
                port.show(lights);
            }
            match port.read(&mut buffer, READ_TIMEOUT) {
                Ok(0) | Err(ReadFailure::Interrupted) => {}
                Ok(n_bytes) => {
                    let report = RawReport::clipped(&buffer[..n_bytes.min(RawReport::MAX_BYTES)]);
                    self.push(SourceEvent::HidReport { device: HAND, stamp_ns: clock::monotonic_ns(), report });
                }
                Err(ReadFailure::Gone(source_text)) => return ReadEnd::Gone(source_text),
                Err(ReadFailure::Dropped) => {
                    self.tell(Plug::Out);
                    self.tell(Plug::In);
                    tracing::warn!("the kernel has dropped events of the hand controller; presence must be given anew");
                }
                Err(ReadFailure::GivenBack) => return ReadEnd::GivenBack,
            }
        }
        ReadEnd::Stopped
    }

    /// Looks for the device again and again. There is no device to be read meanwhile, so its slowness delays nothing. A
    /// refusal for want of permission is tried again too: udev sets permissions a little after the node appears.
    fn search(&mut self) -> Option<OpenPort> {
        while !self.is_stopped() {
            match self.host.open(&self.choice) {
                Ok(opened) => return Some(opened),
                Err(error) => tracing::debug!(%error, "the hand controller is not there yet"),
            }
            std::thread::park_timeout(self.pause);
        }
        None
    }

    fn tell(&self, plug: Plug) {
        self.push(SourceEvent::Plug { device: HAND, stamp_ns: clock::monotonic_ns(), plug });
    }

    /// Hands an event on without ever waiting for the process loop: where there is no room, the oldest event goes.
    fn push(&self, mut event: SourceEvent) {
        while let Err(TrySendError::Full(refused)) = self.events.try_send(event) {
            event = refused;
            match self.oldest.try_recv() {
                Ok(SourceEvent::HidReport { .. }) => {
                    self.shared.n_drained.fetch_add(1, Ordering::Relaxed);
                }
                Ok(_) => self.shared.missed_plug.store(true, Ordering::Relaxed),
                Err(_) => {}
            }
        }
        // One token is enough: whoever is awake looks at everything.
        if let Some(wake) = &self.wake {
            let _is_awake = wake.try_send(());
        }
    }

    fn is_stopped(&self) -> bool {
        self.shared.stop.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
pub(crate) mod tests;
