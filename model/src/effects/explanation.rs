//! What each effect is, in words for whoever has the machine before him: a title, two sentences, and what to look at. Page,
//! report and commands show these texts.

use super::of_segment::{SegmentEffect, without_segment};
use std::borrow::Cow;

/// An effect in plain words.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Explanation {
    /// What people call it.
    pub title: &'static str,
    /// What happens, and what it looks like; of an effect of one segment, which.
    pub what: Cow<'static, str>,
    /// What to check on the machine.
    pub check: &'static str,
}

/// The words for an effect of this name; none for a user's own formula. Effects of snakes and joints with one name share them, and
/// those of one segment have the words of all and the segment's.
pub fn explanation(name: &str) -> Option<Explanation> {
    let of_all = without_segment(name);
    let (_, words) = EXPLANATIONS.iter().find(|(own, _)| *own == of_all)?;
    let what = SegmentEffect::from_name(name).map_or(words.what.clone(), |own| {
        Cow::Owned(format!("{} Here: of {} alone, beside what all have.", words.what, own.acts_on()))
    });
    Some(Explanation { what, ..words.clone() })
}

const fn words(title: &'static str, what: &'static str, check: &'static str) -> Explanation {
    Explanation { title, what: Cow::Borrowed(what), check }
}

#[rustfmt::skip]
static EXPLANATIONS: &[(&str, Explanation)] = &[
    ("stiffness-scale", words("stiffness is another",
        "The snake is stiffer or softer than its tubes' data say. It bends too little or too much by the same share everywhere.",
        "Measure the tubes' diameters and wall; weigh a bent tube's tip force; ask the maker for the modulus.")),
    ("actuator-compliance", words("drives give way",
        "Drives, couplings or frame yield under the lines' load. The error grows with the load and goes when the load goes.",
        "Hold a drive, pull its line by hand with a balance, and watch a dial indicator at the coupling.")),
    ("inside-extension", words("lines give way inside the snake",
        "Lines stretch and shorten inside the bent snake as they do behind it. Every bend falls short by about two percent.",
        "Measure the tubes' diameters and modulus; the shape alone cannot tell it from the snake's stiffness.")),
    ("radius-error", words("lines lie at another radius",
        "The lines run nearer to the middle or further out than the model says. Every bend is off by the same share.",
        "Measure the pitch circle of the holes in the spacer disks.")),
    ("camera-scale", words("the camera's scale is off",
        "The camera reads every bend too large or too small by one share. Nothing is wrong with the machine.",
        "Measure a bent wire of known angle with the same camera and the same distance.")),
    ("backlash", words("play",
        "After each reversal the drive moves a little before anything follows. The way back lies beside the way there by a constant width.",
        "Turn the drive to and fro by hand and feel the free way; look for a loose coupling, nut or capstan.")),
    ("static-friction", words("static friction",
        "A constant rubbing force must be overcome before a line or a joint moves. It looks like play, but it needs force and grows with a softer line.",
        "Push the line by hand in the unloaded sheath; clean and oil it; load cells tell it from play.")),
    ("bouc-wen", words("smooth hysteresis",
        "The way back lies beside the way there, and the change from one to the other is gradual. Cables that rub along their whole length do this.",
        "Look for rubbing along sheaths and bends, and for a stretched cable.")),
    ("prandtl-ishlinskii", words("hysteresis of many plays",
        "Many small plays or rubbing places add up along the way. Small reversals show a narrow loop, large ones a wide one.",
        "Record reversals of several sizes; look for rubbing along the whole way of the cable.")),
    ("generalised-prandtl-ishlinskii", words("uneven hysteresis",
        "The loop is wider on one side or bent like the letter S. Many small plays act behind a curve that is not straight.",
        "Record reversals on both sides of the middle; look for a spring, a stop or a pulley that acts on one side.")),
    ("stribeck-friction", words("friction that falls with speed",
        "At rest it sticks more than in motion, so that slow motion goes in jerks. Fast motion hardly shows it.",
        "Move very slowly and look for stick and slip; change the grease.")),
    ("load-friction", words("friction that grows with load",
        "Rubbing is the stronger the more the joint carries. The loop is wide where the load is large and narrow where it is small.",
        "Repeat the motion with and without the load; look at the bearings and the cable's way round its pulleys.")),
    ("cone-friction", words("friction round a bend of the line",
        "A line that is loaded rubs where it is led round a bend, as a rope round a post. The loop grows with the load.",
        "Look at the cone or guide that the lines turn round; clean it, or widen its radius.")),
    ("distributed-capstan", words("friction spread along the cone",
        "A loaded line rubs all along the bends that it is led round, not at one place. The loop grows with the load, half as wide.",
        "Weigh one line over the clean cone; friction at one place with half as much of it looks the same in the shape.")),
    ("disk-friction", words("friction in the spacer disks",
        "Loaded lines rub in the holes of the disks along the bent snake. The loop grows with the square of the bend.",
        "Look for worn or burred holes in the disks.")),
    ("bend-friction", words("friction inside the snake",
        "A moment resists every change of bend, whatever the lines carry. Near straight the snake hardly answers small motions.",
        "Bend the snake by hand without the drives and feel whether it stays where it is left.")),
    ("hole-clearance", words("clearance in the disks",
        "Lines lie at one side of their holes while the load grows and at the other while it falls. The effective radius changes between the two.",
        "Measure hole and line diameter.")),
    ("superelastic-softening", words("the metal softens",
        "Beyond about one percent of strain NiTi carries hardly more load. Large bends need less force than small ones promise.",
        "Compare the force at large bends with that at small ones; look at the alloy's data sheet.")),
    ("non-constant-curvature", words("the bend is no circle",
        "The snake curves more near one end than near the other. The tip lies elsewhere than the bend at the tip says.",
        "Photograph a large bend and lay a circle over it.")),
    ("axial-tip-force", words("a force along the axis",
        "Something pulls or pushes the tip towards or from the base. Bends grow or shrink with their own cube.",
        "Look for a cable, a hose or an instrument that passes through the snake.")),
    ("lateral-tip-force", words("a sideways force at the tip",
        "Something pulls the tip to one side: weight or contact. The snake hangs to that side wherever it bends.",
        "Turn the base by half a turn: a weight's direction stays, the machine's turns with it.")),
    ("tension-compression-asymmetry", words("pull and push differ",
        "Lines give way more when pushed than when pulled, or the reverse. Bends to one side are off more than to the other.",
        "Pull and push one line with the same force and measure its way.")),
    ("line-buckling", words("pushed lines snake",
        "A line that is pushed lies in waves in its guide and becomes shorter. Only pushed lines show it, the more the wider the guide.",
        "Look at the guides' inner diameter; hold the line where it is free.")),
    ("latency", words("delay",
        "Measurement and command belong to different instants. The error grows with speed and is nothing at rest.",
        "Tap the machine and compare the stamps of camera and drives; look at exposure and buffers.")),
    ("viscous-friction", words("drag",
        "A force grows with speed, as of thick grease. Fast motion lags, slow motion does not.",
        "Repeat the motion at half the speed; look at the grease and at seals.")),
    ("plane-offset", words("the plane is turned",
        "The camera or the base is turned about the axis. Every direction is off by one angle, and the size of the bend is right.",
        "Bend along line 1 alone and see in which direction the tip goes.")),
    ("twist", words("the snake twists",
        "The direction turns the more the further it bends. Disks that do not stay in line do this.",
        "Look along the snake: do the disks' marks stay in line while it bends?")),
    ("camera-offset", words("the camera's zero is off",
        "A straight snake does not read as straight. Every reading is off by the same vector.",
        "Hold the snake straight in a tube and read the camera.")),
    ("encoder-zero", words("a drive's zero is off",
        "A line's length counts from another place than straight. The bend is off in that line's direction.",
        "Repeat the search for zero; compare all lines with the straight snake.")),
    ("encoder-scale", words("a drive's scale is off",
        "A line moves more or less than its encoder says. One direction is off by a share, others are not.",
        "Move the drive by ten millimetres and measure with a dial indicator.")),
    ("unequal-lines", words("lines lie unevenly",
        "Holes are not where the model has them. Bend and direction are off twice round the circle.",
        "Measure the holes' angles and radii on one disk.")),
    ("lead-screw-error", words("a screw that runs unevenly",
        "The error comes and goes once for each turn of the screw. It hangs on the place, not on the direction.",
        "Move through three turns slowly and look for a wave of one turn's length.")),
    ("creep", words("creep",
        "Under load it goes on moving slowly, and after it goes back slowly. Rests after a large motion show it.",
        "Hold a large bend for some minutes and watch; look for plastic parts, glue and polymer cables.")),
    ("thermal-drift", words("it warms up",
        "The zero wanders while drives and lines warm. It follows minutes, not motions.",
        "Record the temperature; repeat after an hour of warming up.")),
    ("stem-coupling", words("the bent stem acts on the lines",
        "Where the stem is bent, lines rub more and change their lengths. The error follows the stem's angle.",
        "Hold the snake's bend, bend the stem, and watch the tip.")),
    ("saturation", words("it stops at a limit",
        "Beyond a force or a place nothing moves any more. Large commands are cut off.",
        "Look for an end stop, a slack cable, or a drive at its current limit.")),
    ("preload", words("all lines carry a load from the start",
        "All lines are loaded alike even while the snake is straight. That bends nothing by itself, but it widens every loop of friction.",
        "Let the lines go near straight and see how far they spring back; read the load cells there.")),
    ("cross-coupling", words("one moves another",
        "A joint's or a line's motion changes another one's length. The error follows the other one's command.",
        "Move one alone and watch the others; look how cables pass the joints before.")),
    ("scale", words("gain is off",
        "The joint moves more or less than commanded, by one share everywhere. The error grows with the command.",
        "Measure a large move; check the gear ratio, the pulley's radius and the unit.")),
    ("offset", words("zero is off",
        "Every position is off by the same amount. Nothing else is wrong.",
        "Repeat the search for zero, or put the joint against a known stop.")),
    ("cubic", words("the gain bends",
        "Far from the middle the joint moves more or less than near it, alike on both sides. Linkages and pulleys out of centre do this.",
        "Plot position against command over the whole range; look at the linkage's geometry.")),
    ("quadratic", words("the gain grows to one side",
        "The joint moves more for the same command on one side than on the other. A cam, a lever or a pulley out of centre does this.",
        "Plot position against command over the whole range; look for a part out of centre.")),
    ("dead-zone", words("a dead zone",
        "Around one place the command does nothing. It hangs on the place and not on the direction, unlike play.",
        "Move slowly through that place from both sides; look for slack around the middle.")),
    ("periodic-error", words("an error that repeats",
        "The error comes and goes with the position, once for each turn of some part. Gears and pulleys out of centre do this.",
        "Compare the period with a turn of gear, pulley or screw.")),
    ("first-order-lag", words("it follows late",
        "The joint runs after its command and catches up at rest. The error grows with speed and fades within a time of its own.",
        "Look at the controller's gain, and at filters between command and measurement.")),
    ("second-order", words("it swings",
        "After a fast move the joint overshoots and swings. Its mass and its stiffness set the frequency.",
        "Tap the arm and look at the ringing; lower the acceleration.")),
    ("drift", words("it drifts and settles",
        "The zero wanders after the start and comes to rest. It follows the clock, not the motion.",
        "Repeat after warming up; look at the sensor's supply and temperature.")),
    ("linear-drift", words("it drifts",
        "The zero wanders evenly with time. A slipping part or an integrating sensor does this.",
        "Mark the cable at its pulley and see whether it slips; repeat the search for zero at the end.")),
    ("rate-limit", words("it cannot go faster",
        "Beyond one speed the joint lags further and further. Slow motion is right.",
        "Look at the drive's speed limit and at the voltage under load.")),
    ("inertia", words("mass that is sped up",
        "Torque grows with the acceleration. Link, load and the drive's rotor behind its gear make it.",
        "Compare it with the masses of link and load; repeat with a known weight at a known arm.")),
    ("gravity", words("weight",
        "Torque hangs on the joint's angle, once round a turn. The weight of link and load makes it.",
        "Hold the joint at several angles; turn the machine on its side and see it change.")),
    ("coulomb", words("dry friction in the joint",
        "A torque against the motion, as large at any speed. It turns its sign at every reversal.",
        "Turn the joint by hand without load; look at preloaded bearings, seals and brakes.")),
    ("viscous", words("drag of the joint",
        "A torque against the motion that grows with speed. Grease and the motor's own losses make it.",
        "Repeat at half the speed; repeat warm, as grease thins.")),
    ("stribeck", words("the joint sticks at low speed",
        "Friction is larger at rest and falls once the joint moves. Slow motion goes in jerks.",
        "Move at constant speeds from very slow to fast and plot the torque; change the grease.")),
    ("load-coulomb", words("gear friction that grows with load",
        "The more the gear carries, the more it rubs. Lifting costs more than the weight, and lowering gives back less.",
        "Lift and lower two weights slowly; look at worm, harmonic and planetary gears.")),
    ("load-stribeck", words("the loaded gear sticks",
        "Under load the gear sticks more at rest than in motion. Without load it does not.",
        "Start from rest under two weights and compare the torque of breaking away.")),
    ("quadratic-load", words("gear friction bends with load",
        "Friction grows with the square of the load, beside what grows evenly. Efficiency then changes with load.",
        "Lift and lower three weights slowly and plot friction against load.")),
    ("direction-viscous", words("drag differs by direction",
        "The joint needs more torque one way than the other. The difference grows with speed and is gone at rest.",
        "Exchange the directions of one motion; look at seals, brushes and one-sided preload.")),
    ("quadratic-viscous", words("drag grows faster than speed",
        "Torque grows with the square of speed. Air, churned oil and fans make it.",
        "Plot torque against speed at constant speeds; look at the oil's level.")),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{EffectKind, ForceEffect};
    use crate::joints::JointEffect;
    use std::collections::BTreeSet;

    #[test]
    fn every_effect_has_words_of_its_own_and_none_are_left_over() {
        let snakes = EffectKind::ALL.into_iter().filter(|kind| *kind != EffectKind::Formula).map(EffectKind::name);
        let forces = ForceEffect::ALL.into_iter().map(ForceEffect::name);
        let joints = JointEffect::ALL.into_iter().map(|effect| effect.definition().name);
        let names: BTreeSet<&str> = snakes.chain(joints).chain(forces).collect();
        let told: Vec<&str> = EXPLANATIONS.iter().map(|(name, _)| *name).collect();
        assert_eq!(told.iter().copied().collect::<BTreeSet<_>>(), names);
        assert_eq!(told.len(), names.len(), "one entry each");
        let titles: BTreeSet<&str> = EXPLANATIONS.iter().map(|(_, own)| own.title).collect();
        assert_eq!(titles.len(), names.len(), "no two have one title");
    }

    #[test]
    fn an_effect_of_one_segment_says_which() {
        let words = |name| explanation(name).map(|own| own.what.into_owned()).unwrap_or_default();
        let here = |of: &str| format!(" Here: of {of} alone, beside what all have.");
        assert_eq!(words("backlash-2"), words("backlash") + &here("the lines of segment 2"));
        assert_eq!(words("stiffness-scale-1"), words("stiffness-scale") + &here("segment 1"));
        assert_eq!(words("camera-offset-3"), words("camera-offset") + &here("segment 3"));
        assert!(!words("backlash").contains("Here"));
    }

    #[test]
    fn texts_are_short_sentences() {
        for (name, own) in EXPLANATIONS {
            let n_sentences = own.what.matches(". ").count() + 1;
            assert!(n_sentences == 2 && own.what.len() < 160, "{name}: {}", own.what);
            assert!(own.what.ends_with('.') && own.check.ends_with(['.', '?']) && own.check.len() < 130, "{name}");
            assert!(own.title.len() < 40 && !own.title.ends_with('.'), "{name}: {}", own.title);
        }
    }
}
