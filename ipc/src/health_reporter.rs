//! Publishes a process's health ten times a second; its first message says that the process is ready.

use crate::message::{Health, Message};
use crate::{Bus, IpcError, Process, Reader, Reasons, Writer};

/// Ten times a second: often enough for a person, rare enough to cost nothing.
const PERIOD_NS: i64 = 100_000_000;

/// Name of the channel that carries a process's health.
pub fn health_channel(process: Process) -> String {
    format!("health/{process}")
}

/// Keeps and publishes the counters of one process.
#[derive(Debug)]
pub struct HealthReporter {
    writer: Writer<Health>,
    health: Health,
    due_ns: i64,
}

impl HealthReporter {
    /// Opens the channel `health/<process>`. Nothing is published yet: open everything else first.
    ///
    /// # Errors
    /// As [`Bus::writer_on`].
    pub fn open(bus: &Bus, process: Process) -> Result<Self, IpcError> {
        let writer = bus.writer_on(&health_channel(process))?;
        Ok(Self { writer, health: Health { pid: std::process::id(), ..Health::default() }, due_ns: i64::MIN })
    }

    /// The counters, to be kept up to date by the process.
    pub fn health_mut(&mut self) -> &mut Health {
        &mut self.health
    }

    /// The reasons that hold at this moment.
    pub fn set_now(&mut self, reasons: Reasons) {
        self.health.set_now(reasons);
    }

    /// Sums up what a set of readers has counted.
    pub fn count_readers(&mut self, readers: &[ReadCounts]) {
        self.health.n_received = readers.iter().map(|r| r.n_received).sum();
        self.health.n_lost = readers.iter().map(|r| r.n_lost).sum();
    }

    /// Publishes if a tenth of a second has passed.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn publish_if_due(&mut self, now_ns: i64) -> Result<(), IpcError> {
        if self.is_due(now_ns) { self.publish(now_ns) } else { Ok(()) }
    }

    /// Whether a tenth of a second has passed.
    pub fn is_due(&self, now_ns: i64) -> bool {
        now_ns >= self.due_ns
    }

    /// Publishes at once: when ready, and as the last word before the end.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn publish(&mut self, now_ns: i64) -> Result<(), IpcError> {
        self.health.sequence += 1;
        self.health.sample_ns = now_ns;
        self.due_ns = now_ns + PERIOD_NS;
        self.writer.send(&self.health)
    }
}

/// What one reader has counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadCounts {
    /// Messages taken.
    pub n_received: u64,
    /// Messages that never arrived.
    pub n_lost: u64,
}

impl<M: Message> Reader<M> {
    /// What this reader has counted so far.
    pub fn counts(&self) -> ReadCounts {
        ReadCounts { n_received: self.n_received(), n_lost: self.n_lost() }
    }
}
