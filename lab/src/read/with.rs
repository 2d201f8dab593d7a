//! `--with camera.csv`: measurements from a second log, which has a clock of its own, joined to the commands of the first.
//!
//! Nothing but the motion is common to both. So the second log's clock, a shift and a rate, is the one with which what it measured is
//! most nearly a straight line of the commands; where two shifts do nearly as well, as with a motion that repeats, it is refused.

use super::ReadError;
use super::merge::{commanded, merged};
use crate::Measurements;
use crate::measurements::SecondClock;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::path::Path;

/// Shifts that are tried, and rows of the second log that are asked: first, and at the end.
const MOST_SHIFTS: usize = 100_000;
const SHORTEST_STEP_S: f64 = 0.02;
const ASKED_FIRST: usize = 400;
const ASKED: usize = 8000;
/// Part of the second log that must lie within the first, and rows.
const OVERLAP: f64 = 0.5;
const FEWEST_ROWS: usize = 20;
/// A straight line must explain this much.
const FOLLOWS: f64 = 0.5;
/// Places that are looked at closely, and how much less the second best must explain: its rest is larger by this.
const PLACES: usize = 4;
const TOLD: f64 = 1.2;
/// Halvings of a step.
const HALVINGS: usize = 14;

/// The commands of one log with the measurements of another.
///
/// # Errors
/// [`ReadError::With`] where they cannot be joined.
pub(super) fn join(commands: Measurements, seen: Measurements, path: &Path) -> Result<Measurements, ReadError> {
    let refuse = |why: String| Err(ReadError::With { path: path.to_owned(), why });
    if [&commands, &seen].into_iter().any(|own| own.trial.iter().any(|trial| *trial > 0)) {
        return refuse(
            "one of both has several trials, expected one each; give every trial a file of its own".to_owned(),
        );
    }
    let pair = Pair::new(&commands, &seen);
    let Some((clock, others)) = align(&pair).filter(|(clock, _)| clock.share >= FOLLOWS) else {
        let expected = "no shift of its clock makes it follow the commands, expected one with which half of it is a straight line of them";
        return refuse(format!(
            "{expected}; check that both are of the same motion and that half of it lies within the other"
        ));
    };
    if let Some(other) = others.first().filter(|other| 1.0 - other.share < TOLD * (1.0 - clock.share)) {
        return refuse(format!(
            "its clock may be shifted by {:.3} or by {:.3} s, expected one shift that fits best; the motion repeats, so record one \
             that does not",
            clock.shift_s, other.shift_s
        ));
    }
    Ok(joined(&pair, clock))
}

/// Both logs, the measured rows that are asked, and the middle of their times.
struct Pair<'a> {
    commands: &'a Measurements,
    seen: &'a Measurements,
    rows: Vec<usize>,
    middle_s: f64,
}

/// The clock that suits best, and others, the best first; `None` where too little lies within the other.
fn align(pair: &Pair) -> Option<(SecondClock, Vec<SecondClock>)> {
    let (commands, seen) = (pair.commands, pair.seen);
    let (first, last) = (*pair.rows.first()?, *pair.rows.last()?);
    let length_s = seen.time_s[last] - seen.time_s[first];
    let (begin, end) = (*commands.time_s.first()?, *commands.time_s.last()?);
    let (from, to) = (begin - seen.time_s[last], end - seen.time_s[first]);
    let step_s = ((to - from) / MOST_SHIFTS as f64).max(SHORTEST_STEP_S);
    let n = ((to - from) / step_s) as usize + 1;
    let coarse = pair.thinned(ASKED_FIRST);
    let shares: Vec<f64> =
        (0..n).into_par_iter().map(|k| coarse.share(from + step_s * k as f64, 0.0).unwrap_or(0.0)).collect();
    let is_peak = |k: &usize| {
        let at = |k: Option<usize>| k.and_then(|k| shares.get(k)).copied().unwrap_or(0.0);
        shares[*k] > 0.0 && shares[*k] >= at(k.checked_sub(1)) && shares[*k] > at(Some(k + 1))
    };
    let mut peaks: Vec<usize> = (0..n).filter(is_peak).collect();
    peaks.sort_by(|a, b| shares[*b].total_cmp(&shares[*a]));
    let fine = pair.thinned(ASKED);
    let refined = |k: &usize| fine.refined(from + step_s * *k as f64, step_s, length_s);
    let mut clocks: Vec<SecondClock> = peaks.iter().take(PLACES).filter_map(refined).collect();
    clocks.sort_by(|a, b| b.share.total_cmp(&a.share));
    let best = clocks.first().cloned()?;
    // Noise makes several peaks of one.
    let apart = |other: &SecondClock| (other.shift_s - best.shift_s).abs() > 4.0 * step_s;
    let others = clocks.into_iter().filter(apart).collect();
    Some((best, others))
}

impl<'a> Pair<'a> {
    /// Every measured row; the middle is that between the first and the last of them.
    fn new(commands: &'a Measurements, seen: &'a Measurements) -> Self {
        let rows: Vec<usize> = (0..seen.n_rows()).filter(|row| seen.is_scored(*row)).collect();
        let time_s = |row: Option<&usize>| row.map_or(0.0, |row| seen.time_s[*row]);
        let middle_s = 0.5 * (time_s(rows.first()) + time_s(rows.last()));
        Self { commands, seen, rows, middle_s }
    }

    /// The same with at most so many rows, evenly chosen.
    fn thinned(&self, most: usize) -> Self {
        let rows = self.rows.iter().copied().step_by(self.rows.len().div_ceil(most).max(1)).collect();
        Self { rows, ..*self }
    }

    /// A measured row's time by the first log's clock.
    fn time_s(&self, row: usize, shift_s: f64, rate: f64) -> f64 {
        let own = self.seen.time_s[row];
        own + shift_s + rate * (own - self.middle_s)
    }

    /// Share of what was measured that is a straight line of the commands; `None` where too few rows lie within them.
    fn share(&self, shift_s: f64, rate: f64) -> Option<f64> {
        let (n, m) = (self.commands.n_inputs + 1, self.seen.n_outputs);
        let mut gram = DMatrix::zeros(n, n);
        let mut score = DMatrix::zeros(n, m);
        let mut squares = DVector::zeros(m);
        let mut inside = 0;
        let mut u = DVector::from_element(n, 1.0);
        for &row in &self.rows {
            let time_s = self.time_s(row, shift_s, rate);
            if commanded(self.commands, time_s, &mut u.as_mut_slice()[1..]).is_none() {
                continue;
            }
            inside += 1;
            let y = DVector::from_column_slice(self.seen.output(row));
            gram.ger(1.0, &u, &u, 1.0);
            score.ger(1.0, &u, &y, 1.0);
            squares += y.component_mul(&y);
        }
        if inside < FEWEST_ROWS || (inside as f64) < OVERLAP * self.rows.len() as f64 {
            return None;
        }
        let ridge = 1e-9 * gram.diagonal().max();
        let solved = (&gram + DMatrix::identity(n, n) * ridge).cholesky()?.solve(&score);
        let part = |k: usize| {
            let mean = score[(0, k)] / inside as f64;
            let whole = squares[k] - mean * mean * inside as f64;
            let explained = score.column(k).dot(&solved.column(k)) - mean * mean * inside as f64;
            if whole > 1e-12 * squares[k] { explained / whole } else { 1.0 }
        };
        Some((0..m).map(part).sum::<f64>() / m as f64)
    }

    /// The best clock near a shift: shift and rate in ever smaller steps. The shift is that in the middle of the second log: where
    /// it reads zero may be far from both.
    fn refined(&self, shift_s: f64, step_s: f64, length_s: f64) -> Option<SecondClock> {
        let mut best = SecondClock { shift_s, rate: 0.0, share: self.share(shift_s, 0.0)? };
        let mut step_s = step_s;
        for _ in 0..HALVINGS {
            let by_rate = 2.0 * step_s / length_s.max(1e-9);
            loop {
                let tried = [(step_s, 0.0), (-step_s, 0.0), (0.0, by_rate), (0.0, -by_rate)].map(|(shift, rate)| {
                    let (shift_s, rate) = (best.shift_s + shift, best.rate + rate);
                    self.share(shift_s, rate).map(|share| SecondClock { shift_s, rate, share })
                });
                let next = tried.into_iter().flatten().max_by(|a, b| a.share.total_cmp(&b.share));
                match next.filter(|next| next.share > best.share) {
                    Some(next) => best = next,
                    None => break,
                }
            }
            step_s *= 0.5;
        }
        Some(best)
    }
}

/// Both in one table, with the second log's clock.
fn joined(pair: &Pair, clock: SecondClock) -> Measurements {
    let (commands, seen) = (pair.commands, pair.seen);
    let mut all = merged(commands, seen, &pair.rows, |row| pair.time_s(row, clock.shift_s, clock.rate));
    all.names.outputs.clone_from(&seen.names.outputs);
    all.source = format!("{} with {}", commands.source, seen.source);
    all.sha256 = format!("{}, {}", commands.sha256, seen.sha256);
    all.clock = Some(clock);
    all
}
