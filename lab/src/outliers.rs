//! Measurements that are none: rows that stand out from those before and behind them, single or in short bursts.

use crate::noise::{bounds, by_differences};
use crate::{Problem, Quantity};

/// Rows whose outputs stand out by more than [`STANDS_OUT`] standard deviations of the differences from what lies before and behind
/// them: single ones, also at the ends of a trial, and of shapes bursts, as a tracker makes that has lost its mark for a moment.
pub(crate) fn outliers(problem: &Problem, residual: &[f64]) -> Vec<usize> {
    let Some((sigma, _)) = by_differences(problem, residual) else { return Vec::new() };
    let width = problem.data.n_outputs;
    let rows: Vec<usize> = (0..problem.data.n_rows()).filter(|row| problem.weight[row * width] > 0.0).collect();
    let seen = Seen { problem, residual, rows: &rows, sigma };
    // Of a camera or a tracker: a joint that sticks and slips, or that is seldom moved, goes as suddenly as a burst begins.
    let has_bursts = sigma > 0.0 && matches!(problem.data.quantity, Quantity::Snake | Quantity::Segments);
    let (mut single, mut bursts): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
    let mut first = BESIDE;
    while first + BESIDE < rows.len() {
        let n = if has_bursts { seen.burst(first) } else { usize::from(seen.stand_out(first, 1)) };
        match n {
            0 | 1 => single.extend((n == 1).then_some(rows[first])),
            _ => bursts.extend(&rows[first..first + n]),
        }
        first += n.max(1);
    }
    // What happens as often as this is no accident of the sensor.
    if bursts.len() as f64 <= MOST_IN_BURSTS * rows.len() as f64 {
        single.extend(bursts);
    }
    // What is filtered has no single rows.
    if problem.data.quantity != Quantity::Force {
        single.extend(seen.ends());
    }
    single.sort_unstable();
    single
}

/// So many standard deviations.
const STANDS_OUT: f64 = 6.0;
/// Rows on either side that say where the others are.
const BESIDE: usize = 2;
/// From the row before a burst to the row behind it, s: no machine leaves a place in one row and is back in another after so short a time.
const LONGEST_BURST_S: f64 = 0.3;
/// Share of all rows that bursts may have.
const MOST_IN_BURSTS: f64 = 0.03;
/// Share of all ends of trials that may stand out, beside two: more of them are how a trial begins.
const MOST_OF_ENDS: f64 = 0.25;

/// Residuals in which bursts are looked for.
struct Seen<'a> {
    problem: &'a Problem<'a>,
    residual: &'a [f64],
    /// Rows that count.
    rows: &'a [usize],
    sigma: f64,
}

impl Seen<'_> {
    /// Length of the burst that begins at a place among the rows; 0 where none does.
    fn burst(&self, first: usize) -> usize {
        let time_s = |place: usize| self.problem.data.time_s[self.rows[place]];
        let is_short = |behind: usize| {
            self.trial(first - 1) == self.trial(behind) && time_s(behind) - time_s(first - 1) <= LONGEST_BURST_S
        };
        let may_end = |n: &usize| first + n + BESIDE <= self.rows.len() && (*n == 1 || is_short(first + n));
        if !self.leaves(first) {
            return 0;
        }
        (1..).take_while(may_end).find(|n| self.stand_out(first, *n)).unwrap_or(0)
    }

    /// Whether an output leaves where it was from one row to this one.
    fn leaves(&self, place: usize) -> bool {
        (0..self.problem.data.n_outputs)
            .any(|k| (self.at(place, k) - self.at(place - 1, k)).abs() > STANDS_OUT * self.sigma)
    }

    /// Whether so many rows all stand out, in one output, from the two before and the two behind them.
    fn stand_out(&self, first: usize, n: usize) -> bool {
        let (before, behind) = (first - BESIDE, first + n);
        self.trial(before) == self.trial(behind + 1)
            && (0..self.problem.data.n_outputs).any(|k| {
                let mut others = [before, before + 1, behind, behind + 1].map(|place| self.at(place, k));
                others.sort_by(f64::total_cmp);
                let (middle, spread) = (0.5 * (others[1] + others[2]), others[3] - others[0]);
                (first..behind).all(|place| (self.at(place, k) - middle).abs() > STANDS_OUT * self.sigma + spread)
            })
    }

    /// Rows among the first and the last two of each trial that stand out from the four that are nearest on the one side that there is.
    fn ends(&self) -> Vec<usize> {
        let mut starts: Vec<usize> =
            (0..self.rows.len()).filter(|place| *place == 0 || self.trial(*place) != self.trial(place - 1)).collect();
        let n_ends = 2 * starts.len();
        starts.push(self.rows.len());
        let mut found = Vec::new();
        for trial in starts.windows(2).filter(|trial| trial[1] - trial[0] > 3 * BESIDE) {
            let (first, last) = (trial[0], trial[1] - 1);
            found.extend(self.end([0, 1, 2, 3, 4].map(|n| first + n)));
            found.extend(self.end([0, 1, 2, 3, 4].map(|n| last - n)));
        }
        let most = f64::max(2.0, MOST_OF_ENDS * n_ends as f64);
        if found.len() as f64 <= most { found } else { Vec::new() }
    }

    /// The row of an end, or the one beside it, if it stands out from the others of these places: by what is left, and by what was
    /// measured, since a command that jumps makes a rest that jumps.
    fn end(&self, places: [usize; 5]) -> Option<usize> {
        let stands_out = |n: usize, k: usize, value: &dyn Fn(usize, usize) -> f64| {
            let (low, high) =
                bounds((0..places.len()).filter(|other| *other != n).map(|other| value(places[other], k)));
            let own = value(places[n], k);
            // From the nearest of them, not from their middle: what fades from a trial's beginning on goes a longer way in each row
            // than in all that follow.
            f64::max(own - high, low - own) > STANDS_OUT * self.sigma + (high - low)
        };
        let is_out = |n: &usize| {
            (0..self.problem.data.n_outputs).any(|k| {
                stands_out(*n, k, &|place, k| self.at(place, k))
                    && stands_out(*n, k, &|place, k| self.measured(place, k))
            })
        };
        (0..BESIDE).find(is_out).map(|n| self.rows[places[n]])
    }

    fn trial(&self, place: usize) -> u32 {
        self.problem.data.trial[self.rows[place]]
    }

    /// What the model leaves.
    fn at(&self, place: usize, output: usize) -> f64 {
        self.residual[self.rows[place] * self.problem.data.n_outputs + output]
    }

    /// What was measured, weighed as what is left is.
    fn measured(&self, place: usize, output: usize) -> f64 {
        let entry = self.rows[place] * self.problem.data.n_outputs + output;
        self.problem.data.outputs[entry] * self.problem.weight[entry]
    }
}
