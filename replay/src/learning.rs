//! What `estimate` has learnt in one pass, learnt again by a freshly started process, every update compared byte by byte.
//!
//! Each update names the shape and the newest slave state that it rests on, and how many states that were. So states are
//! sent up to that one, then the shape, and nothing more until the update is back: the process does what it did then, however
//! it is scheduled.

use crate::ReplayError;
use crate::difference::{Bytes, Difference, first_field};
use crate::verifier::{PATIENCE, STALL_NS, Turn};
use crate::window::Window;
use krait_ipc::message::{Message, ModelUpdate, Shape, SlaveState};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Writer, clock};
use krait_model::ModelHash;
use krait_schema::Sample;

/// States that are sent in a row; the process's queue holds 8192.
const MOST_AT_ONCE: u64 = 4096;

/// Sends the states and shapes of a pass and compares the updates that come back.
pub struct LearningVerifier<'a> {
    pass: u64,
    window: &'a mut Window,
    states: Writer<SlaveState>,
    shapes: Writer<Shape>,
    updates: Reader<ModelUpdate>,
    /// The update that is to come back, and the next one.
    due: Option<ModelUpdate>,
    next: Option<ModelUpdate>,
    /// The newest state that was sent.
    state_sequence: u64,
    /// Updates that came out the same.
    pub n_updates: u64,
    bytes: Bytes,
    difference: Option<Difference>,
    progress_ns: i64,
}

impl<'a> LearningVerifier<'a> {
    /// Opens the channels for a pass, from 1; `None` when nothing was learnt in it. The process must be started after this and
    /// be ready before the first turn.
    ///
    /// # Errors
    /// [`ReplayError`] when the recording cannot be read or a channel cannot be had.
    pub fn open(bus: &Bus, window: &'a mut Window, pass: u64) -> Result<Option<Self>, ReplayError> {
        window.begin(pass);
        let Some(first) = window.next(|w| &mut w.updates, pass)? else { return Ok(None) };
        Ok(Some(Self {
            pass,
            window,
            states: bus.writer()?,
            shapes: bus.writer()?,
            updates: bus.reader(ReadOptions::waking())?,
            due: None,
            state_sequence: first.state_sequence.saturating_sub(first.n_states),
            next: Some(first),
            n_updates: 0,
            bytes: Bytes::default(),
            difference: None,
            progress_ns: clock::monotonic_ns(),
        }))
    }

    /// Which model was learnt.
    pub fn model(&self) -> Option<ModelHash> {
        self.next.map(|update| ModelHash(update.model_hash))
    }

    /// Bytes compared so far.
    pub fn n_bytes(&self) -> u64 {
        self.bytes.n_compared
    }

    /// The first difference, if there is one.
    pub fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }

    /// Takes the update that is due, or sends what the next one rests on.
    ///
    /// # Errors
    /// [`ReplayError::Missing`] or [`ReplayError::Gap`] for what the recording does not hold, [`ReplayError::Stalled`] when
    /// nothing comes back, or a channel failed.
    pub fn turn(&mut self) -> Result<Turn, ReplayError> {
        let Some(recorded) = self.due else { return self.send_next() };
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

    fn send_next(&mut self) -> Result<Turn, ReplayError> {
        let pass = self.pass;
        let update = match self.next.take() {
            Some(update) => update,
            None => match self.window.next(|w| &mut w.updates, pass)? {
                Some(update) => update,
                None => return Ok(Turn::Done),
            },
        };
        self.window.states.forget_before(pass, self.state_sequence + 1);
        for n in 0..update.state_sequence.saturating_sub(self.state_sequence) {
            let sequence = self.state_sequence + 1 + n;
            let state = self.window.find(|w| &mut w.states, pass, sequence)?;
            self.states.put(&state.ok_or(ReplayError::Missing { sequence, channel: SlaveState::CHANNEL })?)?;
            if n % MOST_AT_ONCE == MOST_AT_ONCE - 1 {
                self.states.wake()?;
                std::thread::sleep(2 * PATIENCE);
            }
        }
        self.state_sequence = self.state_sequence.max(update.state_sequence);
        let sequence = update.shape_sequence;
        let shape = self.window.find(|w| &mut w.shapes, pass, sequence)?;
        self.shapes.put(&shape.ok_or(ReplayError::Missing { sequence, channel: Shape::CHANNEL })?)?;
        self.window.shapes.forget_before(pass, sequence);
        self.states.wake()?;
        self.shapes.wake()?;
        self.due = Some(update);
        Ok(Turn::Going)
    }

    fn compare(&mut self, recorded: ModelUpdate, repeated: ModelUpdate) {
        if self.bytes.same(&Sample::ModelUpdate(recorded), &Sample::ModelUpdate(repeated)) {
            self.n_updates += 1;
            return;
        }
        let (field, was, is) = first_field(&recorded, &repeated);
        self.difference = Some(Difference {
            process: Process::Estimate,
            pass: self.pass,
            sequence: recorded.sequence,
            field,
            recorded: was,
            repeated: is,
        });
    }
}
