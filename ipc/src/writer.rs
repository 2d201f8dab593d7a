//! The one writer of a channel.

use crate::IpcError;
use crate::bus::{Address, DataService, EventService, Shm};
use crate::message::Message;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};

/// Publishes messages and wakes the readers that sleep. There is at most one per channel.
#[derive(Debug)]
pub struct Writer<M: Message> {
    publisher: Publisher<Shm, M, ()>,
    notifier: Notifier<Shm>,
    n_sent: u64,
    address: Address,
}

impl<M: Message> Writer<M> {
    pub(crate) fn open(address: Address, data: &DataService<M>, event: &EventService) -> Result<Self, IpcError> {
        let publisher = data.publisher_builder().max_loaned_samples(1).create().map_err(|error| match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers => {
                IpcError::SecondWriter { instance: address.instance.clone(), channel: address.channel.clone() }
            }
            other => address.failed("becoming its writer", format!("{other:?}")),
        })?;
        let notifier =
            event.notifier_builder().create().map_err(|e| address.failed("becoming its notifier", format!("{e:?}")))?;
        Ok(Self { publisher, notifier, n_sent: 0, address })
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
    /// No allocation and no blocking; one system call per sleeping reader.
    pub fn send(&mut self, message: &M) -> Result<(), IpcError> {
        let sample = self.publisher.loan_uninit().map_err(|e| self.failed("borrowing shared memory", &e))?;
        sample.write_payload(*message).send().map_err(|e| self.failed("publishing", &e))?;
        self.n_sent += 1;
        self.notifier.notify().map_err(|e| self.failed("waking its readers", &e))?;
        Ok(())
    }

    #[cold]
    fn failed(&self, doing: &'static str, error: &dyn core::fmt::Debug) -> IpcError {
        self.address.failed(doing, format!("{error:?}"))
    }
}
