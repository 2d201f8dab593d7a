//! The one table of the processes of a chain: name, order of start and end, turn at the cores, what its loss means.

use serde::{Serialize, Serializer};

/// A process of a chain; each publishes its health.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Process {
    /// Reads the operator's device.
    Master,
    /// Turns the operator's motion into motion of the snake.
    Resolve,
    /// Turns the setpoint into actuator positions.
    Compensate,
    /// Updates parameters from the measured shape.
    Estimate,
    /// Writes to the drives.
    Slave,
    /// Writes every channel to a file.
    Record,
    /// Publishes the shapes of another program; joins a chain from outside.
    Shape,
}

/// What becomes of a live chain when a process ends or falls silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenLost {
    /// It is started again; the snake holds until it is engaged anew.
    HoldAndRestart,
    /// It is started again; the snake moves on.
    Restart,
    /// It is not started again; the snake moves on.
    GoOn,
}

/// What is fixed about a process.
struct Row {
    process: Process,
    name: &'static str,
    /// Its turn when the cores are given out; none: it is no part of the chain's latency and keeps out of the way.
    core_turn: Option<usize>,
    when_lost: WhenLost,
    /// What its loss means, for a person.
    loss: &'static str,
}

/// In the order of the chain, which is that of the enumeration.
const TABLE: [Row; 7] = [
    Row {
        process: Process::Master,
        name: "master",
        core_turn: Some(0),
        when_lost: WhenLost::HoldAndRestart,
        loss: "no operator is heard until it runs again",
    },
    Row {
        process: Process::Resolve,
        name: "resolve",
        core_turn: Some(1),
        when_lost: WhenLost::HoldAndRestart,
        loss: "the operator's motion leads nowhere until it runs again",
    },
    Row {
        process: Process::Compensate,
        name: "compensate",
        core_turn: Some(2),
        when_lost: WhenLost::HoldAndRestart,
        loss: "the drives are told nothing until it runs again",
    },
    Row {
        process: Process::Estimate,
        name: "estimate",
        core_turn: None,
        when_lost: WhenLost::Restart,
        loss: "the motion goes on with the parameters that were learnt; learning begins anew",
    },
    Row {
        process: Process::Slave,
        name: "slave",
        core_turn: Some(3),
        when_lost: WhenLost::HoldAndRestart,
        loss: "nobody commands the drives until it runs again",
    },
    Row {
        process: Process::Record,
        name: "record",
        core_turn: None,
        when_lost: WhenLost::GoOn,
        loss: "the motion is not affected; nothing more is recorded",
    },
    Row {
        process: Process::Shape,
        name: "shape",
        core_turn: None,
        when_lost: WhenLost::GoOn,
        loss: "the motion goes on with the parameters that were learnt; no shape is measured",
    },
];

impl Process {
    /// Every process, in the order of the chain; those that join from outside last.
    pub const ALL: [Self; 7] =
        [Self::Master, Self::Resolve, Self::Compensate, Self::Estimate, Self::Slave, Self::Record, Self::Shape];

    /// Start order: the recorder first, the operator last, so that everything listens before anything moves.
    pub const START_ORDER: [Self; 6] =
        [Self::Record, Self::Slave, Self::Estimate, Self::Compensate, Self::Resolve, Self::Master];

    /// End order: the operator first, so that every sample under way arrives; the recorder last, so that it takes every last message.
    pub const END_ORDER: [Self; 6] =
        [Self::Master, Self::Resolve, Self::Compensate, Self::Slave, Self::Estimate, Self::Record];

    /// The subcommand that runs the process, and the name under which it joins an instance and publishes its health.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The process of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        TABLE.iter().find(|row| row.name == name).map(|row| row.process)
    }

    /// Its turn when the cores are given out ([`crate::Realtime::apply`]); `None` for a process that no sample waits for.
    pub fn core_turn(self) -> Option<usize> {
        self.row().core_turn
    }

    /// What becomes of a live chain without it.
    pub fn when_lost(self) -> WhenLost {
        self.row().when_lost
    }

    /// What its loss means, in words.
    pub fn loss(self) -> &'static str {
        self.row().loss
    }

    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }
}

impl core::fmt::Display for Process {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Process {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_enumeration_and_every_order_has_every_process() {
        for (process, row) in Process::ALL.into_iter().zip(&TABLE) {
            assert_eq!(row.process, process);
            assert_eq!(Process::from_name(process.name()), Some(process));
            let is_started = process != Process::Shape;
            assert_eq!(Process::START_ORDER.contains(&process), is_started);
            assert_eq!(Process::END_ORDER.contains(&process), is_started);
        }
        assert_eq!(Process::from_name("launch"), None);
    }
}
