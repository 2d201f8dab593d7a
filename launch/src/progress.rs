//! Progress on standard error while a chain runs: one line that is rewritten on a terminal, one line a few seconds elsewhere.

use crate::budget::BudgetWatch;
use crate::supervisor::Supervisor;
use core::time::Duration;
use krait_ipc::message::{Setpoint, Shape};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, clock};
use std::io::{IsTerminal, Write, stderr};
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the chain is looked at; a child that dies is noticed within this time.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// How often the line is rewritten on a terminal, ns.
const TERMINAL_PERIOD_NS: i64 = 200_000_000;
/// How often a line is written to a file or pipe, ns.
const FILE_PERIOD_NS: i64 = 5_000_000_000;

/// Shows what a running chain does.
pub struct Progress {
    label: String,
    seconds: Option<f64>,
    setpoints: Reader<Setpoint>,
    shapes: Reader<Shape>,
    setpoint: Option<Setpoint>,
    shape: Option<Shape>,
    is_terminal: bool,
    due_ns: i64,
}

impl Progress {
    /// Looks at the channels of a chain that has just started; with `seconds`, the chain ends after that time.
    ///
    /// # Errors
    /// One sentence when a channel cannot be read.
    pub fn new(label: &str, bus: &Bus, seconds: Option<f64>) -> anyhow::Result<Self> {
        Ok(Self {
            label: label.to_owned(),
            seconds,
            setpoints: bus.reader(ReadOptions::glancing())?,
            shapes: bus.reader(ReadOptions::glancing())?,
            setpoint: None,
            shape: None,
            is_terminal: stderr().is_terminal(),
            due_ns: i64::MIN,
        })
    }

    /// Shows the chain until its time is up (true) or a stop is asked for (false).
    ///
    /// # Errors
    /// One sentence that names the process that died.
    pub fn show(mut self, supervisor: &mut Supervisor, stop: &AtomicBool) -> anyhow::Result<bool> {
        let start_ns = clock::monotonic_ns();
        let finished = loop {
            supervisor.look()?;
            self.setpoint = self.setpoints.take_newest()?.map(|s| *s).or(self.setpoint);
            self.shape = self.shapes.take_newest()?.map(|s| *s).or(self.shape);
            let now_ns = clock::monotonic_ns();
            let elapsed_s = (now_ns - start_ns) as f64 * 1e-9;
            if now_ns >= self.due_ns {
                self.due_ns = now_ns + if self.is_terminal { TERMINAL_PERIOD_NS } else { FILE_PERIOD_NS };
                self.write_line(elapsed_s, supervisor.budget().map_or(0, BudgetWatch::n_late), has_changed(supervisor));
            }
            if self.seconds.is_some_and(|seconds| elapsed_s >= seconds) {
                break true;
            }
            if stop.load(Ordering::Relaxed) {
                break false;
            }
            std::thread::sleep(LOOK_EVERY);
        };
        if self.is_terminal {
            write_out("\r\x1b[K");
        }
        Ok(finished)
    }

    fn write_line(&self, elapsed_s: f64, n_late: u64, has_changed: bool) {
        let time = match self.seconds {
            Some(seconds) => format!("{elapsed_s:5.1} of {seconds:.0} s"),
            None => format!("{elapsed_s:6.1} s"),
        };
        let bend = |bend: Option<[f64; 2]>| match bend {
            Some([x, y]) => format!("{:5.1}", x.hypot(y).to_degrees()),
            None => "    -".to_owned(),
        };
        let commanded = bend(self.setpoint.map(|s| s.bend_rad));
        let reached = bend(self.shape.map(|s| s.bend_rad));
        let mut line = format!("{}: {time}  bend {commanded} deg commanded, {reached} reached", self.label);
        if n_late > 0 {
            line = format!("{line}, {n_late} late");
        }
        if has_changed {
            line = format!("{line}  ({})", Reason::ModelChanged.sentence());
        }
        if let Some(reason) = self.setpoint.and_then(|s| most_telling(Reasons::from_bits(s.reasons))) {
            line = format!("{line}  ({})", reason.sentence());
        }
        write_out(&if self.is_terminal { format!("\r\x1b[K{line}") } else { format!("{line}\n") });
    }
}

fn has_changed(supervisor: &Supervisor) -> bool {
    let estimate = supervisor.health(Process::Estimate);
    estimate.is_some_and(|health| Reasons::from_bits(health.reasons_now).contains(Reason::ModelChanged))
}

fn most_telling(reasons: Reasons) -> Option<Reason> {
    reasons.iter().next()
}

/// Progress is a courtesy: a closed standard error must not end a chain.
fn write_out(text: &str) {
    let mut out = stderr().lock();
    if out.write_all(text.as_bytes()).and_then(|()| out.flush()).is_err() {
        tracing::debug!("standard error is closed");
    }
}
