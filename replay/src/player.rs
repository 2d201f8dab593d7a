//! Plays a program to the simulated snake in the program's own time, as fast as the processes go or slower.
//!
//! The loop is closed: every stage sees the slave's state. Which state that is must not depend on who is scheduled first,
//! or no two replays would be alike; so the step for sample n rests on the state after sample n - [`UNDER_WAY`], and on the
//! model updates that the shapes up to then have led to. The same number bounds how many samples are under way, so a queue
//! of 256 never overflows, and a replay gives the same bytes at every speed. Where a busy machine recorded few samples for a
//! while, that state would be too old to be trusted: then the step rests on one that is no older than [`OLDEST_STATE_NS`], or,
//! behind a gap, on the state after the sample before it.

use crate::keeper::Keeper;
use crate::program::{Next, Planned, Program, ProgramPart, What};
use crate::steering::{MachinePose, pose_of_setpoint, pose_of_state};
use crate::{ReplayError, Turn};
use core::time::Duration;
use krait_ipc::message::{Command, Cue, HopStamps, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_ipc::{Bus, ReadOptions, Reader, Writer, clock};
use krait_report::Tracked;
use krait_schema::Sample;
use std::collections::VecDeque;

/// Samples under way at most, and the age of the state that a step rests on, in samples: 32 ms at 1 kHz. Every stage has
/// that many to work on each time it is woken.
pub const UNDER_WAY: u64 = 32;
/// The same age in the replay's time, ns: a third of what the stages take for fresh.
const OLDEST_STATE_NS: i64 = 33_000_000;
/// A chain that answers nothing for so long will not answer any more, ns.
const STALL_NS: i64 = 20_000_000_000;
/// The same once a stop was asked for, ns.
const STALL_AFTER_STOP_NS: i64 = 2_000_000_000;

/// What was sent and what came back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PlayCounts {
    /// Samples of the recording or trajectory that were sent.
    pub recorded: u64,
    /// Samples sent on the way to the start.
    pub approach: u64,
    /// Samples sent while coming to rest.
    pub rest: u64,
    /// Samples that the slave has answered.
    pub answered: u64,
    /// Messages missing between the processes and the replay.
    pub lost: u64,
}

impl PlayCounts {
    /// Samples sent.
    pub fn sent(&self) -> u64 {
        self.recorded + self.approach + self.rest
    }

    pub(crate) fn count(&mut self, part: ProgramPart) {
        match part {
            ProgramPart::Approach | ProgramPart::LettingGo => self.approach += 1,
            ProgramPart::Recorded => self.recorded += 1,
            ProgramPart::Rest => self.rest += 1,
        }
    }
}

/// What came out last, for a person who steps through a replay.
#[derive(Clone, Copy, Debug, Default)]
pub struct NewestPlayed {
    /// The setpoint.
    pub setpoint: Option<Setpoint>,
    /// The command.
    pub command: Option<Command>,
    /// The slave's state.
    pub state: Option<SlaveState>,
}

impl NewestPlayed {
    /// The pose of the newest setpoint, or the slave's before there is one.
    pub(crate) fn pose(&self) -> MachinePose {
        let slave = || self.state.as_ref().map(pose_of_state);
        self.setpoint.as_ref().map(pose_of_setpoint).or_else(slave).unwrap_or_default()
    }
}

/// A replay in its own time.
pub struct Player {
    program: Program,
    pending: Option<Planned>,
    inputs: Option<Writer<OperatorInput>>,
    sent_setpoints: Option<Writer<Setpoint>>,
    cues: Writer<Cue>,
    setpoints: Option<Reader<Setpoint>>,
    commands: Reader<Command>,
    states: Reader<SlaveState>,
    shapes: Reader<Shape>,
    updates: Reader<ModelUpdate>,
    keeper: Option<Keeper>,
    has_estimate: bool,
    counts: PlayCounts,
    newest: NewestPlayed,
    tracking: Tracked,
    /// The state before the first sample: its sequence number and its instant.
    base: Option<(u64, i64)>,
    /// Instants of the newest [`UNDER_WAY`] samples, the oldest first; before so many were sent, that of `base` before them.
    instants_ns: VecDeque<i64>,
    /// When each shape that no step rests on yet became available.
    shapes_ns: VecDeque<i64>,
    n_updates_due: u64,
    /// The newest shape, and the newest that `estimate` has made an update of.
    shape_sequence: u64,
    updated_sequence: u64,
    now_ns: i64,
    progress_ns: i64,
    is_stopping: bool,
}

impl Player {
    /// Opens the channels. The chain must be started after this, in recorded time; `has_estimate` says whether each of its shapes
    /// leads to a model update.
    ///
    /// # Errors
    /// [`ReplayError::Ipc`] when a channel cannot be had.
    pub fn open(bus: &Bus, program: Program, keeper: Option<Keeper>, has_estimate: bool) -> Result<Self, ReplayError> {
        let has_inputs = program.sends_inputs();
        Ok(Self {
            program,
            pending: None,
            inputs: if has_inputs { Some(bus.writer()?) } else { None },
            sent_setpoints: if has_inputs { None } else { Some(bus.writer()?) },
            cues: bus.writer()?,
            setpoints: if has_inputs { Some(bus.reader(ReadOptions::observing())?) } else { None },
            commands: bus.reader(ReadOptions::observing())?,
            states: bus.reader(ReadOptions::following())?,
            shapes: bus.reader(ReadOptions::observing())?,
            updates: bus.reader(ReadOptions::observing())?,
            keeper,
            has_estimate,
            counts: PlayCounts::default(),
            newest: NewestPlayed::default(),
            tracking: Tracked::default(),
            base: None,
            instants_ns: VecDeque::with_capacity(UNDER_WAY as usize + 1),
            shapes_ns: VecDeque::new(),
            n_updates_due: 0,
            shape_sequence: 0,
            updated_sequence: 0,
            now_ns: 0,
            progress_ns: clock::monotonic_ns(),
            is_stopping: false,
        })
    }

    /// Begins behind the newest state: the slave must be ready.
    ///
    /// # Errors
    /// [`ReplayError::Stalled`] when no state has come.
    pub fn begin(&mut self) -> Result<(), ReplayError> {
        self.take()?;
        let state = self.newest.state.ok_or(ReplayError::Stalled { sample: 0, n_waiting: 0, patience_s: 0 })?;
        self.base = Some((state.sequence, state.sample_ns));
        self.instants_ns.push_back(state.sample_ns);
        self.now_ns = state.sample_ns;
        self.progress_ns = clock::monotonic_ns();
        Ok(())
    }

    /// What was sent and what came back so far.
    pub fn counts(&self) -> PlayCounts {
        let readers = self.setpoints.as_ref().map_or(0, Reader::n_lost)
            + self.commands.n_lost()
            + self.states.n_lost()
            + self.shapes.n_lost()
            + self.updates.n_lost();
        PlayCounts { lost: readers, ..self.counts }
    }

    /// What came out last.
    pub fn newest(&self) -> &NewestPlayed {
        &self.newest
    }

    /// What is played, and how much of it has been.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// How well the machine followed.
    pub fn tracking(&self) -> &Tracked {
        &self.tracking
    }

    /// The replay's time of the newest sample, ns.
    pub fn now_ns(&self) -> i64 {
        self.now_ns
    }

    /// Leaves out the rest of the score, comes to rest and ends.
    pub fn stop(&mut self) {
        self.pending = None;
        self.is_stopping = true;
        self.program.stop();
    }

    /// Takes what came back, sends what is due before `until_ns` (the replay's time) but at most `n_most` recorded samples,
    /// and sleeps for at most `patience` if neither was possible. Returns how many recorded samples were sent.
    ///
    /// # Errors
    /// [`ReplayError::Stalled`] when the chain does not answer, or a channel or the recording failed.
    pub fn turn(&mut self, until_ns: i64, n_most: u64, patience: Duration) -> Result<(Turn, u64), ReplayError> {
        let n_taken = self.take()?;
        let before = self.counts;
        let ended = self.feed(until_ns, n_most)?;
        let n_recorded = self.counts.recorded - before.recorded;
        if ended && self.is_whole() {
            return Ok((Turn::Done, n_recorded));
        }
        let now_ns = clock::monotonic_ns();
        if n_taken > 0 || self.counts.sent() > before.sent() || self.is_whole() {
            self.progress_ns = now_ns;
        }
        if n_taken == 0 && self.counts.sent() == before.sent() {
            self.states.wait(patience)?;
        }
        let patience_ns = if self.is_stopping { STALL_AFTER_STOP_NS } else { STALL_NS };
        if now_ns - self.progress_ns > patience_ns {
            return Err(ReplayError::Stalled {
                sample: self.counts.sent(),
                n_waiting: self.counts.sent() - self.counts.answered,
                patience_s: patience_ns.unsigned_abs() / 1_000_000_000,
            });
        }
        Ok((Turn::Going, n_recorded))
    }

    /// Ends the recording. Returns how many samples it holds.
    ///
    /// # Errors
    /// [`ReplayError::Record`] when it could not be written to its end.
    pub fn finish(mut self) -> Result<Option<u64>, ReplayError> {
        self.take()?;
        self.keeper.map(Keeper::finish).transpose()
    }

    /// Whether every sample sent has been answered.
    pub fn is_idle(&self) -> bool {
        self.counts.answered == self.counts.sent()
    }

    /// Whether, besides, every shape has led to its model update: nobody waits for the last one's, so it may come late.
    fn is_whole(&self) -> bool {
        self.is_idle() && self.updated_sequence >= self.shape_sequence
    }

    /// States first: whatever led to a state was published before it and is found afterwards.
    fn take(&mut self) -> Result<u64, ReplayError> {
        let mut n_taken = 0;
        while let Some(state) = self.states.take()?.map(|state| *state) {
            n_taken += 1;
            self.counts.answered = self.base.map_or(0, |(sequence, _)| state.sequence.saturating_sub(sequence));
            self.newest.state = Some(state);
            keep(&mut self.keeper, Sample::State(state))?;
        }
        while let Some(reader) = &mut self.setpoints
            && let Some(setpoint) = reader.take()?.map(|setpoint| *setpoint)
        {
            self.newest.setpoint = Some(setpoint);
            self.tracking.setpoint(&setpoint);
            keep(&mut self.keeper, Sample::Setpoint(setpoint))?;
        }
        while let Some(command) = self.commands.take()?.map(|command| *command) {
            self.newest.command = Some(command);
            keep(&mut self.keeper, Sample::Command(command))?;
        }
        while let Some(shape) = self.shapes.take()?.map(|shape| *shape) {
            if self.has_estimate {
                self.shapes_ns.push_back(shape.available_ns);
                self.shape_sequence = shape.sequence;
            }
            self.tracking.shape(&shape);
            keep(&mut self.keeper, Sample::Shape(shape))?;
        }
        while let Some(update) = self.updates.take()?.map(|update| *update) {
            self.updated_sequence = update.shape_sequence;
            keep(&mut self.keeper, Sample::ModelUpdate(update))?;
        }
        Ok(n_taken)
    }

    /// Sends what may be sent now. Returns whether there is nothing more to send at all.
    fn feed(&mut self, until_ns: i64, n_most: u64) -> Result<bool, ReplayError> {
        let last = self.counts.recorded.saturating_add(n_most);
        let mut n_sent = 0;
        let mut ended = false;
        while self.counts.sent() - self.counts.answered < UNDER_WAY {
            let planned = match self.pending.take() {
                Some(planned) => planned,
                None => match self.program.next(&self.newest.pose(), self.is_idle())? {
                    Next::Sample(planned) => planned,
                    Next::Wait => break,
                    Next::End => {
                        ended = true;
                        break;
                    }
                },
            };
            let at_ns = self.now_ns.saturating_add(planned.dt_ns);
            let (before, before_ns) = self.rests_on(at_ns);
            let is_early = at_ns > until_ns || self.counts.answered < before;
            if is_early || (planned.part == ProgramPart::Recorded && self.counts.recorded >= last) {
                self.pending = Some(planned);
                break;
            }
            self.send(&planned, before, before_ns)?;
            n_sent += 1;
        }
        if n_sent > 0 {
            if let Some(inputs) = &mut self.inputs {
                inputs.wake()?;
            }
            if let Some(setpoints) = &mut self.sent_setpoints {
                setpoints.wake()?;
            }
        }
        Ok(ended)
    }

    /// Sends a sample whose step rests on the state after the sample `before`, of the instant `before_ns`.
    fn send(&mut self, planned: &Planned, before: u64, before_ns: i64) -> Result<(), ReplayError> {
        self.now_ns += planned.dt_ns;
        let now_ns = self.now_ns;
        let sequence = self.counts.sent() + 1;
        let (base_sequence, _) = self.base.unwrap_or_default();
        self.note_updates_due(before_ns);
        let state_sequence = base_sequence + before;
        self.instants_ns.push_back(now_ns);
        if self.instants_ns.len() > UNDER_WAY as usize {
            self.instants_ns.pop_front();
        }
        self.cues.put(&Cue {
            sequence,
            sample_ns: now_ns,
            input_sequence: sequence,
            resolve_begun_ns: now_ns,
            setpoint_sent_ns: now_ns,
            compensate_begun_ns: now_ns,
            command_sent_ns: now_ns,
            resolve_state_sequence: state_sequence,
            compensate_state_sequence: state_sequence,
            model_update_sequence: self.n_updates_due,
        })?;
        let stamps = HopStamps { device_ns: now_ns, input_sent_ns: now_ns, ..HopStamps::default() };
        match planned.what {
            What::Input(input) => {
                let input = OperatorInput { sequence, sample_ns: now_ns, stamps, ..input };
                if let Some(inputs) = &mut self.inputs {
                    inputs.put(&input)?;
                }
                keep(&mut self.keeper, Sample::Input(input))?;
            }
            What::Setpoint(setpoint) => {
                let stamps = HopStamps { resolve_begun_ns: now_ns, setpoint_sent_ns: now_ns, ..stamps };
                let setpoint = Setpoint { sequence, sample_ns: now_ns, input_sequence: sequence, stamps, ..setpoint };
                if let Some(setpoints) = &mut self.sent_setpoints {
                    setpoints.put(&setpoint)?;
                }
                self.newest.setpoint = Some(setpoint);
                self.tracking.setpoint(&setpoint);
                keep(&mut self.keeper, Sample::Setpoint(setpoint))?;
            }
        }
        self.counts.count(planned.part);
        Ok(())
    }

    /// The sample, 0 for `base`, on whose state the step for the next one rests if that comes at this instant, and its own instant.
    fn rests_on(&self, at_ns: i64) -> (u64, i64) {
        let Some(newest) = self.instants_ns.len().checked_sub(1) else { return (self.counts.sent(), self.now_ns) };
        let is_fresh = |ns: &i64| at_ns - ns <= OLDEST_STATE_NS;
        let oldest = self.instants_ns.iter().position(is_fresh).unwrap_or(newest);
        (self.counts.sent().saturating_sub((newest - oldest) as u64), self.instants_ns[oldest])
    }

    /// Each shape gives one model update; those that had become available by an instant are due.
    fn note_updates_due(&mut self, instant_ns: i64) {
        while self.shapes_ns.front().is_some_and(|available_ns| *available_ns <= instant_ns) {
            self.shapes_ns.pop_front();
            self.n_updates_due += 1;
        }
    }
}

fn keep(keeper: &mut Option<Keeper>, sample: Sample) -> Result<(), ReplayError> {
    keeper.as_mut().map_or(Ok(()), |keeper| keeper.keep(sample))
}
