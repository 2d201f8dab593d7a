//! Three lengths numbered in a row and a bend in two components: a snake.

use super::Column;
use super::name::NamedUnit;
use super::role::Guess;
use crate::read::{Dimension, N_LINES, Unit};
use std::collections::BTreeMap;

/// The lab's names of a tip's position.
pub(super) const TIP: [&str; 3] = ["tip_x_m", "tip_y_m", "tip_z_m"];

/// Columns of a snake, each with its unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    /// The lab's column, place in the file, unit, and why.
    pub columns: Vec<(String, usize, Unit, String)>,
    /// What was guessed, a sentence each.
    pub guesses: Vec<String>,
}

/// Finds them by name, unit and range; `None` if the file is of no snake.
pub(super) fn find(columns: &[Column]) -> Option<Found> {
    let mut guesses = Vec::new();
    let lines: [usize; N_LINES] = lines(columns, |n| n == N_LINES)?.try_into().ok()?;
    let mut found = Vec::new();
    for (k, &place) in lines.iter().enumerate() {
        let unit = length(columns, &lines, place, &mut guesses)?;
        found.push((format!("q{}_m", k + 1), place, unit, "of three lengths".to_owned()));
    }
    if let Some(shape) = shape(columns) {
        for (target, place) in shape {
            let unit = angle(columns, place, &mut guesses)?;
            found.push((target.to_owned(), place, unit, "of a bend".to_owned()));
        }
    } else {
        let tip = tip(columns, &lines)?;
        for (target, &place) in TIP.into_iter().zip(&tip) {
            let unit = length(columns, &tip, place, &mut guesses)?;
            found.push((target.to_owned(), place, unit, "of a position".to_owned()));
        }
    }
    found.extend(loads(columns, N_LINES, "of three loads"));
    Some(Found { columns: found, guesses })
}

/// So many lengths of the same words with numbers in a row.
pub(super) fn lines(columns: &[Column], is_number: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
    let is_position = |column: &Column| matches!(column.guess, Guess::Command(_) | Guess::Measured(_) | Guess::Unclear);
    let is_length = |column: &Column| match column.words.unit.dimension() {
        Some(dimension) => dimension == Dimension::Length,
        None => column.looked.reach().is_some_and(|reach| reach <= 100.0),
    };
    let mut families = numbered(columns, |column| is_position(column) && is_length(column));
    families.retain(|family| is_number(family.len()));
    // Encoders rather than what they shall reach.
    let is_measured = |family: &Vec<usize>| {
        family
            .first()
            .and_then(|place| columns.get(*place))
            .is_some_and(|column| !matches!(column.guess, Guess::Command(_)))
    };
    families.iter().find(|family| is_measured(family)).or(families.first()).cloned()
}

/// Loads of so many lines, each with its unit, newtons where the name has none; nothing unless there are loads of all lines.
pub(super) fn loads(columns: &[Column], n_lines: usize, why: &str) -> Vec<(String, usize, Unit, String)> {
    let is_load = |column: &Column| {
        let is_force = column.words.unit.dimension().is_none_or(|dimension| dimension == Dimension::Force);
        is_force && matches!(column.guess, Guess::Other("a load" | "a force"))
    };
    let family = numbered(columns, is_load).into_iter().find(|family| family.len() == n_lines).unwrap_or_default();
    let named = |(k, place): (usize, usize)| {
        let unit = match columns.get(place).map(|column| &column.words.unit) {
            Some(NamedUnit::Known(unit)) => *unit,
            _ => Unit::from_suffix("n")?,
        };
        Some((format!("tau{}_n", k + 1), place, unit, why.to_owned()))
    };
    family.into_iter().enumerate().filter_map(named).collect()
}

/// Columns of the same words with numbers in a row, in that order.
pub(super) fn numbered(columns: &[Column], is_one: impl Fn(&Column) -> bool) -> Vec<Vec<usize>> {
    let mut families: BTreeMap<Vec<&str>, Vec<(u32, usize)>> = BTreeMap::new();
    for (place, column) in columns.iter().enumerate().filter(|(_, column)| is_one(column)) {
        if let Some((number, words)) = column.words.numbered() {
            families.entry(words).or_default().push((number, place));
        }
    }
    let in_a_row = |mut members: Vec<(u32, usize)>| {
        members.sort_unstable();
        let is_row = members.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1);
        is_row.then(|| members.into_iter().map(|(_, place)| place).collect::<Vec<_>>())
    };
    let mut rows: Vec<_> = families.into_values().filter_map(in_a_row).collect();
    rows.sort_unstable();
    rows
}

/// A name's words without that of an axis; `None` where it is of no such axis.
fn without<'a>(column: &'a Column, axis: &str) -> Option<Vec<&'a str>> {
    let words = || column.words.words.iter().map(String::as_str);
    words().any(|word| word == axis).then(|| words().filter(|word| *word != axis).collect())
}

/// Two angles: a bend in x and y, or the paper's angles under their names.
fn shape(columns: &[Column]) -> Option<[(&'static str, usize); 2]> {
    let is_angle = |column: &Column| match column.words.unit.dimension() {
        Some(dimension) => dimension == Dimension::Angle,
        None => column.words.has("bend") || column.words.has("delta") || column.words.has("theta"),
    };
    let angles = || columns.iter().enumerate().filter(|(_, column)| is_angle(column));
    for (x, column) in angles() {
        let Some(stem) = without(column, "x") else { continue };
        let y = angles().find(|(_, other)| without(other, "y").is_some_and(|own| own == stem));
        if let Some((y, _)) = y {
            return Some([("bend_x_rad", x), ("bend_y_rad", y)]);
        }
    }
    let place = |words: &[&str]| angles().find(|(_, column)| column.words.words == words).map(|(place, _)| place);
    Some([("theta_l_rad", place(&["theta", "l"])?), ("delta_rad", place(&["delta"])?)])
}

/// Three lengths of the same words but for x, y and z: a position, where no angle says the shape.
fn tip(columns: &[Column], lines: &[usize]) -> Option<Vec<usize>> {
    let is_length = |(place, column): &(usize, &Column)| {
        let dimension = column.words.unit.dimension();
        dimension.is_none_or(|own| own == Dimension::Length)
            && !lines.contains(place)
            && !matches!(column.guess, Guess::Command(_) | Guess::Other(_) | Guess::Time)
            && column.looked.moves()
    };
    let lengths = || columns.iter().enumerate().filter(is_length);
    lengths().find_map(|(x, column)| {
        let stem = without(column, "x")?;
        let other =
            |axis| lengths().find(|(_, own)| without(own, axis).as_ref() == Some(&stem)).map(|(place, _)| place);
        Some(vec![x, other("y")?, other("z")?])
    })
}

/// The unit of a line: its name's, or the one in which such lengths are those of a snake.
pub(super) fn length(columns: &[Column], lines: &[usize], place: usize, guesses: &mut Vec<String>) -> Option<Unit> {
    let reach = || lines.iter().filter_map(|place| columns.get(*place)?.looked.reach()).fold(0.0, f64::max);
    named_or(columns.get(place)?, guesses, || Some((reach(), 0.1, ["m", "mm"])))
}

pub(super) fn angle(columns: &[Column], place: usize, guesses: &mut Vec<String>) -> Option<Unit> {
    let column = columns.get(place)?;
    named_or(column, guesses, || Some((column.looked.reach()?, core::f64::consts::TAU, ["rad", "deg"])))
}

/// The unit in a column's name. Without one a guess: how far it reaches, up to which limit the first of two units is taken, and
/// both.
fn named_or(
    column: &Column,
    guesses: &mut Vec<String>,
    likely: impl FnOnce() -> Option<(f64, f64, [&'static str; 2])>,
) -> Option<Unit> {
    if let NamedUnit::Known(unit) = column.words.unit {
        return Some(unit);
    }
    let (reach, limit, [near, far]) = likely()?;
    let unit = Unit::from_suffix(if reach <= limit { near } else { far })?;
    guesses.push(format!("{:?} names no unit: taken for {}, as it reaches {reach:.4}", column.name(), unit.suffix));
    Some(unit)
}
