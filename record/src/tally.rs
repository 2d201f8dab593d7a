//! What became of the messages, while the recorder's two threads count them.

use core::sync::atomic::{AtomicU64, Ordering};
use krait_schema::{Channel, ChannelCounts, RecorderStatus};

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
