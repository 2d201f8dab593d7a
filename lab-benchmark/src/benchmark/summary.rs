//! The figures of a benchmark: rates with Wilson's intervals, errors over the floor, coverage, who is taken for whom.

use super::outcome::is_exact;
use super::{Group, Outcome};
use crate::HiddenTruth;
use krait_lab::diagnose::Verdict;
use serde::Serialize;
use std::collections::BTreeMap;

/// A share of cells with its 95 % interval after Wilson.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Cells for which it holds.
    pub n: usize,
    /// Cells.
    pub of: usize,
    /// n / of; 0 without cells.
    pub rate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Rate {
    /// Counts.
    pub fn new(n: usize, of: usize) -> Self {
        if of == 0 {
            return Self { n, of, rate: 0.0, low: 0.0, high: 1.0 };
        }
        let (z, cells, p) = (1.959_964_f64, of as f64, n as f64 / of as f64);
        let middle = p + z * z / (2.0 * cells);
        let half = z * (p * (1.0 - p) / cells + z * z / (4.0 * cells * cells)).sqrt();
        let whole = 1.0 + z * z / cells;
        Self { n, of, rate: p, low: ((middle - half) / whole).max(0.0), high: ((middle + half) / whole).min(1.0) }
    }

    fn of<'a>(cells: &[&'a Outcome], holds: impl Fn(&'a Outcome) -> bool) -> Self {
        Self::new(cells.iter().filter(|outcome| holds(outcome)).count(), cells.len())
    }
}

/// What a benchmark says.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Finished cells.
    pub n_cells: usize,
    /// Cells without a result, with the reason.
    pub refused: Vec<(String, String)>,
    /// An effect was claimed where none is, by noise and over all.
    pub false_alarms: BTreeMap<String, Rate>,
    /// Nothing was said where nothing is.
    pub right_none: Rate,
    /// Single effects: first name right, claimed or not.
    pub top_1: Rate,
    /// The same by size in units of the noise.
    pub top_1_by_size: BTreeMap<String, Rate>,
    /// The same by motion.
    pub top_1_by_motion: BTreeMap<String, Rate>,
    /// One of the first effect's look-alikes right.
    pub in_class: Rate,
    /// One of the three best right.
    pub top_3: Rate,
    /// Single effects claimed (verdict missing) with the right first name.
    pub claimed_right: Rate,
    /// Single effects claimed with a wrong first name.
    pub claimed_wrong: Rate,
    /// Single effects with a second, wrong one beside.
    pub extras: Rate,
    /// Pairs: both right and nothing else.
    pub pairs_exact: Rate,
    /// Pairs: first name one of the two.
    pub pairs_first: Rate,
    /// Single effects: this one asserted and no other.
    pub single_exact: Rate,
    /// Three to five effects: all asserted and no other.
    pub several_exact: Rate,
    /// Of their effects, those that were asserted.
    pub several_recall: Rate,
    /// Of the effects asserted there, those that are right.
    pub several_precision: Rate,
    /// A known effect beside an unknown one: the known one asserted, and a rest said to remain.
    pub beside_right: Rate,
    /// A known effect beside an unknown one: a wrong one asserted.
    pub beside_wrong: Rate,
    /// Effects outside the library of which known ones were asserted, alone or beside a rest.
    pub outside_asserted: Rate,
    /// Effects outside the library that were claimed to be a known one.
    pub outside_claimed: Rate,
    /// Effects outside the library that were called unknown.
    pub outside_unknown: Rate,
    /// Wrong dimensions with free geometry: exactly the hidden effect.
    pub off_base_exact: Rate,
    /// The same, the hidden effect among the look-alikes of the first name.
    pub off_base_in_class: Rate,
    /// Ramps: the truth is among the look-alikes, or nothing was claimed.
    pub poor_honest: Rate,
    /// 95 % intervals (value plus or minus two standard errors) that hold the truth.
    pub coverage: Rate,
    /// Median of held-out error over the noise that was added, known effects claimed.
    pub over_floor_median: f64,
    /// Its 90th percentile.
    pub over_floor_p90: f64,
    /// Baselines, each by itself: false alarms, first name right, pairs exact.
    pub baselines: BTreeMap<String, [Rate; 3]>,
    /// Median held-out error of the true effect's fit over the noise.
    pub oracle_over_floor_median: f64,
    /// Median error of the dictionary without names over the noise, single effects.
    pub generic_over_floor_median: f64,
    /// Kind hidden, then first name said, then how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
}

impl Summary {
    /// Counts outcomes.
    pub fn new(outcomes: &[Outcome]) -> Self {
        let group = |group: Group| -> Vec<&Outcome> {
            outcomes.iter().filter(|o| o.group == group.word() && o.said.is_some()).collect()
        };
        let [none, single, pair, outside, poor, several, beside, off_base] = Group::ALL.map(group);
        let known: Vec<&Outcome> = single.iter().chain(&pair).chain(&several).copied().collect();
        let claimed: Vec<&Outcome> = known.iter().filter(|o| o.is_claimed()).copied().collect();
        let verdict = |word: &'static str| move |o: &Outcome| o.said.as_ref().is_some_and(|s| s.verdict == word);
        let mut over: Vec<f64> = claimed.iter().filter_map(|o| o.over_floor()).collect();
        over.sort_by(f64::total_cmp);
        Self {
            n_cells: outcomes.len(),
            refused: outcomes.iter().filter_map(|o| Some((o.id.clone(), o.refused.clone()?))).collect(),
            false_alarms: by(&none, |t| t.noise.clone(), Outcome::is_asserted),
            right_none: Rate::of(&none, verdict("none")),
            top_1: Rate::of(&single, Outcome::is_top_1),
            top_1_by_size: by(&single, size, Outcome::is_top_1),
            top_1_by_motion: by(&single, |t| t.motion.clone(), Outcome::is_top_1),
            in_class: Rate::of(&single, Outcome::is_in_class),
            top_3: Rate::of(&single, Outcome::is_top_3),
            claimed_right: Rate::of(&single, |o| o.is_claimed() && o.is_top_1()),
            claimed_wrong: Rate::of(&single, |o| o.is_claimed() && !o.is_top_1()),
            extras: Rate::of(&single, |o| o.is_claimed() && o.said.as_ref().is_some_and(|s| s.named.len() > 1)),
            pairs_exact: Rate::of(&pair, Outcome::is_exact),
            pairs_first: Rate::of(&pair, one_of_two),
            single_exact: Rate::of(&single, Outcome::is_exact),
            several_exact: Rate::of(&several, Outcome::is_exact),
            several_recall: part(&several, |(hits, _, known)| (hits, known)),
            several_precision: part(&several, |(hits, named, _)| (hits, named)),
            beside_right: Rate::of(&beside, |o| o.is_said(Verdict::Partly) && o.hits().0 > 0),
            beside_wrong: Rate::of(&beside, Outcome::asserts_wrongly),
            outside_asserted: Rate::of(&outside, Outcome::is_asserted),
            outside_claimed: Rate::of(&outside, Outcome::is_claimed),
            outside_unknown: Rate::of(&outside, verdict("unknown")),
            off_base_exact: Rate::of(&off_base, Outcome::is_exact),
            off_base_in_class: Rate::of(&off_base, |o| o.is_asserted() && o.is_in_class()),
            poor_honest: Rate::of(&poor, |o| !o.is_claimed() || o.is_in_class()),
            coverage: coverage(&known),
            over_floor_median: quantile(&over, 0.5),
            over_floor_p90: quantile(&over, 0.9),
            baselines: baselines(&none, &single, &pair),
            oracle_over_floor_median: median_over(&single, |o| o.baselines.as_ref()?.oracle_deg),
            generic_over_floor_median: median_over(&single, |o| Some(o.baselines.as_ref()?.generic_deg)),
            confusion: confusion(outcomes),
        }
    }
}

/// A share of counted names over cells.
fn part(cells: &[&Outcome], of: impl Fn((usize, usize, usize)) -> (usize, usize)) -> Rate {
    let counts = cells.iter().map(|outcome| of(outcome.hits()));
    let (n, of) = counts.fold((0, 0), |(n, of), (own, all)| (n + own, of + all));
    Rate::new(n, of)
}

fn size(truth: &HiddenTruth) -> String {
    truth.size.first().map_or_else(String::new, |size| format!("{size:.1}"))
}

/// A rate for each value of a property, and over all.
fn by(
    cells: &[&Outcome],
    property: impl Fn(&HiddenTruth) -> String,
    holds: impl Fn(&Outcome) -> bool,
) -> BTreeMap<String, Rate> {
    let mut counts: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for outcome in cells {
        let Some(truth) = &outcome.truth else { continue };
        for key in [property(truth), "all".to_owned()] {
            let count = counts.entry(key).or_default();
            count.0 += usize::from(holds(outcome));
            count.1 += 1;
        }
    }
    counts.into_iter().map(|(key, (n, of))| (key, Rate::new(n, of))).collect()
}

fn one_of_two(outcome: &Outcome) -> bool {
    let (Some(truth), Some(said)) = (&outcome.truth, &outcome.said) else { return false };
    said.named.first().is_some_and(|name| truth.right.iter().any(|right| right.contains(name)))
}

fn coverage(cells: &[&Outcome]) -> Rate {
    let rows: Vec<&(String, f64, f64, f64)> =
        cells.iter().filter_map(|o| o.said.as_ref()).flat_map(|s| &s.known).collect();
    let inside = rows.iter().filter(|(_, truth, value, se)| (truth - value).abs() <= 2.0 * se).count();
    Rate::new(inside, rows.len())
}

fn baselines(none: &[&Outcome], single: &[&Outcome], pair: &[&Outcome]) -> BTreeMap<String, [Rate; 3]> {
    type Says = fn(&Outcome) -> Vec<String>;
    let rules: [(&str, Says); 3] = [
        ("always backlash", |_| vec!["backlash".to_owned()]),
        ("raw BIC, forward", |o| o.baselines.as_ref().map_or(Vec::new(), |b| b.bic.clone())),
        ("effective-N BIC, forward", |o| o.baselines.as_ref().map_or(Vec::new(), |b| b.bic_effective.clone())),
    ];
    let right = |o: &Outcome, names: &[String]| {
        let right = o.truth.as_ref().and_then(|truth| truth.right.first());
        names.first().is_some_and(|name| right.is_some_and(|right| right.contains(name)))
    };
    let rates = |says: Says| {
        [
            Rate::of(none, |o| !says(o).is_empty()),
            Rate::of(single, |o| right(o, &says(o))),
            Rate::of(pair, |o| o.truth.as_ref().is_some_and(|truth| is_exact(&truth.right, &says(o)))),
        ]
    };
    let is_asked = single.iter().chain(none).any(|o| o.baselines.is_some());
    let asked = rules.into_iter().take(if is_asked { 3 } else { 1 });
    asked.map(|(name, says)| (name.to_owned(), rates(says))).collect()
}

fn median_over(cells: &[&Outcome], error: impl Fn(&Outcome) -> Option<f64>) -> f64 {
    let ratio = |o: &&Outcome| Some(error(o)? / o.truth.as_ref()?.noise_rms);
    let mut ratios: Vec<f64> = cells.iter().filter_map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    quantile(&ratios, 0.5)
}

fn confusion(outcomes: &[Outcome]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for outcome in outcomes.iter().filter(|o| {
        o.group == Group::Single.word() || o.group == Group::Outside.word() || o.group == Group::None.word()
    }) {
        let (Some(truth), Some(said)) = (&outcome.truth, &outcome.said) else { continue };
        let name = if outcome.is_asserted() { said.named.first().cloned() } else { None };
        let name = name.unwrap_or_else(|| said.verdict.clone());
        *confusion.entry(truth.kind.clone()).or_default().entry(name).or_default() += 1;
    }
    confusion
}

fn quantile(sorted: &[f64], part: f64) -> f64 {
    let k = (part * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(k).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_s_interval_is_that_of_the_textbook() {
        // 8 of 10: 0.490 to 0.943; none of 20: 0 to 0.161.
        let rate = Rate::new(8, 10);
        assert!((rate.low - 0.4902).abs() < 1e-3 && (rate.high - 0.9433).abs() < 1e-3, "{rate:?}");
        let rate = Rate::new(0, 20);
        assert!(rate.low == 0.0 && (rate.high - 0.1611).abs() < 1e-3, "{rate:?}");
    }

    #[test]
    fn pairs_are_exact_only_with_one_name_for_each() {
        let right = vec![vec!["a".to_owned(), "b".to_owned()], vec!["c".to_owned()]];
        let named = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert!(is_exact(&right, &named(&["c", "b"])) && is_exact(&right, &named(&["a", "c"])));
        assert!(!is_exact(&right, &named(&["a", "b"])) && !is_exact(&right, &named(&["a"])));
    }
}
