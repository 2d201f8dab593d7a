//! Families of effects that look alike, and what to do with a machine to tell their members apart: the texts of the next experiment.

/// Families of effects, and the experiments that tell members from each other and from other families.
pub(super) const FAMILIES: [(&[&str], &str); 9] = [
    (
        &["stiffness-scale", "actuator-compliance", "radius-error", "camera-scale", "inside-extension"],
        "Hang known weights on the tip at a fixed pose (a load changes the bend through stiffness only), put a dial \
         indicator behind the drive (compliance of the actuators), and turn a target by known angles before the camera \
         (its scale); the section and modulus of the tubes say what the lines give inside the snake",
    ),
    (
        &["backlash", "static-friction", "bouc-wen", "prandtl-ishlinskii", "stribeck-friction", "bend-friction"],
        "Run nested loops of decreasing amplitude down to 2 deg at three speeds, and record the loads of the lines: crossing a \
         play moves nothing and changes no load, friction makes the load jump, micro-slip moves a little from the start",
    ),
    (
        &["cone-friction", "distributed-capstan", "disk-friction", "hole-clearance"],
        "Run loops of three amplitudes in one plane: the width of the loop grows with the bend for friction in the cone and \
         with its square for friction at the disks; bend the stem to change the cone's angle; weigh one line over the cone: friction \
         along its bends needs twice the coefficient of friction at one place",
    ),
    (
        &["superelastic-softening", "non-constant-curvature", "axial-tip-force"],
        "Measure the tip's position and its tangent at 30, 60 and 90 deg going up and down: curvature moves one against the \
         other, softening opens a loop at large bends only",
    ),
    (
        &["tension-compression-asymmetry", "line-buckling"],
        "Rotate the plane at 45 deg with the lines preloaded, drawn and pushed: buckling leaves the slope of drawn lines alone",
    ),
    (
        &["viscous-friction", "latency"],
        "Run the same path at one, four and sixteen times the speed with the lines' loads recorded: latency shifts the camera, \
         not the loads; or light a lamp in the camera's view with the command",
    ),
    (
        &["plane-offset", "twist"],
        "Rotate the plane through a whole turn at 20, 40 and 80 deg: a twist grows with the bend",
    ),
    (
        &["lateral-tip-force", "encoder-zero", "camera-offset"],
        "Repeat one path after homing again (encoder zeros change), with the camera turned by 180 deg (its offset turns), and \
         with the base rolled by 180 deg (a weight's force turns)",
    ),
    (
        &["creep", "thermal-drift"],
        "Step to 60 deg and hold for five minutes, three times with ten minutes between: creep starts again at each step, drift \
         goes on",
    ),
];

/// The same for the family of this first name, where the loads were recorded already and did not tell.
pub(super) const WITH_LOADS: [(&str, &str); 2] = [
    (
        "backlash",
        "Run nested loops of decreasing amplitude down to 2 deg at a tenth of the speed, with the loads recorded again: crossing a play \
         moves nothing, micro-slip moves a little from the start, and friction turns the load round",
    ),
    (
        "viscous-friction",
        "Run the same path at one, four and sixteen times the speed, with the loads recorded again: latency shifts the camera, not the \
         loads",
    ),
];

/// Families of effects of joints, and the experiments that tell members from each other.
pub(super) const OF_JOINTS: [(&[&str], &str); 4] = [
    (
        &[
            "backlash",
            "bouc-wen",
            "prandtl-ishlinskii",
            "generalised-prandtl-ishlinskii",
            "load-friction",
            "cone-friction",
        ],
        "Run slow loops of this joint from its whole range down to a fiftieth of it, each twice: a loop within a play moves nothing, \
         micro-slip gives a little from the start, and a loop of load friction widens with the distance from the middle",
    ),
    (
        &["latency", "first-order-lag", "second-order", "rate-limit"],
        "Run fast steps of falling size, and a small sine whose frequency rises to the fastest that the joint can: a delay shifts all \
         alike, a lag rounds, a second order overshoots, a rate limit bends large steps only",
    ),
    (
        &["creep", "drift", "linear-drift"],
        "Step to one end and hold for a minute, three times with a minute between: creep starts again at each step, drift goes on",
    ),
    (
        &["quadratic", "cubic", "saturation", "dead-zone", "periodic-error", "scale", "offset"],
        "Go slowly over the whole range both ways, twice, with a rest every twentieth of it: curves, limits and rhythms follow the place \
         and repeat, hysteresis does not",
    ),
];

/// What helps joints where nothing else is known to.
pub(super) const RICH_OF_JOINTS: &str = "Run this joint in nested loops from its whole range to a tenth of it at three speeds, then fast steps of \
                              falling size with holds of 3 s, while the other joints rest: reversals separate hysteresis from \
                              everything that has none";

/// Families of effects of a force, and the experiments that tell members from each other; the first one that has all of them is taken.
pub(super) const OF_FORCE: [(&[&str], &str); 3] = [
    (
        &["coulomb", "viscous", "stribeck", "quadratic-viscous", "direction-viscous"],
        "Run this joint at six steady speeds from a hundredth of its fastest up to it, both ways over the same part of its range: dry \
         friction is the same at all of them, a Stribeck part is there at the slow ones only, drag grows with the speed or its \
         square, and what depends on the speed alone keeps its sign when the motion turns",
    ),
    (
        &["coulomb", "stribeck", "load-coulomb", "load-stribeck", "quadratic-load"],
        "Repeat the same path without a weight, with a known one and with twice that: dry friction stays, friction of load grows with \
         the load and quadratic friction with its square; a Stribeck part is there at slow speeds only",
    ),
    (
        &["inertia", "gravity"],
        "Repeat the same path at half and at a fourth of the speed: a weight's part stays, inertia falls to a fourth and to a sixteenth",
    ),
];

/// What helps a force where nothing else is known to.
pub(super) const RICH_OF_FORCE: &str = "Run each joint alone over its whole range both ways, at four steady speeds and with swings of growing \
                             acceleration, first as it is and then with a known weight: what depends on the place, the speed, the \
                             acceleration and the load then moves apart, and friction shows at each turn";

/// The experiment of the first family that has all of these effects.
pub(super) fn of_family(families: &[(&[&str], &'static str)], class: &[String]) -> Option<&'static str> {
    let has_all = |(names, _): &&(&[&str], &str)| class.iter().all(|own| names.contains(&own.as_str()));
    families.iter().find(has_all).map(|(_, instruction)| *instruction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_model::effects::{EffectKind, ForceEffect};
    use krait_model::joints::JointEffect;

    #[test]
    fn every_family_has_effects_of_its_own_kind_of_machine_only() {
        let all = |families: &[(&'static [&'static str], &str)], is_own: &dyn Fn(&str) -> bool| {
            families.iter().flat_map(|(names, _)| names.iter()).find(|name| !is_own(name)).copied()
        };
        assert_eq!(all(&OF_FORCE, &|name| ForceEffect::from_name(name).is_some()), None);
        assert_eq!(all(&OF_JOINTS, &|name| JointEffect::from_name(name).is_some()), None);
        assert_eq!(all(&FAMILIES, &|name| EffectKind::from_name(name).is_some()), None);
    }
}
