//! A channel that a verification writes, with the numbers of several writers: readers take a number that does not follow the
//! one before for out of order, unless another writer sent it.

use crate::ReplayError;
use krait_ipc::message::Message;
use krait_ipc::{Bus, Writer};

/// The writer of a channel, another one for each run.
pub(crate) struct Sender<M: Message> {
    // None only while one gives way to the next: a channel has one writer.
    writer: Option<Writer<M>>,
    run: Option<u64>,
}

impl<M: Message> Sender<M> {
    pub(crate) fn open(bus: &Bus) -> Result<Self, ReplayError> {
        Ok(Self { writer: Some(bus.writer()?), run: None })
    }

    /// Whether a message of this run needs another writer; what was sent so far must have been taken before.
    pub(crate) fn begins(&self, run: u64) -> bool {
        self.run.is_some_and(|own| own != run)
    }

    /// Sends a message of a run, without waking anybody.
    pub(crate) fn put(&mut self, bus: &Bus, run: u64, message: &M) -> Result<(), ReplayError> {
        if self.begins(run) {
            self.writer = None;
        }
        self.run = Some(run);
        let writer = match &mut self.writer {
            Some(writer) => writer,
            None => self.writer.insert(bus.writer()?),
        };
        Ok(writer.put(message)?)
    }

    /// Wakes the channel's reader.
    pub(crate) fn wake(&mut self) -> Result<(), ReplayError> {
        self.writer.as_mut().map_or(Ok(()), |writer| Ok(writer.wake()?))
    }
}
