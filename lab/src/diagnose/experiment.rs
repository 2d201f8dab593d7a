//! What to do next: the motion that would separate effects that these data cannot tell apart.

use super::Verdict;
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

/// Families of effects, and the experiments that tell members from each other and from other families.
const FAMILIES: [(&[&str], &str); 9] = [
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
const WITH_LOADS: [(&str, &str); 2] = [
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
const OF_JOINTS: [(&[&str], &str); 4] = [
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
const RICH_OF_JOINTS: &str = "Run this joint in nested loops from its whole range to a tenth of it at three speeds, then fast steps of \
                              falling size with holds of 3 s, while the other joints rest: reversals separate hysteresis from \
                              everything that has none";

/// The experiment for effects of a joint (from 1) that look alike; `None` where there is nothing to separate.
pub(crate) fn separate_joints(class: &[String], joint: Option<usize>) -> Option<NextExperiment> {
    let first = class.first().filter(|_| class.len() > 1)?;
    let shared = OF_JOINTS
        .iter()
        .find(|(names, _)| names.contains(&first.as_str()))
        .filter(|(names, _)| class.iter().skip(1).all(|other| names.contains(&other.as_str())));
    let instruction = shared.map_or(RICH_OF_JOINTS, |(_, instruction)| instruction);
    let instruction = joint.map_or(instruction.to_owned(), |joint| format!("On joint {joint}: {instruction}"));
    Some(NextExperiment { separates: class.to_vec(), instruction, motion: None })
}

/// The experiment for effects that look alike; `None` where there is nothing to separate.
pub(crate) fn separate(class: &[String], n_reversals: usize, has_loads: bool) -> Option<NextExperiment> {
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
