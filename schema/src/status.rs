//! What became of the messages of each channel: what the recorder writes to `/krait/recorder`.

use crate::channel::Channel;

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
