//! iceoryx2's ports of one message, which a writer and a reader stand on.
//!
//! Their code is large, and another one for each message. Every message makes its own in this crate (`message!`) behind a
//! table of calls, so that no crate that opens a channel compiles it again.

use crate::IpcError;
use crate::bus::{Bus, ChannelAddress, HISTORY, MAX_BORROWED, MAX_READERS, Shm};
use crate::message::Message;
use crate::reader::Received;
use core::fmt::Debug;
use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};

/// Puts messages on a channel.
pub trait Publish<M>: Debug {
    /// Publishes a copy of a message and wakes nobody.
    fn publish(&self, message: &M) -> Result<(), Failure>;
}

/// Takes messages from a channel.
pub trait Subscribe<M: Message>: Debug {
    /// The next message and who sent it, or `None` when there is none.
    fn take(&self) -> Result<Option<(UniquePublisherId, Received<M>)>, Failure>;
    /// Whether there is a next message.
    fn has_messages(&self) -> Result<bool, Failure>;
}

/// What a port was at when it failed, and iceoryx2's word for it.
#[derive(Debug)]
pub struct Failure {
    pub(crate) doing: &'static str,
    pub(crate) source_text: String,
}

/// Becomes the one writer of a channel.
pub(crate) fn publisher<M: Message>(bus: &Bus, address: &ChannelAddress) -> Result<Box<dyn Publish<M>>, IpcError> {
    let data = bus.data_service::<M>(address)?;
    let builder = data.publisher_builder().max_loaned_samples(1).override_sample_preallocation(|_| n_samples::<M>());
    let publisher = builder.create().map_err(|error| match error {
        PublisherCreateError::ExceedsMaxSupportedPublishers => {
            IpcError::SecondWriter { instance: address.instance.clone(), channel: address.channel.clone() }
        }
        other => address.failed("becoming its writer", format!("{other:?}")),
    })?;
    Ok(Box::new(publisher))
}

/// Becomes a reader of a channel that keeps up to `buffer` messages.
pub(crate) fn subscriber<M: Message>(
    bus: &Bus,
    address: &ChannelAddress,
    buffer: usize,
) -> Result<Box<dyn Subscribe<M>>, IpcError> {
    let data = bus.data_service::<M>(address)?;
    let builder = data.subscriber_builder().buffer_size(buffer.min(M::DEPTH));
    let subscriber = builder.create().map_err(|error| match error {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => IpcError::TooManyReaders {
            instance: address.instance.clone(),
            channel: address.channel.clone(),
            limit: MAX_READERS,
        },
        other => address.failed("becoming its reader", format!("{other:?}")),
    })?;
    Ok(Box::new(subscriber))
}

impl<M: Message> Publish<M> for Publisher<Shm, M, ()> {
    fn publish(&self, message: &M) -> Result<(), Failure> {
        let sample = self.loan_uninit().map_err(|e| failure("borrowing shared memory", &e))?;
        sample.write_payload(*message).send().map_err(|e| failure("publishing", &e))?;
        Ok(())
    }
}

impl<M: Message> Subscribe<M> for Subscriber<Shm, M, ()> {
    fn take(&self) -> Result<Option<(UniquePublisherId, Received<M>)>, Failure> {
        let taken = self.receive().map_err(|e| failure("taking from it", &e))?;
        Ok(taken.map(|sample| (sample.header().publisher_id(), Received(sample))))
    }

    fn has_messages(&self) -> Result<bool, Failure> {
        self.has_samples().map_err(|e| failure("looking at it", &e))
    }
}

#[cold]
fn failure(doing: &'static str, error: &dyn Debug) -> Failure {
    Failure { doing, source_text: format!("{error:?}") }
}

/// Samples that can be in use at once, all readers together: their queues hold some of the newest `DEPTH` (a full one drops
/// its oldest), each reader has a few in hand, and the next one is being written. iceoryx2 would take room for as many in
/// each queue.
const fn n_samples<M: Message>() -> usize {
    M::DEPTH + HISTORY + MAX_READERS * (MAX_BORROWED + 1) + 2
}
