//! What one pass of a recording shows: tracking error, largest bend, what was learnt, what changed.
//!
//! Everything here is computed from the recording alone, so that anyone with the file gets the same figures.

use crate::Spread;
use krait_ipc::message::{Command, Compensation, ModelUpdate, Phase, Setpoint, Shape};
use krait_model::ChangeKind;
use serde::Serialize;

/// The score counts from this long after the operator's first motion: the estimator has seen a few reversals by then.
pub const SCORED_FROM_S: f64 = 10.0;
/// Below this bend the bending plane is too ill-defined for its error to mean anything, rad.
const PLANE_FROM_BEND_RAD: f64 = 15.0 * core::f64::consts::PI / 180.0;

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
    /// Length of the difference between the measured and the commanded bend vector, deg.
    pub error_deg: Spread,
    /// Difference of the bend angles alone, deg.
    pub bend_error_deg: Spread,
    /// Difference of the bending planes, where the bend is at least 15 deg, deg.
    pub plane_error_deg: Spread,
    /// Largest bend over the whole pass.
    pub peak_bend_deg: PeakBend,
    /// Shapes that the score rests on.
    pub scored_shapes: usize,
    /// The score counts from this long after the operator's first motion, s.
    pub scored_from_s: f64,
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
    setpoints: Vec<(i64, [f64; 2], bool)>,
    shapes: Vec<(i64, [f64; 2])>,
    last_command: Option<Command>,
    changes: Vec<(i64, u32)>,
    watched: bool,
}

impl PassLog {
    /// Takes a setpoint.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        let following = setpoint.phase() == Some(Phase::Following);
        self.setpoints.push((setpoint.sample_ns, setpoint.bend_rad, following));
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
        let errors = self.errors_rad();
        let spread = |pick: fn(&ShapeError) -> Option<f64>| {
            Spread::of(&errors.iter().filter_map(pick).map(f64::to_degrees).collect::<Vec<_>>())
        };
        let peak = |bends: &mut dyn Iterator<Item = [f64; 2]>| bends.map(length).fold(0.0, f64::max).to_degrees();
        PassReport {
            compensation: compensation.name(),
            error_deg: spread(|e| Some(e.vector_rad)),
            bend_error_deg: spread(|e| Some(e.bend_rad)),
            plane_error_deg: spread(|e| e.plane_rad),
            peak_bend_deg: PeakBend {
                commanded: peak(&mut self.setpoints.iter().map(|(_, bend, _)| *bend)),
                reached: peak(&mut self.shapes.iter().map(|(_, bend)| *bend)),
            },
            scored_shapes: errors.len(),
            scored_from_s: SCORED_FROM_S,
            eta: self.last_command.map_or(f64::NAN, |c| c.eta),
            lambda_mm: self.last_command.map_or(f64::NAN, |c| c.lambda_m * 1e3),
            watched_for_changes: self.watched,
            changes: self.change_reports(),
        }
    }

    /// The error of every shape from [`SCORED_FROM_S`] after the first motion on.
    fn errors_rad(&self) -> Vec<ShapeError> {
        let Some(first_ns) = self.setpoints.iter().find(|(.., following)| *following).map(|(ns, ..)| *ns) else {
            return Vec::new();
        };
        let from_ns = first_ns + (SCORED_FROM_S * 1e9) as i64;
        let scored = self.shapes.iter().filter(|(ns, _)| *ns >= from_ns);
        scored.filter_map(|(ns, measured)| Some(ShapeError::between(*measured, self.setpoint_at(*ns)?))).collect()
    }

    /// The newest setpoint at an instant.
    fn setpoint_at(&self, sample_ns: i64) -> Option<[f64; 2]> {
        let after = self.setpoints.partition_point(|(ns, ..)| *ns <= sample_ns);
        self.setpoints.get(after.checked_sub(1)?).map(|(_, bend, _)| *bend)
    }
}

struct ShapeError {
    vector_rad: f64,
    bend_rad: f64,
    plane_rad: Option<f64>,
}

impl ShapeError {
    fn between(measured: [f64; 2], commanded: [f64; 2]) -> Self {
        let [mx, my] = measured;
        let [cx, cy] = commanded;
        let plane_rad =
            (length(commanded) >= PLANE_FROM_BEND_RAD).then(|| (cx * my - cy * mx).atan2(cx * mx + cy * my));
        Self { vector_rad: length([mx - cx, my - cy]), bend_rad: length(measured) - length(commanded), plane_rad }
    }
}

fn length(bend: [f64; 2]) -> f64 {
    bend[0].hypot(bend[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_the_length_of_the_difference_of_the_bend_vectors() {
        let error = ShapeError::between([0.0, 0.5], [0.5, 0.0]);
        assert!((error.vector_rad - 0.5f64.hypot(0.5)).abs() < 1e-15);
        assert_eq!(error.bend_rad, 0.0);
        assert!((error.plane_rad.expect("far from straight") - core::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!(ShapeError::between([0.1, 0.0], [0.1, 0.1]).plane_rad.is_none(), "too straight to have a plane");
    }
}
