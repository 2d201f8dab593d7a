//! What each recorded step rested on, as cues: the plan by which a pass is repeated.

use crate::{Pass, ReplayError};
use krait_ipc::message::{Command, Cue, Message, Setpoint};
use std::collections::BTreeSet;

/// One sample's way through the stages, as it was recorded.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// What its steps depended on besides the input.
    pub cue: Cue,
    /// Which of the pass's setpoints it gave.
    pub setpoint_idx: usize,
    /// Which of the pass's commands it gave; none if `compensate` refused the setpoint then.
    pub command_idx: Option<usize>,
}

/// All steps of a pass, and the messages that they name.
#[derive(Clone, Debug, Default)]
pub struct Steps {
    /// In the order of the setpoints.
    pub all: Vec<Step>,
    /// Whether the recording holds operator input; without it, setpoints are what is sent.
    pub has_inputs: bool,
    /// Sequence numbers of the slave states that steps rest on.
    pub state_sequences: BTreeSet<u64>,
    /// Sequence numbers of the model updates that steps rest on.
    pub update_sequences: BTreeSet<u64>,
    /// Setpoints at the end that no command answers, because the recording ended first.
    pub n_unanswered: usize,
}

/// Longest run of setpoints without a command that can be repeated: nobody tells how far `compensate` is meanwhile.
const MOST_SKIPPED: usize = 64;

impl Steps {
    /// Plans the repetition of a pass.
    ///
    /// # Errors
    /// [`ReplayError::Gap`] or [`ReplayError::Missing`] when the recording lacks what a step depended on.
    pub fn of(pass: &Pass) -> Result<Self, ReplayError> {
        check_whole(&pass.setpoints)?;
        check_whole(&pass.commands)?;
        let mut steps = Self { has_inputs: !pass.inputs.is_empty(), ..Self::default() };
        let mut commands = pass.commands.iter().enumerate().peekable();
        let mut n_skipped = 0;
        for (setpoint_idx, setpoint) in pass.setpoints.iter().enumerate() {
            let command = commands.next_if(|(_, command)| command.setpoint_sequence == setpoint.sequence);
            n_skipped = if command.is_some() { 0 } else { n_skipped + 1 };
            steps.n_unanswered = n_skipped;
            steps.push(pass, setpoint_idx, setpoint, command)?;
        }
        if let Some((_, orphan)) = commands.next() {
            return Err(ReplayError::Missing { sequence: orphan.setpoint_sequence, channel: Setpoint::CHANNEL });
        }
        steps.all.truncate(steps.all.len() - steps.n_unanswered);
        steps.check_skipped(pass)?;
        Ok(steps)
    }

    fn push(
        &mut self,
        pass: &Pass,
        setpoint_idx: usize,
        setpoint: &Setpoint,
        command: Option<(usize, &Command)>,
    ) -> Result<(), ReplayError> {
        if self.has_inputs && Pass::find(&pass.inputs, setpoint.input_sequence).is_none() {
            return Err(ReplayError::Missing { sequence: setpoint.input_sequence, channel: "input" });
        }
        let mut cue = Cue {
            sample_ns: setpoint.sample_ns,
            input_sequence: setpoint.input_sequence,
            resolve_begun_ns: setpoint.stamps.resolve_begun_ns,
            setpoint_sent_ns: setpoint.stamps.setpoint_sent_ns,
            resolve_state_sequence: if self.has_inputs { setpoint.state_sequence } else { 0 },
            ..Cue::default()
        };
        if let Some((_, command)) = command {
            cue.compensate_begun_ns = command.stamps.compensate_begun_ns;
            cue.command_sent_ns = command.stamps.command_sent_ns;
            cue.compensate_state_sequence = command.state_sequence;
            cue.model_update_sequence = command.model_update_sequence;
        }
        for sequence in [cue.resolve_state_sequence, cue.compensate_state_sequence] {
            if sequence > 0 && self.state_sequences.insert(sequence) && Pass::find(&pass.states, sequence).is_none() {
                return Err(ReplayError::Missing { sequence, channel: "state" });
            }
        }
        let sequence = cue.model_update_sequence;
        if sequence > 0 && self.update_sequences.insert(sequence) && Pass::find(&pass.updates, sequence).is_none() {
            return Err(ReplayError::Missing { sequence, channel: "model_update" });
        }
        self.all.push(Step { cue, setpoint_idx, command_idx: command.map(|(idx, _)| idx) });
        Ok(())
    }

    fn check_skipped(&self, pass: &Pass) -> Result<(), ReplayError> {
        let mut n_skipped = 0;
        for step in &self.all {
            n_skipped = if step.command_idx.is_some() { 0 } else { n_skipped + 1 };
            if n_skipped > MOST_SKIPPED {
                let sequence = pass.setpoints.get(step.setpoint_idx).map_or(0, |setpoint| setpoint.sequence);
                return Err(ReplayError::Missing { sequence, channel: "command" });
            }
        }
        Ok(())
    }
}

/// A stage that starts anew counts from 1, and so must what it is compared with.
fn check_whole<M: Message>(messages: &[M]) -> Result<(), ReplayError> {
    for (message, expected) in messages.iter().zip(1..) {
        if message.sequence() != expected {
            return Err(ReplayError::Gap { channel: M::CHANNEL, expected, found: message.sequence() });
        }
    }
    Ok(())
}
