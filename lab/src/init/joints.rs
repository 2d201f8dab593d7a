//! Commands beside measurements, a pair for each joint.

use super::Column;
use super::name::NamedUnit;
use super::role::Guess;
use crate::read::{Dimension, Unit};
use core::f64::consts::TAU;
use std::cmp::Ordering;

/// Joints that a machine can have.
const MOST: usize = 16;
/// A gain of degrees per radian, found between columns whose names already differ so.
const DEG_PER_RAD: f64 = 360.0 / TAU;
const NEAR: f64 = 0.05;
/// Share of a straight line below which a measurement does not follow its command.
const FOLLOWS: f64 = 0.5;

/// A joint's columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pair {
    pub u: usize,
    pub y: usize,
    pub why_u: String,
    pub why_y: String,
}

/// The unit of all commands or of all measurements.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Side {
    /// The model's unit.
    pub unit: String,
    /// The unit of a column whose name has none, if the lab converts it.
    pub unnamed: Option<Unit>,
    /// That it was taken from the range, in a sentence.
    pub guess: Option<String>,
}

/// Finds the pairs, in order of the joints.
pub(super) fn pairs(columns: &[Column]) -> Vec<Pair> {
    let moving = |column: &Column| column.looked.moves();
    let side = |is_one: fn(&Guess) -> bool| {
        let own = columns.iter().enumerate().filter(move |(_, column)| is_one(&column.guess) && moving(column));
        own.map(|(place, column)| (Guess::joint(&column.words), place)).collect::<Vec<_>>()
    };
    let commands = side(|guess| matches!(guess, Guess::Command(_)));
    let measured = side(|guess| matches!(guess, Guess::Measured(_)));
    let unclear = side(|guess| *guess == Guess::Unclear);
    let mut pairs: Vec<(String, Pair)> = Vec::new();
    for (joint, u) in &commands {
        // One command in two units is one joint: of several columns of a joint the first counts.
        let is_taken = pairs.iter().any(|(other, _)| other == joint);
        if let Some((_, y)) = measured.iter().find(|(other, _)| other == joint && !is_taken) {
            pairs.push((joint.clone(), pair(columns, *u, *y)));
        }
    }
    if pairs.is_empty() {
        let left: Vec<usize> =
            [&commands, &measured, &unclear].into_iter().flatten().map(|(_, place)| *place).collect();
        pairs.extend(alone(columns, &commands, &measured, &left).map(|pair| (String::new(), pair)));
    }
    pairs.sort_by(|(a, _), (b, _)| in_order(a, b));
    pairs.into_iter().map(|(_, pair)| pair).take(MOST).collect()
}

/// Joints with numbers by their numbers, others as they stand.
fn in_order(a: &str, b: &str) -> Ordering {
    match (a.parse::<u32>(), b.parse::<u32>()) {
        (Ok(a), Ok(b)) => a.cmp(&b),
        _ => Ordering::Equal,
    }
}

/// Where names make no pair: one command and one measurement, or the only two columns that move.
fn alone(
    columns: &[Column],
    commands: &[(String, usize)],
    measured: &[(String, usize)],
    left: &[usize],
) -> Option<Pair> {
    if let ([(_, u)], [(_, y)]) = (commands, measured) {
        return Some(pair(columns, *u, *y));
    }
    let [a, b] = *left else { return None };
    let is_measured = |place: usize| measured.iter().any(|(_, own)| *own == place);
    let is_command = |place: usize| commands.iter().any(|(_, own)| *own == place);
    if is_measured(a) || is_command(b) {
        return Some(pair(columns, b, a));
    }
    if is_measured(b) || is_command(a) {
        return Some(pair(columns, a, b));
    }
    let mut pair = pair(columns, a, b);
    pair.why_u = "stands first".to_owned();
    Some(pair)
}

fn pair(columns: &[Column], u: usize, y: usize) -> Pair {
    let why = |place: usize| match columns.get(place).map(|column| &column.guess) {
        Some(Guess::Command(word) | Guess::Measured(word)) => format!("named {word:?}"),
        _ => "moves".to_owned(),
    };
    Pair { u, y, why_u: why(u), why_y: why(y) }
}

/// Gain and share of variance of the straight line between two columns as they stand in the file.
fn line(columns: &[Column], u: usize, y: usize) -> Option<(f64, f64)> {
    let (u, y) = (columns.get(u)?, columns.get(y)?);
    let rows = || {
        let rows = u.looked.values.iter().zip(&y.looked.values);
        rows.filter(|(u, y)| u.is_finite() && y.is_finite())
    };
    let n = rows().count() as f64;
    let (mean_u, mean_y) = rows().fold((0.0, 0.0), |(a, b), (u, y)| (a + u / n, b + y / n));
    let (mut uu, mut uy, mut yy) = (0.0, 0.0, 0.0);
    for (u, y) in rows() {
        let (u, y) = (u - mean_u, y - mean_y);
        uu += u * u;
        uy += u * y;
        yy += y * y;
    }
    (uu > 0.0 && yy > 0.0).then(|| (uy / uu, uy * uy / (uu * yy)))
}

/// The unit of one side of all pairs.
///
/// # Errors
/// A reason: the joints are of several quantities.
pub(super) fn side(columns: &[Column], places: &[usize]) -> Result<Side, String> {
    let own: Vec<&Column> = places.iter().filter_map(|place| columns.get(*place)).collect();
    let unit_of = |column: &Column| match &column.words.unit {
        NamedUnit::Known(unit) if unit.dimension == Dimension::Angle => Some("rad".to_owned()),
        NamedUnit::Known(unit) => Some(unit.suffix.to_owned()),
        NamedUnit::Counts(unit) => Some(unit.clone()),
        NamedUnit::None | NamedUnit::Other(_) => None,
    };
    let quantity = |column: &Column| column.words.unit.dimension();
    if let Some(first) = own.first() {
        if let Some(other) = own.iter().find(|other| quantity(other) != quantity(first)) {
            return Err(format!(
                "columns {:?} and {:?} are of different quantities, expected joints of one; name one sort with --map, such as --map 'u1_rad={}'",
                first.name(),
                other.name(),
                first.name()
            ));
        }
        if let Some(unit) = unit_of(first) {
            return Ok(Side { unit, unnamed: None, guess: None });
        }
    }
    let largest = own.iter().filter_map(|column| column.looked.reach()).fold(0.0, f64::max);
    let unit = match largest {
        largest if largest <= TAU => "rad",
        largest if largest <= 720.0 => "deg",
        _ => "counts",
    };
    let names = own.iter().map(|column| format!("{:?}", column.name())).collect::<Vec<_>>().join(", ");
    let guess = format!("{names} without a unit in the name: taken for {unit}, reaching {largest:.4}");
    let model = if unit == "deg" { "rad" } else { unit };
    Ok(Side { unit: model.to_owned(), unnamed: Unit::from_suffix(unit), guess: Some(guess) })
}

/// How each measurement follows its command, and what is a reason for care.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Checked {
    pub pairs: Vec<String>,
    pub cautions: Vec<String>,
}

/// Looks whether the units in the names contradict the motion.
///
/// # Errors
/// The contradiction.
pub(super) fn check(columns: &[Column], pairs: &[Pair]) -> Result<Checked, String> {
    let mut checked = Checked::default();
    let mut loose = Vec::new();
    for (k, Pair { u, y, .. }) in pairs.iter().enumerate() {
        let (Some(from), Some(to), Some((gain, share))) = (columns.get(*u), columns.get(*y), line(columns, *u, *y))
        else {
            continue;
        };
        let percent = 100.0 * share;
        let (name, command) = (to.name(), from.name());
        checked.pairs.push(format!("joint {}: {name:?} is {percent:.0} % a straight line of {command:?}", k + 1));
        if share < FOLLOWS {
            loose.push((k + 1).to_string());
        }
        let (NamedUnit::Known(from_unit), NamedUnit::Known(to_unit)) = (&from.words.unit, &to.words.unit) else {
            continue;
        };
        if let Some(ratio) = same_numbers(gain, share, from_unit, to_unit) {
            let (a, b) = (from_unit.suffix, to_unit.suffix);
            return Err(format!(
                "columns {command:?} and {name:?} move by the same numbers (ratio {ratio:.3}) although one names {a} and the other {b}; one unit is wrong: correct the name, or say --map 'y{}_{a}={name}:{a}'",
                k + 1
            ));
        }
    }
    if !loose.is_empty() {
        checked.cautions.push(format!(
            "less than half of joint {} is a straight line of its command: is each command that joint's own?",
            loose.join(", ")
        ));
    }
    Ok(checked)
}

/// Whether two angles in different units have a ratio of one in their numbers.
fn same_numbers(gain: f64, share: f64, from: &Unit, to: &Unit) -> Option<f64> {
    let are_angles = from.dimension == Dimension::Angle && to.dimension == Dimension::Angle;
    let ratio = from.factor / to.factor;
    let differ = (ratio.max(1.0 / ratio) - DEG_PER_RAD).abs() < 1e-6;
    (are_angles && differ && share > 0.9 && (gain.abs() - 1.0).abs() < NEAR).then_some(gain)
}
