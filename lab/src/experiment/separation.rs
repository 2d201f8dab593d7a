//! How well look-alikes can be told apart, on the data at hand and by a motion: lambda_ij.
//!
//! lambda_ij = min over the parameters of j of |y_i - y_j|^2 / sigma^2, where y_i is what the machine would show if effect i,
//! fitted to the data, were the truth: the likelihood ratio that is expected against j. From 10 on the right one is found in
//! four of five cases at a level of 1 %. What the model file leaves to the fits (gain and offset of joints, open values) is free
//! with j, so that calibration can take up what it will. Rows whose noise remembers others count as fewer. In a long motion a
//! difference may be no chance and still change the error by so little that the diagnosis calls both laws the same.

use super::ground::Ground;
use super::moves::Move;
use crate::diagnose::search::Search;
use crate::diagnose::{FoundEffect, SAME, working_rows};
use crate::fit::{Fit, Variable, fit};
use crate::machine::{Candidate, MachineUnderTest};
use crate::noise::autocorrelation_time;
use crate::{LabError, Measurements, Problem, Term};
use rayon::prelude::*;

const ITERATIONS: u32 = 20;
const TOLERANCE: f64 = 1e-5;
/// The same for moves one by one, which are only chosen from.
const FEW_ITERATIONS: u32 = 6;
const COARSE: f64 = 1e-2;

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
    /// Mean square between the two on the experiment, as a part of the noise's.
    pub part_then: f64,
}

impl Pair {
    /// Whether the experiment tells the two apart: by so much more than chance, and by so much that the diagnosis does not call
    /// their errors the same.
    pub fn is_told(&self) -> bool {
        self.is_beyond_chance() && 1.0 + self.part_then > SAME * SAME
    }

    /// Whether the experiment shows a difference that is no chance, however small.
    pub fn is_beyond_chance(&self) -> bool {
        self.lambda_then >= Separation::ENOUGH
    }
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

    /// Pairs of names that the experiment leaves alike, one way or the other, each pair once.
    pub fn left_alike(&self) -> Vec<(&str, &str)> {
        let mut left: Vec<(&str, &str)> = Vec::new();
        for pair in self.pairs.iter().filter(|pair| !pair.is_told()) {
            let (a, b) = (pair.truth.as_str(), pair.other.as_str());
            if !left.contains(&(a, b)) && !left.contains(&(b, a)) {
                left.push((a, b));
            }
        }
        left
    }
}

/// Look-alikes, each fitted to the data at hand behind the other effects of the answer.
pub(super) struct Rivals<'a> {
    machine: &'a dyn MachineUnderTest,
    fits: Vec<(String, Fit)>,
    /// Standard deviation of an output.
    sigma: f64,
    /// Rows over which what is left remembers: so many count as one.
    memory: f64,
    /// Truth and other, as places among the fits, and lambda on the data at hand.
    pairs: Vec<(usize, usize, f64)>,
}

/// What a diagnosis found, as a list of effects of the machine that it is compared with.
pub(super) struct Answer<'a> {
    /// The machine whose list this is.
    pub machine: &'a dyn MachineUnderTest,
    /// Its effects, with those found behind them.
    pub effects: Vec<Term>,
    /// What every fit finds of the machine.
    pub variables: Vec<Variable>,
    /// Standard deviation of an output.
    pub sigma: f64,
}

impl<'a> Rivals<'a> {
    /// The look-alikes of a found effect; `None` where fewer than two of them can be fitted.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model makes no chain.
    pub fn new(answer: Answer<'a>, data: &Measurements, effect: &FoundEffect) -> Result<Option<Self>, LabError> {
        let Answer { machine, effects: mut base, variables, sigma } = answer;
        let is_it = |term: &Term| {
            let values = effect.parameters.iter().map(|own| own.value);
            term.name == effect.name && term.values.iter().copied().eq(values)
        };
        let Some(place) = base.iter().rposition(is_it) else { return Ok(None) };
        let own = base.remove(place);
        let now = data.select(&working_rows(data, &[]));
        let problem = Problem::new(machine, now.clone(), &[], f64::INFINITY);
        let mut fits = Vec::new();
        for candidate in of_joint(machine, machine.candidates(data), effect.joint)? {
            if effect.class.contains(&candidate.name.to_owned()) {
                let from = (candidate.name == own.name).then_some(&own);
                fits.extend(best(&problem, &base, &variables, candidate, from)?);
            }
        }
        let n_scored = |data: &Measurements| (0..data.n_rows()).filter(|row| data.is_scored(*row)).count();
        // Rows that are left out still count.
        let rows = n_scored(data) as f64 / n_scored(&now) as f64;
        let best = fits.iter().min_by(|a, b| a.1.sum_of_squares.total_cmp(&b.1.sum_of_squares));
        let Some((_, best)) = best else { return Ok(None) };
        let memory = autocorrelation_time(&best.residual, problem.width()).max(1.0);
        let mut rivals = Self { machine, fits, sigma, memory, pairs: Vec::new() };
        let all: Vec<(usize, usize)> = rivals.places().collect();
        let lambdas: Vec<Result<f64, LabError>> =
            all.par_iter().map(|&pair| rivals.lambda(&now, pair, ITERATIONS, TOLERANCE)).collect();
        // An effect that needs a column which the data do not have was not fitted either.
        for ((truth, other), lambda) in all.into_iter().zip(lambdas) {
            rivals.pairs.push((truth, other, rows * lambda?));
        }
        Ok((!rivals.pairs.is_empty()).then_some(rivals))
    }

    fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let n = self.fits.len();
        (0..n).flat_map(move |truth| (0..n).filter(move |other| *other != truth).map(move |other| (truth, other)))
    }

    /// lambda of each pair by each move alone.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model makes no chain.
    pub fn told_by(&self, ground: &Ground, moves: &[Move]) -> Result<Vec<Vec<f64>>, LabError> {
        let one = |own: &Move| self.lambdas(ground, &ground.alone(own), FEW_ITERATIONS, COARSE);
        moves.par_iter().map(one).collect()
    }

    /// What a path would decide.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model makes no chain.
    pub fn separation(&self, ground: &Ground, path: &[Vec<f64>]) -> Result<Separation, LabError> {
        let lambdas = self.lambdas(ground, path, ITERATIONS, TOLERANCE)?;
        let values = ground.measured_values(path);
        let pair = |(&(truth, other, lambda_now), lambda_then): (&(usize, usize, f64), f64)| Pair {
            truth: self.fits[truth].0.clone(),
            other: self.fits[other].0.clone(),
            lambda_now,
            lambda_then,
            part_then: lambda_then * self.memory / values,
        };
        Ok(Separation { seconds: ground.seconds(path), pairs: self.pairs.iter().zip(lambdas).map(pair).collect() })
    }

    /// lambda of each pair on a path, measured as often as the data were.
    fn lambdas(
        &self,
        ground: &Ground,
        path: &[Vec<f64>],
        iterations: u32,
        tolerance: f64,
    ) -> Result<Vec<f64>, LabError> {
        let inputs = ground.measurements(path)?;
        let each = |&(truth, other, _): &(usize, usize, f64)| {
            Ok(ground.measured_for_each_row() * self.lambda(&inputs, (truth, other), iterations, tolerance)?)
        };
        self.pairs.par_iter().map(each).collect()
    }

    /// What is left between the truth's outputs and the other's best fit to them, in units of the noise.
    fn lambda(
        &self,
        inputs: &Measurements,
        (truth, other): (usize, usize),
        iterations: u32,
        tolerance: f64,
    ) -> Result<f64, LabError> {
        let outputs = self.machine.predict(&self.fits[truth].1.effects, inputs)?;
        let measured = Measurements { outputs, sigma: None, ..inputs.clone() };
        let problem = Problem::new(self.machine, measured, &[], f64::INFINITY);
        let other = &self.fits[other].1;
        let fit = fit(&problem, &other.effects, &other.variables, iterations, tolerance)?;
        Ok(fit.sum_of_squares / (self.sigma.powi(2) * self.memory))
    }
}

/// Candidates of one joint, from 1, alone; all of them for a machine without joints.
fn of_joint(
    machine: &dyn MachineUnderTest,
    candidates: Vec<Candidate>,
    joint: Option<usize>,
) -> Result<Vec<Candidate>, LabError> {
    let Some(joint) = joint else { return Ok(candidates) };
    let alone = |mut own: Candidate| {
        let term = Term::new(own.name, own.neutral.clone());
        let parameters = machine.parameters(&term)?;
        // The answer's own search fits the widths of several plays, which screening holds.
        let is_width = |k: &usize| parameters[*k].name.starts_with("half_width") && !own.free.contains(k);
        let widths: Vec<usize> = (0..parameters.len()).filter(is_width).collect();
        own.free.extend(widths);
        let place = parameters.iter().position(|parameter| parameter.name == "joint");
        if let Some(place) = place {
            // Of one joint all are alike; of several each has starts of its own.
            own.starts.iter_mut().filter(|start| start[place] == 0.0).for_each(|start| start[place] = joint as f64);
            own.starts.retain(|start| start[place] == joint as f64);
            let mut seen: Vec<Vec<f64>> = Vec::new();
            own.starts.retain(|start| {
                let is_new = !seen.contains(start);
                seen.push(start.clone());
                is_new
            });
        }
        Ok(own)
    };
    candidates.into_iter().map(alone).collect()
}

/// A candidate fitted behind the other effects, from the best place of its grid and from these values.
fn best(
    problem: &Problem,
    base: &[Term],
    variables: &[Variable],
    candidate: Candidate,
    from: Option<&Term>,
) -> Result<Option<(String, Fit)>, LabError> {
    let candidates = [candidate];
    let search = Search { problem, candidates: &candidates, base, base_variables: variables, seed: 1 };
    let mut trials = search.every_start(&search.start()?);
    if let Some(own) = from {
        let effects: Vec<Term> = base.iter().chain([own]).cloned().collect();
        trials.push(search.fitted(vec![0], &effects)?);
    }
    let best = trials.into_iter().min_by(|a, b| a.fit.sum_of_squares.total_cmp(&b.fit.sum_of_squares));
    Ok(best.map(|trial| (candidates[0].name.to_owned(), trial.fit)))
}
