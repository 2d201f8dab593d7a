//! The thread that compresses and writes: whatever the disk does, it keeps the queue moving.

use crate::drain::Taken;
use crate::error::RecordError;
use crate::parts::Parts;
use crate::tally::Tally;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use crossbeam_channel::{Receiver, RecvTimeoutError};
use krait_ipc::clock;
use krait_schema::{Channel, ChannelCounts, RecorderStatus, Sample};
use std::collections::BTreeMap;

/// How often the counts are written to `/krait/recorder`.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// What both threads know.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    pub(crate) tally: Tally,
    /// Whether the file can no longer be written; the samples that still come are counted as dropped.
    pub(crate) has_stopped: AtomicBool,
}

/// What the files came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Written {
    pub(crate) n_bytes: u64,
    pub(crate) n_parts: u32,
}

/// Writes what comes through the queue until its other end is gone. Returns what was written, or why it stopped.
pub(crate) fn write_all(
    parts: Parts<'_>,
    queue: &Receiver<Taken>,
    shared: &Shared,
    flush_period: Duration,
) -> Result<Written, RecordError> {
    let mut disk = Disk { parts, shared, n_statuses: 0, at_begin: RecorderStatus::default() };
    let mut result = Ok(());
    let mut flush = Timer::new(flush_period);
    let mut status = Timer::new(STATUS_PERIOD);
    loop {
        let now_ns = clock::monotonic_ns();
        let next = queue.recv_timeout(flush.left(now_ns).min(status.left(now_ns)));
        match next {
            Ok(taken) if result.is_ok() => result = disk.store(&taken),
            Ok((sample, _)) => shared.tally.add_dropped(sample.channel()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        let now_ns = clock::monotonic_ns();
        // Asked even when the recording has stopped: a timer that is not renewed leaves no time to sleep.
        let (is_status_due, is_flush_due) = (status.is_due(now_ns), flush.is_due(now_ns));
        if result.is_ok() && is_status_due {
            result = disk.store_status();
        }
        if result.is_ok() && is_flush_due {
            result = disk.flush(now_ns);
        }
        if let Err(error) = &result
            && !shared.has_stopped.swap(true, Ordering::Relaxed)
        {
            tracing::error!(%error, "the recording stopped; the motion is not affected");
        }
    }
    result.and_then(|()| disk.finish()).inspect_err(|_| shared.has_stopped.store(true, Ordering::Relaxed))
}

struct Disk<'a> {
    parts: Parts<'a>,
    shared: &'a Shared,
    n_statuses: u64,
    // Counts when the part began.
    at_begin: RecorderStatus,
}

impl Disk<'_> {
    fn store(&mut self, (sample, taken_ns): &Taken) -> Result<(), RecordError> {
        let channel = sample.channel();
        let written = self.parts.writer().write(sample, *taken_ns);
        match written {
            Ok(()) => self.shared.tally.add_written(channel),
            Err(_) => self.shared.tally.add_dropped(channel),
        }
        written
    }

    fn store_status(&mut self) -> Result<(), RecordError> {
        self.n_statuses += 1;
        let now_ns = clock::monotonic_ns();
        let status = self.shared.tally.status(self.n_statuses, now_ns);
        self.parts.writer().write(&Sample::Recorder(Box::new(status)), now_ns)
    }

    /// Closes the chunk, and with it the part if that is full.
    fn flush(&mut self, now_ns: i64) -> Result<(), RecordError> {
        self.parts.flush()?;
        if !self.parts.is_full(now_ns) {
            return Ok(());
        }
        self.store_status()?;
        let status = self.shared.tally.status(self.n_statuses, now_ns);
        self.parts.rotate(self.end(&status), now_ns)?;
        self.at_begin = status;
        Ok(())
    }

    fn finish(mut self) -> Result<Written, RecordError> {
        self.store_status()?;
        let status = self.shared.tally.status(self.n_statuses, clock::monotonic_ns());
        let (end, n_parts) = (self.end(&status), self.parts.n_parts());
        Ok(Written { n_bytes: self.parts.finish(&end)?, n_parts })
    }

    /// The metadata record `krait.end`: what became of the messages while this part was written.
    fn end(&self, status: &RecorderStatus) -> BTreeMap<String, String> {
        let total = since(status.total(), self.at_begin.total());
        let mut end = BTreeMap::from([
            ("end_wall_ns".to_owned(), clock::wall_ns().to_string()),
            ("n_written".to_owned(), total.n_written.to_string()),
            ("n_dropped".to_owned(), total.n_dropped.to_string()),
            ("n_lost".to_owned(), total.n_lost.to_string()),
            ("n_out_of_order".to_owned(), total.n_out_of_order.to_string()),
        ]);
        for (channel, (now, before)) in
            Channel::ALL.into_iter().zip(status.channels.iter().zip(&self.at_begin.channels))
        {
            let counts = since(*now, *before);
            let text = format!(
                "n_written={} n_dropped={} n_lost={} n_out_of_order={}",
                counts.n_written, counts.n_dropped, counts.n_lost, counts.n_out_of_order
            );
            end.insert(channel.topic().to_owned(), text);
        }
        end
    }
}

fn since(now: ChannelCounts, before: ChannelCounts) -> ChannelCounts {
    ChannelCounts {
        n_written: now.n_written.saturating_sub(before.n_written),
        n_dropped: now.n_dropped.saturating_sub(before.n_dropped),
        n_lost: now.n_lost.saturating_sub(before.n_lost),
        n_out_of_order: now.n_out_of_order.saturating_sub(before.n_out_of_order),
    }
}

/// Something that is due again and again.
struct Timer {
    period_ns: i64,
    due_ns: i64,
}

impl Timer {
    fn new(period: Duration) -> Self {
        let period_ns = i64::try_from(period.as_nanos()).unwrap_or(i64::MAX);
        Self { period_ns, due_ns: clock::monotonic_ns().saturating_add(period_ns) }
    }

    fn left(&self, now_ns: i64) -> Duration {
        Duration::from_nanos(u64::try_from(self.due_ns.saturating_sub(now_ns)).unwrap_or(0))
    }

    fn is_due(&mut self, now_ns: i64) -> bool {
        let is_due = now_ns >= self.due_ns;
        if is_due {
            self.due_ns = now_ns.saturating_add(self.period_ns);
        }
        is_due
    }
}
