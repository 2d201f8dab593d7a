//! The known name that somebody most likely meant: by what people call an effect, and else by its spelling.

/// What people call an effect, and the names that krait has for it, the likeliest first. Lower case, hyphens between words.
const SYNONYMS: [(&str, &[&str]); 22] = [
    ("coulomb-friction", &["static-friction", "cone-friction"]),
    ("coulomb", &["static-friction", "cone-friction"]),
    ("dry-friction", &["static-friction", "cone-friction"]),
    ("stiction", &["stribeck-friction", "static-friction"]),
    ("friction", &["static-friction", "cone-friction"]),
    ("capstan", &["cone-friction"]),
    ("capstan-friction", &["cone-friction"]),
    ("damping", &["viscous-friction"]),
    ("play", &["backlash"]),
    ("slack", &["backlash"]),
    ("lost-motion", &["backlash"]),
    ("clearance", &["hole-clearance", "backlash"]),
    ("hysteresis", &["bouc-wen", "prandtl-ishlinskii"]),
    ("gain", &["stiffness-scale", "scale"]),
    ("stiffness", &["stiffness-scale"]),
    ("elasticity", &["actuator-compliance", "stiffness-scale"]),
    ("delay", &["latency"]),
    ("dead-time", &["latency"]),
    ("lag", &["first-order-lag", "latency"]),
    ("relaxation", &["creep"]),
    ("temperature", &["thermal-drift", "drift"]),
    ("crosstalk", &["cross-coupling"]),
];

/// The one of `names` that `given` is another word for, or else the one that looks most like it (Jaro-Winkler); `None` where
/// there are none.
///
/// ```
/// use krait_model::nearest_name;
/// assert_eq!(nearest_name("backlsh", ["creep", "backlash"]), Some("backlash"));
/// assert_eq!(nearest_name("Coulomb friction", ["viscous-friction", "static-friction"]), Some("static-friction"));
/// ```
pub fn nearest_name<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let names: Vec<&str> = names.into_iter().collect();
    let word = given.trim().to_lowercase().replace([' ', '_'], "-");
    let meant = SYNONYMS.iter().find(|(synonym, _)| *synonym == word);
    let known =
        meant.and_then(|(_, effects)| effects.iter().find_map(|effect| names.iter().find(|name| *name == effect)));
    let alike = |name: &str| strsim::jaro_winkler(given, name);
    known.or_else(|| names.iter().max_by(|a, b| alike(a).total_cmp(&alike(b)))).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_people_call_an_effect_finds_it_and_only_among_the_names_that_count() {
        let effects = ["backlash", "bouc-wen", "camera-scale", "latency", "static-friction", "stiffness-scale"];
        for (given, expected) in [
            ("Coulomb friction", "static-friction"),
            ("hysteresis", "bouc-wen"),
            ("play", "backlash"),
            ("gain", "stiffness-scale"),
            ("dead_time", "latency"),
            ("bouc-when", "bouc-wen"),
        ] {
            assert_eq!(nearest_name(given, effects), Some(expected), "{given}");
        }
        assert_eq!(nearest_name("gain", ["offset", "scale"]), Some("scale"));
        assert_eq!(nearest_name("anything", []), None);
    }

    #[test]
    fn every_synonym_leads_to_effects_that_there_are() {
        for (synonym, effects) in SYNONYMS {
            for effect in effects {
                let is_snakes = crate::effects::EffectKind::ALL.iter().any(|kind| kind.name() == *effect);
                assert!(is_snakes || ["scale", "first-order-lag", "drift"].contains(effect), "{synonym}: {effect}");
            }
        }
    }
}
