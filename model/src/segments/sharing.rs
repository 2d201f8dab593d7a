//! How the lines share what holds the segments, Eq. (10) for any number of lines: as preferred, and within bounds.
//!
//! Problem: minimise |tau - tau_p|^2 subject to J^T tau = m and low <= tau <= high, with tau_p the same preload on every line.
//!
//! Solution: without bounds tau = tau_p + J (J^T J)^-1 (m - J^T tau_p), the loads of least norm and what of the preload bends nothing.
//! With bounds the dual active-set method of Goldfarb and Idnani (1983): it begins from the set of bounds of the step before, lets go
//! of those that only hold the loads back, and takes in the bound that is violated most, until none is. Each pivot is a 6x6
//! solution; the loads are computed from the final set alone, so that they do not depend on where the search began.
//!
//! Failure: no loads within the bounds hold the segments. The line that cannot be brought within its bound is named. More pivots than
//! [`MAX_PIVOTS`] count as a failure of their own; the search from no bounds needs at most a few times the number of lines.

use super::{Bends, BendsByBends, LineValues, LinesByBends, MAX_LINES, Segments};
use nalgebra::SVector;

/// Pivots of one search at most.
pub(super) const MAX_PIVOTS: usize = 6 * MAX_LINES;
/// A bound that is broken by less than this is kept, N.
const KEPT_N: f64 = 1e-9;
/// What of a line is left beside the others, 1, below which it is bound by them.
const INDEPENDENT: f64 = 1e-9;

/// Bounds and preferred load of each line, N, push positive; infinite bounds bind nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadSharing {
    /// Smallest loads.
    pub low_n: LineValues,
    /// Largest loads, at least the smallest.
    pub high_n: LineValues,
    /// Load that each line would have by itself.
    pub preload_n: f64,
}

/// How the loads were found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sharing {
    /// The preferred loads lie within every bound.
    Preferred,
    /// Lines are at their bounds.
    Bounded {
        /// The line whose bound costs most, from 0.
        line_idx: usize,
    },
    /// No loads within the bounds hold the segments.
    Infeasible {
        /// A line that cannot be brought within its bound while the others keep theirs, from 0.
        line_idx: usize,
        /// What it would bear, N.
        load_n: f64,
        /// Its bound, N.
        limit_n: f64,
    },
    /// The search took too many pivots.
    Unsettled,
    /// A number that was given is not finite.
    NotFinite,
}

impl Sharing {
    /// Whether the loads hold the segments within the bounds.
    pub fn holds(&self) -> bool {
        matches!(self, Self::Preferred | Self::Bounded { .. })
    }
}

/// Loads of the lines with the way they were found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedLoads {
    /// Loads at the snake, N, push positive; without meaning unless they hold.
    pub tau_n: LineValues,
    /// How they were found.
    pub sharing: Sharing,
    /// Which lines are at a bound; where the next search begins.
    pub active: ActiveSet,
    /// Pivots of the search.
    pub n_pivots: usize,
}

/// Which lines are at a bound: -1 the lower, 1 the upper one, 0 none.
pub type ActiveSet = [i8; MAX_LINES];

/// The point that a set of bounds determines.
struct Point {
    tau_n: LineValues,
    /// Multipliers of the bounds in the set, 0 of the others.
    multipliers: LineValues,
}

impl LoadSharing {
    /// No bounds, no preload: the loads of least norm.
    pub fn least_norm() -> Self {
        Self { low_n: LineValues::repeat(f64::NEG_INFINITY), high_n: LineValues::repeat(f64::INFINITY), preload_n: 0.0 }
    }

    fn bound_n(&self, line: usize, side: i8) -> f64 {
        if side < 0 { self.low_n[line] } else { self.high_n[line] }
    }
}

impl Segments {
    /// Loads that hold the moments J^T tau, N m, shared as asked for; the search begins from a set of bounds, zeros for none.
    ///
    /// # Real-time
    /// No allocation; at most 72 pivots of one 6x6 solution each.
    pub fn share_loads(&self, moments_nm: &Bends, asked: &LoadSharing, begin: &ActiveSet) -> SharedLoads {
        let mut preferred_n = LineValues::zeros();
        preferred_n.rows_mut(0, self.n_lines).fill(asked.preload_n);
        let least_n = match asked.preload_n == 0.0 {
            true => self.least_loads_n(moments_nm),
            false => preferred_n + self.least_loads_n(&(moments_nm - self.j().tr_mul(&preferred_n))),
        };
        let none: ActiveSet = [0; MAX_LINES];
        let answer = |tau_n, sharing, active, n_pivots| SharedLoads { tau_n, sharing, active, n_pivots };
        if !least_n.iter().all(|load| load.is_finite()) {
            return answer(least_n, Sharing::NotFinite, none, 0);
        }
        if self.worst(&least_n, asked).is_none() {
            return answer(least_n, Sharing::Preferred, none, 0);
        }
        let mut search = Search { own: self, asked, moments_nm, preferred_n, active: none, n_pivots: 0 };
        let mut point = search.begin(begin).unwrap_or(Point { tau_n: least_n, multipliers: LineValues::zeros() });
        let sharing = loop {
            let Some((line, side)) = self.worst(&point.tau_n, asked) else { break search.limiting(&point) };
            if let Some(failed) = search.take_in(&mut point, line, side) {
                break failed;
            }
        };
        let exact = sharing.holds().then(|| search.point()).flatten();
        answer(exact.map_or(point.tau_n, |point| point.tau_n), sharing, search.active, search.n_pivots)
    }

    /// d tau / d moments, N per N m, while the same lines stay at their bounds.
    pub fn load_slopes(&self, active: &ActiveSet) -> LinesByBends {
        if active.iter().all(|side| *side == 0) {
            return self.pinv().transpose();
        }
        // The set of a search is one whose free lines still hold every moment.
        let Some(inverse) = self.free_inverse(active) else { return LinesByBends::zeros() };
        let mut slopes = self.j() * inverse;
        for k in (0..self.n_lines).filter(|&k| active[k] != 0) {
            slopes.row_mut(k).fill(0.0);
        }
        slopes
    }

    /// The line that breaks its bound most, and which bound.
    fn worst(&self, tau_n: &LineValues, asked: &LoadSharing) -> Option<(usize, i8)> {
        let mut worst = (KEPT_N, None);
        for k in 0..self.n_lines {
            for (side, over_n) in [(-1, asked.low_n[k] - tau_n[k]), (1, tau_n[k] - asked.high_n[k])] {
                if over_n > worst.0 {
                    worst = (over_n, Some((k, side)));
                }
            }
        }
        worst.1
    }

    /// (J_F^T J_F)^-1 over the lines that are free; `None` where these do not hold every moment.
    fn free_inverse(&self, active: &ActiveSet) -> Option<BendsByBends> {
        let mut normal = BendsByBends::zeros();
        for k in (0..self.n_lines).filter(|&k| active[k] == 0) {
            let row = self.j().row(k);
            normal += row.transpose() * row;
        }
        // In units of the radii, so that the ones of what is not there do not dwarf what is.
        let scale = normal.trace() / self.n_bends() as f64;
        let factors = self.padded(normal / scale).cholesky()?;
        let least = factors.l_dirty().diagonal().iter().fold(f64::INFINITY, |least, own| least.min(*own));
        if least * least < INDEPENDENT {
            return None;
        }
        let mut inverse = factors.inverse() / scale;
        for k in self.n_bends()..super::MAX_BENDS {
            inverse[(k, k)] = 0.0;
        }
        Some(inverse)
    }
}

/// A search under way.
struct Search<'a> {
    own: &'a Segments,
    asked: &'a LoadSharing,
    moments_nm: &'a Bends,
    preferred_n: LineValues,
    active: ActiveSet,
    n_pivots: usize,
}

impl Search<'_> {
    /// The point of the set of the step before, without the bounds that only hold the loads back; `None` where that set is none.
    fn begin(&mut self, begin: &ActiveSet) -> Option<Point> {
        for (k, side) in begin.iter().enumerate().take(self.own.n_lines) {
            let side = side.signum();
            self.active[k] = if self.asked.bound_n(k, side).is_finite() { side } else { 0 };
        }
        while self.active.iter().any(|side| *side != 0) {
            let Some(point) = self.point() else { break };
            let least = (0..self.own.n_lines).min_by(|&a, &b| point.multipliers[a].total_cmp(&point.multipliers[b]))?;
            if point.multipliers[least] >= 0.0 {
                return Some(point);
            }
            self.active[least] = 0;
            self.n_pivots += 1;
        }
        self.active = [0; MAX_LINES];
        None
    }

    /// The loads nearest to the preferred ones that hold the moments with the set's lines at their bounds.
    fn point(&self) -> Option<Point> {
        let own = self.own;
        let inverse = own.free_inverse(&self.active)?;
        let mut tau_n = self.preferred_n;
        for k in (0..own.n_lines).filter(|&k| self.active[k] != 0) {
            tau_n[k] = self.asked.bound_n(k, self.active[k]);
        }
        let pull = own.j() * (inverse * (self.moments_nm - own.j().transpose() * tau_n));
        let mut multipliers = LineValues::zeros();
        for k in 0..own.n_lines {
            match self.active[k] {
                0 => tau_n[k] += pull[k],
                side => multipliers[k] = -f64::from(side) * (tau_n[k] - self.preferred_n[k] - pull[k]),
            }
        }
        Some(Point { tau_n, multipliers })
    }

    /// Brings a line within its bound, and lets go of bounds that stand in its way; tells where that cannot be.
    fn take_in(&mut self, point: &mut Point, line: usize, side: i8) -> Option<Sharing> {
        let own = self.own;
        // Of the bound's normal, e_line times this.
        let sign = -f64::from(side);
        let bound_n = self.asked.bound_n(line, side);
        let mut multiplier = 0.0;
        loop {
            self.n_pivots += 1;
            let Some(inverse) = own.free_inverse(&self.active).filter(|_| self.n_pivots <= MAX_PIVOTS) else {
                return Some(Sharing::Unsettled);
            };
            let row: SVector<f64, 6> = own.j().row(line).transpose();
            let pull: LineValues = own.j() * (inverse * row) * sign;
            let left = 1.0 - sign * pull[line];
            let mut longest = (f64::INFINITY, None);
            for k in (0..own.n_lines).filter(|&k| self.active[k] != 0) {
                let rate = f64::from(self.active[k]) * pull[k];
                if rate > INDEPENDENT && point.multipliers[k] / rate < longest.0 {
                    longest = (point.multipliers[k] / rate, Some(k));
                }
            }
            let over_n = sign * (bound_n - point.tau_n[line]);
            let whole = if left > INDEPENDENT { over_n / left } else { f64::INFINITY };
            let step = whole.min(longest.0);
            if step == f64::INFINITY {
                return Some(Sharing::Infeasible { line_idx: line, load_n: point.tau_n[line], limit_n: bound_n });
            }
            for k in 0..own.n_lines {
                match self.active[k] {
                    0 if left > INDEPENDENT => {
                        let along = if k == line { sign } else { 0.0 };
                        point.tau_n[k] += step * (along - pull[k]);
                    }
                    0 => {}
                    at => point.multipliers[k] -= step * f64::from(at) * pull[k],
                }
            }
            multiplier += step;
            match longest.1 {
                Some(k) if longest.0 < whole => (self.active[k], point.multipliers[k]) = (0, 0.0),
                _ => {
                    (self.active[line], point.multipliers[line]) = (side, multiplier);
                    point.tau_n[line] = bound_n;
                    return None;
                }
            }
        }
    }

    /// The bound in force that costs most.
    fn limiting(&self, point: &Point) -> Sharing {
        let dearer = |&a: &usize, &b: &usize| point.multipliers[a].total_cmp(&point.multipliers[b]);
        let at_bound = (0..self.own.n_lines).filter(|&k| self.active[k] != 0);
        at_bound.max_by(dearer).map_or(Sharing::Preferred, |line_idx| Sharing::Bounded { line_idx })
    }
}
