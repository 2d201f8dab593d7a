//! What stays of a list: only members that pay on blocks of time that their fit did not see.

use super::kind::Kind;
use super::refine::{Fit, Loss, as_given, refine};
use super::search::Search;
use super::signal::Signal;
use rayon::prelude::*;

/// Errors of a list on left-out blocks.
#[derive(Clone, Debug)]
pub(super) struct HeldOut {
    /// Sum of squares of each block.
    pub blocks: Vec<f64>,
    /// Mean square of all rows.
    pub mean_square: f64,
}

/// Rows of the loss in blocks of time.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// First row of each block, and the end of the last.
    pub bounds: Vec<usize>,
    /// Whether each block is a recording: its gain and offset are its own then.
    pub are_recordings: bool,
}

const FOLDS: usize = 6;
/// A member must take away more of what is left without it than this, ...
const SMALLEST_PART: f64 = 0.05;
/// ... by more than so many standard errors over blocks.
const ERRORS: f64 = 1.0;
/// The same for a shape without a name.
const SMALLEST_OF_SHAPE: f64 = 0.08;
const ERRORS_OF_SHAPE: f64 = 1.7;
/// Blocks of a record.
const BLOCKS: (usize, usize) = (12, 36);
/// Parts that a motion of fewer strokes is cut into.
const FEWEST_STROKES: usize = 4;
/// Trials are blocks from this number on.
const MANY_TRIALS: usize = 12;

impl Blocks {
    /// Blocks that are as long as the residual's memory asks for; whole trials where there are many.
    pub fn new(signal: &Signal, n_effective: f64) -> Self {
        let n = signal.rows.len();
        let n_blocks = ((n_effective / 5.0) as usize).clamp(BLOCKS.0, BLOCKS.1).min(n.max(1));
        if (MANY_TRIALS..=n_blocks.max(MANY_TRIALS)).contains(&signal.n_trials) {
            let mut bounds = vec![0];
            bounds.extend((1..n).filter(|i| signal.trial[signal.rows[*i]] != signal.trial[signal.rows[i - 1]]));
            bounds.push(n);
            return Self { bounds, are_recordings: false };
        }
        Self::equal(n, n_blocks)
    }

    /// Blocks as long as a stroke, where the motion of one record has few: blocks within a stroke hide that what was learnt there is
    /// not so in another stroke.
    fn strokes(&self, signal: &Signal) -> Option<Self> {
        let n_strokes = signal.n_strokes();
        let has_few = n_strokes < BLOCKS.0 && signal.n_trials == 1 && !self.are_recordings;
        let n = signal.rows.len();
        has_few.then(|| Self::equal(n, n_strokes.max(FEWEST_STROKES).min(n.max(1))))
    }

    fn equal(n: usize, n_blocks: usize) -> Self {
        Self { bounds: (0..=n_blocks).map(|b| b * n / n_blocks).collect(), are_recordings: false }
    }

    /// One block for each recording.
    pub fn recordings(signal: &Signal) -> Self {
        let n = signal.rows.len();
        let recording = |i: usize| signal.recording(signal.rows[i]);
        let mut bounds = vec![0];
        bounds.extend((1..n).filter(|i| recording(*i) != recording(i - 1)));
        bounds.push(n);
        Self { bounds, are_recordings: true }
    }

    pub fn n(&self) -> usize {
        self.bounds.len() - 1
    }

    /// Sums over the entries of each block.
    pub fn sums(&self, entry: impl Fn(usize) -> f64) -> Vec<f64> {
        self.bounds.windows(2).map(|w| (w[0]..w[1]).map(&entry).sum()).collect()
    }
}

/// Errors on blocks that a refit, warm from the fit, did not see. Start states are held.
pub(super) fn held_out(signal: &Signal, fit: &Fit, loss: Loss, blocks: &Blocks, iterations: usize) -> HeldOut {
    let n = signal.rows.len();
    let n_folds = if blocks.are_recordings { blocks.n() } else { FOLDS.min(blocks.n()) };
    let folds: Vec<Vec<(usize, f64)>> = (0..n_folds)
        .into_par_iter()
        .map(|fold| {
            let mut weight = loss.weight.to_vec();
            let ranges: Vec<_> =
                (fold..blocks.n()).step_by(n_folds).map(|b| blocks.bounds[b]..blocks.bounds[b + 1]).collect();
            for range in &ranges {
                // A left-out recording's own gain and offset come from its first third.
                let start = if blocks.are_recordings { range.start + range.len() / 3 } else { range.start };
                weight[start..range.end].fill(0.0);
            }
            let seen = Loss { weight: &weight, ..loss };
            let refitted = if fit.members.is_empty() {
                as_given(signal, &[], seen)
            } else {
                refine(signal, &fit.members, seen, iterations, 1e-4, false)
            };
            let square = |i: usize| (i, loss.weight[i] * refitted.solution.residual[i].powi(2));
            ranges.into_iter().flatten().map(square).collect()
        })
        .collect();
    let mut squares = vec![0.0; n];
    folds.into_iter().flatten().for_each(|(i, square)| squares[i] = square);
    let counted: f64 = loss.weight.iter().sum();
    HeldOut { mean_square: squares.iter().sum::<f64>() / counted.max(1.0), blocks: blocks.sums(|i| squares[i]) }
}

/// Mean of block differences over its standard error.
pub(super) fn in_errors(before: &[f64], after: &[f64]) -> f64 {
    let (mean, error) = crate::diagnose::mean_and_error(before.iter().zip(after).map(|(b, a)| b - a));
    mean / error.max(1e-300)
}

/// What is left of a list after leaving out, weakest first, what does not pay on left-out blocks; where the motion has few strokes,
/// beside another member, on left-out strokes too. Strokes thin a list and do not empty it: of two strokes each one's gain and offset
/// say next to nothing of the other.
pub(super) fn gate(search: &Search, best: &Fit, blocks: &Blocks) -> (Fit, HeldOut) {
    let strokes = blocks.strokes(search.signal);
    let gate = Gate { search, blocks, strokes: strokes.as_ref() };
    let thinned = gate.thin_and_grow(best);
    if strokes.is_some() && thinned.0.members.is_empty() {
        Gate { strokes: None, ..gate }.thin_and_grow(best)
    } else {
        thinned
    }
}

/// On what a list is judged.
#[derive(Clone, Copy)]
struct Gate<'a> {
    search: &'a Search<'a>,
    blocks: &'a Blocks,
    strokes: Option<&'a Blocks>,
}

/// Errors on blocks, and on strokes where there are few.
type Judged = (HeldOut, Option<HeldOut>);

impl Gate<'_> {
    fn on(&self, blocks: &Blocks, fit: &Fit) -> HeldOut {
        held_out(self.search.signal, fit, self.search.loss, blocks, 3)
    }

    fn judge(&self, fit: &Fit) -> Judged {
        (self.on(self.blocks, fit), self.strokes.map(|strokes| self.on(strokes, fit)))
    }

    /// Thins a list, and takes back what pays once the others are gone: one that was fitted too closely may have hidden it.
    fn thin_and_grow(&self, best: &Fit) -> (Fit, HeldOut) {
        let (mut current, mut own) = self.thin(best);
        for _ in 0..best.members.len() {
            let has = |kind: Kind| current.members.iter().any(|m| m.kind == kind);
            // On blocks alone: what does not pay on strokes is thinned out again.
            let grow = |kind: Kind| {
                let with = self.search.part(best, |other| other == kind || has(other), 8);
                let (part, stands) = pays(kind, &own.0, &self.on(self.blocks, &with));
                (stands && !with.imitates(self.search.signal)).then_some((part, with))
            };
            let grown: Vec<_> = best.kinds().into_par_iter().filter(|kind| !has(*kind)).filter_map(grow).collect();
            let most = grown.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, with)) = most else { break };
            let grown = self.thin(&with);
            if grown.0.kinds() == current.kinds() {
                break;
            }
            (current, own) = grown;
        }
        (current, own.0)
    }

    fn thin(&self, best: &Fit) -> (Fit, Judged) {
        let signal = self.search.signal;
        let mut current = best.clone();
        let mut own = self.judge(&current);
        while !current.members.is_empty() {
            let parts: Vec<_> = current
                .kinds()
                .par_iter()
                .map(|kind| {
                    let without = self.search.part(&current, |own| own != *kind, 8);
                    let held = self.judge(&without);
                    (*kind, without, held)
                })
                .collect();
            let is_alone = parts.len() == 1;
            let mut weakest: Option<(f64, Fit, Judged)> = None;
            for (kind, without, held) in parts {
                let (part, mut stands) = pays(kind, &held.0, &own.0);
                if let (Some(held), Some(own), false) = (&held.1, &own.1, is_alone) {
                    stands &= pays(kind, held, own).1;
                }
                let place = current.members.iter().position(|m| m.kind == kind);
                let imitates = place.is_some_and(|i| current.member_imitates(signal, i));
                if (imitates || !stands) && weakest.as_ref().is_none_or(|(least, ..)| part < *least) {
                    weakest = Some((part, without, held));
                }
            }
            let Some((_, without, held)) = weakest else { break };
            (current, own) = (without, held);
        }
        (current, own)
    }
}

/// The part of what is left without a member that it takes away, and whether that is enough.
fn pays(kind: Kind, without: &HeldOut, with: &HeldOut) -> (f64, bool) {
    let part = (without.mean_square - with.mean_square) / without.mean_square.max(1e-300);
    let (errors, smallest) =
        if kind.is_shape() { (ERRORS_OF_SHAPE, SMALLEST_OF_SHAPE) } else { (ERRORS, SMALLEST_PART) };
    (part, in_errors(&without.blocks, &with.blocks) > errors && part > smallest)
}

/// The members in the order of what each takes away, averaged over all orders in which they could be added (Shapley).
pub(super) fn order(search: &Search, fit: &Fit) -> Vec<(Kind, f64)> {
    let kinds: Vec<Kind> = fit.members.iter().map(|m| m.kind).collect();
    let k = kinds.len();
    let subsets: Vec<usize> = (0..1 << k).collect();
    let value: Vec<f64> = subsets
        .par_iter()
        .map(|subset| {
            let has = |kind: Kind| kinds.iter().position(|own| *own == kind).is_some_and(|i| subset >> i & 1 == 1);
            let part = if *subset + 1 == 1 << k { fit.clone() } else { search.part(fit, has, 4) };
            -part.square().max(1e-300).ln()
        })
        .collect();
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let share = |i: usize| -> f64 {
        let without = subsets.iter().filter(|subset| *subset >> i & 1 == 0);
        without
            .map(|&subset| {
                let size = subset.count_ones() as usize;
                let weight = factorial(size) * factorial(k - 1 - size) / factorial(k);
                weight * (value[subset | 1 << i] - value[subset])
            })
            .sum()
    };
    let mut ordered: Vec<(Kind, f64)> = (0..k).map(|i| (kinds[i], share(i))).collect();
    ordered.sort_by(|a, b| b.1.total_cmp(&a.1));
    ordered
}
