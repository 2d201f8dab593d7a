//! Progress on standard error while a chain runs: one line that is rewritten on a terminal, one line a few seconds elsewhere.
//!
//! The line fits 80 columns, so that a terminal of the usual size can rewrite it: time, state, bend that was reached of the
//! bend that was asked for, how far the two are apart (root mean square of a second), bending plane, late and lost samples.
//! While nothing moves it says why instead.

use crate::budget::BudgetWatch;
use crate::log;
use crate::supervisor::Supervisor;
use core::time::Duration;
use krait_console::{LiveTracking, bend_deg, number, plane_deg};
use krait_ipc::message::{Phase, Setpoint, Shape};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, clock};
use std::io::{IsTerminal, stderr};
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the chain is looked at; a child that dies is noticed within this time.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// How often the line is rewritten on a terminal, ns.
const TERMINAL_PERIOD_NS: i64 = 200_000_000;
/// How often a line is written to a file or pipe, ns.
const FILE_PERIOD_NS: i64 = 5_000_000_000;

/// Columns of a terminal of the usual size.
const COLUMNS: usize = 80;

/// Shows what a running chain does.
pub struct Progress {
    seconds: Option<f64>,
    setpoints: Reader<Setpoint>,
    shapes: Reader<Shape>,
    setpoint: Option<Setpoint>,
    shape: Option<Shape>,
    tracking: LiveTracking,
    is_terminal: bool,
    due_ns: i64,
}

impl Progress {
    /// Looks at the channels of a chain that has just started, and says once which it is; with `seconds`, the chain ends after that time.
    ///
    /// # Errors
    /// One sentence when a channel cannot be read.
    pub fn new(label: &str, bus: &Bus, seconds: Option<f64>) -> anyhow::Result<Self> {
        log::say(&format!("{label}\n"));
        Ok(Self {
            seconds,
            setpoints: bus.reader(ReadOptions::glancing())?,
            shapes: bus.reader(ReadOptions::glancing())?,
            setpoint: None,
            shape: None,
            tracking: LiveTracking::default(),
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
            supervisor.exchange_if_asked(stop)?;
            self.take_messages()?;
            let now_ns = clock::monotonic_ns();
            let elapsed_s = (now_ns - start_ns) as f64 * 1e-9;
            if now_ns >= self.due_ns {
                self.due_ns = now_ns + if self.is_terminal { TERMINAL_PERIOD_NS } else { FILE_PERIOD_NS };
                let line = self.line(elapsed_s, now_ns, supervisor);
                log::say(&if self.is_terminal { format!("\r\x1b[K{line}") } else { format!("{line}\n") });
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
            log::say("\r\x1b[K");
        }
        Ok(finished)
    }

    fn take_messages(&mut self) -> anyhow::Result<()> {
        while let Some(setpoint) = self.setpoints.take()? {
            self.tracking.setpoint(setpoint.sample_ns, setpoint.bend_rad);
            self.setpoint = Some(*setpoint);
        }
        while let Some(shape) = self.shapes.take()? {
            self.tracking.shape(shape.sample_ns, shape.bend_rad);
            self.shape = Some(*shape);
        }
        Ok(())
    }

    fn line(&self, elapsed_s: f64, now_ns: i64, supervisor: &Supervisor) -> String {
        let time = match self.seconds {
            Some(seconds) => format!("{elapsed_s:.1} of {seconds:.0} s"),
            None => format!("{elapsed_s:.1} s"),
        };
        let follows = self.setpoint.and_then(|setpoint| setpoint.phase()) == Some(Phase::Following);
        let held = self.setpoint.and_then(|s| most_telling(Reasons::from_bits(s.reasons)));
        let what = match held {
            Some(reason) if !follows => format!("holding: {}", reason.sentence()),
            _ if has_changed(supervisor) => format!("following: {}", Reason::ModelChanged.sentence()),
            _ => self.figures(now_ns, supervisor),
        };
        format!("{time:>9}  {what}").chars().take(COLUMNS - 1).collect()
    }

    fn figures(&self, now_ns: i64, supervisor: &Supervisor) -> String {
        let reached = self.shape.map(|shape| shape.bend_rad);
        let n_lost: u64 = Process::ALL.iter().filter_map(|p| supervisor.health(*p)).map(|health| health.n_lost).sum();
        format!(
            "following  bend {} of {} deg, off {}, plane {}, {} late, {n_lost} lost",
            number(reached.map(bend_deg), 1),
            number(self.setpoint.map(|s| bend_deg(s.bend_rad)), 1),
            number(self.tracking.rms_rad(now_ns).map(f64::to_degrees), 2),
            number(reached.and_then(plane_deg), 0),
            supervisor.budget().map_or(0, BudgetWatch::n_late),
        )
    }
}

fn has_changed(supervisor: &Supervisor) -> bool {
    let estimate = supervisor.health(Process::Estimate);
    estimate.is_some_and(|health| Reasons::from_bits(health.reasons_now).contains(Reason::ModelChanged))
}

fn most_telling(reasons: Reasons) -> Option<Reason> {
    reasons.iter().next()
}
