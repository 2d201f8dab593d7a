//! The thread that compresses and writes: whatever the disk does, it keeps the queue moving.

use crate::channel::Channel;
use crate::drain::Taken;
use crate::error::RecordError;
use crate::sample::Sample;
use crate::sink::RecordingSink;
use crate::status::Tally;
use crate::writer::RecordingWriter;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use crossbeam_channel::{Receiver, RecvTimeoutError};
use krait_ipc::clock;
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

/// Writes what comes through the queue until its other end is gone. Returns the length of the file, or why it stopped.
pub(crate) fn write_all<S: RecordingSink>(
    writer: RecordingWriter<S>,
    queue: &Receiver<Taken>,
    shared: &Shared,
    flush_period: Duration,
) -> Result<u64, RecordError> {
    let mut disk = Disk { writer, shared, n_statuses: 0 };
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
        if result.is_ok() && status.is_due(now_ns) {
            result = disk.store_status();
        }
        if result.is_ok() && flush.is_due(now_ns) {
            result = disk.writer.flush();
        }
        if let Err(error) = &result
            && !shared.has_stopped.swap(true, Ordering::Relaxed)
        {
            tracing::error!(%error, "the recording stopped; the motion is not affected");
        }
    }
    result.and_then(|()| disk.finish()).inspect_err(|_| shared.has_stopped.store(true, Ordering::Relaxed))
}

struct Disk<'a, S: RecordingSink> {
    writer: RecordingWriter<S>,
    shared: &'a Shared,
    n_statuses: u64,
}

impl<S: RecordingSink> Disk<'_, S> {
    fn store(&mut self, (sample, taken_ns): &Taken) -> Result<(), RecordError> {
        let channel = sample.channel();
        let written = self.writer.write(sample, *taken_ns);
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
        self.writer.write(&Sample::Recorder(Box::new(status)), now_ns)
    }

    fn finish(mut self) -> Result<u64, RecordError> {
        self.store_status()?;
        let status = self.shared.tally.status(self.n_statuses, clock::monotonic_ns());
        let total = status.total();
        let mut end = BTreeMap::from([
            ("end_wall_ns".to_owned(), clock::wall_ns().to_string()),
            ("n_written".to_owned(), total.n_written.to_string()),
            ("n_dropped".to_owned(), total.n_dropped.to_string()),
            ("n_lost".to_owned(), total.n_lost.to_string()),
            ("n_out_of_order".to_owned(), total.n_out_of_order.to_string()),
        ]);
        for (channel, counts) in Channel::ALL.into_iter().zip(status.channels) {
            let text = format!(
                "n_written={} n_dropped={} n_lost={} n_out_of_order={}",
                counts.n_written, counts.n_dropped, counts.n_lost, counts.n_out_of_order
            );
            end.insert(channel.topic().to_owned(), text);
        }
        self.writer.finish(&end)
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
