//! A writer of a channel; nearly every channel has but one.

use crate::IpcError;
use crate::bus::{Address, DataService, HISTORY, MAX_BORROWED, MAX_READERS, Shm};
use crate::doorbell::Doorbell;
use crate::message::Message;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};

/// Publishes messages and wakes the readers that sleep. There are at most [`Message::MAX_WRITERS`] per channel.
#[derive(Debug)]
pub struct Writer<M: Message> {
    publisher: Publisher<Shm, M, ()>,
    doorbell: Doorbell,
    n_sent: u64,
    address: Address,
}

impl<M: Message> Writer<M> {
    pub(crate) fn open(address: Address, data: &DataService<M>, doorbell: Doorbell) -> Result<Self, IpcError> {
        let builder =
            data.publisher_builder().max_loaned_samples(1).override_sample_preallocation(|_| n_samples::<M>());
        let publisher = builder.create().map_err(|error| match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers => {
                IpcError::SecondWriter { instance: address.instance.clone(), channel: address.channel.clone() }
            }
            other => address.failed("becoming its writer", format!("{other:?}")),
        })?;
        Ok(Self { publisher, doorbell, n_sent: 0, address })
    }

    /// Messages sent so far.
    pub fn n_sent(&self) -> u64 {
        self.n_sent
    }

    /// Publishes a message and wakes its readers.
    ///
    /// The caller numbers its messages 1, 2, 3, ...; readers count what is missing.
    ///
    /// # Errors
    /// [`IpcError::Channel`] when shared memory is exhausted or a reader's queue is broken. A reader that is slow, or gone,
    /// is no error: its oldest sample is dropped and counted there.
    ///
    /// # Real-time
    /// No blocking; one system call if any reader sleeps; one small allocation, which iceoryx2 0.10 makes for each message.
    pub fn send(&mut self, message: &M) -> Result<(), IpcError> {
        self.put(message)?;
        self.wake()
    }

    /// Publishes a message without waking anybody: for bursts, which end with one [`Writer::wake`].
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn put(&mut self, message: &M) -> Result<(), IpcError> {
        let sample = self.publisher.loan_uninit().map_err(|e| self.failed("borrowing shared memory", &e))?;
        sample.write_payload(*message).send().map_err(|e| self.failed("publishing", &e))?;
        self.n_sent += 1;
        Ok(())
    }

    /// Wakes the readers that sleep.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn wake(&mut self) -> Result<(), IpcError> {
        self.doorbell.ring().map_err(|e| self.failed("waking its readers", &e))
    }

    #[cold]
    fn failed(&self, doing: &'static str, error: &dyn core::fmt::Debug) -> IpcError {
        self.address.failed(doing, format!("{error:?}"))
    }
}

/// Samples that can be in use at once, all readers together: their queues hold some of the newest `DEPTH` (a full one drops
/// its oldest), each reader has a few in hand, and the next one is being written. iceoryx2 would take room for as many in
/// each queue.
const fn n_samples<M: Message>() -> usize {
    M::DEPTH + HISTORY + MAX_READERS * (MAX_BORROWED + 1) + 2
}
