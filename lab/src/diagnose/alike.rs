//! Does an effect depend on the same as what it leaves? Then it may only imitate what nobody knows, and is no more than a hypothesis.

use krait_model::effects::Class;

/// Whether effects of a class (its label) make errors that depend on what a group of structure is named after.
pub(super) fn is_alike(class: &str, group: &str) -> bool {
    let any = |own: &[Class]| own.iter().any(|own| own.label() == class);
    match group {
        "the pose" => any(&[Class::Proportional, Class::Cubic, Class::DeadZone, Class::Clipped, Class::Periodic]),
        "the plane of bending" => any(&[
            Class::Plane,
            Class::FirstHarmonic,
            Class::SecondHarmonic,
            Class::Coupling,
            Class::Asymmetry,
            Class::Periodic,
        ]),
        "direction of motion" | "travel since a reversal" => any(&[
            Class::ConstantHysteresis,
            Class::LoadHysteresis,
            Class::BendHysteresis,
            Class::ConstantHysteresisAndRate,
        ]),
        "speed" => any(&[Class::Rate, Class::ConstantHysteresisAndRate]),
        "time" => any(&[Class::Drift, Class::Rest]),
        _ => group.starts_with("earlier poses") && any(&[Class::Rest, Class::Drift]),
    }
}

#[cfg(test)]
mod tests {
    use super::is_alike;

    #[test]
    fn a_drift_is_like_what_changes_with_time_and_play_is_not() {
        assert!(is_alike("drift", "time") && !is_alike("K2 constant hysteresis", "time"));
        assert!(is_alike("K2 constant hysteresis", "travel since a reversal") && !is_alike("drift", "the pose"));
    }
}
