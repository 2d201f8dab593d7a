//! Are the columns of a machine of kind force what their names say? A negated force or angle, the force of another joint, an angle or a
//! force in another unit: said before any effect is named.
//!
//! The judge is the plain joint: inertia, gravity, dry and viscous friction, of which inertia and friction are never negative. Columns
//! that another reading lets it explain far better are probably so. The size of a force says nothing by itself; it does where the
//! model file has values.

mod ladder;

use super::columns::DEG_PER_RAD;
use crate::fit::Variable;
use crate::noise::bounds;
use crate::{LabError, Measurements, Problem};
use core::f64::consts::TAU;
use ladder::{Ladder, Moved, Values};

/// Another reading is probable when it leaves less than this part of the error.
const MUCH_LESS: f64 = 0.35;
/// Fewer rows say nothing: the plain joint has five numbers and an offset.
const FEWEST_ROWS: usize = 60;
/// Degrees under a name of radians span more than this, rad, and radians under a name of degrees less than a degree for each of it.
const TURN_RAD: f64 = TAU;
const MILLI: f64 = 1e-3;

/// What is probably wrong with a joint's columns.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Reading {
    /// The force is this joint's.
    OfJoint(usize),
    /// Force or angle is negated.
    Negated,
    /// Angles are to be multiplied by this.
    Angle(f64),
    /// Forces are to be multiplied by this.
    Force(f64),
}

/// A reading, with the error as it stands and as it would be.
#[derive(Clone, Copy, Debug)]
struct Better {
    reading: Reading,
    before: f64,
    after: f64,
}

/// What is probably wrong with the columns, a sentence; `None` where they are as good as any. `free`: what of the file's values a fit
/// finds.
///
/// # Errors
/// [`LabError::Chain`] where the model's own effects make no chain.
pub(super) fn check(problem: &Problem, free: &[Variable]) -> Result<Option<String>, LabError> {
    let n = problem.data.n_outputs;
    if problem.n_scored_outputs() < FEWEST_ROWS * n {
        return Ok(None);
    }
    let ladder = Ladder::new(problem, free);
    let found = (0..n).map(|joint| better(&ladder, joint)).collect::<Result<Vec<_>, _>>()?;
    let said = sentences(&problem.data, problem.machine.error_unit().0, &found);
    Ok((!said.is_empty()).then(|| said.join("; ")))
}

/// The reading of a joint's columns that explains far more than the one that is given.
fn better(ladder: &Ladder, joint: usize) -> Result<Option<Better>, LabError> {
    let n = ladder.problem.data.n_outputs;
    let given = Moved { joint, angle: 1.0, force: 1.0 };
    let mut readings = vec![(Reading::Negated, Moved { force: -1.0, ..given })];
    readings.extend(
        of_angles(span_rad(&ladder.problem.data, joint)).map(|angle| (Reading::Angle(angle), Moved { angle, ..given })),
    );
    let others =
        (0..n).filter(|other| *other != joint).map(|other| (Reading::OfJoint(other), Moved { joint: other, ..given }));
    let of_forces = [MILLI, 1.0 / MILLI].map(|force| (Reading::Force(force), Moved { force, ..given }));
    let mut best: Option<Better> = None;
    let mut offer = |reading, before: f64, after: f64| {
        if after < MUCH_LESS * before && best.is_none_or(|own| after * own.before < own.after * before) {
            best = Some(Better { reading, before, after });
        }
    };
    // With whatever values the plain joint would need, ...
    let before = ladder.left(joint, given, Values::Anew)?;
    for (reading, moved) in readings.iter().copied().chain(others) {
        offer(reading, before, ladder.left(joint, moved, Values::Anew)?);
    }
    // ... and with those that the file has, which must explain something where the columns are said to be others.
    if ladder.has_values(joint) {
        let before = ladder.left(joint, given, Values::OfFile)?;
        for (reading, moved) in readings.into_iter().chain(of_forces) {
            let after = ladder.left(joint, moved, Values::OfFile)?;
            if after < MUCH_LESS * ladder.left(joint, moved, Values::Without)? {
                offer(reading, before, after);
            }
        }
    }
    Ok(best)
}

/// Factors of angles that span so much which another unit would have; a motion that is plausible as it stands has none.
fn of_angles(span_rad: f64) -> impl Iterator<Item = f64> {
    let factor = match span_rad {
        span if span > TURN_RAD => Some(DEG_PER_RAD.recip()),
        span if span * DEG_PER_RAD < TURN_RAD => Some(DEG_PER_RAD),
        _ => None,
    };
    factor.into_iter()
}

fn span_rad(data: &Measurements, joint: usize) -> f64 {
    let (low, high) = bounds(data.inputs.iter().skip(joint).step_by(data.n_inputs).copied().filter(|q| q.is_finite()));
    high - low
}

/// A sentence for each reading, of all joints that have it.
fn sentences(data: &Measurements, unit: &str, found: &[Option<Better>]) -> Vec<String> {
    let all = || found.iter().enumerate().filter_map(|(joint, own)| own.map(|own| (joint, own)));
    let mut said = Vec::new();
    let mut told: Vec<usize> = Vec::new();
    for (joint, own) in all() {
        if told.contains(&joint) {
            continue;
        }
        let is_other_way = |other: usize| found[other].is_some_and(|back| back.reading == Reading::OfJoint(joint));
        let joints: Vec<usize> = match own.reading {
            Reading::OfJoint(other) if is_other_way(other) => vec![joint, other],
            Reading::OfJoint(_) => vec![joint],
            reading => all().filter(|(_, other)| other.reading == reading).map(|(joint, _)| joint).collect(),
        };
        let mean = |part: fn(&Better) -> f64| {
            let squares = joints.iter().filter_map(|joint| found[*joint]).map(|own| part(&own).powi(2));
            (squares.sum::<f64>() / joints.len() as f64).sqrt()
        };
        let (before, after) = (mean(|own| own.before), mean(|own| own.after));
        let what = in_words(data, unit, own.reading, &joints);
        said.push(format!("{what}: {before:.3} {unit} becomes {after:.3} {unit}"));
        told.extend(joints);
    }
    said
}

fn in_words(data: &Measurements, unit: &str, reading: Reading, joints: &[usize]) -> String {
    let own_name = |names: &[String], k: usize| names.get(k).filter(|name| !name.is_empty()).cloned();
    let angle = |k: usize| own_name(&data.names.inputs, k).unwrap_or_else(|| format!("q{}", k + 1));
    let force_base = if unit == "A" { "i" } else { "tau" };
    let force = |k: usize| own_name(&data.names.outputs, k).unwrap_or_else(|| format!("{force_base}{}", k + 1));
    let list = |name: &dyn Fn(usize) -> String| {
        let names: Vec<String> = joints.iter().map(|joint| name(*joint)).collect();
        let (last, others) =
            names.split_last().map_or((String::new(), &[][..]), |(last, others)| (last.clone(), others));
        if others.is_empty() { last } else { format!("{} and {last}", others.join(", ")) }
    };
    let (forces, angles) = (list(&force), list(&angle));
    let are = if joints.len() == 1 { "is" } else { "are" };
    match reading {
        Reading::OfJoint(_) if joints.len() == 2 => {
            format!("{forces} are probably exchanged, or {angles} are")
        }
        Reading::OfJoint(other) => format!("{forces} probably belongs to {}", angle(other)),
        Reading::Negated => format!(
            "{forces} {are} probably negated, or {angles} {are} (what speeds a joint up is positive, and so is friction while the angle grows)"
        ),
        Reading::Angle(factor) if factor < 1.0 => {
            format!("{angles} {are} probably in degrees where radians are expected")
        }
        Reading::Angle(_) => format!("{angles} {are} probably in radians where degrees are expected"),
        Reading::Force(factor) => {
            let prefix = if factor < 1.0 { "m" } else { "k" };
            format!(
                "{forces} {are} probably in {prefix}{unit} where {unit} is expected, or the model's values are another machine's"
            )
        }
    }
}
