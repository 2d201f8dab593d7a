//! A verdict and a candidate's fate in words.

use super::answer::{FoundEffect, Remaining, Verdict};
use crate::machine::Candidate;
use crate::{FEWEST_BLOCKS, Problem, scored_time_s};

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

/// So many effects are named in a headline; the table has all.
const NAMED: usize = 4;

/// The effects of a headline: each with its place, its size and what it cannot be told from.
pub(crate) fn named(effects: &[FoundEffect], place: impl Fn(&FoundEffect) -> String) -> String {
    let one = |effect: &FoundEffect| {
        let size = effect.size();
        let alike = (effect.class.len() > 1).then(|| format!("or {}", effect.class[1..].join(", ")));
        let details: Vec<String> = size.into_iter().chain(alike).collect();
        let details = if details.is_empty() { String::new() } else { format!(" ({})", details.join("; ")) };
        format!("{}{}{details}", effect.name, place(effect))
    };
    let mut names: Vec<String> = effects.iter().take(NAMED).map(one).collect();
    match effects.len().saturating_sub(NAMED) {
        0 => {}
        1 => names.push("a smaller one".to_owned()),
        n => names.push(format!("{n} smaller ones")),
    }
    names.join(" and ")
}

/// How sure a headline is of the least sure of its effects, each with what it cannot be told from.
pub(crate) fn sure(effects: &[FoundEffect]) -> String {
    let least = effects.iter().map(|own| own.probability).fold(1.0, f64::min);
    let (of, or_more) = if effects.len() == 1 { ("of it", "") } else { ("of each", " or more") };
    match least {
        p if p > 0.99 => format!("sure {of}: more than 99 %"),
        p => format!("sure {of}: {:.0} %{or_more}", 100.0 * p),
    }
}

/// The verdict in one sentence; `place` is put behind an effect's name.
pub(super) fn sentence(
    verdict: Verdict,
    effects: &[FoundEffect],
    place: impl Fn(&FoundEffect) -> String,
    remaining: &Remaining,
    after: f64,
    floor: Option<f64>,
    unit: &str,
) -> String {
    let is_known = floor.is_some();
    let floor =
        floor.map_or("an unknown noise floor".to_owned(), |floor| format!("a noise floor of {floor:.3} {unit}"));
    let names = || named(effects, &place);
    match verdict {
        Verdict::None => {
            format!("nothing is missing: an error of {after:.3} {unit} beside {floor} is the measurement's own")
        }
        Verdict::Partly => format!(
            "partly: {} {} {:.0} % of {}; {after:.3} {unit} remain beside {floor}{}",
            names(),
            stand_and_take(effects.len()),
            100.0 * (1.0 - remaining.unexplained),
            of_what(is_known),
            remaining.looks_like.map_or(String::new(), |what| format!(", and the rest depends on {what}"))
        ) + &format!("; {}", sure(effects)),
        Verdict::Missing => format!(
            "missing: {}; with it the error on data it was not fitted to is {after:.3} {unit}, beside {floor}; {}",
            names(),
            sure(effects)
        ),
        Verdict::Unknown if remaining.looks_like.is_none() && remaining.unexplained <= EXPLAINED => {
            "something is missing that no known effect explains: some imitate it, but only with values at the edge of what is \
             physical"
                .to_owned()
        }
        _ => format!(
            "something is missing that no known effect, nor two together, explains: {after:.3} {unit} remain beside {floor}, \
             {:.0} % of {}{}",
            100.0 * remaining.unexplained,
            of_what(is_known),
            remaining.looks_like.map_or(String::new(), |what| format!("; it depends on {what}"))
        ),
    }
}

/// What shares are of: where the floor is not known noise is a part of it.
pub(crate) fn of_what(is_floor_known: bool) -> &'static str {
    if is_floor_known { "what there was to explain" } else { "the mean square, noise included" }
}

/// What a test would need, of data that are too short for one.
pub(super) fn too_short(problem: &Problem) -> String {
    format!(
        "too short to test: {:.0} s of data make {} independent blocks of the {FEWEST_BLOCKS} that a test needs; {:.0} s of such data \
         are needed at least",
        scored_time_s(&problem.data),
        problem.n_blocks,
        problem.needed_s()
    )
}
