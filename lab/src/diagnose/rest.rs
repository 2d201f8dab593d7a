//! What a fit leaves beside what its own numbers can make, and the step that further numbers ask for there, to first order.

use super::answer::Diagnosis;
use super::whole::DiagnoseOptions;
use super::working::working_rows;
use crate::fit::{Fit, Variable, dot, inverse, normal_equations, standard_errors};
use crate::free::free_variables;
use crate::machine::MachineUnderTest;
use crate::prepare::{Prepared, prepare};
use crate::{LabError, Measurements, Problem};
use nalgebra::DVector;

/// What is calibration counts from so many standard errors on, and from this share on that it takes away of what the effects leave.
pub(crate) const ERRORS: f64 = 4.0;
pub(crate) const LEAST_SHARE: f64 = 0.02;
/// Steps towards it, each with the effects fitted again; one of less than this many standard errors is the last.
pub(super) const MOST_STEPS: usize = 4;
pub(super) const SMALL_STEP: f64 = 0.3;

/// Mean square that a diagnosis leaves, with a price for each effect and for each part of the data that was moved.
pub(crate) fn badness(own: &Diagnosis, n_moved: usize) -> f64 {
    let n = own.effects.len() + own.partial.len() + n_moved;
    own.final_heldout_rms.powi(2) * (1.0 + LEAST_SHARE).powf(n as f64)
}

/// Residual of a fit, and what its numbers would change of it.
pub(super) struct Rest {
    slopes: Vec<Vec<f64>>,
    residual: Vec<f64>,
}

impl Rest {
    pub(super) fn of(fitted: &Fit) -> Self {
        Self { slopes: fitted.slopes.clone(), residual: fitted.residual.clone() }
    }

    /// These columns and the slopes, the step that they ask for together, and how much of the squares it takes away.
    fn together(&self, columns: &[&Vec<f64>]) -> (Vec<Vec<f64>>, DVector<f64>, f64) {
        let all: Vec<Vec<f64>> = columns.iter().copied().chain(&self.slopes).cloned().collect();
        let (gram, gradient) = normal_equations(&all, &self.residual);
        let step = -inverse(&gram) * &gradient;
        let gain = -step.dot(&gradient);
        (all, step, gain)
    }

    /// The step that some columns ask for beside the slopes, and how much of the squares it takes away.
    pub(super) fn solved(&self, columns: &[&Vec<f64>]) -> (DVector<f64>, f64) {
        let (_, step, gain) = self.together(columns);
        (step.rows(0, columns.len()).into_owned(), gain)
    }

    /// Squares that the slopes alone leave.
    pub(super) fn left(&self) -> f64 {
        dot(&self.residual, &self.residual) - self.solved(&[]).1
    }

    /// Standard errors of the numbers of these columns, beside the slopes, with what the step that they ask for leaves: what such a number
    /// makes is no noise.
    pub(super) fn errors_of(&self, problem: &Problem, columns: &[&Vec<f64>]) -> Vec<f64> {
        let (all, step, _) = self.together(columns);
        let mut left = self.residual.clone();
        for (column, step) in all.iter().zip(step.iter()) {
            left.iter_mut().zip(column).for_each(|(left, own)| *left += step * own);
        }
        standard_errors(problem, &all, &left).0
    }
}

/// Blocks of the working rows, s.
const SHORTEST_BLOCK_S: f64 = 4.0;

/// Measurements ready for a fit, on the working rows alone where these are not all.
pub(super) fn on_working_rows<'a>(
    machine: &'a dyn MachineUnderTest,
    data: &Measurements,
) -> Result<Problem<'a>, LabError> {
    let Prepared { problem, excluded, .. } = prepare(machine, data)?;
    let rows = working_rows(data, &excluded);
    Ok(if rows.len() < data.n_rows() {
        Problem::new(machine, data.select(&rows), &[], SHORTEST_BLOCK_S).by_output(problem.output_factors())
    } else {
        problem
    })
}

/// What a diagnosis had free: of the model's own, and of the effects that it found.
pub(super) fn variables(
    machine: &dyn MachineUnderTest,
    problem: &Problem,
    options: &DiagnoseOptions,
    diagnosis: &Diagnosis,
) -> Result<Vec<Variable>, LabError> {
    let mut all = free_variables(machine, &problem.data, &options.free)?;
    let found = if diagnosis.effects.is_empty() { &diagnosis.partial } else { &diagnosis.effects };
    let base = machine.effects().len();
    for (slot, effect) in found.iter().enumerate() {
        for (k, own) in effect.parameters.iter().enumerate().filter(|(_, own)| own.is_free && !own.on_bound) {
            let size = own.value.abs().max(own.se);
            all.push(Variable::new(machine, &diagnosis.terms, base + slot, k, size)?);
        }
    }
    Ok(all)
}
