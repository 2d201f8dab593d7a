//! What a run leaves behind to be judged: the recording, the processes, and each process's own counts at its end.

use crate::budget::{BudgetReport, BudgetWatch};
use crate::in_force::{ModelInForce, lanes_of};
use crate::supervisor::Supervisor;
use anyhow::Context;
use core::ops::Range;
use krait_ipc::{Process, Reason, Reasons};
use krait_record::Recording;
use krait_report::{LatencyLog, LatencyReport, PassLog, PassReport};
use krait_schema::Sample;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The figures of a run, in the shape of `--json`.
#[derive(Debug, Serialize)]
pub struct Figures {
    /// Every process that took part.
    pub processes: Vec<ProcessFigure>,
    /// One entry per pass.
    pub passes: Vec<PassReport>,
    /// Latency over all passes, microseconds.
    pub latency_us: LatencyReport,
    /// Latency against the budget, as watched while the chain ran.
    pub budget: Option<BudgetReport>,
    /// Samples over all passes.
    pub samples: SampleFigures,
    /// The recording.
    pub recording: PathBuf,
    /// Whether the recording holds the run to its end; it does not if the disk was full.
    pub recording_is_whole: bool,
}

/// A process that took part.
#[derive(Clone, Debug, Serialize)]
pub struct ProcessFigure {
    /// Which.
    pub name: Process,
    /// Process id.
    pub pid: u32,
    /// The pass it was part of.
    pub pass: String,
}

/// Samples on their way from the operator to the drives.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct SampleFigures {
    /// Operator inputs sent by the master.
    pub sent: u64,
    /// Commands that reached the drives' process.
    pub received: u64,
    /// Messages missing anywhere: between any two processes, or in the recording.
    pub lost: u64,
}

impl SampleFigures {
    /// The counts of a chain that has ended, by the last health of each process.
    pub fn of(supervisor: &Supervisor) -> Self {
        let sent = supervisor.health(Process::Master).map_or(0, |health| health.n_sent);
        let received = supervisor.newest_state().map_or(0, |state| state.n_commands);
        let gaps: u64 = [Process::Resolve, Process::Compensate, Process::Estimate, Process::Slave]
            .into_iter()
            .filter_map(|process| supervisor.health(process))
            .map(|health| health.n_lost)
            .sum();
        // What the operator's side sent while the stages were exchanged was for nobody.
        let unanswered = if supervisor.exchanged().is_some() { 0 } else { sent.saturating_sub(received) };
        Self { sent, received, lost: gaps.max(unanswered) }
    }
}

/// Collected while a run goes on.
#[derive(Debug, Default)]
pub struct Evidence {
    processes: Vec<ProcessFigure>,
    passes: Vec<(ModelInForce, Range<i64>)>,
    samples: SampleFigures,
    budget: Option<BudgetReport>,
    recording_stopped: bool,
}

impl Evidence {
    /// Notes who takes part in a pass; who was there before is not noted again.
    pub fn processes(&mut self, pass: &str, processes: &[(Process, u32)]) {
        for (name, pid) in processes {
            if !self.processes.iter().any(|known| known.pid == *pid) {
                self.processes.push(ProcessFigure { name: *name, pid: *pid, pass: pass.to_owned() });
            }
        }
    }

    /// Notes a pass that has ended, with its window of CLOCK_MONOTONIC and the counts of its processes.
    pub fn pass(&mut self, model: ModelInForce, window_ns: Range<i64>, supervisor: &Supervisor) {
        self.passes.push((model, window_ns));
        let counts = SampleFigures::of(supervisor);
        self.samples.sent += counts.sent;
        self.samples.received += counts.received;
        self.samples.lost += counts.lost;
        self.budget = supervisor.budget().map(BudgetWatch::report);
    }

    /// Latency against the budget.
    pub fn budget(&self) -> Option<&BudgetReport> {
        self.budget.as_ref()
    }

    /// Notes how the recorder fared, after it has ended.
    pub fn recorder(&mut self, supervisor: &Supervisor) {
        let ever =
            supervisor.health(Process::Record).map_or(Reasons::NONE, |health| Reasons::from_bits(health.reasons_ever));
        self.recording_stopped = ever.contains(Reason::RecordingStopped);
    }

    /// Reads the recording back and computes everything from it.
    ///
    /// # Errors
    /// One sentence when the recording cannot be read.
    pub fn figures(&self, path: &Path) -> anyhow::Result<Figures> {
        let parts = Recording::open_parts(path)?;
        let recorded: Vec<_> = parts.iter().map(Recording::samples).collect::<Result<_, _>>()?;
        let mut logs: Vec<PassLog> = self.passes.iter().map(|_| PassLog::default()).collect();
        let mut latency = LatencyLog::new()?;
        let mut n_missing_in_recording = 0;
        for recorded in recorded.into_iter().flatten() {
            let sample = recorded.with_context(|| format!("recording {}", path.display()))?.sample;
            if let Sample::Recorder(status) = &sample {
                n_missing_in_recording = status.total().n_dropped + status.total().n_lost;
            }
            let pass = self.passes.iter().position(|(_, window_ns)| window_ns.contains(&sample.sample_ns()));
            let Some(log) = pass.and_then(|idx| logs.get_mut(idx)) else { continue };
            match &sample {
                Sample::Setpoint(setpoint) => log.setpoint(setpoint),
                Sample::Shape(shape) => log.shape(shape),
                Sample::ModelUpdate(update) => log.update(update),
                Sample::State(state) => {
                    latency.state(state);
                }
                _ => {}
            }
        }
        let passes = logs
            .iter()
            .zip(&self.passes)
            .map(|(log, (model, _))| log.report(model.label, model.machine.learnt(), lanes_of(&model.machine)))
            .collect();
        let samples = SampleFigures { lost: self.samples.lost + n_missing_in_recording, ..self.samples };
        Ok(Figures {
            processes: self.processes.clone(),
            passes,
            latency_us: latency.report(),
            budget: self.budget.clone(),
            samples,
            recording: path.to_owned(),
            recording_is_whole: !self.recording_stopped && parts.iter().all(|part| part.contents().missing.is_empty()),
        })
    }
}
