//! A verdict and a candidate's fate in words.

use super::answer::{FoundEffect, Remaining, Verdict};
use crate::machine::Candidate;

/// A list that leaves less of what was explainable explains it, if its values can be.
const EXPLAINED: f64 = 0.02;

/// A sentence as it stands by itself: with a capital letter and a full stop.
pub fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or(String::new(), |first| format!("{}{}.", first.to_uppercase(), letters.as_str()))
}

/// What became of a candidate.
pub(super) fn state(
    candidate: &Candidate,
    effects: &[FoundEffect],
    refined: bool,
    visible: f64,
    p_value: f64,
) -> String {
    if let Some(reason) = &candidate.cannot {
        return reason.clone();
    }
    if let Some(n) = effects.iter().position(|effect| effect.name == candidate.name) {
        return format!("chosen, number {}", n + 1);
    }
    if let Some(effect) = effects.iter().find(|effect| effect.class.iter().any(|name| name == candidate.name)) {
        return format!("cannot be told from {}", effect.name);
    }
    match (refined, visible) {
        (_, visible) if visible < 0.05 => "cannot be seen in these data".to_owned(),
        (true, _) => "refined, explains less".to_owned(),
        (false, _) if p_value >= 0.05 => "no sign of it".to_owned(),
        (false, _) => "screened, explains less".to_owned(),
    }
}

/// What effects do that are named under partly.
pub(crate) fn stand_and_take(n_effects: usize) -> &'static str {
    if n_effects == 1 { "stands and takes" } else { "stand and take" }
}

/// The verdict in one sentence.
pub(super) fn sentence(
    verdict: Verdict,
    effects: &[FoundEffect],
    remaining: &Remaining,
    after: f64,
    floor: Option<f64>,
    unit: &str,
) -> String {
    let floor =
        floor.map_or("an unknown noise floor".to_owned(), |floor| format!("a noise floor of {floor:.3} {unit}"));
    let names = |effect: &FoundEffect| match effect.class.len() {
        1 => effect.name.clone(),
        _ => format!("one of {{{}}}", effect.class.join(", ")),
    };
    match verdict {
        Verdict::None => {
            format!("nothing is missing: an error of {after:.3} {unit} beside {floor} is the measurement's own")
        }
        Verdict::Partly => format!(
            "partly: {} {} {:.0} % of what there was to explain; {after:.3} {unit} remain beside {floor}{}",
            effects.iter().map(names).collect::<Vec<_>>().join(" and "),
            stand_and_take(effects.len()),
            100.0 * (1.0 - remaining.unexplained),
            remaining.looks_like.map_or(String::new(), |what| format!(", and the rest depends on {what}"))
        ),
        Verdict::Missing => format!(
            "missing: {}; with it the error on data it was not fitted to is {after:.3} {unit}, beside {floor}",
            effects.iter().map(names).collect::<Vec<_>>().join(" and ")
        ),
        Verdict::Unknown if remaining.looks_like.is_none() && remaining.unexplained <= EXPLAINED => {
            "something is missing that no known effect explains: some imitate it, but only with values at the edge of what is \
             physical"
                .to_owned()
        }
        _ => format!(
            "something is missing that no known effect, nor two together, explains: {after:.3} {unit} remain beside {floor}, \
             {:.0} % of what there was to explain{}",
            100.0 * remaining.unexplained,
            remaining.looks_like.map_or(String::new(), |what| format!("; it depends on {what}"))
        ),
    }
}
