//! Beam search over lists of effects: every extension from a grid, the best deepened, then swapped and pruned.

use super::kind::Kind;
use super::refine::{Fit, Loss, as_given, kinds, polish, refine};
use super::signal::Signal;
use super::simulate::{Member, Run};
use super::solve::{Design, Solution, evaluate, solve, weighted_normal};
use crate::diagnose::screen::{orthonormal, remove};
use crate::noise::autocorrelation_time;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How a search is done.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// Lists that are kept at each depth.
    pub width: usize,
    /// Longest list.
    pub depth: usize,
}

/// A search over the lists of one joint.
pub(super) struct Search<'a> {
    pub signal: &'a Signal,
    pub loss: Loss<'a>,
    pub candidates: Vec<Kind>,
    /// The best fit of every list that was tried.
    pub pool: BTreeMap<Vec<Kind>, Fit>,
    /// Rows that tell something of their own.
    pub n_effective: f64,
    /// Slow waves in time, orthonormal: what they can make of a residual does not tell how many rows tell something of their own.
    slow: Vec<Vec<f64>>,
}

/// Price of a parameter, in units of ln N.
const PRICE: f64 = 2.0;
/// What a shape without a name costs more than an effect, in parameters: known effects are likelier.
const SURCHARGE: f64 = 2.0;
/// What an order of the chain other than the usual one costs, in the same units: it is one of several.
const PRICE_OF_ORDER: f64 = 4.0;
/// The same for records of few independent rows.
const PRICE_OF_SHORT: f64 = 3.0;
const SHORT: f64 = 60.0;
/// Lists of this length are tried in any case.
const DEEP_ENOUGH: usize = 3;
/// A residual of which more than this share of rows tells something of its own has nothing more to give.
const ENDS_WITH_WHITE: f64 = 0.3;
/// Two minima this far apart in the coordinate are different starts.
const APART: f64 = 0.6;

impl<'a> Search<'a> {
    pub fn new(signal: &'a Signal, loss: Loss<'a>, candidates: Vec<Kind>) -> Self {
        let base = as_given(signal, &[], loss);
        let wander = Member::new(signal, Kind::Wander, &[], 0.0);
        let slow = orthonormal(&super::simulate::columns(signal, &wander, &signal.base));
        let mut own =
            Self { signal, loss, candidates, pool: BTreeMap::from([(Vec::new(), base)]), n_effective: 0.0, slow };
        own.count_rows();
        own
    }

    /// The fit without further effects.
    pub fn base(&self) -> &Fit {
        &self.pool[&Vec::new()]
    }

    /// N ln RSS and a price for each parameter.
    pub fn score(&self, fit: &Fit) -> f64 {
        let n = self.n_effective;
        let price = if n < SHORT { PRICE_OF_SHORT } else { PRICE };
        let shapes = fit.members.iter().filter(|m| m.kind.is_shape()).count() as f64;
        let parameters = fit.n_parameters() + SURCHARGE * shapes;
        n * (fit.square() / self.signal.rows.len() as f64).max(1e-300).ln() + price * parameters * n.ln()
    }

    /// Whether a list can hold one more of this kind.
    pub fn is_compatible(members: &[Member], kind: Kind) -> bool {
        members.iter().all(|own| kind.stands_beside(own.kind))
    }

    /// The best list.
    pub fn run(&mut self, plan: Plan) -> Fit {
        let mut beam = vec![self.base().clone()];
        for depth in 1..=plan.depth {
            let extended = self.extend_all(&beam);
            if extended.is_empty() {
                break;
            }
            self.n_effective = self.rows_of(lowest(extended.iter()).unwrap_or_else(|| self.base()));
            let mut rough = extended;
            rough.sort_by(|a, b| self.score(a).total_cmp(&self.score(b)));
            let before = self.pool.values().map(|fit| self.score(fit)).fold(f64::INFINITY, f64::min);
            rough.iter().skip(2 * plan.width).for_each(|fit| self.remember(fit));
            rough.truncate(2 * plan.width);
            let mut deep = self.deepened(&rough);
            deep.sort_by(|a, b| self.score(a).total_cmp(&self.score(b)));
            let best = deep.first().map_or(f64::INFINITY, |fit| self.score(fit));
            deep.truncate(plan.width);
            beam = deep;
            // What several effects leave has a long memory, which makes each of them look dear: only what is left without one ends it.
            if depth >= DEEP_ENOUGH && best > before + 2.0 && (self.ends_white() || depth > DEEP_ENOUGH) {
                break;
            }
        }
        let start = self.inside(plan.depth).min_by(|a, b| self.score(a).total_cmp(&self.score(b)));
        let start = start.unwrap_or_else(|| self.base()).clone();
        let best = self.swap_and_prune(start, plan.depth);
        if self.ends_white() {
            return best;
        }
        // A slow rest makes every list look dear, also that which would be right with one member exchanged.
        let start = lowest(self.inside(plan.depth)).unwrap_or_else(|| self.base()).clone();
        let other = self.swap_and_prune(start, plan.depth);
        if self.score(&other) < self.score(&best) { other } else { best }
    }

    /// Lists of at most this length whose members are what they say.
    fn inside(&self, depth: usize) -> impl Iterator<Item = &Fit> {
        self.pool.values().filter(move |fit| fit.members.len() <= depth && !fit.imitates(self.signal))
    }

    /// Whether what the best list leaves has nothing more to give.
    fn ends_white(&self) -> bool {
        self.n_effective > ENDS_WITH_WHITE * self.signal.rows.len() as f64
    }

    /// Takes the rows that tell something of their own from what the best list leaves.
    fn count_rows(&mut self) {
        self.n_effective = self.rows_of(lowest(self.pool.values()).unwrap_or_else(|| self.base()));
    }

    /// Rows of the loss that tell something of their own beside a slow wandering, 8 or more.
    fn rows_of(&self, fit: &Fit) -> f64 {
        let mut residual = fit.solution.residual.clone();
        remove(&self.slow, &mut residual);
        memories(&residual)
    }

    fn remember(&mut self, fit: &Fit) {
        let key = fit.kinds();
        if self.pool.get(&key).is_none_or(|own| fit.square() < own.square()) {
            self.pool.insert(key, fit.clone());
        }
    }

    /// Every list one longer, each once.
    fn extend_all(&mut self, beam: &[Fit]) -> Vec<Fit> {
        let mut jobs: Vec<(Vec<Kind>, &Fit, Kind)> = Vec::new();
        let mut known = Vec::new();
        for fit in beam {
            for &kind in &self.candidates {
                if !Self::is_compatible(&fit.members, kind) {
                    continue;
                }
                let key = with(fit.kinds(), kind);
                if let Some(own) = self.pool.get(&key) {
                    known.push(own.clone());
                } else if !jobs.iter().any(|(own, ..)| *own == key) {
                    jobs.push((key, fit, kind));
                }
            }
        }
        let found: Vec<Option<Fit>> = jobs.par_iter().map(|(_, fit, kind)| self.extend(fit, *kind)).collect();
        known.extend(found.into_iter().flatten());
        known
    }

    /// A list with one more member, from the best places of its grid.
    pub fn extend(&self, fit: &Fit, kind: Kind) -> Option<Fit> {
        let starts = self.starts(&fit.members, kind, 2);
        let fits = starts.iter().map(|members| refine(self.signal, members, self.loss, 5, 1e-5, true));
        fits.min_by(|a, b| a.square().total_cmp(&b.square()))
    }

    /// The best places of a new member's grid with the others held, in its usual place of the chain or where it leaves clearly less.
    fn starts(&self, members: &[Member], kind: Kind, keep: usize) -> Vec<Vec<Member>> {
        let usual = members.iter().position(|own| own.kind > kind).unwrap_or(members.len());
        let here = evaluate(self.signal, members, self.loss.weight, self.loss.noise);
        let mut best = self.starts_at(usual, members, &here, kind, keep);
        // What adds costs little to try; of the others hysteresis stands most often where it is not looked for.
        let others = (0..=members.len()).filter(|at| {
            let between = &members[*at.min(&usual)..*at.max(&usual)];
            let first = if *at < usual { between.first() } else { between.last() };
            (!kind.carries() || kind == Kind::Backlash) && first.is_some_and(|own| kind.has_order_with(own.kind))
        });
        for at in others {
            let there = self.starts_at(at, members, &here, kind, keep);
            if let (Some(other), Some(own)) = (there.first(), best.first())
                && self.is_clearly_less(other.0, own.0)
            {
                best = there;
            }
        }
        best.into_iter().map(|(_, list)| list).collect()
    }

    /// Whether another order of the chain leaves so much less that it is taken, by sums of squares.
    fn is_clearly_less(&self, other: f64, usual: f64) -> bool {
        self.n_effective * (usual / other.max(1e-300)).ln() > PRICE_OF_ORDER
    }

    /// The same in one place of the chain, each with its sum of squares; `here` is what the others make.
    fn starts_at(
        &self,
        at: usize,
        members: &[Member],
        here: &(Run, Design, Solution),
        kind: Kind,
        keep: usize,
    ) -> Vec<(f64, Vec<Member>)> {
        let with = |member: Member| {
            let mut list = members.to_vec();
            list.insert(at, member);
            list
        };
        let grid = kind.grid(self.signal);
        if kind.ranges(self.signal).is_empty() {
            let list = with(Member::new(self.signal, kind, &[], 0.0));
            return vec![(as_given(self.signal, &list, self.loss).square(), list)];
        }
        let starts: &[f64] = if kind.has_start() { &[0.0, -1.0, 1.0] } else { &[0.0] };
        let cells = grid.iter().flat_map(|values| starts.iter().map(move |start| (values, *start)));
        let mut scored: Vec<(f64, Member)> = cells
            .map(|(values, start)| {
                let member = Member::new(self.signal, kind, values, start);
                let square = if kind.carries() {
                    let list = with(member.clone());
                    let mut run = here.0.clone();
                    run.redo(self.signal, &list, at);
                    solve(self.signal, &Design::new(self.signal, &run), self.loss.weight, self.loss.noise).square
                } else {
                    let mut columns = super::simulate::columns(self.signal, &member, &here.0.passed[at]);
                    columns.iter_mut().for_each(|column| here.2.project(column, self.loss.weight));
                    here.2.square - gain(&columns, &here.2.residual, self.loss.weight)
                };
                (square, member)
            })
            .collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ranges = kind.ranges(self.signal);
        let mut picked: Vec<(f64, Member)> = Vec::new();
        for (square, member) in scored {
            let place = |m: &Member| ranges[0].coordinate(m.values[0]);
            let far = |other: &Member| {
                matches!(kind, Kind::Periodic | Kind::Rhythm) || (place(other) - place(&member)).abs() > APART
            };
            if picked.len() < keep && picked.iter().all(|(_, own)| far(own)) {
                picked.push((square, member));
            }
        }
        picked.into_iter().map(|(square, member)| (square, with(member))).collect()
    }

    /// Lists fitted for longer, with the plainer ones that they stand for.
    fn deepened(&mut self, lists: &[Fit]) -> Vec<Fit> {
        let mut deep: Vec<Fit> = lists.par_iter().map(|fit| self.deepen(fit)).collect();
        deep.iter().for_each(|fit| self.remember(fit));
        deep.extend(self.plainer(&deep));
        self.count_rows();
        deep
    }

    /// A longer fit; every member from its whole grid again with the others held, which leaves local minima.
    pub fn deepen(&self, fit: &Fit) -> Fit {
        let mut best = self.in_best_order(refine(self.signal, &fit.members, self.loss, 15, 1e-5, true));
        for (place, kind) in best.members.iter().map(|own| own.kind).enumerate().collect::<Vec<_>>() {
            if matches!(kind, Kind::Periodic | Kind::Rhythm) || kind.ranges(self.signal).is_empty() {
                continue;
            }
            let rest: Vec<Member> = best.members.iter().filter(|own| own.kind != kind).cloned().collect();
            let here = evaluate(self.signal, &rest, self.loss.weight, self.loss.noise);
            for (_, start) in self.starts_at(place, &rest, &here, kind, 1) {
                if as_given(self.signal, &start, self.loss).square() < 1.3 * best.square() {
                    let again = refine(self.signal, &start, self.loss, 10, 1e-5, true);
                    if again.square() < best.square() {
                        best = again;
                    }
                }
            }
        }
        polish(self.signal, best, self.loss)
    }

    /// Lists with one play in place of many that are no more than one, where those are not known: one of their weights is below zero by
    /// chance, so that they are left out, and the play with them.
    fn plainer(&mut self, lists: &[Fit]) -> Vec<Fit> {
        let are_many = |kind: Kind| matches!(kind, Kind::Plays | Kind::UnevenPlays);
        let plain = |fit: &Fit| {
            let place = fit.members.iter().position(|own| are_many(own.kind))?;
            let rest: Vec<Member> = fit.members.iter().filter(|own| !are_many(own.kind)).cloned().collect();
            let key = with(kinds(&rest), Kind::Backlash);
            let is_new = !self.pool.contains_key(&key) && Self::is_compatible(&rest, Kind::Backlash);
            (is_new && self.candidates.contains(&Kind::Backlash) && fit.member_imitates(self.signal, place))
                .then_some(rest)
        };
        let rests: Vec<Vec<Member>> = lists.iter().filter_map(plain).collect();
        let extended =
            |rest: &Vec<Member>| self.extend(&refine(self.signal, rest, self.loss, 8, 1e-5, true), Kind::Backlash);
        let found: Vec<Fit> = rests.par_iter().filter_map(extended).map(|fit| self.deepen(&fit)).collect();
        found.iter().for_each(|fit| self.remember(fit));
        found
    }

    /// A list with its members in another order of the chain, where that leaves clearly less.
    fn in_best_order(&self, mut best: Fit) -> Fit {
        for _ in 0..best.members.len() {
            let moved = orders(&best.members);
            let fits = moved.iter().map(|members| refine(self.signal, members, self.loss, 5, 1e-5, true));
            let other = fits.min_by(|a, b| a.square().total_cmp(&b.square()));
            match other.filter(|own| self.is_clearly_less(own.square(), best.square())) {
                Some(other) => best = other,
                None => break,
            }
        }
        best
    }

    /// Every member replaced or left out, or one more, until nothing gets better.
    fn swap_and_prune(&mut self, mut best: Fit, depth: usize) -> Fit {
        for _ in 0..3 {
            let mut options = Vec::new();
            if best.members.len() < depth {
                options.extend(self.extend_all(core::slice::from_ref(&best)));
            }
            for kind in best.kinds() {
                let rest: Vec<Member> = best.members.iter().filter(|own| own.kind != kind).cloned().collect();
                let key = kinds(&rest);
                let without = match self.pool.get(&key) {
                    Some(own) => own.clone(),
                    None => refine(self.signal, &rest, self.loss, 12, 1e-5, true),
                };
                self.remember(&without);
                options.extend(self.extend_all(core::slice::from_ref(&without)));
                options.push(without);
            }
            options.iter().for_each(|fit| self.remember(fit));
            options.retain(|fit| fit.members.len() <= depth);
            options.sort_by(|a, b| self.score(a).total_cmp(&self.score(b)));
            options.truncate(3);
            let deep = self.deepened(&options);
            let now = self.score(&best);
            let next = deep.into_iter().filter(|fit| !fit.imitates(self.signal));
            let next = next.min_by(|a, b| self.score(a).total_cmp(&self.score(b)));
            match next.filter(|fit| self.score(fit) < now - 1e-6) {
                Some(next) => best = next,
                None => break,
            }
        }
        best
    }

    /// The fit of part of a list: what the pool has, or the list's own values refined.
    pub fn part(&self, fit: &Fit, keep: impl Fn(Kind) -> bool, iterations: usize) -> Fit {
        let rest: Vec<Member> = fit.members.iter().filter(|own| keep(own.kind)).cloned().collect();
        let warm = refine(self.signal, &rest, self.loss, iterations, 1e-5, true);
        match self.pool.get(&kinds(&rest)) {
            Some(own) if own.square() < warm.square() => {
                refine(self.signal, &own.members, self.loss, iterations, 1e-5, true)
            }
            _ => warm,
        }
    }

    /// Kinds that may stand in a member's place.
    pub fn others(&self, fit: &Fit, slot: Kind) -> Vec<Kind> {
        let may = |own: &Kind| {
            let fits = |m: &Member| m.kind == slot || own.stands_beside(m.kind);
            *own != slot && !own.is_shape() && fit.members.iter().all(fits)
        };
        self.candidates.iter().copied().filter(may).collect()
    }
}

/// The orders of a list with one member moved, to just behind or just before one with which it has an order.
fn orders(members: &[Member]) -> Vec<Vec<Member>> {
    let mut all: Vec<Vec<Member>> = Vec::new();
    for (first, second) in (0..members.len()).flat_map(|j| (0..j).map(move |i| (i, j))) {
        if !members[first].kind.has_order_with(members[second].kind) {
            continue;
        }
        let mut behind = members.to_vec();
        behind[first..=second].rotate_left(1);
        let mut before = members.to_vec();
        before[first..=second].rotate_right(1);
        for list in [behind, before] {
            let order = |own: &[Member]| own.iter().map(|m| m.kind).collect::<Vec<Kind>>();
            if !all.iter().any(|other| order(other) == order(&list)) {
                all.push(list);
            }
        }
    }
    all
}

/// The fit that leaves least.
fn lowest<'f>(fits: impl Iterator<Item = &'f Fit>) -> Option<&'f Fit> {
    fits.min_by(|a, b| a.square().total_cmp(&b.square()))
}

/// What columns take away from the sum of squares of a residual.
fn gain(columns: &[Vec<f64>], residual: &[f64], weight: &[f64]) -> f64 {
    let (gram, right) = weighted_normal(columns, residual, weight);
    let p = right.len();
    let ridge = 1e-9 * gram.trace().max(1e-300);
    let solved = (gram + DMatrix::identity(p, p) * ridge).cholesky().map(|factor| factor.solve(&right));
    solved.map_or(0.0, |beta: DVector<f64>| beta.dot(&right).max(0.0))
}

/// The key of a list with one more member.
fn with(mut kinds: Vec<Kind>, kind: Kind) -> Vec<Kind> {
    kinds.push(kind);
    kinds.sort_unstable();
    kinds
}

/// Rows of the loss over the residual's correlation time, 8 or more.
pub(super) fn n_effective(fit: &Fit) -> f64 {
    memories(&fit.solution.residual)
}

fn memories(residual: &[f64]) -> f64 {
    let mean = residual.iter().sum::<f64>() / residual.len().max(1) as f64;
    let centred: Vec<f64> = residual.iter().map(|r| r - mean).collect();
    (residual.len() as f64 / autocorrelation_time(&centred, 1).max(1.0)).max(8.0)
}
