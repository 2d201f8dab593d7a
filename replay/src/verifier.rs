//! One pass through freshly started stages again, several samples under way at once, every output compared byte by byte.
//!
//! Back-pressure: what comes out says how far the stages are, and never are more samples under way than [`WINDOW`]. So no
//! queue overflows however the stages are scheduled, and every sample is accounted for.

use crate::ReplayError;
use crate::difference::{Bytes, Difference, first_field};
use crate::steps::{Step, Steps};
use crate::window::Window;
use core::time::Duration;
use krait_ipc::message::{Command, Cue, Health, ModelUpdate, OperatorInput, Setpoint, SlaveState};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, Writer, clock, health_channel};
use krait_model::ModelHash;
use krait_schema::Sample;
use std::collections::VecDeque;

/// Samples under way at most. A stage's queue holds 256; a sample rests on up to two states.
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

/// Sends a pass and compares what comes back.
pub struct Verifier<'a> {
    pass: u64,
    steps: Steps<'a>,
    channels: Channels,
    n_fed: u64,
    /// What the samples fed so far must give.
    setpoints_due: VecDeque<Setpoint>,
    commands_due: VecDeque<Command>,
    /// Setpoints that came out the same.
    pub n_setpoints: u64,
    /// Commands that came out the same.
    pub n_commands: u64,
    bytes: Bytes,
    difference: Option<Difference>,
    progress_ns: i64,
}

/// Where samples are sent, and where their outputs come back.
struct Channels {
    inputs: Option<Writer<OperatorInput>>,
    // Without operator input, the setpoints are what is sent.
    sent_setpoints: Option<Writer<Setpoint>>,
    cues: Writer<Cue>,
    states: Writer<SlaveState>,
    updates: Writer<ModelUpdate>,
    setpoints: Option<Reader<Setpoint>>,
    commands: Reader<Command>,
    healths: Vec<(Process, Reader<Health>)>,
}

impl<'a> Verifier<'a> {
    /// Opens the channels for a pass, from 1; `None` when there is no such pass. The stages must be started after this and be
    /// ready before the first turn. Without operator input (`has_inputs`), setpoints are what is sent.
    ///
    /// # Errors
    /// [`ReplayError`] when the recording lacks what a step depended on, or a channel cannot be had.
    pub fn open(bus: &Bus, window: &'a mut Window, pass: u64, has_inputs: bool) -> Result<Option<Self>, ReplayError> {
        let Some(steps) = Steps::of(window, pass, has_inputs)? else { return Ok(None) };
        let channels = Channels {
            inputs: if has_inputs { Some(bus.writer()?) } else { None },
            sent_setpoints: if has_inputs { None } else { Some(bus.writer()?) },
            cues: bus.writer()?,
            states: bus.writer()?,
            updates: bus.writer()?,
            setpoints: if has_inputs { Some(bus.reader(ReadOptions::observing())?) } else { None },
            commands: bus.reader(ReadOptions::following())?,
            healths: [Process::Resolve, Process::Compensate]
                .into_iter()
                .map(|process| Ok((process, bus.reader_on(&health_channel(process), ReadOptions::glancing())?)))
                .collect::<Result<_, ReplayError>>()?,
        };
        Ok(Some(Self {
            pass,
            steps,
            channels,
            n_fed: 0,
            setpoints_due: VecDeque::new(),
            commands_due: VecDeque::new(),
            n_setpoints: 0,
            n_commands: 0,
            bytes: Bytes::default(),
            difference: None,
            progress_ns: clock::monotonic_ns(),
        }))
    }

    /// Which model the pass was compensated with, if it holds a command that says so.
    pub fn model(&self) -> Option<ModelHash> {
        self.steps.model()
    }

    /// Setpoints at the end of the pass that no command answers; they are not repeated. Known at the end.
    pub fn n_unanswered(&self) -> usize {
        self.steps.n_unanswered()
    }

    /// How long it took when it was recorded, s. Known at the end.
    pub fn recorded_s(&self) -> f64 {
        self.steps.ends_ns.map_or(0.0, |(first_ns, last_ns)| last_ns.saturating_sub(first_ns) as f64 * 1e-9)
    }

    /// Bytes compared so far.
    pub fn n_bytes(&self) -> u64 {
        self.bytes.n_compared
    }

    /// The first difference, if there is one.
    pub fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }

    /// Takes what came back, sends what there is room for, and sleeps a little if neither was possible.
    ///
    /// # Errors
    /// [`ReplayError::Stalled`] when nothing comes back any more, or a channel failed.
    pub fn turn(&mut self) -> Result<Turn, ReplayError> {
        let n_taken = self.take_setpoints()? + self.take_commands()?;
        let is_answered = self.commands_due.is_empty() && self.setpoints_due.is_empty();
        if self.difference.is_some() || (is_answered && self.steps.peek().is_none()) {
            return Ok(Turn::Done);
        }
        let n_sent = self.feed()?;
        let now_ns = clock::monotonic_ns();
        if n_taken + n_sent > 0 {
            self.progress_ns = now_ns;
            return Ok(Turn::Going);
        }
        self.channels.commands.wait(PATIENCE)?;
        self.look_for_refusals()?;
        if now_ns - self.progress_ns > STALL_NS {
            return Err(ReplayError::Stalled {
                sample: self.n_fed,
                n_waiting: self.commands_due.len() as u64,
                patience_s: STALL_NS.unsigned_abs() / 1_000_000_000,
            });
        }
        Ok(Turn::Going)
    }

    fn feed(&mut self) -> Result<u64, ReplayError> {
        let before = self.n_fed;
        while self.setpoints_due.len() < WINDOW
            && self.commands_due.len() < WINDOW
            && let Some(step) = self.steps.peek().copied()
        {
            self.n_fed += 1;
            self.send(&step)?;
            self.steps.pop()?;
            self.setpoints_due.extend(step.input.map(|_| step.setpoint));
            self.commands_due.extend(step.command);
        }
        if self.n_fed > before {
            self.channels.wake()?;
        }
        Ok(self.n_fed - before)
    }

    /// First what the step depends on, then the cue, then the sample: whoever has the sample has all of it.
    fn send(&mut self, step: &Step) -> Result<(), ReplayError> {
        let cue = &step.cue;
        let newest_state = cue.resolve_state_sequence.max(cue.compensate_state_sequence);
        while let Some(state) = self.steps.states.next_up_to(newest_state) {
            self.channels.states.put(&state)?;
        }
        while let Some(update) = self.steps.updates.next_up_to(cue.model_update_sequence) {
            self.channels.updates.put(&update)?;
        }
        self.channels.cues.put(&Cue { sequence: self.n_fed, ..*cue })?;
        if let (Some(inputs), Some(input)) = (&mut self.channels.inputs, &step.input) {
            inputs.put(input)?;
        }
        if let Some(setpoints) = &mut self.channels.sent_setpoints {
            setpoints.put(&step.setpoint)?;
        }
        Ok(())
    }

    fn take_setpoints(&mut self) -> Result<u64, ReplayError> {
        let mut n_taken = 0;
        while let Some(reader) = &mut self.channels.setpoints
            && self.difference.is_none()
            && let Some(repeated) = reader.take()?.map(|setpoint| *setpoint)
        {
            n_taken += 1;
            let recorded = self.setpoints_due.pop_front();
            let was_refused = |recorded: &Setpoint| recorded.input_sequence != repeated.input_sequence;
            let refused = recorded.is_some_and(|recorded| was_refused(&recorded));
            self.compare(Process::Resolve, recorded, repeated, refused, |s| (s.sequence, Sample::Setpoint(*s)));
            self.n_setpoints += u64::from(self.difference.is_none());
        }
        Ok(n_taken)
    }

    fn take_commands(&mut self) -> Result<u64, ReplayError> {
        let mut n_taken = 0;
        while self.difference.as_ref().is_none_or(|found| found.process == Process::Resolve)
            && let Some(repeated) = self.channels.commands.take()?.map(|command| *command)
        {
            n_taken += 1;
            // What rests on a setpoint that differs need not be looked at: the setpoint is the first difference.
            let limit = self.difference.as_ref().map_or(u64::MAX, |found| found.sequence);
            if repeated.setpoint_sequence >= limit {
                break;
            }
            let recorded = self.commands_due.pop_front();
            let refused = recorded.is_some_and(|recorded| recorded.setpoint_sequence != repeated.setpoint_sequence);
            let before = self.difference.take();
            self.compare(Process::Compensate, recorded, repeated, refused, |c| (c.sequence, Sample::Command(*c)));
            self.n_commands += u64::from(self.difference.is_none());
            self.difference = self.difference.take().or(before);
        }
        Ok(n_taken)
    }

    fn compare<M: core::fmt::Debug>(
        &mut self,
        process: Process,
        recorded: Option<M>,
        repeated: M,
        refused: bool,
        of: impl Fn(&M) -> (u64, Sample),
    ) {
        let (sequence, repeated_sample) = of(&repeated);
        let Some(recorded) = recorded else {
            self.differ(process, sequence, ("(output)".to_owned(), "none".to_owned(), "one".to_owned()));
            return;
        };
        let (sequence, recorded_sample) = of(&recorded);
        if refused {
            self.differ(process, sequence, ("(output)".to_owned(), "one".to_owned(), "none".to_owned()));
        } else if !self.bytes.same(&recorded_sample, &repeated_sample) {
            self.differ(process, sequence, first_field(&recorded, &repeated));
        }
    }

    fn differ(&mut self, process: Process, sequence: u64, (field, recorded, repeated): (String, String, String)) {
        self.difference = Some(Difference { process, pass: self.pass, sequence, field, recorded, repeated });
    }

    /// A sample that is refused gives no output; the stage says so in its health.
    fn look_for_refusals(&mut self) -> Result<(), ReplayError> {
        let mut refused = None;
        for (process, reader) in &mut self.channels.healths {
            if let Some(health) = reader.take_newest()?
                && health.n_refused > 0
                && refused.is_none()
            {
                let why = Reasons::from_bits(health.reasons_now).iter().next().map_or("refused", Reason::sentence);
                refused = Some((*process, why));
            }
        }
        if let Some((process, why)) = refused {
            let sequence = 1 + if process == Process::Resolve { self.n_setpoints } else { self.n_commands };
            self.differ(process, sequence, ("(output)".to_owned(), "one".to_owned(), format!("none: {why}")));
        }
        Ok(())
    }
}

impl Channels {
    fn wake(&mut self) -> Result<(), ReplayError> {
        self.states.wake()?;
        self.updates.wake()?;
        if let Some(inputs) = &mut self.inputs {
            inputs.wake()?;
        }
        if let Some(setpoints) = &mut self.sent_setpoints {
            setpoints.wake()?;
        }
        Ok(())
    }
}
