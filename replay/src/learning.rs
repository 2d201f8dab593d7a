//! What `estimate` has learnt in one run, learnt again by a freshly started process, every update compared byte by byte.
//!
//! Each update names the shape and the newest slave state that it rests on, and how many states that were. So states are
//! sent up to that one, then the shape, and nothing more until the update is back: the process does what it did then, however
//! it is scheduled. Where the slave was started again in between, the number of states says how many of its first run were
//! taken before those of the next.

use crate::ReplayError;
use crate::difference::{Bytes, Difference, first_field};
use crate::sender::Sender;
use crate::verifier::{PATIENCE, Repetition, STALL_NS, Turn};
use crate::window::Window;
use core::ops::RangeInclusive;
use krait_ipc::message::{ModelUpdate, Shape, SlaveState};
use krait_ipc::{Bus, Process, ReadOptions, Reader, clock};
use krait_model::ModelHash;
use krait_schema::{Channel, Sample};

/// States that are sent in a row; the process's queue holds 8192.
const MOST_AT_ONCE: u64 = 4096;
/// The newest state that an update rests on was there when its shape was, give or take what a busy machine takes, ns.
const STATE_AFTER_SHAPE_NS: i64 = 1_000_000_000;

/// Sends the states and shapes of a run and compares the updates that come back.
pub struct LearningVerifier<'a> {
    run: u64,
    window: &'a mut Window,
    states: Sender<SlaveState>,
    shapes: Sender<Shape>,
    updates: Reader<ModelUpdate>,
    model: Option<ModelHash>,
    /// The update that is to come back, and the next one.
    due: Option<ModelUpdate>,
    next: Option<ModelUpdate>,
    /// The newest state that was sent, with its run, and how many that were.
    state_run: u64,
    state_sequence: u64,
    n_states: u64,
    n_updates: u64,
    n_behind_end: u64,
    n_sent: u64,
    bytes: Bytes,
    difference: Option<Difference>,
    progress_ns: i64,
}

impl<'a> LearningVerifier<'a> {
    /// The channels that learning rests on.
    pub const CHANNELS: &'static [Channel] = &[Channel::State, Channel::Shape, Channel::ModelUpdate];

    /// Opens the channels for a run, from 1; `None` when there is no such run. The process must be started after this and be
    /// ready before the first turn.
    ///
    /// # Errors
    /// [`ReplayError`] when the recording cannot be read, lacks what the first update rests on, or a channel cannot be had.
    pub fn open(bus: &Bus, window: &'a mut Window, run: u64) -> Result<Option<Self>, ReplayError> {
        let Some(first) = window.next(|w| &mut w.updates, run)? else { return Ok(None) };
        let (_, shape) = shape_of(window, &first)?;
        let latest_ns = shape.available_ns.saturating_add(STATE_AFTER_SHAPE_NS);
        let state = window.named(|w| &mut w.states, first.state_sequence, latest_ns)?;
        Ok(Some(Self {
            run,
            window,
            states: Sender::open(bus)?,
            shapes: Sender::open(bus)?,
            updates: bus.reader(ReadOptions::waking())?,
            model: (first.model_hash != 0).then_some(ModelHash(first.model_hash)),
            due: None,
            next: Some(first),
            state_run: state.map_or(1, |(run, _)| run),
            state_sequence: first.state_sequence.saturating_sub(first.n_states),
            n_states: 0,
            n_updates: 0,
            n_behind_end: 0,
            n_sent: 0,
            bytes: Bytes::default(),
            difference: None,
            progress_ns: clock::monotonic_ns(),
        }))
    }

    fn send_next(&mut self, bus: &Bus) -> Result<Turn, ReplayError> {
        let run = self.run;
        let update = match self.next.take() {
            Some(update) => update,
            None => match self.window.next(|w| &mut w.updates, run)? {
                Some(update) => update,
                None => return Ok(Turn::Done),
            },
        };
        match self.send(bus, &update) {
            Ok(()) => self.due = Some(update),
            Err(ReplayError::Missing { is_behind_end: true, .. }) => {
                self.n_behind_end = 1 + self.window.count_rest(|w| &mut w.updates, run)?;
                return Ok(Turn::Done);
            }
            Err(error) => return Err(error),
        }
        Ok(Turn::Going)
    }

    /// What an update rests on.
    fn send(&mut self, bus: &Bus, update: &ModelUpdate) -> Result<(), ReplayError> {
        self.send_states(bus, update)?;
        let (run, shape) = shape_of(self.window, update)?;
        self.shapes.put(bus, run, &shape)?;
        self.states.wake()?;
        self.shapes.wake()
    }

    /// The states that came between the update before and this one.
    fn send_states(&mut self, bus: &Bus, update: &ModelUpdate) -> Result<(), ReplayError> {
        let n_new = update.n_states.saturating_sub(self.n_states);
        let newest = update.state_sequence;
        let is_of_same_run = newest.checked_sub(self.state_sequence).is_some_and(|n| n >= n_new);
        if !is_of_same_run {
            let n_left = n_new.saturating_sub(newest);
            self.send_range(bus, self.state_sequence + 1..=self.state_sequence + n_left)?;
            (self.state_run, self.state_sequence) = (self.state_run + 1, 0);
            // Before another writer takes over the channel, what the one before has sent must have been taken.
            self.let_take()?;
        }
        self.send_range(bus, self.state_sequence + 1..=newest)?;
        (self.state_sequence, self.n_states) = (newest, update.n_states);
        self.window.states.forget_before(self.state_run, newest + 1);
        Ok(())
    }

    fn send_range(&mut self, bus: &Bus, sequences: RangeInclusive<u64>) -> Result<(), ReplayError> {
        for sequence in sequences {
            let state = self.window.find(|w| &mut w.states, self.state_run, sequence)?;
            let Some(state) = state else { return Err(self.window.missing(|w| &mut w.states, sequence)) };
            self.states.put(bus, self.state_run, &state)?;
            self.n_sent += 1;
            if self.n_sent.is_multiple_of(MOST_AT_ONCE) {
                self.let_take()?;
            }
        }
        Ok(())
    }

    fn let_take(&mut self) -> Result<(), ReplayError> {
        self.states.wake()?;
        std::thread::sleep(2 * PATIENCE);
        Ok(())
    }

    fn compare(&mut self, recorded: ModelUpdate, repeated: ModelUpdate) {
        if self.bytes.same(&Sample::ModelUpdate(recorded), &Sample::ModelUpdate(repeated)) {
            self.n_updates += 1;
            return;
        }
        let (field, was, is) = first_field(&recorded, &repeated);
        self.difference = Some(Difference {
            process: Process::Estimate,
            run: self.run,
            sequence: recorded.sequence,
            field,
            recorded: was,
            repeated: is,
        });
    }
}

impl Repetition for LearningVerifier<'_> {
    fn process(&self) -> Process {
        Process::Estimate
    }

    fn model(&self) -> Option<ModelHash> {
        self.model
    }

    fn turn(&mut self, bus: &Bus) -> Result<Turn, ReplayError> {
        let Some(recorded) = self.due else { return self.send_next(bus) };
        if let Some(repeated) = self.updates.take()?.map(|update| *update) {
            self.compare(recorded, repeated);
            self.due = None;
            self.progress_ns = clock::monotonic_ns();
            return Ok(if self.difference.is_some() { Turn::Done } else { Turn::Going });
        }
        self.updates.wait(PATIENCE)?;
        if clock::monotonic_ns() - self.progress_ns > STALL_NS {
            let patience_s = STALL_NS.unsigned_abs() / 1_000_000_000;
            return Err(ReplayError::Stalled { sample: recorded.shape_sequence, n_waiting: 1, patience_s });
        }
        Ok(Turn::Going)
    }

    fn n_identical(&self) -> u64 {
        self.n_updates
    }

    fn n_behind_end(&self) -> u64 {
        self.n_behind_end
    }

    fn n_bytes(&self) -> u64 {
        self.bytes.n_compared
    }

    fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }
}

/// The shape that an update rests on, found by its exposure: that is the instant that the update names.
fn shape_of(window: &mut Window, update: &ModelUpdate) -> Result<(u64, Shape), ReplayError> {
    let sequence = update.shape_sequence;
    let found = window.named(|w| &mut w.shapes, sequence, update.sample_ns)?;
    let Some((run, shape)) = found else { return Err(window.missing(|w| &mut w.shapes, sequence)) };
    window.shapes.forget_before(run, sequence);
    Ok((run, shape))
}
