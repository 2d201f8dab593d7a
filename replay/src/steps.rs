//! What each recorded step rested on: the plan by which a run of a stage is repeated, made as it is used.

use crate::ReplayError;
use crate::stage::{Queue, RestsOn, Stage};
use crate::window::{Of, Window};
use krait_ipc::message::{Command, Cue, Message, ModelUpdate, SlaveState};
use krait_model::ModelHash;

/// One step of a stage as it was recorded.
pub(crate) struct Step<S: Stage> {
    /// What the step depended on besides its input.
    pub cue: Cue,
    /// What it took, with its run.
    pub input: (u64, S::In),
    /// The slave state that it knew, with its run, if it is another than the step before knew.
    pub state: Option<(u64, SlaveState)>,
    /// The same for the model update.
    pub update: Option<(u64, ModelUpdate)>,
    /// What it gave.
    pub output: S::Out,
}

/// The steps of one run of a stage, in order. A restarted stage begins with its memory empty and its numbers at 1, so each of
/// its runs is repeated by itself.
pub(crate) struct Steps<'a, S: Stage> {
    window: &'a mut Window,
    run: u64,
    next: Option<Step<S>>,
    n: u64,
    n_behind_end: u64,
    state_sequence: u64,
    update_sequence: u64,
}

impl<'a, S: Stage> Steps<'a, S> {
    /// The steps of a run, from 1; `None` when the recording holds no such run.
    ///
    /// # Errors
    /// [`ReplayError::Gap`] or [`ReplayError::Missing`] when the recording lacks what a step depended on, here and whenever
    /// another step is planned.
    pub(crate) fn of(window: &'a mut Window, run: u64) -> Result<Option<Self>, ReplayError> {
        let (state_sequence, update_sequence) = (0, 0);
        let mut steps = Self { window, run, next: None, n: 0, n_behind_end: 0, state_sequence, update_sequence };
        steps.plan()?;
        Ok(steps.next.is_some().then_some(steps))
    }

    /// Which model the next output rests on; messages of before version 3 do not say.
    pub(crate) fn model(&self) -> Option<ModelHash> {
        let hash = self.next.as_ref().map(|step| S::rests_on(&step.output).model_hash);
        hash.filter(|hash| *hash != 0).map(ModelHash)
    }

    /// Outputs at the end of the run that rest on what would come after the recording's end: they are no steps.
    pub(crate) fn n_behind_end(&self) -> u64 {
        self.n_behind_end
    }

    /// The next step; it stays the next until [`Steps::pop`].
    pub(crate) fn peek(&self) -> Option<&Step<S>> {
        self.next.as_ref()
    }

    /// Takes the next step.
    pub(crate) fn pop(&mut self) -> Result<Option<Step<S>>, ReplayError> {
        let step = self.next.take();
        self.plan()?;
        Ok(step)
    }

    fn plan(&mut self) -> Result<(), ReplayError> {
        let Queue(outputs) = S::outputs();
        let Some(output) = self.window.next(outputs, self.run)? else { return Ok(()) };
        check_next(&output, &mut self.n)?;
        match self.step(output) {
            Ok(step) => self.next = Some(step),
            Err(ReplayError::Missing { is_behind_end: true, .. }) => {
                self.n_behind_end = 1 + self.window.count_rest(outputs, self.run)?;
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn step(&mut self, output: S::Out) -> Result<Step<S>, ReplayError> {
        let RestsOn { taken_sequence, sent_ns, cue, .. } = S::rests_on(&output);
        let Queue(inputs) = S::inputs();
        let input = self.taken(inputs, taken_sequence, sent_ns)?;
        let named_state = cue.resolve_state_sequence.max(cue.compensate_state_sequence);
        let state = match named_state != self.state_sequence {
            true => Some(self.taken(|window| &mut window.states, named_state, sent_ns)?),
            false => None,
        };
        let update = match cue.model_update_sequence != self.update_sequence {
            true => Some(self.taken(|window| &mut window.updates, cue.model_update_sequence, sent_ns)?),
            false => None,
        };
        self.state_sequence = named_state;
        self.update_sequence = cue.model_update_sequence;
        Ok(Step { cue, input, state, update, output })
    }

    /// The message that a step names, with its run. What is older is never named again.
    fn taken<M: Message>(&mut self, of: Of<M>, sequence: u64, sent_ns: i64) -> Result<(u64, M), ReplayError> {
        let found = self.window.named(of, sequence, sent_ns)?;
        let Some((run, message)) = found else { return Err(self.window.missing(of, sequence)) };
        of(self.window).forget_before(run, sequence);
        Ok((run, message))
    }
}

/// Which model a command rests on; messages of before version 3 do not say.
pub(crate) fn model_of(command: &Command) -> Option<ModelHash> {
    (command.model_hash != 0).then_some(ModelHash(command.model_hash))
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
