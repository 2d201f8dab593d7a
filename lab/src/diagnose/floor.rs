//! The floor of a snake's, of segments' or of a force's error, as a verdict takes it.
//!
//! Differences between neighbouring rows see only what changes from row to row. Alone they are a floor where what is left remembers
//! nothing, and else no more than a hint: slow noise and what no effect explains look alike to them.

use super::search::Trial;
use super::verdict::Case;
use crate::Problem;
use crate::noise::{FloorSource, NoiseFloor, at_floor, remembers};

/// The measurement's own noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Floor {
    /// Length of the error that it makes, in the unit of errors; `None`: unknown.
    pub rms: Option<f64>,
    /// Its relative standard error; zero where it is unknown.
    pub relative_error: f64,
    /// Where it comes from, in words.
    pub source: &'static str,
}

impl Floor {
    const UNKNOWN: Self = Self { rms: None, relative_error: 0.0, source: "the data do not tell" };

    /// The floor in the unit of errors, of a fit that leaves this residual.
    pub fn new(problem: &Problem, floors: &NoiseFloor, residual: &[f64]) -> Self {
        let Some((sigma, source)) = floors.sigma() else { return Self::UNKNOWN };
        let known =
            |source| Self { rms: Some(rms_of(problem, sigma)), relative_error: floors.relative_error(), source };
        match source {
            FloorSource::White | FloorSource::Rest => known(source.label()),
            FloorSource::Differences if !remembers(&scored(problem, residual), problem.data.n_outputs) => {
                known("differences; what is left has no memory")
            }
            FloorSource::Differences => {
                Self { source: "unknown: differences between neighbouring rows alone are no floor", ..Self::UNKNOWN }
            }
        }
    }

    /// Whether an error is no more than the floor, as far as the floor is known.
    pub fn is_reached(&self, rms: f64) -> bool {
        self.rms.is_some_and(|floor| rms <= at_floor(self.relative_error) * floor)
    }
}

impl Case<'_> {
    /// The floor in the unit of errors, with what this trial leaves.
    pub(super) fn floor(&self, chosen: &Trial) -> Floor {
        Floor::new(self.full.problem, &self.floors, &chosen.fit.residual)
    }

    /// What noise makes at least of the error, in its unit: the floor, or a hint at one.
    pub(super) fn least_of(&self, floors: &NoiseFloor) -> Option<f64> {
        floors.sigma().map(|(sigma, _)| rms_of(self.full.problem, sigma))
    }
}

/// The length of an error whose every output has this standard deviation, in the unit of errors.
fn rms_of(problem: &Problem, sigma: f64) -> f64 {
    sigma * (problem.data.n_outputs as f64).sqrt() * problem.machine.error_unit().1
}

/// The outputs' entries of a residual in the rows that count.
fn scored(problem: &Problem, residual: &[f64]) -> Vec<f64> {
    let outputs = problem.outputs_of(residual);
    let width = problem.data.n_outputs;
    let rows = outputs.chunks(width).zip(problem.weight.chunks(width)).filter(|(_, weight)| weight[0] > 0.0);
    rows.flat_map(|(row, _)| row).copied().collect()
}
