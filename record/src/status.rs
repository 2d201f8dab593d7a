//! What became of the messages: counted by the recorder's two threads, written to the file, reported at the end.

use crate::channel::Channel;
use core::sync::atomic::{AtomicU64, Ordering};

/// What became of the messages of one channel since the recording began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChannelCounts {
    /// Written to the file.
    pub n_written: u64,
    /// Taken from shared memory and not written, because the disk was too slow or full.
    pub n_dropped: u64,
    /// Never reached the recorder (gaps in the sequence numbers).
    pub n_lost: u64,
    /// Came twice or too late, and were not written.
    pub n_out_of_order: u64,
}

/// The counts of every channel at one moment; written to `/krait/recorder` once a second and at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecorderStatus {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// When it was taken, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// Counts in the order of [`Channel::ALL`], without [`Channel::Recorder`] itself.
    pub channels: [ChannelCounts; Channel::N_SHARED],
}

impl RecorderStatus {
    /// Version of the payload, as `Message::VERSION`.
    pub const VERSION: u32 = 1;

    /// The counts of all channels together.
    pub fn total(&self) -> ChannelCounts {
        self.channels.iter().fold(ChannelCounts::default(), |sum, channel| ChannelCounts {
            n_written: sum.n_written.saturating_add(channel.n_written),
            n_dropped: sum.n_dropped.saturating_add(channel.n_dropped),
            n_lost: sum.n_lost.saturating_add(channel.n_lost),
            n_out_of_order: sum.n_out_of_order.saturating_add(channel.n_out_of_order),
        })
    }

    /// The counts of a channel that is read from shared memory; `None` for [`Channel::Recorder`].
    pub fn of(&self, channel: Channel) -> Option<ChannelCounts> {
        self.channels.get(channel.index()).copied()
    }
}

/// The same counts while both threads add to them. They are statistics: no other memory is ordered by them.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    channels: [Counters; Channel::ALL.len()],
}

#[derive(Debug, Default)]
struct Counters {
    written: AtomicU64,
    dropped: AtomicU64,
    lost: AtomicU64,
    out_of_order: AtomicU64,
}

impl Tally {
    pub(crate) fn add_written(&self, channel: Channel) {
        self.channels[channel.index()].written.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn add_dropped(&self, channel: Channel) {
        self.channels[channel.index()].dropped.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn set_missed(&self, channel: Channel, n_lost: u64, n_out_of_order: u64) {
        self.channels[channel.index()].lost.store(n_lost, Ordering::Relaxed);
        self.channels[channel.index()].out_of_order.store(n_out_of_order, Ordering::Relaxed);
    }

    pub(crate) fn status(&self, sequence: u64, sample_ns: i64) -> RecorderStatus {
        let mut status = RecorderStatus { sequence, sample_ns, ..RecorderStatus::default() };
        for (counts, counters) in status.channels.iter_mut().zip(&self.channels) {
            *counts = ChannelCounts {
                n_written: counters.written.load(Ordering::Relaxed),
                n_dropped: counters.dropped.load(Ordering::Relaxed),
                n_lost: counters.lost.load(Ordering::Relaxed),
                n_out_of_order: counters.out_of_order.load(Ordering::Relaxed),
            };
        }
        status
    }
}
