//! The part of a recording that is held while its steps are repeated: what the steps under way rest on, and no more, so
//! that an hour takes no more memory than a minute.

use crate::ReplayError;
use krait_ipc::message::{Command, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_record::PassCounter;
use krait_record::Stream;
use krait_schema::{Channel, Sample};
use std::collections::VecDeque;
use std::path::Path;

/// What steps rest on.
const OF_STEPS: [Channel; 5] =
    [Channel::Input, Channel::Setpoint, Channel::Command, Channel::State, Channel::ModelUpdate];
/// What learning rests on.
const OF_LEARNING: [Channel; 3] = [Channel::State, Channel::Shape, Channel::ModelUpdate];

/// A recording, read as far as it was asked for.
pub struct Window {
    stream: Stream,
    pub(crate) inputs: Queue<OperatorInput>,
    pub(crate) setpoints: Queue<Setpoint>,
    pub(crate) commands: Queue<Command>,
    pub(crate) states: Queue<SlaveState>,
    pub(crate) shapes: Queue<Shape>,
    pub(crate) updates: Queue<ModelUpdate>,
}

/// Messages of a channel, each with the pass that it belongs to.
pub(crate) struct Queue<M> {
    messages: VecDeque<(u64, M)>,
    counter: PassCounter,
    newest: (u64, u64),
}

impl Window {
    /// Begins at the first sample of the recording's first part.
    ///
    /// # Errors
    /// [`ReplayError::Read`] when it cannot be read.
    pub fn open(path: &Path) -> Result<Self, ReplayError> {
        Ok(Self::of(Stream::open(path, &OF_STEPS)?))
    }

    /// The same for what `estimate` rests on.
    ///
    /// # Errors
    /// [`ReplayError::Read`] when it cannot be read.
    pub fn open_for_learning(path: &Path) -> Result<Self, ReplayError> {
        Ok(Self::of(Stream::open(path, &OF_LEARNING)?))
    }

    fn of(stream: Stream) -> Self {
        let (inputs, setpoints, commands) = (Queue::new(), Queue::new(), Queue::new());
        let (states, shapes, updates) = (Queue::new(), Queue::new(), Queue::new());
        Self { stream, inputs, setpoints, commands, states, shapes, updates }
    }

    /// The next message of a channel's pass, taken out; `None` when the pass holds no more.
    pub(crate) fn next<M: Message>(&mut self, of: Of<M>, pass: u64) -> Result<Option<M>, ReplayError> {
        self.search(of, |queue| match queue.messages.front() {
            Some((own, message)) if *own == pass => Found::Yes(*message),
            Some((own, _)) if *own > pass => Found::No,
            _ => Found::NotYet,
        })
        .inspect(|found| {
            if found.is_some() {
                of(self).messages.pop_front();
            }
        })
    }

    /// The message of a channel's pass with a sequence number; `None` when there is none.
    pub(crate) fn find<M: Message>(&mut self, of: Of<M>, pass: u64, sequence: u64) -> Result<Option<M>, ReplayError> {
        self.search(of, |queue| {
            let place = |(own, message): &(u64, M)| (*own, message.sequence());
            match queue.messages.binary_search_by_key(&(pass, sequence), place) {
                Ok(idx) => queue.messages.get(idx).map_or(Found::No, |(_, message)| Found::Yes(*message)),
                Err(_) if queue.newest > (pass, sequence) => Found::No,
                Err(_) => Found::NotYet,
            }
        })
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
            let Some(recorded) = self.stream.next() else { return Ok(None) };
            match recorded?.sample {
                Sample::Input(m) => self.inputs.push(m),
                Sample::Setpoint(m) => self.setpoints.push(m),
                Sample::Command(m) => self.commands.push(m),
                Sample::State(m) => self.states.push(m),
                Sample::Shape(m) => self.shapes.push(m),
                Sample::ModelUpdate(m) => self.updates.push(m),
                _ => {}
            }
        }
    }

    /// Forgets the passes before one.
    pub(crate) fn begin(&mut self, pass: u64) {
        self.inputs.forget_before(pass, 0);
        self.setpoints.forget_before(pass, 0);
        self.commands.forget_before(pass, 0);
        self.states.forget_before(pass, 0);
        self.shapes.forget_before(pass, 0);
        self.updates.forget_before(pass, 0);
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
        Self { messages: VecDeque::new(), counter: PassCounter::default(), newest: (0, 0) }
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
            self.messages.push_back((place.0, message));
        }
    }

    /// Forgets what nobody will ask for any more.
    pub(crate) fn forget_before(&mut self, pass: u64, sequence: u64) {
        while self.messages.front().is_some_and(|(own, message)| (*own, message.sequence()) < (pass, sequence)) {
            self.messages.pop_front();
        }
    }
}
