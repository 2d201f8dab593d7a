//! Reads any channel of shared memory as samples.

use crate::Sample;
use krait_ipc::message::Message;
use krait_ipc::{Bus, IpcError, ReadCounts, ReadOptions, Reader};

/// A reader of some channel.
pub trait SampleSource {
    /// Takes the next sample, if there is one.
    ///
    /// # Errors
    /// As [`Reader::take`].
    fn take(&mut self) -> Result<Option<Sample>, IpcError>;
    /// What was received and lost, and what came out of order.
    fn counts(&self) -> (ReadCounts, u64);
}

struct TypedSource<M: Message, F> {
    reader: Reader<M>,
    wrap: F,
}

impl<M: Message, F: Fn(&M) -> Sample> SampleSource for TypedSource<M, F> {
    fn take(&mut self) -> Result<Option<Sample>, IpcError> {
        Ok(self.reader.take()?.map(|message| (self.wrap)(&message)))
    }

    fn counts(&self) -> (ReadCounts, u64) {
        (self.reader.counts(), self.reader.n_out_of_order())
    }
}

pub(crate) fn open<M: Message>(
    bus: &Bus,
    channel: &str,
    options: ReadOptions,
    wrap: impl Fn(&M) -> Sample + 'static,
) -> Result<Box<dyn SampleSource>, IpcError> {
    Ok(Box::new(TypedSource { reader: bus.reader_on::<M>(channel, options)?, wrap }))
}
