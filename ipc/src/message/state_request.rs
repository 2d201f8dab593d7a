//! How anybody of the same user asks for another operating state: the supervisor decides, commands the slave, and answers.

use super::{Transition, message};
use iceoryx2::prelude::ZeroCopySend;

/// Processes that may ask at the same time.
const MAX_ASKING: usize = 8;

/// A request to the supervisor, which alone may command the slave. Whoever wants a stop needs no permission:
/// [`crate::StopSwitch`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.StateRequest")]
pub struct StateRequest {
    /// Position among the requests of this sender, from 1.
    pub sequence: u64,
    /// When it was asked for, CLOCK_MONOTONIC, nanoseconds. With `sender_pid` it names the request.
    pub sample_ns: i64,
    /// See [`Transition`].
    pub transition: u32,
    /// Process id of the sender.
    pub sender_pid: u32,
}

message!(StateRequest, "state_request", 1, super::RARE, MAX_ASKING);

impl StateRequest {
    /// A request of this process.
    pub fn new(sequence: u64, sample_ns: i64, transition: Transition) -> Self {
        Self { sequence, sample_ns, transition: transition as u32, sender_pid: std::process::id() }
    }

    /// The typed transition, or `None` for a value that no version of krait sends.
    pub fn transition(&self) -> Option<Transition> {
        Transition::ALL.into_iter().find(|t| *t as u32 == self.transition)
    }
}

/// What became of a request; published by the supervisor.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.StateAnswer")]
pub struct StateAnswer {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// `sample_ns` of the request.
    pub sample_ns: i64,
    /// `sender_pid` of the request.
    pub sender_pid: u32,
    /// See [`RequestOutcome`].
    pub outcome: u32,
    /// The slave's operating state then, see [`super::OperatingState`].
    pub operating_state: u32,
    /// The slave's flags then, as in [`super::SlaveState`], and [`StateAnswer::LETTING_GO`].
    pub flags: u32,
}

message!(StateAnswer, "state_answer", 1, super::RARE);

impl StateAnswer {
    /// Power was asked off and goes as soon as the actuators are at rest, see [`super::SlaveState::is_letting_go`].
    pub const LETTING_GO: u32 = 1 << 31;

    /// Whether this is the answer to a request.
    pub fn is_to(&self, request: &StateRequest) -> bool {
        (self.sender_pid, self.sample_ns) == (request.sender_pid, request.sample_ns)
    }

    /// The typed outcome, or `None` for a value that no version of krait sends.
    pub fn outcome(&self) -> Option<RequestOutcome> {
        [RequestOutcome::Done, RequestOutcome::Refused, RequestOutcome::NoSlave, RequestOutcome::TooLate]
            .into_iter()
            .find(|outcome| *outcome as u32 == self.outcome)
    }
}

/// What became of a request.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestOutcome {
    /// The slave has done it.
    Done = 0,
    /// It is not valid in the slave's state, and changed nothing.
    Refused = 1,
    /// The slave did not answer.
    NoSlave = 2,
    /// It was held up for longer than [`Transition::EXPIRES_NS`], and changed nothing.
    TooLate = 3,
}
