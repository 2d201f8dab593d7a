//! Which chains ran in a recording, and which of their processes were started again while the others ran on.
//!
//! A process that starts counts from 1, so each run of it begins with a message of number 1. Runs that overlap in time are of
//! one chain, a *pass*; all but the first of a process in a pass are restarts.

use crate::ReplayError;
use krait_ipc::Process;
use krait_ipc::message::Message;
use krait_record::Stream;
use krait_schema::{Channel, Sample};
use serde::Serialize;
use std::path::Path;

/// One channel of each process that a chain consists of.
const OF_PROCESSES: [Channel; 5] =
    [Channel::Input, Channel::Setpoint, Channel::Command, Channel::State, Channel::ModelUpdate];

/// What a recording holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Chains that ran one after the other.
    pub n_passes: u64,
    /// Processes that were started again.
    pub restarts: Vec<Restart>,
    /// From the first to the last setpoint, summed over all runs, s.
    pub recorded_s: f64,
}

/// A process that was started again while the others ran on: its numbers and its memory begin anew.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Restart {
    /// Which process.
    pub process: Process,
    /// The pass, from 1.
    pub pass: u64,
    /// When its first message of the new run was sampled, s after the first sample of the pass.
    pub at_s: f64,
    /// Messages that the run before holds.
    pub n_before: u64,
}

/// What one process published between its start and its end.
#[derive(Clone, Copy, Debug)]
struct Run {
    process: Process,
    first_ns: i64,
    last_ns: i64,
    n: u64,
}

impl Survey {
    /// Reads a recording and all its parts once.
    ///
    /// # Errors
    /// [`ReplayError::Read`] when it cannot be read.
    pub fn of(path: &Path) -> Result<Self, ReplayError> {
        let mut runs: Vec<Run> = Vec::new();
        for recorded in Stream::open(path, &OF_PROCESSES)? {
            match recorded?.sample {
                Sample::Input(m) => note(&mut runs, Process::Master, &m),
                Sample::Setpoint(m) => note(&mut runs, Process::Resolve, &m),
                Sample::Command(m) => note(&mut runs, Process::Compensate, &m),
                Sample::State(m) => note(&mut runs, Process::Slave, &m),
                Sample::ModelUpdate(m) => note(&mut runs, Process::Estimate, &m),
                _ => {}
            }
        }
        Ok(Self::of_runs(runs))
    }

    fn of_runs(mut runs: Vec<Run>) -> Self {
        runs.sort_by_key(|run| run.first_ns);
        let mut survey = Self::default();
        let (mut pass_first_ns, mut pass_last_ns) = (0, i64::MIN);
        let mut before: Vec<Run> = Vec::new();
        for run in runs {
            if run.first_ns > pass_last_ns {
                survey.n_passes += 1;
                pass_first_ns = run.first_ns;
                before.clear();
            }
            pass_last_ns = pass_last_ns.max(run.last_ns);
            if let Some(before) = before.iter().rev().find(|before| before.process == run.process) {
                let (pass, at_s) = (survey.n_passes, seconds(pass_first_ns, run.first_ns));
                survey.restarts.push(Restart { process: run.process, pass, at_s, n_before: before.n });
            }
            if run.process == Process::Resolve {
                survey.recorded_s += seconds(run.first_ns, run.last_ns);
            }
            before.push(run);
        }
        survey
    }
}

fn note(runs: &mut Vec<Run>, process: Process, message: &impl Message) {
    let ns = message.sample_ns();
    match runs.iter_mut().rev().find(|run| run.process == process) {
        Some(run) if message.sequence() != 1 => {
            (run.last_ns, run.n) = (run.last_ns.max(ns), run.n + 1);
        }
        _ => runs.push(Run { process, first_ns: ns, last_ns: ns, n: 1 }),
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(process: Process, first_s: i64, last_s: i64) -> Run {
        Run { process, first_ns: first_s * 1_000_000_000, last_ns: last_s * 1_000_000_000, n: 7 }
    }

    #[test]
    fn a_chain_after_another_is_a_pass_and_a_process_that_comes_back_a_restart() {
        use Process::{Compensate, Resolve, Slave};
        let first = [run(Slave, 0, 9), run(Compensate, 1, 8), run(Resolve, 2, 7)];
        let second = [
            run(Slave, 20, 40),
            run(Compensate, 21, 38),
            run(Resolve, 22, 25),
            run(Resolve, 27, 32),
            run(Resolve, 35, 37),
        ];
        let survey = Survey::of_runs([first.as_slice(), &second].concat());
        let restart = |at_s| Restart { process: Resolve, pass: 2, at_s, n_before: 7 };
        assert_eq!(survey.restarts, [restart(7.0), restart(15.0)]);
        assert_eq!((survey.n_passes, survey.recorded_s), (2, 5.0 + 3.0 + 5.0 + 2.0));
    }
}
