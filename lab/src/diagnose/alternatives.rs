//! Which effects these data cannot tell apart, and how often each would come out best on resampled data.

use super::accept::{FOLDS, mean_and_error};
use super::search::{Trial, memory, price};
use crate::Problem;
use crate::fit::held_out_block_squares;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Trials of as many effects, with their errors block by block.
pub(super) struct Alternatives {
    pub trials: Vec<Trial>,
    /// Held-out squares of each trial's blocks.
    pub squares: Vec<Vec<f64>>,
    /// Share of resamples in which each trial is best.
    pub frequency: Vec<f64>,
}

/// Errors up to this ratio are the same for a user.
pub(crate) const SAME: f64 = 1.02;
/// Squares up to this ratio are told apart by no law: a third of what the smallest further effect takes away.
const IMPERFECT: f64 = 1.01;
const RESAMPLES: usize = 500;
/// On more rows errors may turn out to be the same that differ by up to this ratio, or by this many times what blocks tell.
const NEAR: f64 = 1.05;
const NEAR_ERRORS: f64 = 2.0;
/// One-sided 5 % of Student's t for the usual number of blocks.
const T_ONE_SIDED: f64 = 1.69;

impl Alternatives {
    /// Compares trials, best first.
    pub fn new(problem: &Problem, trials: Vec<Trial>, seed: u64) -> Self {
        let squares: Vec<Vec<f64>> =
            trials.iter().map(|trial| held_out_block_squares(problem, &trial.fit, FOLDS)).collect();
        let frequency = frequency(problem, &trials, &squares, seed);
        Self { trials, squares, frequency }
    }

    /// Candidates that may stand in place `slot` of the best trial, itself first: the other places are the same.
    pub fn class(&self, slot: usize) -> Vec<usize> {
        let Some(best) = self.trials.first() else { return Vec::new() };
        let mut class = vec![best.found[slot]];
        for (trial, squares) in self.trials.iter().zip(&self.squares).skip(1) {
            let Some(other) = stand_in(&best.found, &trial.found, slot) else { continue };
            let (sum, best_sum): (f64, f64) = (squares.iter().sum(), self.squares[0].iter().sum());
            let same = sum <= SAME * SAME * best_sum || self.is_no_worse(squares);
            if same && !class.contains(&other) {
                class.push(other);
            }
        }
        class
    }

    /// The trials that more rows may show to be as good as the best one, itself first.
    pub fn near(&self) -> Vec<&Trial> {
        let Some(best) = self.squares.first() else { return Vec::new() };
        let best_sum: f64 = best.iter().sum();
        let is_near = |squares: &[f64]| {
            let (mean, error) = mean_and_error(squares.iter().zip(best).map(|(own, best)| own - best));
            squares.iter().sum::<f64>() <= NEAR * NEAR * best_sum || mean < NEAR_ERRORS * T_ONE_SIDED * error
        };
        let all = self.trials.iter().zip(&self.squares).enumerate();
        all.filter(|(k, (_, squares))| *k == 0 || is_near(squares)).map(|(_, (trial, _))| trial).collect()
    }

    /// Whether a trial's held-out squares are those of the best one, as far as the blocks tell.
    fn is_no_worse(&self, squares: &[f64]) -> bool {
        let (mean, error) = mean_and_error(squares.iter().zip(&self.squares[0]).map(|(j, b)| j - b));
        mean < T_ONE_SIDED * error
    }

    /// How far a parameter of the effect in a place of `found` moves, at most, where an effect that these data cannot tell from
    /// another one's stands in for that: 0 for single effects.
    pub fn spread(&self, found: &[usize], slot: usize, parameter: usize) -> f64 {
        let Some(best) = self.trials.first() else { return 0.0 };
        let value = |trial: &Trial| {
            let place = trial.found.iter().position(|own| Some(own) == found.get(slot))?;
            let base = trial.fit.effects.len() - trial.found.len();
            trial.fit.effects.get(base + place)?.values.get(parameter).copied()
        };
        let Some(own) = value(best) else { return 0.0 };
        let as_good = self
            .trials
            .iter()
            .zip(&self.squares)
            .skip(1)
            .filter(|(own, squares)| own.found.len() == best.found.len() && self.is_no_worse(squares));
        as_good.filter_map(|(trial, _)| value(trial)).map(|other| (other - own).abs()).fold(0.0, f64::max)
    }

    /// How many of a place's class have no more parameters than the best trial: a more flexible effect imitates any other.
    pub fn n_as_simple(&self, slot: usize) -> usize {
        let Some(best) = self.trials.first() else { return 0 };
        let simple = |candidate: &usize| {
            let own = self.trials.iter().find(|own| stand_in(&best.found, &own.found, slot) == Some(*candidate));
            own.is_none_or(|own| own.fit.variables.len() <= best.fit.variables.len())
        };
        self.class(slot).iter().filter(|candidate| simple(candidate)).count()
    }

    /// The best trial that is no worse, as far as the blocks tell or by so little that it may be the imperfection of a law, and has such a
    /// candidate in a place of the best one.
    pub fn no_worse_with(&self, slot: usize, is_wanted: impl Fn(usize) -> bool) -> Option<usize> {
        let best = self.trials.first()?;
        let is_such = |place: &usize| {
            let other = stand_in(&best.found, &self.trials[*place].found, slot);
            let squares = &self.squares[*place];
            let sum = |own: &[f64]| own.iter().sum::<f64>();
            let is_near = sum(squares) <= IMPERFECT * sum(&self.squares[0]);
            other.is_some_and(&is_wanted) && (is_near || self.is_no_worse(squares))
        };
        (1..self.trials.len()).find(is_such)
    }

    /// Makes the trial of this place the best one; the others stay in their order.
    pub fn prefer(&mut self, place: usize) {
        let Some(trials) = self.trials.get_mut(..=place) else { return };
        trials.rotate_right(1);
        self.squares[..=place].rotate_right(1);
        self.frequency[..=place].rotate_right(1);
    }

    /// How often a trial is best that holds, for this place of the best trial, one of its class.
    pub fn probability(&self, class: &[usize]) -> f64 {
        let holds = |trial: &Trial| trial.found.iter().any(|k| class.contains(k));
        let sum: f64 = self.trials.iter().zip(&self.frequency).filter(|(trial, _)| holds(trial)).map(|(_, f)| f).sum();
        // The sum of nothing is minus zero.
        sum + 0.0
    }
}

/// The candidate that stands in a place of `best` if the rest of `other` is the same.
fn stand_in(best: &[usize], other: &[usize], slot: usize) -> Option<usize> {
    let rest: Vec<usize> = best.iter().enumerate().filter(|(k, _)| *k != slot).map(|(_, own)| *own).collect();
    if other.len() != best.len() || !rest.iter().all(|own| other.contains(own)) {
        return None;
    }
    other.iter().copied().find(|own| !rest.contains(own))
}

fn frequency(problem: &Problem, trials: &[Trial], squares: &[Vec<f64>], seed: u64) -> Vec<f64> {
    let n_blocks = problem.n_blocks;
    let own = price(problem, memory(problem, trials));
    let price: Vec<f64> = trials.iter().map(|t| (t.fit.variables.len() as f64 * own).exp()).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x005e_ed0f_b007);
    let mut wins = vec![0.0; trials.len()];
    for _ in 0..RESAMPLES {
        let picks: Vec<usize> = (0..n_blocks).map(|_| random.next_u32() as usize % n_blocks).collect();
        let cost = |k: usize| picks.iter().map(|&b| squares[k][b]).sum::<f64>() * price[k];
        let best = (0..trials.len()).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        if let Some(own) = best.and_then(|k| wins.get_mut(k)) {
            *own += 1.0 / RESAMPLES as f64;
        }
    }
    wins
}
