//! Lists of more than two effects of a snake or of a force: a beam behind the best shorter ones, then swapped and pruned, and at last
//! weighed against other lists as a whole.

use super::accept::Comparison;
use super::alternatives::Alternatives;
use super::at_once;
use super::search::{Search, Trial};
use crate::Term;
use rayon::prelude::*;

/// Lists that are kept at each length.
const WIDTH: usize = 3;
/// Candidates that are refined behind each of them.
const N_NEXT: usize = 6;

/// What every robot of tendons or wires in tubes has, each its own mechanism: a stiffness that is not quite the one of the data
/// sheet, friction where lines go round bends, friction that does not depend on load, and play.
const USUAL: [&str; 4] = ["stiffness-scale", "cone-friction", "static-friction", "backlash"];
/// Of what the beam's best list leaves above the floor, the usual list must take away this part to be taken in its place.
const MUST_TAKE: f64 = 0.9;

/// A list is lengthened and its members are exchanged in turns, so many times at most.
const MOST_ROUNDS: usize = 3;
/// Members are exchanged so many times in a row at most ...
const MOST_EXCHANGES: usize = 4;
/// ... while that takes away this share of what the list leaves.
const LEAST_GAIN: f64 = 1e-3;

/// The longest list that deserves its length, with the lists that it was chosen from; `None` where nothing does.
pub(super) fn longer(
    search: &Search,
    comparison: &Comparison,
    chosen: &Trial,
    shorter: &[Trial],
    max_effects: usize,
) -> Option<(Trial, Alternatives)> {
    let mut best = chosen.clone();
    let mut rivals = shorter.to_vec();
    for round in 0..MOST_ROUNDS {
        let (mut longest, mut from) = beam(search, comparison, &best, &rivals, max_effects);
        // One effect of wide reach (a friction that depends on the bend) can imitate three narrow ones better than any of them alone:
        // then the beam never passes the list that leaves nothing.
        if round == 0
            && max_effects >= USUAL.len()
            && comparison.leaves_something(&longest)
            && let Some(usual) = usual(search)
            && comparison.takes(&longest, &usual, MUST_TAKE)
        {
            (longest, from) = (usual.clone(), vec![usual]);
        }
        if longest.found.len() < max_effects
            && let Some(own) = search.unstretched(&longest).into_iter().find(|own| !search.imitates(own))
            && comparison.deserves(&longest, &own, 0.0)
        {
            (longest, from) = (own, Vec::new());
        }
        if longest.found.len() <= best.found.len() {
            break;
        }
        // A list with other members, or in another minimum, may leave room for one more.
        let before = longest.fit.sum_of_squares;
        (best, rivals) = exchanged(search, longest, from);
        if best.fit.sum_of_squares > (1.0 - LEAST_GAIN) * before {
            break;
        }
    }
    if best.found.len() <= chosen.found.len() {
        return None;
    }
    let pruned = prune(search, comparison, best);
    let Some((best, stand_ins)) = narrower(search, comparison, &pruned, max_effects) else {
        return Some(with_rivals(search, pruned, rivals));
    };
    Some(with_rivals(search, best, stand_ins))
}

/// A longer list that does not pay on left-out blocks must need so many free numbers less for each name more.
const NUMBERS_FOR_A_NAME: usize = 3;
/// Lists are weighed as a whole so many times in a row at most.
const MOST_AT_ONCE: usize = 3;

/// A list that is clearly better than the one that was found step by step, with the lists that it was chosen from; `None` where there is
/// none.
pub(super) fn or_at_once(
    search: &Search,
    comparison: &Comparison,
    chosen: &Trial,
    max_effects: usize,
) -> Option<(Trial, Alternatives)> {
    let mut best = chosen.clone();
    for _ in 0..MOST_AT_ONCE {
        let others = at_once::lists(search, &best, max_effects);
        let is_better = |own: &Trial| {
            !search.imitates(own) && search.is_clearly_better(own, &best) && is_worth(comparison, &best, own)
        };
        let Some(better) = others.into_iter().find(is_better) else { break };
        best = exchanged(search, better, Vec::new()).0;
    }
    if best.found == chosen.found {
        return None;
    }
    Some(with_rivals(search, prune(search, comparison, best), Vec::new()))
}

/// Whether a list deserves its length beside another one.
fn is_worth(comparison: &Comparison, list: &Trial, other: &Trial) -> bool {
    let more = other.found.len().saturating_sub(list.found.len());
    let n_free = |own: &Trial| own.fit.variables.len();
    more == 0 || n_free(other) + NUMBERS_FOR_A_NAME * more <= n_free(list) || comparison.deserves(list, other, 0.0)
}

/// The longest list behind these that deserves its length, with the lists of its length.
fn beam(
    search: &Search,
    comparison: &Comparison,
    chosen: &Trial,
    shorter: &[Trial],
    max_effects: usize,
) -> (Trial, Vec<Trial>) {
    let mut beam: Vec<Trial> = core::iter::once(chosen).chain(shorter.iter().take(WIDTH)).cloned().collect();
    let mut best = chosen.clone();
    let mut rivals = Vec::new();
    for _ in chosen.found.len()..max_effects {
        if !beam.first().is_some_and(|own| comparison.leaves_something(own)) {
            break;
        }
        let looks: Vec<_> = beam.iter().map(|own| search.look(own)).collect();
        let p_value = looks.iter().map(|(_, test)| test.p_value).fold(1.0, f64::min);
        let parents: Vec<_> = beam.iter().zip(&looks).map(|(own, (cells, _))| (own, cells.as_slice())).collect();
        let mut next = search.behind(&parents, N_NEXT);
        next.retain(|own| !search.imitates(own));
        let Some(first) = next.first().cloned() else { break };
        if comparison.deserves(&best, &first, p_value) {
            best = first;
            rivals = next.clone();
        } else if beam.first().is_some_and(|own| own.found.len() > best.found.len()) {
            // Two lengths in a row without a gain that counts.
            break;
        }
        next.truncate(WIDTH);
        beam = next;
    }
    (best, rivals)
}

/// A list whose members are exchanged one by one, or begun anew, until that brings nothing more; with the lists of its length.
fn exchanged(search: &Search, mut best: Trial, mut rivals: Vec<Trial>) -> (Trial, Vec<Trial>) {
    for _ in 0..MOST_EXCHANGES {
        rivals.extend(search.swaps(&best));
        rivals = search.distinct(rivals);
        rivals.retain(|own| own.found.len() == best.found.len() && !search.imitates(own));
        let Some(first) = rivals.first().cloned() else { break };
        let is_better = first.fit.sum_of_squares < (1.0 - LEAST_GAIN) * best.fit.sum_of_squares;
        best = first;
        if !is_better {
            break;
        }
    }
    (best, rivals)
}

/// A list with the lists of its length that it was chosen from; with stand-ins for each member where there are none.
fn with_rivals(search: &Search, list: Trial, rivals: Vec<Trial>) -> (Trial, Alternatives) {
    let mut rivals = search.distinct(rivals);
    if rivals.first().is_none_or(|own| own.found.len() != list.found.len()) {
        rivals = search.distinct([vec![list.clone()], search.swaps(&list)].concat());
    }
    rivals.retain(|own| own.found.len() == list.found.len() && !search.imitates(own));
    let best = rivals.first().cloned().unwrap_or(list);
    (best, Alternatives::new(search.problem, rivals, search.seed))
}

/// A list that explains more with one or two narrower effects for one of wide reach, with its stand-ins. A step aside that costs
/// little is allowed: it may be the stand-ins behind it that explain more. A longer list must have fewer free numbers, or as many
/// where one that can be stretched into a plainer effect has gone.
fn narrower(search: &Search, comparison: &Comparison, list: &Trial, max_effects: usize) -> Option<(Trial, Vec<Trial>)> {
    let others = search.narrowed(list, max_effects).into_iter().filter(|own| own.found != list.found);
    let aside = others.into_iter().find(|own| !search.imitates(own))?;
    if comparison.deserves(&aside, list, 0.0) {
        return None;
    }
    // What was replaced stays out: the step would be undone.
    let is_gone = |k: &usize| list.found.contains(k) && !aside.found.contains(k);
    let stand_ins = |of: &Trial| {
        let mut all = search.swaps(of);
        all.retain(|own| !own.found.iter().any(is_gone) && !search.imitates(own));
        all
    };
    let first = stand_ins(&aside).into_iter().next().unwrap_or(aside.clone());
    let stand_ins = stand_ins(&first);
    let best = prune(search, comparison, stand_ins.first().cloned().unwrap_or(first));
    let n_free = |own: &Trial| own.fit.variables.len();
    let was_stretched = list.found.iter().any(|k| is_gone(k) && search.candidates[*k].highest.is_some());
    let most = n_free(list) + usize::from(was_stretched);
    let is_allowed = best.found.len() <= list.found.len() || n_free(&best) < most;
    let ranked = search.distinct(vec![list.clone(), best.clone()]);
    (is_allowed && ranked.first().is_some_and(|own| own.found == best.found)).then_some((best, stand_ins))
}

/// The usual list fitted from the start, with the effects that are not in the model yet; `None` where they make no chain.
fn usual(search: &Search) -> Option<Trial> {
    let is_missing = |name: &&&str| !search.base.iter().any(|own| own.name == **name);
    let place = |name: &str| search.candidates.iter().position(|candidate| candidate.name == name);
    let found: Vec<usize> = USUAL.iter().filter(is_missing).filter_map(|name| place(name)).collect();
    let own = found.iter().map(|&k| {
        let candidate = &search.candidates[k];
        Some(candidate.term(candidate.starts.first()?.clone()))
    });
    let effects: Vec<Term> = search.base.iter().cloned().map(Some).chain(own).collect::<Option<_>>()?;
    search.fitted(found, &effects).ok().filter(|usual| !search.imitates(usual))
}

/// The list without the members that do not pay on left-out blocks, weakest first.
fn prune(search: &Search, comparison: &Comparison, mut trial: Trial) -> Trial {
    while trial.found.len() > 1 {
        let parts: Vec<Trial> =
            (0..trial.found.len()).into_par_iter().filter_map(|slot| search.without(&trial, slot).ok()).collect();
        let idle = parts.into_iter().filter(|part| !comparison.deserves(part, &trial, 0.0));
        let Some(weakest) = idle.min_by(|a, b| a.fit.sum_of_squares.total_cmp(&b.fit.sum_of_squares)) else { break };
        trial = weakest;
    }
    trial
}

/// The places of a list's members in the order of what each takes away, averaged over all orders (Shapley), and the fits of the
/// first one, two ... of them: in this order, and in the order in which they stand.
pub(super) fn order(search: &Search, trial: &Trial) -> (Vec<usize>, [Vec<Trial>; 2]) {
    let k = trial.found.len();
    let part = |subset: usize| {
        let base = search.base.len();
        let own = |i: &usize| subset >> i & 1 == 1;
        let found: Vec<usize> = (0..k).filter(own).map(|i| trial.found[i]).collect();
        let mut effects = trial.fit.effects[..base].to_vec();
        effects.extend((0..k).filter(own).map(|i| trial.fit.effects[base + i].clone()));
        search.fitted(found, &effects).ok()
    };
    let parts: Vec<Option<Trial>> = (0..1 << k).into_par_iter().map(part).collect();
    let value = |subset: usize| parts[subset].as_ref().map_or(0.0, |own| -own.fit.sum_of_squares.max(1e-300).ln());
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let share = |i: usize| -> f64 {
        let without = (0..1_usize << k).filter(|subset| subset >> i & 1 == 0);
        let gain = |subset: usize| {
            let size = subset.count_ones() as usize;
            factorial(size) * factorial(k - 1 - size) / factorial(k) * (value(subset | 1 << i) - value(subset))
        };
        without.map(gain).sum()
    };
    let shares: Vec<f64> = (0..k).map(share).collect();
    let mut order: Vec<usize> = (0..k).collect();
    order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
    let prefixes = |order: &[usize]| {
        let prefix = |n: usize| order[..n].iter().map(|i| 1 << i).sum::<usize>();
        (1..k).filter_map(|n| parts[prefix(n)].clone()).collect()
    };
    let both = [prefixes(&order), prefixes(&(0..k).collect::<Vec<_>>())];
    (order, both)
}
