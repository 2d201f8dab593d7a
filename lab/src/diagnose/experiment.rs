//! What to do next: the motion that would separate effects that these data cannot tell apart.

use super::families::{FAMILIES, OF_FORCE, OF_JOINTS, RICH_OF_FORCE, RICH_OF_JOINTS, WITH_LOADS, of_family};
use super::gate::reversals;
use super::{FoundEffect, Verdict};
use crate::Problem;
use crate::experiment::Experiment;
use krait_model::effects::without_segment;

/// The next experiment.
#[derive(Clone, Debug)]
pub struct NextExperiment {
    /// What it separates.
    pub separates: Vec<String>,
    /// What to do, a sentence or two.
    pub instruction: String,
    /// The motion made for it and what that is expected to decide, where that was computed.
    pub motion: Option<Experiment>,
}

impl NextExperiment {
    /// The same with what another one asks for behind it.
    fn and_then(self, other: &Self) -> Self {
        Self { instruction: format!("{}. For the rest: {}", self.instruction, other.instruction), ..self }
    }
}

/// The experiment for effects of a joint (from 1) that look alike; `None` where there is nothing to separate.
pub(crate) fn separate_joints(class: &[String], joint: Option<usize>) -> Option<NextExperiment> {
    if class.len() < 2 {
        return None;
    }
    Some(on_joint(class, joint, of_family(&OF_JOINTS, class).unwrap_or(RICH_OF_JOINTS)))
}

/// The experiment for effects of a force, of a joint (from 1) where there are several, that look alike; `None` where there is nothing to
/// separate.
pub(super) fn separate_force(class: &[String], joint: Option<usize>) -> Option<NextExperiment> {
    (class.len() > 1).then(|| on_joint(class, joint, of_family(&OF_FORCE, class).unwrap_or(RICH_OF_FORCE)))
}

fn on_joint(class: &[String], joint: Option<usize>, instruction: &str) -> NextExperiment {
    let instruction = joint.map_or(instruction.to_owned(), |joint| format!("On joint {joint}: {instruction}"));
    NextExperiment { separates: class.to_vec(), instruction, motion: None }
}

/// The experiment for effects of a snake or of segments that look alike; `None` where there is nothing to separate.
fn separate(class: &[String], n_reversals: usize, has_loads: bool) -> Option<NextExperiment> {
    if class.len() < 2 {
        return None;
    }
    let holds = |names: &[&str], own: &str| names.contains(&without_segment(own));
    let home = FAMILIES.iter().find(|(names, _)| holds(names, &class[0]));
    let shared = home.filter(|(names, _)| class.iter().any(|other| *other != class[0] && holds(names, other)));
    let instruction = |(names, own): &(&[&str], &'static str)| {
        let again = WITH_LOADS.iter().find(|(first, _)| has_loads && names.first() == Some(first));
        again.map_or(*own, |(_, again)| *again)
    };
    let shared = shared.map(instruction);
    let outside = class.iter().any(|other| home.is_some_and(|(names, _)| !holds(names, other)));
    let rich = "Go up and down in three planes, rotate the plane both ways at 45 deg, in nested loops and at three speeds, with \
                holds of 3 s: reversals separate hysteresis from everything that has none";
    let instruction = match shared {
        _ if n_reversals < 8 => rich.to_owned(),
        Some(instruction) if outside => format!("{instruction}. {rich}"),
        Some(instruction) => instruction.to_owned(),
        None => rich.to_owned(),
    };
    Some(NextExperiment { separates: class.to_vec(), instruction, motion: None })
}

/// The experiment that a verdict on a snake, on segments or on a joint's force asks for.
pub(super) fn asked_for(
    problem: &Problem,
    verdict: Verdict,
    effects: &[FoundEffect],
    looks_like: Option<&str>,
) -> Option<NextExperiment> {
    let (n_reversals, has_loads) = (reversals(&problem.data), problem.loads().is_some());
    let own = |effect: &FoundEffect| match problem.machine.kind() {
        "force" => separate_force(&effect.class, effect.joint),
        _ => separate(&effect.class, n_reversals, has_loads),
    };
    next(verdict, || effects.iter().find_map(own), looks_like)
}

/// The experiment that a verdict asks for: what would tell the look-alikes apart, and where a rest remains what would show it.
pub(crate) fn next(
    verdict: Verdict,
    separating: impl FnOnce() -> Option<NextExperiment>,
    looks_like: Option<&str>,
) -> Option<NextExperiment> {
    match verdict {
        Verdict::None => None,
        Verdict::Missing => separating(),
        Verdict::Partly => Some(match separating() {
            Some(own) => own.and_then(&explore(looks_like)),
            None => explore(looks_like),
        }),
        Verdict::Unknown | Verdict::TooShort => Some(explore(looks_like)),
    }
}

/// What helps where nothing known explains the rest.
fn explore(looks_like: Option<&str>) -> NextExperiment {
    let about =
        looks_like.map_or(String::new(), |what| format!(" The rest depends on {what}: vary that and keep all else."));
    NextExperiment {
        separates: Vec::new(),
        motion: None,
        instruction: format!(
            "Repeat the same path twice without touching anything: what repeats is the machine, the rest is noise.{about} Then \
             write the rest down as a formula (krait lab add formula --help)."
        ),
    }
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;

    fn class(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn what_a_force_is_asked_for_is_about_its_own_effects() {
        let asked = |names: &[&str]| separate_force(&class(names), None).map(|next| next.instruction);
        assert_eq!(asked(&["coulomb"]), None, "nothing to separate");
        let says = |names: &[&str], words: &str| {
            let instruction = asked(names).expect("look-alikes");
            assert!(instruction.contains(words) && !instruction.contains("plane"), "{names:?}: {instruction}");
        };
        says(&["coulomb", "stribeck"], "six steady speeds");
        says(&["coulomb", "quadratic-load"], "with twice that");
        says(&["inertia", "gravity"], "a fourth of the speed");
        says(&["rub", "coulomb"], "Run each joint alone");
        says(&["gravity", "viscous"], "Run each joint alone");
    }
}
