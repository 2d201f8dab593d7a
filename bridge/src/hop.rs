//! What the messages of a hop say to the stage between them, whatever machine it is for.

use krait_ipc::Reasons;
use krait_ipc::message::{Command, Cue, Message, OperatorInput, Setpoint};

/// What wakes a stage.
pub(crate) trait Arriving: Message {
    /// The operator input that it rests on, by which its cue is found.
    fn input_sequence(&self) -> u64;
    /// The same as if it came at another instant.
    fn at(&self, sample_ns: i64) -> Self;
}

/// What a stage publishes.
pub(crate) trait Departing: Message {
    /// What a cue says to the stage that makes it.
    fn moment(cue: &Cue) -> Moment;
    /// The stamp of its publishing, so that the loop can enter it.
    fn sent_stamp(&mut self) -> &mut i64;
    /// The reasons that it carries.
    fn reasons(&self) -> Reasons;
}

/// What a cue says to one stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    /// What counts as now, ns; 0: the sample is left out.
    pub begun_ns: i64,
    /// What counts as the instant of publishing, ns.
    pub sent_ns: i64,
    /// The newest slave state to know; 0: none.
    pub state_sequence: u64,
    /// The newest model update to know; 0: none.
    pub update_sequence: u64,
}

impl Arriving for OperatorInput {
    fn input_sequence(&self) -> u64 {
        self.sequence
    }

    fn at(&self, sample_ns: i64) -> Self {
        Self { sample_ns, ..*self }
    }
}

impl Arriving for Setpoint {
    fn input_sequence(&self) -> u64 {
        self.input_sequence
    }

    fn at(&self, sample_ns: i64) -> Self {
        Self { sample_ns, ..*self }
    }
}

impl Departing for Setpoint {
    fn moment(cue: &Cue) -> Moment {
        Moment {
            begun_ns: cue.resolve_begun_ns,
            sent_ns: cue.setpoint_sent_ns,
            state_sequence: cue.resolve_state_sequence,
            update_sequence: 0,
        }
    }

    fn sent_stamp(&mut self) -> &mut i64 {
        &mut self.stamps.setpoint_sent_ns
    }

    fn reasons(&self) -> Reasons {
        Reasons::from_bits(self.reasons)
    }
}

impl Departing for Command {
    fn moment(cue: &Cue) -> Moment {
        Moment {
            begun_ns: cue.compensate_begun_ns,
            sent_ns: cue.command_sent_ns,
            state_sequence: cue.compensate_state_sequence,
            update_sequence: cue.model_update_sequence,
        }
    }

    fn sent_stamp(&mut self) -> &mut i64 {
        &mut self.stamps.command_sent_ns
    }

    fn reasons(&self) -> Reasons {
        Reasons::from_bits(self.reasons)
    }
}
