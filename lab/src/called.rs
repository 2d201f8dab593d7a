//! What the effects of a model are called where their numbers are named, so that no two of them share a name.

use crate::fit::Variable;
use crate::machine::MachineUnderTest;
use crate::{Added, Term};

/// The effect that feels another joint, whose number stands behind that of its own.
const COUPLING: &str = "cross-coupling";

/// One name for each effect of a machine of this kind: the effect's label; where several share one, with the number of the joint behind
/// it (`backlash-2`; 0: every joint), and where that is not enough with their order as well.
pub fn called(kind: &str, effects: &[Term]) -> Vec<String> {
    let labels: Vec<String> = effects.iter().map(|own| own.label().to_owned()).collect();
    let has_joint = ["joints", "force"].contains(&kind);
    let with_joint = |own: &Term| match own.values.as_slice() {
        [joint, from, ..] if own.name == COUPLING => format!("-{joint:.0}-from-{from:.0}"),
        [joint, ..] => format!("-{joint:.0}"),
        [] => String::new(),
    };
    let by_joint = apart(&labels, |place| match &effects[place] {
        own if has_joint && own.formula.is_none() => with_joint(own),
        _ => String::new(),
    });
    let order = |place: usize| 1 + by_joint[..place].iter().filter(|own| **own == by_joint[place]).count();
    apart(&by_joint, |place| format!("-{}", order(place)))
}

/// The names, those that several share with something behind them.
fn apart(names: &[String], behind: impl Fn(usize) -> String) -> Vec<String> {
    let is_shared = |name: &String| names.iter().filter(|own| *own == name).count() > 1;
    let one = |(place, name): (usize, &String)| match is_shared(name) {
        true => format!("{name}{}", behind(place)),
        false => name.clone(),
    };
    names.iter().enumerate().map(one).collect()
}

/// The places of the effects that a name means: the one that is called so, else all with this label.
pub(crate) fn meant(kind: &str, effects: &[Term], name: &str) -> Vec<usize> {
    match called(kind, effects).iter().position(|own| own == name) {
        Some(place) => vec![place],
        None => (0..effects.len()).filter(|place| effects[*place].label() == name).collect(),
    }
}

/// What the fitted parameters of an answer are called: with their effect before them, but for a new effect's own and where one effect
/// has all.
pub fn parameters_called(added: &Added, machine: &dyn MachineUnderTest) -> Vec<String> {
    let (own, new) = added.terms.split_at(machine.effects().len().min(added.terms.len()));
    let of_one = added.variables.windows(2).all(|pair| pair[0].effect == pair[1].effect);
    let names: Vec<String> = [own, new].iter().flat_map(|part| called(machine.kind(), part)).collect();
    let one = |variable: &Variable| {
        let is_alone = if variable.effect < own.len() { new.is_empty() && of_one } else { new.len() == 1 };
        match names.get(variable.effect) {
            Some(effect) if !is_alone => format!("{effect}.{}", variable.name),
            _ => variable.name.clone(),
        }
    };
    added.variables.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_of_one_kind_are_called_by_their_joint_and_a_single_one_as_ever() {
        let on = |name: &str, values: &[f64]| Term::new(name, values.to_vec());
        let effects = [
            on("backlash", &[1.0, 0.1]),
            on("cubic", &[2.0, 0.1, 0.0]),
            on("backlash", &[2.0, 0.1]),
            on("cross-coupling", &[1.0, 2.0, 0.1]),
            on("cross-coupling", &[1.0, 3.0, 0.1]),
            on("creep", &[0.0, 0.1]),
            on("creep", &[0.0, 0.2]),
        ];
        let names = [
            "backlash-1",
            "cubic",
            "backlash-2",
            "cross-coupling-1-from-2",
            "cross-coupling-1-from-3",
            "creep-0-1",
            "creep-0-2",
        ];
        assert_eq!(called("joints", &effects), names);
        assert_eq!(meant("joints", &effects, "backlash"), [0, 2]);
        assert_eq!((meant("joints", &effects, "backlash-2"), meant("joints", &effects, "cubic")), (vec![2], vec![1]));
        assert!(meant("joints", &effects, "cubic-2").is_empty());
        // The first value of a snake's effect is no joint.
        let twice = [on("bouc-wen", &[9e-5]), on("bouc-wen", &[8e-5])];
        assert_eq!(called("snake", &twice), ["bouc-wen-1", "bouc-wen-2"]);
    }
}
