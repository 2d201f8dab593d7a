//! The part of a recording that is held while its steps are repeated: what the steps under way rest on, and no more, so
//! that an hour takes no more memory than a minute.
//!
//! Terms: a *run* of a channel is what one writer published; a process that is started again counts from 1 and begins the
//! next run. A number alone therefore does not name a message: [`Window::named`] finds which of several was meant.

use crate::ReplayError;
use krait_ipc::message::{Command, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_record::PassCounter;
use krait_record::Stream;
use krait_schema::{Channel, Sample};
use std::collections::VecDeque;
use std::path::Path;

/// The recorder takes the channels in turn, some seconds of each at most: one of which nothing came for so long while others
/// went on has fallen silent, ns.
const SILENT_NS: i64 = 60_000_000_000;

/// A recording, read as far as it was asked for.
pub struct Window {
    stream: Stream,
    /// The newest instant read so far, of any channel, ns.
    newest_ns: i64,
    /// Whether there is no more to read.
    has_ended: bool,
    pub(crate) inputs: Queue<OperatorInput>,
    pub(crate) setpoints: Queue<Setpoint>,
    pub(crate) commands: Queue<Command>,
    pub(crate) states: Queue<SlaveState>,
    pub(crate) shapes: Queue<Shape>,
    pub(crate) updates: Queue<ModelUpdate>,
}

/// Messages of a channel, each with its run.
pub(crate) struct Queue<M> {
    messages: VecDeque<(u64, M)>,
    counter: PassCounter,
    newest: (u64, u64),
    newest_ns: i64,
}

impl Window {
    /// Begins at the first sample of the recording's first part; only these channels are read.
    ///
    /// # Errors
    /// [`ReplayError::Read`] when it cannot be read.
    pub fn open(path: &Path, channels: &[Channel]) -> Result<Self, ReplayError> {
        let stream = Stream::open(path, channels)?;
        let (inputs, setpoints, commands) = (Queue::new(), Queue::new(), Queue::new());
        let (states, shapes, updates) = (Queue::new(), Queue::new(), Queue::new());
        Ok(Self { stream, newest_ns: i64::MIN, has_ended: false, inputs, setpoints, commands, states, shapes, updates })
    }

    /// The next message of a channel's run, taken out; `None` when the run holds no more.
    pub(crate) fn next<M: Message>(&mut self, of: Of<M>, run: u64) -> Result<Option<M>, ReplayError> {
        self.search(of, |queue| match queue.messages.front() {
            Some((own, message)) if *own == run => Found::Yes(*message),
            Some((own, _)) if *own > run => Found::No,
            _ => Found::NotYet,
        })
        .inspect(|found| {
            if found.is_some() {
                of(self).messages.pop_front();
            }
        })
    }

    /// The message of a channel's run with a sequence number; `None` when there is none.
    pub(crate) fn find<M: Message>(&mut self, of: Of<M>, run: u64, sequence: u64) -> Result<Option<M>, ReplayError> {
        self.search(of, |queue| match queue.place(run, sequence) {
            Some(message) => Found::Yes(message),
            None if queue.newest > (run, sequence) => Found::No,
            None => Found::NotYet,
        })
    }

    /// The message that somebody named by its sequence number at an instant, with its run: where several runs have one of
    /// this number, the newest that was there by then. `None` when there is none.
    pub(crate) fn named<M: Message>(
        &mut self,
        of: Of<M>,
        sequence: u64,
        named_ns: i64,
    ) -> Result<Option<(u64, M)>, ReplayError> {
        while of(self).newest_ns <= named_ns
            && self.newest_ns <= named_ns.saturating_add(SILENT_NS)
            && self.read_on()?
        {}
        let queue = of(self);
        let runs = (1..=queue.counter.newest).rev();
        let mut found = runs.filter_map(|run| queue.place(run, sequence).map(|message| (run, message)));
        Ok(found.find(|(_, message)| message.sample_ns() <= named_ns))
    }

    /// What was named and is not there.
    pub(crate) fn missing<M: Message>(&mut self, of: Of<M>, sequence: u64) -> ReplayError {
        let is_behind_end = self.has_ended && sequence > of(self).newest.1;
        ReplayError::Missing { sequence, channel: M::CHANNEL, is_behind_end }
    }

    /// How many messages of a channel's run there are still; they are taken out.
    pub(crate) fn count_rest<M: Message>(&mut self, of: Of<M>, run: u64) -> Result<u64, ReplayError> {
        let mut n = 0;
        while self.next(of, run)?.is_some() {
            n += 1;
        }
        Ok(n)
    }

    /// Reads on until it is known whether something is there. The recorder takes the channels in turn, some seconds of each
    /// at most, so this is soon known unless a stage has fallen silent.
    fn search<M: Message>(
        &mut self,
        of: Of<M>,
        look: impl Fn(&Queue<M>) -> Found<M>,
    ) -> Result<Option<M>, ReplayError> {
        loop {
            match look(of(self)) {
                Found::Yes(message) => return Ok(Some(message)),
                Found::No => return Ok(None),
                Found::NotYet => {}
            }
            if !self.read_on()? {
                return Ok(None);
            }
        }
    }

    /// Reads one more sample. Returns whether there was one.
    fn read_on(&mut self) -> Result<bool, ReplayError> {
        let Some(recorded) = self.stream.next() else {
            self.has_ended = true;
            return Ok(false);
        };
        let sample = recorded?.sample;
        self.newest_ns = self.newest_ns.max(sample.sample_ns());
        match sample {
            Sample::Input(m) => self.inputs.push(m),
            Sample::Setpoint(m) => self.setpoints.push(m),
            Sample::Command(m) => self.commands.push(m),
            Sample::State(m) => self.states.push(m),
            Sample::Shape(m) => self.shapes.push(m),
            Sample::ModelUpdate(m) => self.updates.push(m),
            _ => {}
        }
        Ok(true)
    }
}

/// A channel of the window.
pub(crate) type Of<M> = fn(&mut Window) -> &mut Queue<M>;

enum Found<M> {
    Yes(M),
    No,
    NotYet,
}

impl<M: Message> Queue<M> {
    fn new() -> Self {
        Self { messages: VecDeque::new(), counter: PassCounter::default(), newest: (0, 0), newest_ns: i64::MIN }
    }

    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.messages.len()
    }

    /// A file may hold anything; what is looked up must be sorted, each number once.
    fn push(&mut self, message: M) {
        let place = (self.counter.of(message.sequence()), message.sequence());
        if place > self.newest {
            self.newest = place;
            self.newest_ns = message.sample_ns();
            self.messages.push_back((place.0, message));
        }
    }

    fn place(&self, run: u64, sequence: u64) -> Option<M> {
        let found = self.messages.binary_search_by_key(&(run, sequence), |(own, message)| (*own, message.sequence()));
        found.ok().and_then(|idx| self.messages.get(idx)).map(|(_, message)| *message)
    }

    /// Forgets what nobody will ask for any more.
    pub(crate) fn forget_before(&mut self, run: u64, sequence: u64) {
        while self.messages.front().is_some_and(|(own, message)| (*own, message.sequence()) < (run, sequence)) {
            self.messages.pop_front();
        }
    }
}
