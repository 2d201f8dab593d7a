//! What one pass of a recording shows: tracking error, largest bend, what was learnt, what changed.
//!
//! Everything here is computed from the recording alone, so that anyone with the file gets the same figures.

use crate::tracking::{self, Seen, Tracking, TrackingScore, Wanted, length};
use krait_ipc::message::{Command, Compensation, ModelUpdate, Setpoint, Shape};
use krait_model::ChangeKind;
use serde::Serialize;

/// Largest bend commanded and reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PeakBend {
    /// Of the setpoint, deg.
    pub commanded: f64,
    /// Of the measured shape, deg.
    pub reached: f64,
}

/// What one pass showed.
#[derive(Clone, Debug, Serialize)]
pub struct PassReport {
    /// off, naive or estimated.
    pub compensation: &'static str,
    /// Tracking error.
    #[serde(flatten)]
    pub tracking: TrackingScore,
    /// Largest bend over the whole pass.
    pub peak_bend_deg: PeakBend,
    /// Load scale at the end of the pass.
    pub eta: f64,
    /// Backlash half-width at the end of the pass, mm.
    pub lambda_mm: f64,
    /// Whether the watch for changes had learnt what is normal before the pass ended.
    pub watched_for_changes: bool,
    /// Changes of the machine that were seen.
    pub changes: Vec<ChangeReport>,
}

/// A change that the estimator saw: the model no longer explained the measured shape as it did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChangeReport {
    /// Exposure of the shape that showed it, after the pass's first setpoint, s.
    pub at_s: f64,
    /// What it looks like.
    pub looks_like: &'static str,
}

/// One stretch of a recording in which one chain ran.
#[derive(Debug, Default)]
pub struct PassLog {
    setpoints: Vec<Wanted>,
    shapes: Vec<Seen>,
    last_command: Option<Command>,
    changes: Vec<(i64, u32)>,
    watched: bool,
}

impl PassLog {
    /// Takes a setpoint.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        self.setpoints.push(tracking::wanted(setpoint));
    }

    /// Takes a measured shape.
    pub fn shape(&mut self, shape: &Shape) {
        if shape.bend_rad.iter().all(|b| b.is_finite()) {
            self.shapes.push((shape.sample_ns, shape.bend_rad));
        }
    }

    /// Takes a command.
    pub fn command(&mut self, command: &Command) {
        self.last_command = Some(*command);
    }

    /// Takes a model update.
    pub fn update(&mut self, update: &ModelUpdate) {
        self.watched |= update.is_watching == 1;
        if update.changed_ns != 0 && self.changes.last().is_none_or(|(ns, _)| *ns != update.changed_ns) {
            self.changes.push((update.changed_ns, update.change_kind));
        }
    }

    fn change_reports(&self) -> Vec<ChangeReport> {
        let start_ns = self.setpoints.first().map_or(0, |(ns, ..)| *ns);
        let report = |&(ns, kind): &(i64, u32)| ChangeReport {
            at_s: (ns - start_ns) as f64 * 1e-9,
            looks_like: ChangeKind::from_number(kind)
                .map_or("of a kind that this program does not know", ChangeKind::sentence),
        };
        self.changes.iter().map(report).collect()
    }

    /// What the pass showed.
    pub fn report(&self, compensation: Compensation) -> PassReport {
        let peak = |bends: &mut dyn Iterator<Item = [f64; 2]>| bends.map(length).fold(0.0, f64::max).to_degrees();
        PassReport {
            compensation: compensation.name(),
            tracking: Tracking::of(self.setpoints.iter().copied(), self.shapes.iter().copied()).score(),
            peak_bend_deg: PeakBend {
                commanded: peak(&mut self.setpoints.iter().map(|(_, bend, _)| *bend)),
                reached: peak(&mut self.shapes.iter().map(|(_, bend)| *bend)),
            },
            eta: self.last_command.map_or(f64::NAN, |c| c.eta),
            lambda_mm: self.last_command.map_or(f64::NAN, |c| c.lambda_m * 1e3),
            watched_for_changes: self.watched,
            changes: self.change_reports(),
        }
    }
}
