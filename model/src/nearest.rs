//! The known name that somebody most likely meant: by what people call an effect, and else by its spelling.

use crate::effects::{Definition, EffectKind, ForceEffect, explanation};
use crate::joints::JointEffect;

/// Every effect of every machine.
fn definitions() -> impl Iterator<Item = &'static Definition> {
    let snakes = EffectKind::ALL.into_iter().map(EffectKind::definition);
    let joints = JointEffect::ALL.into_iter().map(JointEffect::definition);
    snakes.chain(joints).chain(ForceEffect::ALL.into_iter().map(ForceEffect::definition))
}

/// The effect among `names` that a word means besides its own name.
fn meant(word: &str, names: &[&str]) -> Option<&'static str> {
    let place = |definition: &Definition| definition.also.iter().position(|also| *also == word);
    let candidates = definitions().filter(|definition| names.contains(&definition.name));
    candidates
        .filter_map(|definition| Some((place(definition)?, definition.name)))
        .min_by_key(|(place, _)| *place)
        .map(|(_, name)| name)
}

/// The one of `names` that `given` says: its own name, another word for it, or its title; in any case, and with spaces for hyphens. `None`
/// for what is only spelt alike.
///
/// ```
/// use krait_model::meant_name;
/// assert_eq!(meant_name("Coulomb friction", ["viscous-friction", "static-friction"]), Some("static-friction"));
/// assert_eq!(meant_name("smooth hysteresis", ["creep", "bouc-wen"]), Some("bouc-wen"));
/// assert_eq!(meant_name("backlsh", ["creep", "backlash"]), None);
/// ```
pub fn meant_name<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let names: Vec<&str> = names.into_iter().collect();
    let word = as_word(given);
    let own = names.iter().find(|name| **name == word);
    let titled = || names.iter().find(|name| explanation(name).is_some_and(|own| as_word(own.title) == word));
    let also = || meant(&word, &names).and_then(|meant| names.iter().find(|name| **name == meant));
    own.or_else(titled).or_else(also).copied()
}

/// As names and other words for them are written.
fn as_word(given: &str) -> String {
    given.trim().to_lowercase().replace([' ', '_'], "-").replace('\u{2019}', "'")
}

/// The one of `names` that `given` is another word for, or else the one that looks most like it (Jaro-Winkler); `None` where
/// there are none. Other words for an effect stand beside its definition.
///
/// ```
/// use krait_model::nearest_name;
/// assert_eq!(nearest_name("backlsh", ["creep", "backlash"]), Some("backlash"));
/// assert_eq!(nearest_name("Coulomb friction", ["viscous-friction", "static-friction"]), Some("static-friction"));
/// ```
pub fn nearest_name<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let names: Vec<&str> = names.into_iter().collect();
    let word = as_word(given);
    let known = meant(&word, &names).and_then(|meant| names.iter().find(|name| **name == meant));
    let alike = |name: &str| strsim::jaro_winkler(given, name);
    known.or_else(|| names.iter().max_by(|a, b| alike(a).total_cmp(&alike(b)))).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_people_call_an_effect_finds_it_on_each_machine() {
        let snake = EffectKind::ALL.map(EffectKind::name);
        let joints = JointEffect::ALL.map(|effect| effect.definition().name);
        let force = ForceEffect::ALL.map(ForceEffect::name);
        for (given, of_snake, of_joints) in [
            ("offset", "camera-offset", "offset"),
            ("scale", "stiffness-scale", "scale"),
            ("slip", "encoder-zero", "linear-drift"),
            ("stiction", "static-friction", "cone-friction"),
            ("Coulomb friction", "static-friction", "cone-friction"),
            ("friction", "static-friction", "cone-friction"),
            ("hysteresis", "bouc-wen", "bouc-wen"),
            ("play", "backlash", "backlash"),
            ("gain", "stiffness-scale", "scale"),
            ("deadband", "backlash", "dead-zone"),
            ("Dead Band", "backlash", "dead-zone"),
            ("delay", "latency", "latency"),
            ("dead_time", "latency", "latency"),
            ("lag", "latency", "first-order-lag"),
            ("clearance", "hole-clearance", "backlash"),
            ("temperature", "thermal-drift", "drift"),
        ] {
            assert_eq!(nearest_name(given, snake), Some(of_snake), "{given} of a snake");
            assert_eq!(nearest_name(given, joints), Some(of_joints), "{given} of joints");
        }
        for (given, expected) in [("Coulomb friction", "coulomb"), ("stiction", "stribeck"), ("weight", "gravity")] {
            assert_eq!(nearest_name(given, force), Some(expected), "{given} of a force");
        }
        assert_eq!(nearest_name("bouc-when", snake), Some("bouc-wen"), "by its spelling");
        assert_eq!(nearest_name("gain", ["offset", "scale"]), Some("scale"), "only among the names that count");
        assert_eq!(nearest_name("anything", []), None);
    }

    /// A word that is written otherwise than it is looked for would never be found.
    #[test]
    fn every_other_word_can_be_found_and_is_no_effect_of_its_own_machine() {
        let machines: [Vec<&Definition>; 3] = [
            EffectKind::ALL.map(EffectKind::definition).to_vec(),
            JointEffect::ALL.map(JointEffect::definition).to_vec(),
            ForceEffect::ALL.map(ForceEffect::definition).to_vec(),
        ];
        for machine in machines {
            for definition in &machine {
                for also in definition.also {
                    assert!(also.bytes().all(|c| c.is_ascii_lowercase() || c == b'-'), "{also}");
                    assert!(machine.iter().all(|other| other.name != *also), "{also} is an effect itself");
                }
            }
        }
    }
}
