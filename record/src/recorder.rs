//! The recorder process: one thread empties shared memory, one writes, and a bounded queue stands between them.

use crate::about::{About, default_file_name};
use crate::config::RecordConfig;
use crate::disk::{Shared, Written, write_all};
use crate::drain::{Drain, WhenFull};
use crate::error::RecordError;
use crate::parts::Parts;
use crate::syncer::{Failure, Syncer, sync_all};
use core::sync::atomic::Ordering;
use core::time::Duration;
use krait_ipc::{Bus, HealthReporter, IpcError, Process, Reason, Reasons, clock, set_slice};
use krait_schema::RecorderStatus;
use std::path::{Path, PathBuf};
use std::thread;

/// How often shared memory is emptied: 5 messages of a 1 kHz channel, 40 of an 8 kHz one, of the 8192 that
/// a channel of samples can hold.
const POLL_PERIOD: Duration = Duration::from_millis(5);
/// As long as health is published, ten times a second, ns.
const HEALTH_PERIOD_NS: i64 = 100_000_000;

/// Time slice of the two threads, us: on a busy machine they are let in before programs that compute for longer, and after
/// the control processes, whose slice is 100.
const SLICE_US: u32 = 500;

/// What a recording came to.
#[derive(Debug)]
pub struct RecordReport {
    /// The file.
    pub path: PathBuf,
    /// Files that it consists of; more than one where it was rotated.
    pub n_parts: u32,
    /// The length of all in bytes, or why the recording stopped early.
    pub outcome: Result<u64, RecordError>,
    /// What became of the messages of each channel.
    pub status: RecorderStatus,
}

/// Records every channel of an instance until it is over, asked every 5 ms, then everything that is still in shared memory.
///
/// The first health message says that every channel is read and the file is open. A disk that is full or gone stops the
/// recording and nothing else: the health says so ([`Reason::RecordingStopped`]), what comes is counted as dropped, and the
/// report has the sentence. Stop it after every writer, so that the last messages are in the file. A writer that opens its
/// channel and is gone again before the recorder's next look (5 ms) goes unseen: iceoryx2 takes its messages with it.
///
/// # Errors
/// [`RecordError`] when the recording could not be begun, or a channel failed; what had been recorded is kept.
pub fn run(bus: &Bus, config: &RecordConfig, is_over: impl FnMut() -> bool) -> Result<RecordReport, RecordError> {
    config.check()?;
    let instance = bus.instance().as_str();
    let path = config.path.clone().unwrap_or_else(|| Path::new("recordings").join(default_file_name(instance)));
    let shared = Shared::default();
    let (sender, receiver) = crossbeam_channel::bounded(config.queue_length);
    let drain = Drain::open(bus, sender, &shared)?;
    let health = HealthReporter::open(bus, Process::Record)?;
    let about = About::run(instance, &config.metadata, config.attachments.clone());
    let failure = Failure::default();
    let (syncer, jobs) = Syncer::pair(&failure);
    let parts = Parts::create(&path, config, about, syncer, clock::monotonic_ns())?;
    let died = |what: String| RecordError::Thread { path: path.clone(), what };
    thread::scope(|scope| {
        let sync = || sync_all(&jobs, config.sync_period(), &failure);
        let thread = thread::Builder::new().name("record-sync".to_owned()).spawn_scoped(scope, sync);
        thread.map_err(|error| died(format!("could not be started: {error}")))?;
        let write = || {
            be_punctual();
            write_all(parts, &receiver, &shared, config.flush_period())
        };
        let thread = thread::Builder::new().name("record-write".to_owned()).spawn_scoped(scope, write);
        let thread = thread.map_err(|error| died(format!("could not be started: {error}")))?;
        be_punctual();
        let mut feed = Feed { drain: Some(drain), health, shared: &shared, due_ns: i64::MIN };
        let fed = feed.until(is_over);
        // The end of the queue is what ends the thread.
        feed.drain = None;
        let outcome = thread.join().map_err(|panic| died(format!("died: {panic:?}")))?;
        let status = shared.tally.status(0, clock::monotonic_ns());
        fed?;
        // The last word: whether the file was ended well.
        feed.report(clock::monotonic_ns())?;
        let n_parts = outcome.as_ref().map_or(1, |written| written.n_parts);
        let outcome = outcome.map(|Written { n_bytes, .. }| n_bytes);
        Ok(RecordReport { path: path.clone(), n_parts, outcome, status })
    })
}

/// Asks for a short slice; a kernel that refuses it makes the recorder less punctual on a busy machine, and nothing else.
fn be_punctual() {
    if let Err(refused) = set_slice(SLICE_US) {
        tracing::debug!(refused);
    }
}

/// The thread that reads shared memory.
struct Feed<'a> {
    drain: Option<Drain<'a>>,
    health: HealthReporter,
    shared: &'a Shared,
    due_ns: i64,
}

impl Feed<'_> {
    fn until(&mut self, mut is_over: impl FnMut() -> bool) -> Result<(), IpcError> {
        while !is_over() {
            self.take_all(WhenFull::Drop)?;
            self.publish_if_due()?;
            thread::sleep(POLL_PERIOD);
        }
        // Published before the last look, so that the file has it.
        self.publish(clock::monotonic_ns())?;
        while self.take_all(WhenFull::Wait)? > 0 {}
        Ok(())
    }

    fn take_all(&mut self, when_full: WhenFull) -> Result<u64, IpcError> {
        self.drain.as_mut().map_or(Ok(0), |drain| drain.take_all(when_full))
    }

    fn publish_if_due(&mut self) -> Result<(), IpcError> {
        let now_ns = clock::monotonic_ns();
        if now_ns < self.due_ns {
            return Ok(());
        }
        self.due_ns = now_ns + HEALTH_PERIOD_NS;
        self.publish(now_ns)
    }

    fn publish(&mut self, now_ns: i64) -> Result<(), IpcError> {
        if let Some(drain) = &self.drain {
            self.health.count_readers(&drain.read_counts());
        }
        self.report(now_ns)
    }

    fn report(&mut self, now_ns: i64) -> Result<(), IpcError> {
        let total = self.shared.tally.status(0, now_ns).total();
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::RecordingStopped, self.shared.has_stopped.load(Ordering::Relaxed));
        reasons.insert_if(Reason::RecordingDropped, total.n_dropped > 0);
        reasons.insert_if(Reason::SamplesLost, total.n_lost > 0);
        self.health.set_now(reasons);
        let health = self.health.health_mut();
        health.n_sent += 1;
        if total.n_dropped > 0 {
            health.note(Reason::RecordingDropped, total.n_dropped as f64, 0.0);
        }
        if total.n_lost > 0 {
            health.note(Reason::SamplesLost, total.n_lost as f64, 0.0);
        }
        self.health.publish(now_ns)
    }
}
