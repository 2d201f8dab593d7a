//! A writer of a channel; nearly every channel has but one.

use crate::IpcError;
use crate::bus::ChannelAddress;
use crate::doorbell::Doorbell;
use crate::message::Message;
use crate::port::Publish;

/// Publishes messages and wakes the readers that sleep. There are at most [`Message::MAX_WRITERS`] per channel.
#[derive(Debug)]
pub struct Writer<M: Message> {
    publisher: Box<dyn Publish<M>>,
    doorbell: Doorbell,
    n_sent: u64,
    address: ChannelAddress,
}

impl<M: Message> Writer<M> {
    pub(crate) fn new(address: ChannelAddress, publisher: Box<dyn Publish<M>>, doorbell: Doorbell) -> Self {
        Self { publisher, doorbell, n_sent: 0, address }
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
        self.publisher.publish(message).map_err(|failure| self.address.at(failure))?;
        self.n_sent += 1;
        Ok(())
    }

    /// Wakes the readers that sleep.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn wake(&mut self) -> Result<(), IpcError> {
        self.doorbell.ring().map_err(|e| self.address.failed("waking its readers", format!("{e:?}")))
    }
}
