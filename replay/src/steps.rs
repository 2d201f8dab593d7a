//! What each recorded step rested on, as cues: the plan by which a pass is repeated, made a little ahead of its use.

use crate::ReplayError;
use crate::window::Window;
use krait_ipc::message::{Command, Cue, Message, ModelUpdate, OperatorInput, Setpoint, SlaveState};
use krait_model::ModelHash;
use std::collections::{BTreeMap, VecDeque};

/// One sample's way through the stages, as it was recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// What its steps depended on besides the input.
    pub cue: Cue,
    /// The operator's input; none where setpoints are what is sent.
    pub input: Option<OperatorInput>,
    /// The setpoint that it gave.
    pub setpoint: Setpoint,
    /// The command that it gave; none if `compensate` refused the setpoint then.
    pub command: Option<Command>,
}

/// The steps of a pass, in the order of the setpoints, and the messages that they name.
pub(crate) struct Steps<'a> {
    window: &'a mut Window,
    pass: u64,
    has_inputs: bool,
    planned: VecDeque<Step>,
    /// Slave states that the planned steps rest on.
    pub states: Named<SlaveState>,
    /// Model updates that they rest on.
    pub updates: Named<ModelUpdate>,
    /// The command that belongs to the next setpoint or to one behind it.
    command: Option<Command>,
    n_setpoints: u64,
    n_commands: u64,
    /// Setpoints without a command since the newest command.
    n_skipped: usize,
    is_whole: bool,
    /// Stamps of the first and the newest setpoint, ns.
    pub ends_ns: Option<(i64, i64)>,
}

/// Messages of a channel that steps rest on, each handed out once and in order.
pub(crate) struct Named<M> {
    waiting: BTreeMap<u64, M>,
    newest: u64,
}

impl<M: Message> Named<M> {
    fn none() -> Self {
        Self { waiting: BTreeMap::new(), newest: 0 }
    }

    fn note(&mut self, message: M) {
        if message.sequence() > self.newest {
            self.waiting.insert(message.sequence(), message);
        }
    }

    /// Takes the next one up to a sequence number.
    pub(crate) fn next_up_to(&mut self, sequence: u64) -> Option<M> {
        let first = self.waiting.first_entry().filter(|first| *first.key() <= sequence)?;
        self.newest = *first.key();
        Some(first.remove())
    }
}

/// Longest run of setpoints without a command that can be repeated: nobody tells how far `compensate` is meanwhile.
const MOST_SKIPPED: usize = 64;
/// Steps that are planned ahead. `compensate` may lag behind `resolve` by a queue, 256, and have known newer states than
/// the steps behind it name; so all that are named must be known when a state is sent.
const N_AHEAD: usize = 512;

impl<'a> Steps<'a> {
    /// The steps of a pass, from 1; `None` when the recording holds no such pass.
    ///
    /// # Errors
    /// [`ReplayError::Gap`] or [`ReplayError::Missing`] when the recording lacks what a step depended on, here and whenever
    /// more steps are planned.
    pub(crate) fn of(window: &'a mut Window, pass: u64, has_inputs: bool) -> Result<Option<Self>, ReplayError> {
        window.begin(pass);
        let mut steps = Self {
            window,
            pass,
            has_inputs,
            planned: VecDeque::new(),
            states: Named::none(),
            updates: Named::none(),
            command: None,
            n_setpoints: 0,
            n_commands: 0,
            n_skipped: 0,
            is_whole: false,
            ends_ns: None,
        };
        steps.plan()?;
        Ok((steps.n_setpoints > 0).then_some(steps))
    }

    /// Which model the first command rests on.
    pub(crate) fn model(&self) -> Option<ModelHash> {
        self.planned.iter().find_map(|step| step.command).and_then(|command| model_of(&command))
    }

    /// Setpoints at the end that no command answers, because the recording ended first; known at the end.
    pub(crate) fn n_unanswered(&self) -> usize {
        if self.is_whole { self.n_skipped } else { 0 }
    }

    /// The next step; it stays the next until [`Steps::pop`].
    pub(crate) fn peek(&self) -> Option<&Step> {
        self.planned.front().filter(|_| self.planned.len() > self.n_undecided())
    }

    /// Goes on to the step after.
    pub(crate) fn pop(&mut self) -> Result<(), ReplayError> {
        self.planned.pop_front();
        self.plan()
    }

    /// Planned steps at the end of which it is not known yet whether they are answered, or known that they are not.
    fn n_undecided(&self) -> usize {
        self.n_skipped.min(MOST_SKIPPED)
    }

    fn plan(&mut self) -> Result<(), ReplayError> {
        while !self.is_whole && self.planned.len() < N_AHEAD + self.n_undecided() {
            match self.window.next(|w| &mut w.setpoints, self.pass)? {
                Some(setpoint) => self.push(setpoint)?,
                None => self.end()?,
            }
        }
        Ok(())
    }

    fn push(&mut self, setpoint: Setpoint) -> Result<(), ReplayError> {
        check_next(&setpoint, &mut self.n_setpoints)?;
        let first_ns = self.ends_ns.map_or(setpoint.sample_ns, |(first_ns, _)| first_ns);
        self.ends_ns = Some((first_ns, setpoint.sample_ns));
        let command = self.command_of(&setpoint)?;
        if command.is_some() && self.n_skipped > MOST_SKIPPED {
            return Err(ReplayError::Missing { sequence: setpoint.sequence - 1, channel: Command::CHANNEL });
        }
        self.n_skipped = if command.is_some() { 0 } else { self.n_skipped + 1 };
        if self.n_skipped > MOST_SKIPPED {
            // Either the recording ends so, or a command will come that cannot be repeated.
            return Ok(());
        }
        let mut cue = Cue {
            sample_ns: setpoint.sample_ns,
            input_sequence: setpoint.input_sequence,
            resolve_begun_ns: setpoint.stamps.resolve_begun_ns,
            setpoint_sent_ns: setpoint.stamps.setpoint_sent_ns,
            resolve_state_sequence: if self.has_inputs { setpoint.state_sequence } else { 0 },
            ..Cue::default()
        };
        if let Some(command) = &command {
            cue.compensate_begun_ns = command.stamps.compensate_begun_ns;
            cue.command_sent_ns = command.stamps.command_sent_ns;
            cue.compensate_state_sequence = command.state_sequence;
            cue.model_update_sequence = command.model_update_sequence;
        }
        let input = self.note_named(&cue)?;
        self.planned.push_back(Step { cue, input, setpoint, command });
        Ok(())
    }

    /// Keeps what a step rests on until it is sent. Returns the input.
    fn note_named(&mut self, cue: &Cue) -> Result<Option<OperatorInput>, ReplayError> {
        let (pass, sequence) = (self.pass, cue.input_sequence);
        let mut input = None;
        if self.has_inputs {
            let found = self.window.find(|w| &mut w.inputs, pass, sequence)?;
            input = Some(found.ok_or(ReplayError::Missing { sequence, channel: OperatorInput::CHANNEL })?);
            self.window.inputs.forget_before(pass, sequence);
        }
        let named = [cue.resolve_state_sequence, cue.compensate_state_sequence];
        for sequence in named.into_iter().filter(|sequence| *sequence > 0) {
            let state = self.window.find(|w| &mut w.states, pass, sequence)?;
            self.states.note(state.ok_or(ReplayError::Missing { sequence, channel: SlaveState::CHANNEL })?);
        }
        // A stage never goes back to an older state, but one may hear of it before the other; of one that names none, nothing
        // is known.
        let oldest = if self.has_inputs { named[0].min(named[1]) } else { named[1] };
        self.window.states.forget_before(pass, oldest);
        let sequence = cue.model_update_sequence;
        if sequence > 0 {
            let update = self.window.find(|w| &mut w.updates, pass, sequence)?;
            let missing = ReplayError::Missing { sequence, channel: ModelUpdate::CHANNEL };
            self.updates.note(update.ok_or(missing)?);
            self.window.updates.forget_before(pass, sequence);
        }
        Ok(input)
    }

    fn command_of(&mut self, setpoint: &Setpoint) -> Result<Option<Command>, ReplayError> {
        if self.command.is_none()
            && let Some(command) = self.window.next(|w| &mut w.commands, self.pass)?
        {
            check_next(&command, &mut self.n_commands)?;
            self.command = Some(command);
        }
        match &self.command {
            Some(command) if command.setpoint_sequence < setpoint.sequence => Err(orphan(command)),
            Some(command) if command.setpoint_sequence == setpoint.sequence => Ok(self.command.take()),
            _ => Ok(None),
        }
    }

    fn end(&mut self) -> Result<(), ReplayError> {
        self.is_whole = true;
        let rest = self.window.next(|w| &mut w.commands, self.pass)?;
        match self.command.or(rest) {
            Some(command) => Err(orphan(&command)),
            None => Ok(()),
        }
    }
}

/// Which model a command rests on; messages of before version 3 do not say.
pub(crate) fn model_of(command: &Command) -> Option<ModelHash> {
    (command.model_hash != 0).then_some(ModelHash(command.model_hash))
}

/// A command whose setpoint is not there.
fn orphan(command: &Command) -> ReplayError {
    ReplayError::Missing { sequence: command.setpoint_sequence, channel: Setpoint::CHANNEL }
}

/// A stage that starts anew counts from 1, and so must what it is compared with.
fn check_next<M: Message>(message: &M, newest: &mut u64) -> Result<(), ReplayError> {
    *newest += 1;
    if message.sequence() == *newest {
        return Ok(());
    }
    Err(ReplayError::Gap { channel: M::CHANNEL, expected: *newest, found: message.sequence() })
}

#[cfg(test)]
mod tests;
