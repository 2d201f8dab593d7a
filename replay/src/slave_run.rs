//! A slave's run on real drives again: its recorded commands, at their recorded instants, on drives made of the recorded cycles.
//!
//! Problem: what a slave does rests on its commands, on what its drives answered, and on when it looked at either.
//!
//! Intuition: it publishes a state after each step, and every state tells which step it was: a command more, a state command more, a
//! stop more, or a tick, and when the drives were written. So the states are the plan by which a slave is run again, alone, without a
//! process or a clock.
//!
//! Whether a failure of the drives that came within some milliseconds was seen in a step is told by the state, too.
//!
//! Failure: the instant of a tick that wrote nothing is known to some microseconds only, as is whether an answer that came at that very
//! moment was seen. What comes out otherwise is counted, not hidden.

mod source;

use crate::ReplayError;
use krait_drives::{BusSetup, RecordedDrive, Repeated};
use krait_ipc::message::{Message, OperatingState, SlaveState, Transition};
use krait_slave::{SlaveConfig, SlaveCore};
use source::Source;
use std::path::Path;

/// Ticks that switching or homing may take more than the recorded states show.
const MORE_TICKS: u32 = 4;

/// How a repeated run compares.
#[derive(Clone, Debug, Default)]
pub struct SlaveRun {
    /// The cycles of the bus.
    pub cycles: Repeated,
    /// Cycles that the slave did not fetch in time, as the recording says.
    pub n_left_out: u64,
    /// Steps of the slave.
    pub n_steps: u64,
    /// Steps after which the drives' setpoint was another.
    pub n_setpoints_differ: u64,
    /// Steps whose command or state command is not in the recording; they were passed over.
    pub n_without_cause: u64,
    /// From the first step to the last, s.
    pub recorded_s: f64,
}

impl SlaveRun {
    fn lacks(&mut self, n_steps: u64) {
        self.n_without_cause = self.n_without_cause.saturating_add(n_steps);
    }
}

/// Runs the slave of a pass, from 1, again.
///
/// # Errors
/// [`ReplayError::Read`] when the recording cannot be read, [`ReplayError::NoCycles`] and [`ReplayError::NoOpening`] when it does not
/// hold what the drives answered, [`ReplayError::OtherActuators`] when these are others than the configuration's.
pub fn repeat_slave(path: &Path, pass: u64, config: &SlaveConfig, setup: &BusSetup) -> Result<SlaveRun, ReplayError> {
    let mut source = Source::open(path, pass)?;
    let opened = source.opening()?;
    if opened.n_actuators as usize != config.drive.actuator.len() {
        let (found, expected) = (opened.n_actuators, config.drive.actuator.len());
        return Err(ReplayError::OtherActuators { found, expected });
    }
    let drive = RecordedDrive::new(setup.clone(), &opened);
    let mut slave = Slave {
        core: SlaveCore::new(drive, config),
        before: SlaveState::default(),
        newest_command: None,
        run: SlaveRun::default(),
    };
    let mut first_ns = None;
    while let Some(state) = source.next_state()? {
        for cycle in source.cycles.drain(..) {
            slave.run.n_left_out = cycle.n_left_out;
            slave.core.drive_mut().push(cycle);
        }
        slave.step(&state, &mut source);
        slave.run.recorded_s = state.sample_ns.saturating_sub(*first_ns.get_or_insert(state.sample_ns)) as f64 * 1e-9;
    }
    slave.run.cycles = slave.core.drive().repeated().clone();
    Ok(slave.run)
}

/// The slave that is run again.
struct Slave {
    core: SlaveCore<RecordedDrive>,
    /// The recorded state of the step before.
    before: SlaveState,
    newest_command: Option<u64>,
    run: SlaveRun,
}

impl Slave {
    /// The step that led to a recorded state, and the state that it leads to now.
    fn step(&mut self, state: &SlaveState, source: &mut Source) {
        self.run.n_steps += 1;
        let before = core::mem::replace(&mut self.before, *state);
        let is_executed = state.command_sequence != before.command_sequence;
        let has_written = state.setpoint_ns > before.sample_ns;
        let now_ns = match (is_executed, has_written) {
            (true, _) => state.stamps.slave_begun_ns,
            (false, true) => state.setpoint_ns,
            (false, false) => state.sample_ns,
        };
        // A command that was executed was written before a failure was seen.
        let has_failed = state.operating() == Some(OperatingState::Fault);
        let seen_until_ns = |is_seen: bool| if is_seen { state.sample_ns } else { i64::MIN };
        self.core.drive_mut().show_failures(seen_until_ns(has_failed && !is_executed));
        if state.n_stops != before.n_stops {
            self.core.stop(now_ns);
        }
        // More than were read have no cause, whatever number a file holds.
        let n_said = state.n_commands.saturating_sub(before.n_commands);
        let n_commands = n_said.min(source.commands.len() as u64 + 1);
        self.run.lacks(n_said - n_commands);
        let is_asked = state.state_command_sequence != before.state_command_sequence;
        if n_commands > 0 {
            self.go_on_being_busy(&before, state, now_ns);
            for k in 1..=n_commands {
                let executed = (is_executed && k == n_commands).then_some(state.command_sequence);
                self.take_command(executed, state.sample_ns, now_ns, source);
            }
        } else if is_asked {
            match source.state_command(state.state_command_sequence, state.sample_ns) {
                Some(command) => {
                    // What was refused then is refused now.
                    if let Err(refused) = self.core.on_state_command(&command, now_ns) {
                        tracing::debug!("{refused}");
                    }
                }
                None => self.run.lacks(1),
            }
        } else if ends_here(&before, state) {
            if let Err(refused) = self.core.transition(Transition::Disable, now_ns) {
                tracing::debug!("{refused}");
            }
        } else {
            self.core.on_tick(now_ns);
            self.become_ready(state, now_ns);
        }
        self.core.drive_mut().show_failures(seen_until_ns(has_failed));
        let again = self.core.report(state.sample_ns);
        let bits = |state: &SlaveState| state.setpoint_q_m.map(f64::to_bits);
        self.run.n_setpoints_differ += u64::from(bits(&again) != bits(state));
    }

    fn take_command(&mut self, executed: Option<u64>, by_ns: i64, now_ns: i64, source: &mut Source) {
        let is_first = self.newest_command.is_none();
        let command = match executed {
            Some(sequence) => source.command(sequence, by_ns),
            None => source.next_command(is_first, by_ns),
        };
        let Some(command) = command else {
            self.run.lacks(1);
            return;
        };
        if self.newest_command.is_none_or(|newest| command.sequence <= newest) {
            self.core.on_new_writer();
        }
        self.newest_command = Some(command.sequence());
        self.core.on_command(&command, now_ns);
    }

    /// While commands come, the ticks in which power comes and zero is found are in no state of their own.
    fn go_on_being_busy(&mut self, before: &SlaveState, state: &SlaveState, now_ns: i64) {
        if self.core.is_busy() {
            let is_still_busy = state.flags & SlaveState::IS_BUSY != 0;
            self.core.on_tick(if is_still_busy { before.sample_ns } else { now_ns });
            self.become_ready(state, now_ns);
        }
    }

    fn become_ready(&mut self, state: &SlaveState, now_ns: i64) {
        for _ in 0..MORE_TICKS {
            if !self.core.is_busy() || state.flags & SlaveState::IS_BUSY != 0 {
                break;
            }
            self.core.on_tick(now_ns);
        }
    }
}

/// Nobody asked: the slave itself ended. Where somebody had, and lines were relaxed first, the power went in a tick.
fn ends_here(before: &SlaveState, state: &SlaveState) -> bool {
    let was = before.operating();
    !before.is_letting_go()
        && state.operating() == Some(OperatingState::Disabled)
        && was.is_some_and(|was| was != OperatingState::Disabled)
}
