//! One run of a stage through a freshly started process again, several samples under way at once, every output compared
//! byte by byte.
//!
//! Back-pressure: what comes out says how far the stage is, and never are more samples under way than [`WINDOW`]. So no
//! queue overflows however the stage is scheduled, and every sample is accounted for.

use crate::ReplayError;
use crate::difference::{Bytes, Difference, first_field};
use crate::sender::Sender;
use crate::stage::Stage;
use crate::steps::{Step, Steps};
use crate::window::Window;
use core::time::Duration;
use krait_ipc::message::{Cue, Health, Message, ModelUpdate, SlaveState};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, Writer, clock, health_channel};
use krait_model::ModelHash;
use std::collections::VecDeque;

/// Samples under way at most. A stage's queue holds 256.
const WINDOW: usize = 96;
/// How long the replay sleeps at most before it looks at the world again.
pub(crate) const PATIENCE: Duration = Duration::from_millis(20);
/// A chain that answers nothing for so long will not answer any more: a busy machine takes a second, ns.
pub(crate) const STALL_NS: i64 = 20_000_000_000;

/// Whether there is more to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// More samples are to be sent or awaited.
    Going,
    /// All is done, or a difference was found.
    Done,
}

/// One run of a process that is repeated.
pub trait Repetition {
    /// Which process it is.
    fn process(&self) -> Process;
    /// Which model the run rests on, if it says so; known before the first turn.
    fn model(&self) -> Option<ModelHash>;
    /// Takes what came back, sends what there is room for, and sleeps a little if neither was possible.
    ///
    /// # Errors
    /// [`ReplayError::Missing`] or [`ReplayError::Gap`] for what the recording does not hold, [`ReplayError::Stalled`] when
    /// nothing comes back any more, or a channel failed.
    fn turn(&mut self, bus: &Bus) -> Result<Turn, ReplayError>;
    /// Outputs that came out the same.
    fn n_identical(&self) -> u64;
    /// Outputs at the end that cannot be repeated, because they rest on what would come after the recording's end.
    fn n_behind_end(&self) -> u64;
    /// Bytes compared so far.
    fn n_bytes(&self) -> u64;
    /// The first difference, if there is one.
    fn difference(&self) -> Option<&Difference>;
}

/// Sends what a run of a stage took and compares what comes back.
pub struct Verifier<'a, S: Stage> {
    run: u64,
    steps: Steps<'a, S>,
    model: Option<ModelHash>,
    inputs: Sender<S::In>,
    cues: Writer<Cue>,
    states: Sender<SlaveState>,
    updates: Sender<ModelUpdate>,
    outputs: Reader<S::Out>,
    health: Reader<Health>,
    n_fed: u64,
    /// What the samples fed so far must give.
    due: VecDeque<S::Out>,
    n_identical: u64,
    bytes: Bytes,
    difference: Option<Difference>,
    progress_ns: i64,
}

impl<'a, S: Stage> Verifier<'a, S> {
    /// Opens the channels for a run of the stage, from 1; `None` when there is no such run. The stage must be started after
    /// this and be ready before the first turn.
    ///
    /// # Errors
    /// [`ReplayError`] when the recording lacks what a step depended on, or a channel cannot be had.
    pub fn open(bus: &Bus, window: &'a mut Window, run: u64) -> Result<Option<Self>, ReplayError> {
        let Some(steps) = Steps::of(window, run)? else { return Ok(None) };
        Ok(Some(Self {
            run,
            model: steps.model(),
            steps,
            inputs: Sender::open(bus)?,
            cues: bus.writer()?,
            states: Sender::open(bus)?,
            updates: Sender::open(bus)?,
            outputs: bus.reader(ReadOptions::following())?,
            health: bus.reader_on(&health_channel(S::PROCESS), ReadOptions::glancing())?,
            n_fed: 0,
            due: VecDeque::new(),
            n_identical: 0,
            bytes: Bytes::default(),
            difference: None,
            progress_ns: clock::monotonic_ns(),
        }))
    }

    fn feed(&mut self, bus: &Bus) -> Result<u64, ReplayError> {
        let before = self.n_fed;
        while self.due.len() < WINDOW
            && self.has_room_for_next()
            && let Some(step) = self.steps.pop()?
        {
            self.n_fed += 1;
            self.send(bus, &step)?;
            self.due.push_back(step.output);
        }
        if self.n_fed > before {
            self.states.wake()?;
            self.updates.wake()?;
            self.inputs.wake()?;
        }
        Ok(self.n_fed - before)
    }

    /// Before another writer takes over a channel, all that the one before has sent must have been used.
    fn has_room_for_next(&self) -> bool {
        let Some(step) = self.steps.peek() else { return false };
        let begins = self.inputs.begins(step.input.0)
            || step.state.is_some_and(|(run, _)| self.states.begins(run))
            || step.update.is_some_and(|(run, _)| self.updates.begins(run));
        !begins || self.due.is_empty()
    }

    /// First what the step depends on, then the cue, then the sample: whoever has the sample has all of it.
    fn send(&mut self, bus: &Bus, step: &Step<S>) -> Result<(), ReplayError> {
        if let Some((run, state)) = &step.state {
            self.states.put(bus, *run, state)?;
        }
        if let Some((run, update)) = &step.update {
            self.updates.put(bus, *run, update)?;
        }
        self.cues.put(&Cue { sequence: self.n_fed, ..step.cue })?;
        let (run, input) = &step.input;
        self.inputs.put(bus, *run, input)
    }

    fn take(&mut self) -> Result<u64, ReplayError> {
        let mut n_taken = 0;
        while self.difference.is_none()
            && let Some(repeated) = self.outputs.take()?.map(|output| *output)
        {
            n_taken += 1;
            self.compare(&repeated);
            self.n_identical += u64::from(self.difference.is_none());
        }
        Ok(n_taken)
    }

    fn compare(&mut self, repeated: &S::Out) {
        let Some(recorded) = self.due.pop_front() else {
            let sequence = repeated.sequence();
            return self.differ(sequence, ("(output)".to_owned(), "none".to_owned(), "one".to_owned()));
        };
        let sequence = recorded.sequence();
        if S::rests_on(&recorded).taken_sequence != S::rests_on(repeated).taken_sequence {
            self.differ(sequence, ("(output)".to_owned(), "one".to_owned(), "none".to_owned()));
        } else if !self.bytes.same(&S::sample(&recorded), &S::sample(repeated)) {
            self.differ(sequence, first_field(&recorded, repeated));
        }
    }

    fn differ(&mut self, sequence: u64, (field, recorded, repeated): (String, String, String)) {
        let (process, run) = (S::PROCESS, self.run);
        self.difference = Some(Difference { process, run, sequence, field, recorded, repeated });
    }

    /// A sample that is refused gives no output; the stage says so in its health.
    fn look_for_refusals(&mut self) -> Result<(), ReplayError> {
        let Some(health) = self.health.take_newest()?.filter(|health| health.n_refused > 0) else { return Ok(()) };
        let why = Reasons::from_bits(health.reasons_now).iter().next().map_or("refused", Reason::sentence);
        self.differ(self.n_identical + 1, ("(output)".to_owned(), "one".to_owned(), format!("none: {why}")));
        Ok(())
    }
}

impl<S: Stage> Repetition for Verifier<'_, S> {
    fn process(&self) -> Process {
        S::PROCESS
    }

    fn model(&self) -> Option<ModelHash> {
        self.model
    }

    fn turn(&mut self, bus: &Bus) -> Result<Turn, ReplayError> {
        let n_taken = self.take()?;
        if self.difference.is_some() || (self.due.is_empty() && self.steps.peek().is_none()) {
            return Ok(Turn::Done);
        }
        let n_sent = self.feed(bus)?;
        let now_ns = clock::monotonic_ns();
        if n_taken + n_sent > 0 {
            self.progress_ns = now_ns;
            return Ok(Turn::Going);
        }
        self.outputs.wait(PATIENCE)?;
        self.look_for_refusals()?;
        if now_ns - self.progress_ns > STALL_NS {
            return Err(ReplayError::Stalled {
                sample: self.n_fed,
                n_waiting: self.due.len() as u64,
                patience_s: STALL_NS.unsigned_abs() / 1_000_000_000,
            });
        }
        Ok(Turn::Going)
    }

    fn n_identical(&self) -> u64 {
        self.n_identical
    }

    fn n_behind_end(&self) -> u64 {
        self.steps.n_behind_end()
    }

    fn n_bytes(&self) -> u64 {
        self.bytes.n_compared
    }

    fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }
}
