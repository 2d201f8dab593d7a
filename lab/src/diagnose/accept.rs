//! Does one more effect deserve to be added? Significance, cross-validation and a contribution that matters.

use super::search::Trial;
use crate::Problem;
use crate::fit::held_out_block_squares;

/// Folds of the cross-validation.
pub(super) const FOLDS: usize = 6;
/// Family-wise level of the first effect, whose absence is the verdict "none".
const LEVEL_OF_FIRST: f64 = 0.03;
/// The same, and the gain in standard errors, where noise is slow: blocks are then not quite independent.
const LEVEL_IN_SLOW_NOISE: f64 = 0.01;
const ERRORS_IN_SLOW_NOISE: f64 = 2.0;
/// Level of each further effect: a wrong one costs more than a missed one.
const LEVEL_OF_NEXT: f64 = 0.01;
/// A further effect must take away at least this share of what the list without it leaves above the floor: a share of what the
/// model as given left would hide small effects behind a large one ...
const SMALLEST_SHARE: f64 = 0.05;
/// ... and this much of the floor's own variance.
pub(super) const SMALLEST_OF_FLOOR: f64 = 0.03;
/// Of lists of so many each free number more must take away this much: one number imitates the imperfection of other laws less than three.
pub(super) const FEWEST_OF_LIST: usize = 3;
const SMALLEST_FOR_A_NUMBER: f64 = 0.01;

/// Errors on left-out blocks of two trials, and what noise there is.
pub(super) struct Comparison<'a> {
    pub problem: &'a Problem<'a>,
    /// Mean square of the floor in the units of `Problem::rms`, if known.
    pub floor: Option<f64>,
    /// Whether noise is white, as far as the data tell.
    pub is_white: bool,
}

impl Comparison<'_> {
    /// Whether a trial leaves anything to explain.
    pub fn leaves_something(&self, trial: &Trial) -> bool {
        let rms = self.problem.rms(trial.fit.sum_of_squares);
        let most = if trial.found.len() + 1 < FEWEST_OF_LIST { NOTHING_LEFT } else { NOTHING_LEFT_OF_LIST };
        self.floor.is_none_or(|floor| rms > most * floor)
    }

    /// Whether a first effect takes away half of a mean square far above a known floor, beyond chance from block to block. Where others
    /// beside it leave much, no test of signs sees it: what is found behind it must then take away nearly everything.
    pub fn takes_half(&self, start: &Trial, first: &Trial) -> bool {
        let is_far = self.floor.is_some_and(|floor| self.problem.rms(start.fit.sum_of_squares) > FAR_ABOVE * floor);
        if !is_far {
            return false;
        }
        let [before, after] = [start, first].map(|own| held_out_block_squares(self.problem, &own.fit, FOLDS));
        let (gain, error) = mean_and_error(before.iter().zip(&after).map(|(b, a)| b - a));
        gain > ERRORS_IN_SLOW_NOISE * error && after.iter().sum::<f64>() <= 0.5 * before.iter().sum::<f64>()
    }

    /// Whether another list takes away this part of what a list leaves above the floor; never where the floor is unknown.
    pub fn takes(&self, list: &Trial, other: &Trial, part: f64) -> bool {
        let Some(floor) = self.floor else { return false };
        let above = |trial: &Trial| self.problem.rms(trial.fit.sum_of_squares).powi(2) - floor.powi(2);
        above(other) <= (1.0 - part) * above(list)
    }

    /// Whether `with` is better than `without` beyond chance (p-value of its search) and by an amount that matters.
    pub fn deserves(&self, without: &Trial, with: &Trial, p_value: f64) -> bool {
        let first = without.found.is_empty();
        let (level, errors) = match (first, self.is_white) {
            (_, false) => (LEVEL_IN_SLOW_NOISE, ERRORS_IN_SLOW_NOISE),
            (true, true) => (LEVEL_OF_FIRST, 1.0),
            (false, true) => (LEVEL_OF_NEXT, 1.0),
        };
        if p_value > level {
            return false;
        }
        let before = held_out_block_squares(self.problem, &without.fit, FOLDS);
        let after = held_out_block_squares(self.problem, &with.fit, FOLDS);
        let (gain, error) = mean_and_error(before.iter().zip(&after).map(|(b, a)| b - a));
        let square = |sums: &[f64]| self.problem.rms(sums.iter().sum()).powi(2);
        let (left, share) = (square(&before), square(&before) - square(&after));
        // Where the floor is not known, all that is left may be explainable.
        let floor = self.floor.unwrap_or(0.0).powi(2);
        let explainable = (left - floor).max(0.0);
        let matters = first || (share >= SMALLEST_SHARE * explainable && share >= smallest(without, with) * floor);
        gain > errors * error && matters
    }
}

/// The share of the floor's variance that a list's next effect must take away at least.
fn smallest(without: &Trial, with: &Trial) -> f64 {
    let more = with.fit.variables.len().saturating_sub(without.fit.variables.len()).max(1) as f64;
    if with.found.len() < FEWEST_OF_LIST {
        SMALLEST_OF_FLOOR
    } else {
        SMALLEST_OF_FLOOR.min(SMALLEST_FOR_A_NUMBER * more)
    }
}

/// Errors up to this ratio of the floor leave nothing for a further effect.
const NOTHING_LEFT: f64 = 1.02;
/// The same for a list's next one.
const NOTHING_LEFT_OF_LIST: f64 = 1.005;

/// Beyond this ratio noise that is slower than the data tell cannot be what is left.
const FAR_ABOVE: f64 = 1.5;

/// Mean of block differences and its standard error.
pub(crate) fn mean_and_error(differences: impl Iterator<Item = f64>) -> (f64, f64) {
    let all: Vec<f64> = differences.collect();
    let n = all.len().max(2) as f64;
    let mean = all.iter().sum::<f64>() / n;
    let variance = all.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
