//! Motion beside a torque or a current, without any command: joints with a force.

use super::Column;
use super::given::TAKEN_OUT;
use super::name::NamedUnit;
use super::role::Guess;
use crate::read::{Dimension, NONE, Unit, force_names};
use krait_model::model_file::ForceUnit;

/// Joints that a machine of kind force can have.
const MOST: usize = 6;
/// Angles without a unit beyond this are degrees.
const MOST_RAD: f64 = 12.6;
const CURRENT: [&str; 4] = ["i", "current", "ampere", "amps"];
const TORQUE: [&str; 4] = ["tau", "torque", "effort", "moment"];

/// Columns of the machine: angle and force of each joint.
pub(super) struct Found {
    /// The lab's column, place in the file, unit, and why.
    pub columns: Vec<(String, usize, Option<Unit>, String)>,
    pub n: usize,
    pub unit: ForceUnit,
    pub cautions: Vec<String>,
}

/// Finds them by name; `None` if a command moves, or a joint lacks motion or force.
pub(super) fn find(columns: &[Column]) -> Option<Found> {
    if columns
        .iter()
        .any(|column| matches!(column.guess, Guess::Command(_)) && column.looked.moves() && !is_force(column))
    {
        return None;
    }
    let numbered = |is_one: &dyn Fn(&Column) -> bool| -> Vec<(u32, usize)> {
        let own = columns.iter().enumerate().filter(|(_, column)| is_one(column));
        own.map(|(place, column)| (column.words.numbered().map_or(1, |(number, _)| number), place)).collect()
    };
    let torques = numbered(&|column| is_of(column, &TORQUE, &["nm"]));
    let currents = numbered(&|column| is_of(column, &CURRENT, &["a"]));
    let angles = numbered(&is_angle);
    // Torque rather than current, where both are there.
    let (forces, unit, why) = match torques.is_empty() {
        true => (currents, ForceUnit::Ampere, "the joint's current"),
        false => (torques, ForceUnit::NewtonMetre, "the joint's torque"),
    };
    let (base, suffix) = force_names(unit);
    let n = forces.len();
    if n == 0 || n > MOST || angles.len() != n {
        return None;
    }
    let mut pairs = Vec::with_capacity(n);
    for (number, force) in forces {
        let mut own = angles.iter().filter(|(other, _)| *other == number);
        let (Some((_, angle)), None) = (own.next(), own.next()) else { return None };
        pairs.push((number, *angle, force));
    }
    pairs.sort_unstable();
    let mut found = Found { columns: Vec::new(), n, unit, cautions: Vec::new() };
    for (k, (_, angle, force)) in pairs.into_iter().enumerate() {
        let column = columns.get(angle)?;
        let unit = match &column.words.unit {
            NamedUnit::Known(unit) => *unit,
            _ => {
                let name = if column.looked.reach()? > MOST_RAD { "deg" } else { "rad" };
                let caution = format!("{:?} names no unit: taken for {name} by its range", column.name());
                found.cautions.push(caution);
                Unit::from_suffix(name)?
            }
        };
        found.columns.push((format!("q{}_rad", k + 1), angle, Some(unit), "the joint's motion".to_owned()));
        found.columns.push((format!("{base}{}_{suffix}", k + 1), force, None, why.to_owned()));
    }
    Some(found)
}

/// How a machine of kind force can be had of columns in which a command moves; `None` where they make none.
pub(super) fn hint(columns: &[Column]) -> Option<String> {
    let mut left = columns.to_vec();
    let mut out = Vec::new();
    for column in &mut left {
        if matches!(column.guess, Guess::Command(_)) && column.looked.moves() && !is_force(column) {
            out.push(format!("--map {}", quoted(&format!("{NONE}={}", column.name()))));
            column.guess = Guess::Other("a command");
        }
    }
    let found = find(&left)?;
    let (base, suffix) = force_names(found.unit);
    let is_one = |target: &str| target.starts_with(base) && target.ends_with(suffix);
    let places = found.columns.iter().filter(|(target, ..)| is_one(target)).map(|(_, place, ..)| *place);
    let names: Vec<String> = places.filter_map(|place| Some(format!("{:?}", columns.get(place)?.name()))).collect();
    let what = if found.unit == ForceUnit::Ampere { "current" } else { "torque" };
    Some(format!(
        "{} may be explained by the motion: what the {what} is made of, say {} and a machine of kind force is proposed",
        names.join(", "),
        out.join(" ")
    ))
}

fn quoted(text: &str) -> String {
    let is_plain = text.chars().all(|c| c.is_alphanumeric() || "=_.-/".contains(c));
    if is_plain { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

fn is_force(column: &Column) -> bool {
    is_of(column, &TORQUE, &["nm"]) || is_of(column, &CURRENT, &["a"])
}

/// Whether a name has one of these units, or no unit and one of these words.
fn is_of(column: &Column, words: &[&str], units: &[&str]) -> bool {
    if column.guess == Guess::Other(TAKEN_OUT) {
        return false;
    }
    match &column.words.unit {
        NamedUnit::None => words.iter().any(|word| column.words.has(word)),
        NamedUnit::Other(text) => units.contains(&text.to_lowercase().as_str()),
        NamedUnit::Known(_) | NamedUnit::Counts(_) => false,
    }
}

fn is_angle(column: &Column) -> bool {
    let is_position = matches!(column.guess, Guess::Measured(_) | Guess::Unclear);
    let is_unit = match &column.words.unit {
        NamedUnit::None => matches!(column.guess, Guess::Measured(_)),
        NamedUnit::Known(unit) => unit.dimension == Dimension::Angle,
        NamedUnit::Counts(_) | NamedUnit::Other(_) => false,
    };
    is_position && is_unit && !is_force(column)
}
