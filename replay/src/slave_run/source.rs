//! What a slave's run rests on, read from a recording some seconds ahead of the state that is next: an hour takes no more memory than a
//! minute.

use crate::ReplayError;
use krait_ipc::message::{Command, DriveCycle, SlaveState, StateCommand};
use krait_record::{PassCounter, Stream};
use krait_schema::{Channel, Sample};
use std::collections::VecDeque;
use std::path::Path;

/// What a slave's run rests on.
const CHANNELS: [Channel; 4] = [Channel::Command, Channel::State, Channel::StateCommand, Channel::DriveCycle];
/// The recorder takes the channels in turn: what belongs to a state is read so long after it, ns.
const AHEAD_NS: i64 = 3_000_000_000;
/// Latest instant, ns: 146 years.
const MAX_NS: i64 = i64::MAX / 2;

/// The recorded messages, read some seconds ahead of the state that is next.
pub(super) struct Source {
    stream: Stream,
    pass: u64,
    counters: [PassCounter; 2],
    newest_ns: i64,
    has_ended: bool,
    states: VecDeque<SlaveState>,
    pub(super) commands: VecDeque<Command>,
    state_commands: VecDeque<StateCommand>,
    pub(super) cycles: Vec<DriveCycle>,
}

impl Source {
    pub(super) fn open(path: &Path, pass: u64) -> Result<Self, ReplayError> {
        Ok(Self {
            stream: Stream::open(path, &CHANNELS)?,
            pass,
            counters: Default::default(),
            newest_ns: i64::MIN,
            has_ended: false,
            states: VecDeque::new(),
            commands: VecDeque::new(),
            state_commands: VecDeque::new(),
            cycles: Vec::new(),
        })
    }

    fn read(&mut self) -> Result<(), ReplayError> {
        let Some(recorded) = self.stream.next() else {
            self.has_ended = true;
            return Ok(());
        };
        let sample = recorded?.sample;
        if !is_plausible(&sample) {
            return Ok(());
        }
        self.newest_ns = self.newest_ns.max(sample.sample_ns());
        match sample {
            Sample::Command(command) => self.commands.push_back(command),
            Sample::StateCommand(command) => self.state_commands.push_back(command),
            Sample::State(state) if self.counters[0].of(state.sequence) == self.pass => self.states.push_back(state),
            Sample::DriveCycle(cycle) if self.counters[1].of(cycle.sequence) == self.pass => self.cycles.push(*cycle),
            _ => {}
        }
        // Commands of passes before, or of before the slave.
        if self.states.is_empty() {
            let oldest_ns = self.newest_ns.saturating_sub(2 * AHEAD_NS);
            while self.commands.front().is_some_and(|command| command.sample_ns < oldest_ns) {
                self.commands.pop_front();
            }
        }
        Ok(())
    }

    /// What was seen when the bus was opened.
    pub(super) fn opening(&mut self) -> Result<DriveCycle, ReplayError> {
        while self.cycles.is_empty() && !self.has_ended {
            self.read()?;
        }
        if self.cycles.is_empty() {
            let [PassCounter { newest: n_states }, PassCounter { newest: n_passes }] = self.counters;
            let is_other_pass = n_passes > 0 && n_states.max(n_passes) < self.pass;
            let (pass, n_passes) = (self.pass, n_states.max(n_passes));
            return Err(if is_other_pass { ReplayError::NoPass { pass, n_passes } } else { ReplayError::NoCycles });
        }
        let opened = self.cycles.remove(0);
        if opened.cycle == 0 { Ok(opened) } else { Err(ReplayError::NoOpening { found: opened.cycle }) }
    }

    /// The next state of the pass, when all that it rests on has been read; `None` at the end.
    pub(super) fn next_state(&mut self) -> Result<Option<SlaveState>, ReplayError> {
        let is_due = |source: &Self| {
            let next = source.states.front();
            next.is_some_and(|state| source.newest_ns >= state.sample_ns.saturating_add(AHEAD_NS))
        };
        while !self.has_ended && !is_due(self) {
            self.read()?;
        }
        Ok(self.states.pop_front())
    }

    /// The command of a number that was there at an instant; those before it are done with.
    pub(super) fn command(&mut self, sequence: u64, by_ns: i64) -> Option<Command> {
        let is_it = |command: &Command| command.sequence == sequence && command.sample_ns <= by_ns;
        let place = self.commands.iter().rposition(is_it)?;
        self.commands.drain(..place);
        self.commands.pop_front()
    }

    /// The command behind the one before, or the newest that was there, where there was none before.
    pub(super) fn next_command(&mut self, is_first: bool, by_ns: i64) -> Option<Command> {
        let was_there = |command: &Command| command.stamps.command_sent_ns <= by_ns;
        if is_first {
            let place = self.commands.iter().rposition(was_there)?;
            self.commands.drain(..place);
        }
        self.commands.front().is_some_and(was_there).then(|| self.commands.pop_front()).flatten()
    }

    pub(super) fn state_command(&self, sequence: u64, by_ns: i64) -> Option<StateCommand> {
        let is_it = |command: &&StateCommand| command.sequence == sequence && command.sample_ns <= by_ns;
        self.state_commands.iter().rev().find(is_it).copied()
    }
}

/// Whether all its instants are some that a clock says: no sum of them overflows.
fn is_plausible(sample: &Sample) -> bool {
    let of = |instants: &[i64]| instants.iter().all(|ns| (0..=MAX_NS).contains(ns));
    match sample {
        Sample::Command(command) => of(&[command.sample_ns, command.stamps.command_sent_ns]),
        Sample::State(state) => of(&[state.sample_ns, state.setpoint_ns, state.stamps.slave_begun_ns]),
        Sample::DriveCycle(cycle) => of(&[cycle.sample_ns, cycle.answered_ns, cycle.wish_ns]),
        other => of(&[other.sample_ns()]),
    }
}
