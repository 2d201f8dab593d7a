//! The steps of the search: single effects, pairs, next ones, stand-ins and narrower ones, each refined by whole simulations
//! and ranked by what it leaves.

use super::periodic;
use super::screen::{Cell, screen};
use super::sign_flip::{SignFlip, sign_flip};
use crate::fit::{Fit, Variable, dot, fit, fit_to_end};
use crate::machine::Candidate;
use crate::noise::autocorrelation_time;
use crate::{LabError, Problem, Term};
use krait_model::effects::Class;
use nalgebra::DVector;
use rayon::prelude::*;

/// A list of missing effects with its fit.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Places of the candidates, in the order of the fit's effects behind the model's own.
    pub found: Vec<usize>,
    /// Its fit.
    pub fit: Fit,
}

/// What a search works on.
pub struct Search<'a> {
    /// The measurements.
    pub problem: &'a Problem<'a>,
    /// What may be missing.
    pub candidates: &'a [Candidate],
    /// The model's own effects, held.
    pub base: &'a [Term],
    /// Parameters of the model's own effects that are free nevertheless.
    pub base_variables: &'a [Variable],
    /// Seed of everything random.
    pub seed: u64,
}

/// Singles that are refined.
const N_SINGLES: usize = 8;
/// More singles are refined while their sum of squares, to first order, is within this factor of the best one's ...
const CLOSE: f64 = 1.2;
/// ... but not more than this.
const MOST_SINGLES: usize = 14;
/// Of one class so many come first: its members explain the same, and others deserve a place in the short list.
const MOST_OF_A_CLASS: usize = 3;
/// Seconds that are refined beside the best single.
const N_SECONDS: usize = 5;
/// Pairs that are refined because they are good together to first order.
const N_PAIRS: usize = 5;
/// An effect with so many free numbers can imitate others, two at once among them.
const WIDE: usize = 3;
/// In units of -2 ln likelihood: a list that was not looked for step by step must be better by this.
const CLEARLY: f64 = 10.0;
const ITERATIONS: u32 = 10;
/// A smaller relative gain ends a fit: differences between candidates that matter are larger.
const TOLERANCE: f64 = 1e-4;

impl<'a> Search<'a> {
    /// The same search on another problem of the machine.
    pub(super) fn on<'b>(&self, problem: &'b Problem<'b>) -> Search<'b>
    where
        'a: 'b,
    {
        Search { problem, ..*self }
    }

    /// The fit without any further effect.
    ///
    /// # Errors
    /// [`LabError::Chain`].
    pub fn start(&self) -> Result<Trial, LabError> {
        Ok(Trial { found: Vec::new(), fit: fit(self.problem, self.base, self.base_variables, ITERATIONS, TOLERANCE)? })
    }

    /// Every cell at a trial, and whether any of them is more than chance.
    pub fn look(&self, trial: &Trial) -> (Vec<Cell>, SignFlip) {
        let cells = screen(self.problem, &trial.fit, self.candidates);
        let test = sign_flip(&cells, self.seed + trial.found.len() as u64);
        (cells, test)
    }

    /// The best single effects, refined, best first.
    pub fn singles(&self, start: &Trial, cells: &[Cell]) -> Vec<Trial> {
        let best = self.best_cells(cells);
        let close = |cell: &Cell| cell.sum_of_squares <= CLOSE * best[0].sum_of_squares;
        let n = best.iter().take_while(|cell| close(cell)).count().clamp(N_SINGLES, MOST_SINGLES);
        let jobs: Vec<_> = best.iter().take(n).map(|cell| self.with(start, &[cell])).collect();
        self.refine(jobs)
    }

    /// Singles to look for a second effect from: the best, and the best that looks different.
    pub fn different(&self, singles: &[Trial]) -> Vec<Trial> {
        let class = |trial: &Trial| trial.found.first().map(|&k| self.candidates[k].class);
        let other = singles.iter().find(|trial| class(trial) != singles.first().and_then(class));
        singles.first().into_iter().chain(other).cloned().collect()
    }

    /// Cells in order, but those of a class that has come up often enough behind all others.
    fn varied<'c>(&self, cells: Vec<&'c Cell>) -> Vec<&'c Cell> {
        let class = |cell: &Cell| self.candidates[cell.candidate].class;
        let early: Vec<bool> = (0..cells.len())
            .map(|k| cells[..k].iter().filter(|own| class(own) == class(cells[k])).count() < MOST_OF_A_CLASS)
            .collect();
        let pick =
            |wanted: bool| cells.iter().zip(&early).filter(move |(_, own)| **own == wanted).map(|(cell, _)| *cell);
        pick(true).chain(pick(false)).collect()
    }

    /// The candidates from every cell of their grids, refined, best first.
    pub fn every_start(&self, start: &Trial) -> Vec<Trial> {
        let cells = screen(self.problem, &start.fit, self.candidates);
        self.refine(periodic::without_hopeless(&cells).map(|cell| self.with(start, &[cell])).collect())
    }

    /// The best stand-ins for each effect of a trial, and each effect itself from the start that looks best beside the others, with the
    /// trial as it is; best first, each list once. An effect that was found before the others may stand in a minimum of its own:
    /// friction that holds a line altogether is a scale.
    pub fn swaps(&self, trial: &Trial) -> Vec<Trial> {
        let mut jobs = vec![(trial.found.clone(), trial.fit.effects.clone())];
        for slot in 0..trial.found.len() {
            let Ok(rest) = self.without(trial, slot) else { continue };
            let cells = screen(self.problem, &rest.fit, self.candidates);
            let best = self.varied(self.best_cells(&cells));
            let (own, others): (Vec<&Cell>, Vec<&Cell>) =
                best.into_iter().partition(|cell| cell.candidate == trial.found[slot]);
            let next = own.into_iter().chain(others.into_iter().take(N_SECONDS));
            jobs.extend(next.map(|cell| self.with(&rest, &[cell])));
        }
        self.distinct(self.refine(jobs))
    }

    /// A trial with one or, where `n_most` allows it, two narrower effects in place of one of wide reach, which have fewer free
    /// numbers together, or as many in place of one that can be stretched into a plainer one; with the trial itself, best first.
    pub(super) fn narrowed(&self, trial: &Trial, n_most: usize) -> Vec<Trial> {
        let mut jobs = vec![(trial.found.clone(), trial.fit.effects.clone())];
        for slot in 0..trial.found.len() {
            let own = &self.candidates[trial.found[slot]];
            let most = match (own.highest, own.free.len()) {
                (Some(_), n_free) => n_free,
                (None, n_free @ WIDE..) => n_free - 1,
                (None, _) => continue,
            };
            let Ok(rest) = self.without(trial, slot) else { continue };
            let is_new = |cell: &Cell| !rest.found.contains(&cell.candidate) && cell.candidate != trial.found[slot];
            let cells: Vec<Cell> =
                screen(self.problem, &rest.fit, self.candidates).into_iter().filter(is_new).collect();
            let n_of = |cell: &Cell| self.candidates[cell.candidate].free.len();
            let singles = self.varied(self.best_cells(&cells)).into_iter().filter(|cell| n_of(cell) <= most);
            jobs.extend(singles.take(N_SECONDS).map(|cell| self.with(&rest, &[cell])));
            if trial.found.len() < n_most {
                let pairs = best_pairs(&cells).into_iter().filter(|(a, b)| n_of(a) + n_of(b) <= most);
                jobs.extend(pairs.take(N_PAIRS).map(|(a, b)| self.with(&rest, &[a, b])));
            }
        }
        self.refine(jobs)
    }

    /// A trial with one effect more where a member is a user's formula: the formula from its own starts beside each effect that it may
    /// have been stretched into, as nothing bounds its numbers; refined, best first.
    pub(super) fn unstretched(&self, trial: &Trial) -> Vec<Trial> {
        let mut jobs = Vec::new();
        for slot in 0..trial.found.len() {
            let own = trial.found[slot];
            let Some(rest) = self.candidates[own].formula.as_ref().and_then(|_| self.without(trial, slot).ok()) else {
                continue;
            };
            let cells = screen(self.problem, &rest.fit, self.candidates);
            let pairs = best_pairs(&cells).into_iter().filter(|(a, b)| [a, b].iter().any(|cell| cell.candidate == own));
            jobs.extend(pairs.take(N_PAIRS).map(|(a, b)| self.with(&rest, &[a, b])));
        }
        self.refine(jobs)
    }

    /// Pairs: the best seconds beside the best singles, and the best pairs to first order; refined, best first.
    pub fn pairs(&self, start: &Trial, cells: &[Cell], singles: &[Trial], second_cells: &[Vec<Cell>]) -> Vec<Trial> {
        let mut jobs = Vec::new();
        for (k, (single, cells)) in singles.iter().zip(second_cells).enumerate() {
            let n = if k == 0 { N_SECONDS } else { N_SECONDS / 2 };
            jobs.extend(self.varied(self.best_cells(cells)).into_iter().take(n).map(|cell| self.with(single, &[cell])));
        }
        jobs.extend(best_pairs(cells).into_iter().take(N_PAIRS).map(|(a, b)| self.with(start, &[a, b])));
        keep_first(&mut jobs, |(found, _)| found);
        self.refine(jobs)
    }

    /// The best next effects behind each of these trials, refined, best first, each list once.
    pub(super) fn behind(&self, parents: &[(&Trial, &[Cell])], n_next: usize) -> Vec<Trial> {
        let mut jobs = Vec::new();
        for (parent, cells) in parents {
            let best = self.varied(self.best_cells(cells));
            jobs.extend(best.into_iter().take(n_next).map(|cell| self.with(parent, &[cell])));
        }
        keep_first(&mut jobs, |(found, _)| found);
        self.refine(jobs)
    }

    /// A trial without one of its effects.
    ///
    /// # Errors
    /// [`LabError::Chain`].
    pub(super) fn without(&self, trial: &Trial, slot: usize) -> Result<Trial, LabError> {
        let (mut found, mut effects) = (trial.found.clone(), trial.fit.effects.clone());
        found.remove(slot);
        effects.remove(self.base.len() + slot);
        self.fitted(found, &effects)
    }

    /// Best first, each set of candidates once.
    pub(super) fn distinct(&self, mut trials: Vec<Trial>) -> Vec<Trial> {
        self.rank(&mut trials);
        keep_first(&mut trials, |trial| &trial.found);
        trials
    }

    /// A trial with further effects in place of its own ones, from the values that screening suggests.
    fn with(&self, from: &Trial, cells: &[&Cell]) -> (Vec<usize>, Vec<Term>) {
        let mut found = from.found.clone();
        let mut effects = from.fit.effects.clone();
        for cell in cells {
            effects.push(self.term(cell, &cell.factors));
            found.push(cell.candidate);
        }
        (found, effects)
    }

    /// The effect of a cell at the values that factors on its columns stand for.
    pub(super) fn term(&self, cell: &Cell, factors: &DVector<f64>) -> Term {
        let candidate = &self.candidates[cell.candidate];
        let mut values = candidate.starts[cell.start].clone();
        if let Some(periodic) = &candidate.periodic {
            periodic::start(periodic, factors, &mut values);
        } else {
            for (&k, factor) in candidate.amplitudes.iter().zip(factors.iter()) {
                let factor = if candidate.one_sided { factor.clamp(0.1, 10.0) } else { factor.clamp(-30.0, 30.0) };
                values[k] = candidate.neutral[k] + factor * (values[k] - candidate.neutral[k]);
            }
        }
        candidate.term(values)
    }

    /// Fits lists of effects; those that make no chain are left out.
    pub(super) fn refine(&self, jobs: Vec<(Vec<usize>, Vec<Term>)>) -> Vec<Trial> {
        let mut trials: Vec<Trial> =
            jobs.into_par_iter().filter_map(|(found, effects)| self.fitted(found, &effects).ok()).collect();
        self.rank(&mut trials);
        trials
    }

    /// Whether a shape (no amplitude) ended at the edge of what is physical: the effect imitates something else. A drift
    /// whose time constant is at its upper limit is still a drift; one at its lower limit is an offset.
    pub fn imitates(&self, trial: &Trial) -> bool {
        (0..trial.found.len()).any(|slot| self.is_imitation(trial, slot))
    }

    /// Whether the effect in this place of a trial does.
    pub(super) fn is_imitation(&self, trial: &Trial, slot: usize) -> bool {
        let candidate = &self.candidates[trial.found[slot]];
        let endless = candidate.class == Class::Drift.label();
        let own = trial.fit.variables.iter().filter(|variable| variable.effect == self.base.len() + slot);
        own.filter(|variable| !candidate.amplitudes.contains(&variable.parameter))
            .any(|variable| variable.bound(&trial.fit.effects).is_some_and(|bound| !endless || bound == variable.low))
    }

    /// Puts the best first.
    pub fn rank(&self, trials: &mut [Trial]) {
        let time = memory(self.problem, trials);
        trials.sort_by(|a, b| self.badness(a, time).total_cmp(&self.badness(b, time)));
    }

    /// A list of effects fitted to this problem from these values, which stand behind the model's own.
    ///
    /// # Errors
    /// [`LabError::Chain`] where they make no chain.
    pub fn fitted(&self, found: Vec<usize>, effects: &[Term]) -> Result<Trial, LabError> {
        let (effects, variables) = self.start_of(&found, effects)?;
        Ok(Trial { found, fit: fit(self.problem, &effects, &variables, ITERATIONS, TOLERANCE)? })
    }

    /// The same to the end: for values that are told, not for a search.
    ///
    /// # Errors
    /// As [`Search::fitted`].
    pub(super) fn fitted_to_end(&self, found: Vec<usize>, effects: &[Term]) -> Result<Trial, LabError> {
        let (effects, variables) = self.start_of(&found, effects)?;
        Ok(Trial { found, fit: fit_to_end(self.problem, &effects, &variables)? })
    }

    /// Effects moved onto their bounds where they lie outside, and what is free of them.
    fn start_of(&self, found: &[usize], effects: &[Term]) -> Result<(Vec<Term>, Vec<Variable>), LabError> {
        let mut effects = effects.to_vec();
        let mut variables = self.base_variables.to_vec();
        for (n, &k) in found.iter().enumerate() {
            variables.extend(self.variables(&effects, self.base.len() + n, k)?);
        }
        for variable in &variables {
            let value = variable.value(&effects);
            variable.set(&mut effects, value);
        }
        Ok((effects, variables))
    }

    fn variables(&self, effects: &[Term], place: usize, candidate: usize) -> Result<Vec<Variable>, LabError> {
        let candidate = &self.candidates[candidate];
        let first = &candidate.starts[0];
        let size =
            |k: usize| if candidate.amplitudes.contains(&k) { first[k] - candidate.neutral[k] } else { first[k] };
        let variable = |&k: &usize| {
            let own = Variable::new(self.problem.machine, effects, place, k, size(k).abs().max(1e-9))?;
            let highest = candidate.highest.filter(|(parameter, _)| *parameter == k).map(|(_, highest)| highest);
            Ok(Variable { high: own.high.min(highest.unwrap_or(f64::INFINITY)), ..own })
        };
        candidate.free.iter().map(variable).collect()
    }

    /// ln RSS + p ln(N)/N: what is left, and a price for each parameter; N counts rows that tell something of their own, of which
    /// noise with a memory (`time` rows long) leaves few.
    pub fn badness(&self, trial: &Trial, time: f64) -> f64 {
        trial.fit.sum_of_squares.ln() + trial.fit.variables.len() as f64 * price(self.problem, time)
    }

    /// Whether a trial is better than another one by more than chance lets a list of other members be, its free numbers paid for.
    pub(super) fn is_clearly_better(&self, trial: &Trial, than: &Trial) -> bool {
        let time = memory(self.problem, &[trial.clone(), than.clone()]);
        let n = self.problem.n_scored as f64 / time;
        (self.badness(than, time) - self.badness(trial, time)) * n > CLEARLY
    }

    /// The best cell of each candidate, best first.
    fn best_cells<'c>(&self, cells: &'c [Cell]) -> Vec<&'c Cell> {
        let n = self.problem.n_scored as f64;
        let price = |cell: &Cell| cell.sum_of_squares.max(1e-300).ln() + cell.factors.len() as f64 * n.ln() / n;
        let mut best: Vec<&Cell> = Vec::new();
        for cell in cells {
            match best.iter_mut().find(|own| own.candidate == cell.candidate) {
                Some(own) if price(cell) < price(own) => *own = cell,
                Some(_) => {}
                None => best.push(cell),
            }
        }
        best.sort_by(|a, b| price(a).total_cmp(&price(b)));
        best
    }
}

/// Keeps the first of those that hold the same candidates in whatever order.
pub(super) fn keep_first<T>(all: &mut Vec<T>, found: impl Fn(&T) -> &Vec<usize>) {
    let mut seen: Vec<Vec<usize>> = Vec::new();
    all.retain(|own| {
        let mut sorted = found(own).clone();
        sorted.sort_unstable();
        let is_new = !seen.contains(&sorted);
        if is_new {
            seen.push(sorted);
        }
        is_new
    });
}

/// ln(N)/N with N rows that tell something of their own, for noise that is `time` rows long.
pub(super) fn price(problem: &Problem, time: f64) -> f64 {
    let n = (problem.n_scored as f64 / time).max(FEWEST_ROWS);
    n.ln() / n
}

/// Fewer rows that tell something would make ln(N)/N fall again.
const FEWEST_ROWS: f64 = 8.0;

/// How long the memory of what is left is, in rows: what the trial leaves that explains most.
pub(super) fn memory(problem: &Problem, trials: &[Trial]) -> f64 {
    let best = trials.iter().min_by(|a, b| a.fit.sum_of_squares.total_cmp(&b.fit.sum_of_squares));
    best.map_or(1.0, |best| autocorrelation_time(&best.fit.residual, problem.width()))
}

/// Pairs of cells of different candidates, best together first, one pair of cells for each pair of candidates.
fn best_pairs(cells: &[Cell]) -> Vec<(&Cell, &Cell)> {
    let pairs: Vec<(usize, usize)> = (0..cells.len()).flat_map(|a| (a + 1..cells.len()).map(move |b| (a, b))).collect();
    let mut scored: Vec<(f64, usize, usize)> = pairs
        .into_par_iter()
        .filter(|&(a, b)| cells[a].candidate != cells[b].candidate)
        .filter(|&(a, b)| !cells[a].columns.is_empty() && !cells[b].columns.is_empty())
        .map(|(a, b)| (joint_gain(&cells[a], &cells[b]), a, b))
        .collect();
    scored.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)).then(x.2.cmp(&y.2)));
    let mut best: Vec<(&Cell, &Cell)> = Vec::new();
    for (_, a, b) in scored {
        let (a, b) = (&cells[a], &cells[b]);
        let known = |(x, y): &(&Cell, &Cell)| (x.candidate, y.candidate) == (a.candidate, b.candidate);
        if !best.iter().any(known) {
            best.push((a, b));
        }
        if best.len() >= 40 {
            break;
        }
    }
    best
}

/// How much of the sum of squares two cells take away together, to first order.
fn joint_gain(a: &Cell, b: &Cell) -> f64 {
    let columns: Vec<&Vec<f64>> = a.columns.iter().chain(&b.columns).collect();
    let (score_a, gram_a) = super::screen::total(&a.blocks);
    let (score_b, gram_b) = super::screen::total(&b.blocks);
    let (n_a, n) = (score_a.len(), columns.len());
    let score = nalgebra::DVector::from_fn(n, |k, _| if k < n_a { score_a[k] } else { score_b[k - n_a] });
    let gram = nalgebra::DMatrix::from_fn(n, n, |i, j| match (i < n_a, j < n_a) {
        (true, true) => gram_a[(i, j)],
        (false, false) => gram_b[(i - n_a, j - n_a)],
        _ => dot(columns[i], columns[j]),
    });
    let factors = crate::fit::inverse(&gram) * &score;
    let wrong_sign = (a.one_sided && factors[0] <= 0.0) || (b.one_sided && factors[n_a] <= 0.0);
    if wrong_sign { 0.0 } else { score.dot(&factors) - 1e-4 * n as f64 * score.dot(&factors).abs() }
}
