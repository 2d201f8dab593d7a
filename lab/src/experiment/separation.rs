//! How well look-alikes can be told apart, on the data at hand and after the experiment: lambda_ij.
//!
//! lambda_ij = min over the parameters of j of |y_i - y_j|^2 / sigma^2, where y_i is what the machine would show if effect i,
//! fitted to the data, were the truth: the likelihood ratio that is expected against j. From 10 on the right one is found in
//! four of five cases at a level of 1 %.

use super::path::{PERIOD_S, path_rad};
use crate::diagnose::Diagnosis;
use crate::diagnose::search::Search;
use crate::fit::{Fit, fit};
use crate::machine::{Candidate, MachineUnderTest};
use crate::{LabError, LoadUse, Measurements, Problem, Quantity, Term};
use krait_model::model_file::SnakeMachine;
use krait_model::{Chain, Circumstances, KnownColumns};

/// Rows on which look-alikes are fitted.
const MOST_ROWS: usize = 5000;
const ITERATIONS: u32 = 20;

/// What one pair of look-alikes comes to.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The effect that is taken for the truth.
    pub truth: String,
    /// The effect that would be taken for it.
    pub other: String,
    /// lambda on the data at hand.
    pub lambda_now: f64,
    /// lambda on the experiment alone.
    pub lambda_then: f64,
}

/// What the experiment is expected to decide.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// Length of the experiment, s.
    pub seconds: f64,
    /// Every pair of look-alikes, both ways.
    pub pairs: Vec<Pair>,
}

impl Separation {
    /// lambda from which on a pair counts as told apart.
    pub const ENOUGH: f64 = 10.0;

    /// The smallest lambda of the experiment.
    pub fn smallest(&self) -> Option<f64> {
        self.pairs.iter().map(|pair| pair.lambda_then).min_by(f64::total_cmp)
    }
}

/// What the experiment would decide between the look-alikes of a diagnosis; `None` where there are none or no noise is known.
///
/// # Errors
/// [`LabError::Chain`] where the model makes no chain.
pub fn separation(
    machine: &dyn MachineUnderTest,
    snake: &SnakeMachine,
    data: &Measurements,
    diagnosis: &Diagnosis,
) -> Result<Option<Separation>, LabError> {
    let Some((sigma, _)) = diagnosis.floors.sigma() else { return Ok(None) };
    let place = diagnosis.effects.iter().position(|effect| effect.class.len() > 1);
    let Some((slot, effect)) = place.and_then(|slot| Some((slot, diagnosis.effects.get(slot)?))) else {
        return Ok(None);
    };
    let mut base = diagnosis.terms.clone();
    base.remove(machine.effects().len() + slot);
    let now = data.select(&thinned(data.n_rows()));
    let then = measurements(snake)?;
    let problem = Problem::new(machine, now.clone(), &[], f64::INFINITY);
    let mut fits = Vec::new();
    for candidate in machine.candidates(data).into_iter().filter(|own| effect.class.iter().any(|n| n == own.name)) {
        fits.extend(best(&problem, &base, candidate)?);
    }
    let mut pairs = Vec::new();
    for truth in &fits {
        for other in fits.iter().filter(|other| other.0 != truth.0) {
            // Rows that are left out still count.
            let rows = data.n_rows() as f64 / now.n_rows().max(1) as f64;
            let one = |inputs: &Measurements| lambda(machine, inputs, &truth.1.effects, &other.1, sigma);
            // An effect that needs a column which the experiment does not have cannot be compared on it.
            if let (Ok(lambda_now), Ok(lambda_then)) = (one(&now), one(&then)) {
                let (truth, other) = (truth.0.clone(), other.0.clone());
                pairs.push(Pair { truth, other, lambda_now: rows * lambda_now, lambda_then });
            }
        }
    }
    let seconds = then.time_s.last().copied().unwrap_or(0.0);
    Ok((!pairs.is_empty()).then_some(Separation { seconds, pairs }))
}

/// A candidate fitted behind the other effects, from the best place of its grid.
fn best(problem: &Problem, base: &[Term], candidate: Candidate) -> Result<Option<(String, Fit)>, LabError> {
    let candidates = [candidate];
    let search = Search { problem, candidates: &candidates, base, base_variables: &[], seed: 1 };
    let trials = search.every_start(&search.start()?);
    Ok(trials.into_iter().next().map(|trial| (candidates[0].name.to_owned(), trial.fit)))
}

/// What is left between the truth's outputs and the other's best fit to them, in units of the noise.
fn lambda(
    machine: &dyn MachineUnderTest,
    inputs: &Measurements,
    truth: &[Term],
    other: &Fit,
    sigma: f64,
) -> Result<f64, LabError> {
    let outputs = machine.predict(truth, inputs)?;
    let problem = Problem::new(machine, Measurements { outputs, ..inputs.clone() }, &[], f64::INFINITY);
    Ok(fit(&problem, &other.effects, &other.variables, ITERATIONS, 1e-5)?.sum_of_squares / sigma.powi(2))
}

fn thinned(n: usize) -> Vec<usize> {
    (0..n).step_by(n.div_ceil(MOST_ROWS).max(1)).collect()
}

/// The experiment as measurements without outputs: encoders as a compensated elastic snake is told.
fn measurements(machine: &SnakeMachine) -> Result<Measurements, LabError> {
    let columns = KnownColumns { time: true, ..KnownColumns::default() };
    let chain = Chain::new(&machine.parameters, machine.settings, &[], columns)?;
    let mut compensator = chain.compensator()?;
    let path = path_rad();
    let step = |(row, bend): (usize, &nalgebra::Vector2<f64>)| {
        let command = compensator.step(*bend, &Circumstances::at(row as f64 * PERIOD_S));
        [command.q_tilde_m.x, command.q_tilde_m.y, command.q_tilde_m.z]
    };
    let inputs: Vec<f64> = path.iter().enumerate().flat_map(step).collect();
    let n = path.len();
    Ok(Measurements {
        source: "the experiment".to_owned(),
        sha256: String::new(),
        quantity: Quantity::Snake,
        time_s: (0..n).map(|row| row as f64 * PERIOD_S).collect(),
        inputs,
        n_inputs: 3,
        outputs: vec![0.0; 2 * n],
        n_outputs: 2,
        trial: vec![0; n],
        loads_n: None,
        load_use: LoadUse::UNCALIBRATED,
        stem_angle_rad: None,
        temperature_c: None,
        sigma: None,
        extra: Vec::new(),
        names: crate::Names::default(),
    })
}
