//! Progress on standard error while a chain runs: one line that is rewritten on a terminal, one line a few seconds elsewhere.
//!
//! The line fits 80 columns, so that a terminal of the usual size can rewrite it: time, state, bend that was reached of the
//! bend that was asked for, how far the two are apart (root mean square of a second), bending plane, late and lost samples;
//! of joints or segments the one that is farthest off. While nothing moves it says why instead. A mark stands above it as a line that stays.

use crate::budget::BudgetWatch;
use crate::log;
use crate::supervisor::Supervisor;
use core::time::Duration;
use krait_console::{LiveTracking, bend_deg, number, plane_deg};
use krait_ipc::message::{JointValues, Marker, Phase, Setpoint, Shape};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, clock};
use krait_report::{Lanes, joint_unit};
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
    slides: bool,
    setpoints: Reader<Setpoint>,
    shapes: Reader<Shape>,
    marks: Reader<Marker>,
    setpoint: Option<Setpoint>,
    shape: Option<Shape>,
    tracking: LiveTracking,
    is_terminal: bool,
    due_ns: i64,
}

impl Progress {
    /// Looks at the channels of a chain that has just started, and says once which it is; with `seconds`, the chain ends after
    /// that time. `slides`: its joints' positions are lengths.
    ///
    /// # Errors
    /// One sentence when a channel cannot be read.
    pub fn new(label: &str, bus: &Bus, seconds: Option<f64>, slides: bool) -> anyhow::Result<Self> {
        log::say(&format!("{label}\n"));
        Ok(Self {
            seconds,
            slides,
            setpoints: bus.reader(ReadOptions::glancing())?,
            shapes: bus.reader(ReadOptions::glancing())?,
            marks: bus.reader_on(Marker::RECORDED_CHANNEL, ReadOptions::glancing())?,
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
            while let Some(mark) = self.marks.take()? {
                // What the recorder took before this chain is another's.
                if mark.sample_ns >= start_ns {
                    let line = mark_line(&mark, start_ns);
                    log::say(&if self.is_terminal { format!("\r\x1b[K{line}\n") } else { format!("{line}\n") });
                }
            }
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
            self.tracking.setpoint(&setpoint);
            self.setpoint = Some(*setpoint);
        }
        while let Some(shape) = self.shapes.take()? {
            self.tracking.shape(&shape);
            self.shape = Some(*shape);
        }
        Ok(())
    }

    fn line(&self, elapsed_s: f64, now_ns: i64, supervisor: &Supervisor) -> String {
        // Tenths of a second only while there is room for them.
        let elapsed = if elapsed_s < 100.0 { format!("{elapsed_s:.1}") } else { format!("{elapsed_s:.0}") };
        let time = match self.seconds {
            Some(seconds) => format!("{elapsed} of {seconds:.0} s"),
            None => format!("{elapsed} s"),
        };
        let follows = self.setpoint.and_then(|setpoint| setpoint.phase()) == Some(Phase::Following);
        let held = self.setpoint.and_then(|s| most_telling(Reasons::from_bits(s.reasons)));
        let what = match held {
            Some(reason) if !follows => format!("holding: {}", reason.sentence()),
            _ if has_changed(supervisor) => format!("following: {}", Reason::ModelChanged.sentence()),
            _ => {
                let n_late = supervisor.budget().map_or(0, BudgetWatch::n_late);
                let healths = Process::ALL.iter().filter_map(|process| supervisor.health(*process));
                let n_lost: u64 = healths.map(|health| health.n_lost).sum();
                format!("following  {}, {n_late} late, {n_lost} lost", self.figures(now_ns))
            }
        };
        format!("{time:>7}  {what}").chars().take(COLUMNS - 1).collect()
    }

    fn figures(&self, now_ns: i64) -> String {
        let Some(setpoint) = self.setpoint else { return "nothing is asked for".to_owned() };
        if setpoint.n_segments() > 0 {
            return self.segment_figures(&setpoint, now_ns);
        }
        if setpoint.n_joints > 0 {
            return self.joint_figures(&setpoint, now_ns);
        }
        let reached = self.shape.and_then(|shape| shape.valid_bend_rad());
        format!(
            "{} of {} deg, off {}, plane {}",
            number(reached.map(bend_deg), 1),
            number(Some(bend_deg(setpoint.bend_rad)), 1),
            number(self.tracking.rms(now_ns).map(f64::to_degrees), 2),
            number(reached.and_then(plane_deg), 0),
        )
    }

    /// The segment that is farthest off: its bend and the one that it shall have.
    fn segment_figures(&self, setpoint: &Setpoint, now_ns: i64) -> String {
        let of_each = |values: &JointValues| Lanes::Segments.each_of(values).map(f64::to_degrees);
        let errors = self.tracking.rms_of_each(now_ns).map(|errors| of_each(&errors)).unwrap_or_default();
        let worst = (0..setpoint.n_segments()).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        let reached = self.shape.filter(|shape| shape.valid_joints_rad().is_some());
        format!(
            "segment {} {} of {} deg, off {}",
            worst + 1,
            number(reached.map(|shape| of_each(&shape.joints_rad)[worst]), 1),
            number(Some(of_each(&setpoint.joints_rad)[worst]), 1),
            number(self.tracking.rms(now_ns).map(f64::to_degrees), 2),
        )
    }

    /// The joint that is farthest off: where it is and where it shall be.
    fn joint_figures(&self, setpoint: &Setpoint, now_ns: i64) -> String {
        let errors = self.tracking.rms_of_each(now_ns).unwrap_or_default();
        let worst = (0..setpoint.n_joints as usize).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        let (unit, per_si) = joint_unit(self.slides);
        let reached =
            self.shape.as_ref().and_then(Shape::valid_joints_rad).and_then(|joints| joints.get(worst).copied());
        format!(
            "joint {} {} of {} {unit}, off {}",
            worst + 1,
            number(reached.map(|value| value * per_si), 2),
            number(Some(setpoint.joints_rad[worst] * per_si), 2),
            number(self.tracking.rms(now_ns).map(|value| value * per_si), 3),
        )
    }
}

/// A mark that the recorder has taken, with the time since the chain's start.
fn mark_line(mark: &Marker, start_ns: i64) -> String {
    let time = format!("{:.1} s", (mark.sample_ns - start_ns) as f64 * 1e-9);
    let line = format!("{time:>7}  mark: {}", mark.text().unwrap_or("(no text)"));
    line.chars().take(COLUMNS - 1).collect()
}

fn has_changed(supervisor: &Supervisor) -> bool {
    let estimate = supervisor.health(Process::Estimate);
    estimate.is_some_and(|health| Reasons::from_bits(health.reasons_now).contains(Reason::ModelChanged))
}

fn most_telling(reasons: Reasons) -> Option<Reason> {
    reasons.iter().next()
}
