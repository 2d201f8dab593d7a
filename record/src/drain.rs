//! Takes every message of every channel out of shared memory into a bounded queue, waking and slowing nobody.

use crate::disk::Shared;
use crate::tally::Tally;
use core::sync::atomic::Ordering;
use core::time::Duration;
use crossbeam_channel::{Sender, TrySendError};
use krait_ipc::message::Marker;
use krait_ipc::{Bus, IpcError, ReadCounts, ReadOptions, Writer, clock};
use krait_schema::{Channel, Sample, SampleSource};

/// How long the last samples may wait for room in the queue: then nobody is slowed by it, and a disk may be slow.
const LAST_PATIENCE: Duration = Duration::from_secs(5);

/// A sample and when it was taken from shared memory, CLOCK_MONOTONIC, nanoseconds.
pub(crate) type Taken = (Sample, i64);

/// What happens to a sample that finds the queue full.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum WhenFull {
    /// It is dropped and counted: the chain runs, and shared memory must be kept empty.
    Drop,
    /// It waits for a while: the chain has ended.
    Wait,
}

/// Readers of all channels, and the queue that they fill.
pub(crate) struct Drain<'a> {
    sources: Vec<(Channel, Box<dyn SampleSource>)>,
    queue: Sender<Taken>,
    shared: &'a Shared,
    confirmations: Writer<Marker>,
}

impl<'a> Drain<'a> {
    /// Opens a reader on every channel.
    pub(crate) fn open(bus: &Bus, queue: Sender<Taken>, shared: &'a Shared) -> Result<Self, IpcError> {
        let mut sources = Vec::new();
        for channel in Channel::ALL {
            sources.extend(channel.source(bus, ReadOptions::observing())?.map(|source| (channel, source)));
        }
        Ok(Self { sources, queue, shared, confirmations: bus.writer_on(Marker::RECORDED_CHANNEL)? })
    }

    /// Takes what there is. Returns how many messages that were.
    pub(crate) fn take_all(&mut self, when_full: WhenFull) -> Result<u64, IpcError> {
        let mut n_taken = 0;
        let mut marks = Vec::new();
        let tally = &self.shared.tally;
        for (channel, source) in &mut self.sources {
            let now_ns = clock::monotonic_ns();
            while let Some(sample) = source.take()? {
                n_taken += 1;
                let mark = match &sample {
                    Sample::Marker(marker) | Sample::DeviceMarker(marker) => Some(**marker),
                    _ => None,
                };
                if enqueue(&self.queue, tally, (sample, now_ns), when_full) {
                    marks.extend(mark);
                }
            }
            let (counts, n_out_of_order) = source.counts();
            tally.set_missed(*channel, counts.n_lost, n_out_of_order);
        }
        self.confirm(&marks)?;
        Ok(n_taken)
    }

    /// Tells the senders of marks that they were taken; a recorder that has stopped has nothing to tell.
    fn confirm(&mut self, marks: &[Marker]) -> Result<(), IpcError> {
        if self.shared.has_stopped.load(Ordering::Relaxed) {
            return Ok(());
        }
        for mark in marks {
            self.confirmations.send(&Marker { sequence: self.confirmations.n_sent() + 1, ..*mark })?;
        }
        Ok(())
    }

    /// What the readers have counted.
    pub(crate) fn read_counts(&self) -> Vec<ReadCounts> {
        self.sources.iter().map(|(_, source)| source.counts().0).collect()
    }
}

/// Whether the queue had room.
fn enqueue(queue: &Sender<Taken>, tally: &Tally, taken: Taken, when_full: WhenFull) -> bool {
    let channel = taken.0.channel();
    let refused = match queue.try_send(taken) {
        Err(TrySendError::Full(taken)) if when_full == WhenFull::Wait => {
            queue.send_timeout(taken, LAST_PATIENCE).is_err()
        }
        result => result.is_err(),
    };
    if refused {
        tally.add_dropped(channel);
    }
    !refused
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::message::StateCommand;

    #[test]
    fn a_full_queue_drops_the_newest_sample_and_counts_it_on_its_channel() {
        let (queue, receiver) = crossbeam_channel::bounded(1);
        let tally = Tally::default();
        for transition in 0..3 {
            let command = StateCommand { sequence: 1, sample_ns: 0, transition, sender_pid: 1 };
            enqueue(&queue, &tally, (Sample::StateCommand(command), 0), WhenFull::Drop);
        }
        let status = tally.status(1, 0);
        assert_eq!(status.of(Channel::StateCommand).map(|counts| counts.n_dropped), Some(2));
        assert_eq!(status.total().n_dropped, 2);
        let (first, _) = receiver.try_recv().expect("the first one");
        assert!(matches!(first, Sample::StateCommand(command) if command.transition == 0));
    }

    #[test]
    fn a_sample_of_the_end_waits_for_room() {
        let (queue, receiver) = crossbeam_channel::bounded(1);
        let tally = Tally::default();
        std::thread::scope(|scope| {
            let taker = scope.spawn(move || receiver.iter().count());
            for sequence in 1..=100 {
                let command = StateCommand { sequence, sample_ns: 0, transition: 0, sender_pid: 1 };
                enqueue(&queue, &tally, (Sample::StateCommand(command), 0), WhenFull::Wait);
            }
            drop(queue);
            assert_eq!(taker.join().expect("no panic"), 100);
        });
        assert_eq!(tally.status(1, 0).total().n_dropped, 0);
    }
}
