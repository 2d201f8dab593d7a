//! What the user has said with `--map` comes before anything that names tell.

use super::Column;
use super::name::{Name, NamedUnit};
use super::role::Guess;
use crate::machine::nearest;
use crate::read::{At, ColumnMap, ReadError};
use std::path::Path;

/// Why a column is not used that the user has taken out.
pub(super) const TAKEN_OUT: &str = "taken out: --map";
const KNOWN: &str = "time_s, trial, u1.. and y1.. of joints or segments, q1_m..q3_m, bend_x_rad, bend_y_rad, theta_l_rad, delta_rad, tip_x_m..tip_z_m, tau1_n..tau3_n, and none to take a column out";

/// Gives columns the roles that were said; which column is the time, if that was said.
///
/// # Errors
/// [`ReadError::MapSource`] and [`ReadError::MapTarget`].
pub(super) fn apply(path: &Path, at: At, columns: &mut [Column], map: &ColumnMap) -> Result<Option<usize>, ReadError> {
    let mut time = None;
    let mut has_joints = false;
    let mut said = Vec::new();
    for mapping in &map.mappings {
        let names = || columns.iter().map(Column::name);
        let place = names().position(|name| name == mapping.source).ok_or_else(|| ReadError::MapSource {
            path: path.to_owned(),
            at,
            column: mapping.source.clone(),
            nearest: nearest(&mapping.source, names()),
        })?;
        if mapping.takes_out() {
            columns.iter_mut().skip(place).take(1).for_each(|column| column.guess = Guess::Other(TAKEN_OUT));
            continue;
        }
        let mut words = Name::of(&mapping.target);
        let guess = guess(&words).ok_or_else(|| ReadError::MapTarget {
            target: mapping.target.clone(),
            reason: "the lab has no such column".to_owned(),
            known: KNOWN.to_owned(),
        })?;
        if let Some(unit) = mapping.unit {
            words.unit = NamedUnit::Known(unit);
        } else if let [_, _, unit] = words.words.as_slice() {
            // A unit of the machine's own.
            words.unit = NamedUnit::Counts(unit.clone());
        }
        words.words.truncate(2);
        time = if guess == Guess::Time { Some(place) } else { time };
        has_joints |= matches!(guess, Guess::Command(_)) || words.has("y") && !words.has("bend");
        said.push(place);
        if let Some(column) = columns.get_mut(place) {
            (column.words, column.guess) = (words, guess);
        }
    }
    // Whoever names joints names all of them.
    let others = columns.iter_mut().enumerate().filter(|(place, _)| has_joints && !said.contains(place));
    for (_, column) in others.filter(|(_, column)| !matches!(column.guess, Guess::Time | Guess::Trial)) {
        if column.guess != Guess::Other(TAKEN_OUT) {
            column.guess = Guess::Other("not in --map");
        }
    }
    Ok(time)
}

fn guess(target: &Name) -> Option<Guess> {
    let words: Vec<&str> = target.words.iter().map(String::as_str).collect();
    let by = || "--map".to_owned();
    Some(match words.as_slice() {
        ["time"] => Guess::Time,
        ["trial"] => Guess::Trial,
        ["u", _] | ["u", _, _] => Guess::Command(by()),
        ["y", _] | ["y", _, _] | ["q", _] | ["bend", "x" | "y"] | ["theta", "l"] | ["delta"] => Guess::Measured(by()),
        ["tip", "x" | "y" | "z"] => Guess::Measured(by()),
        ["tau", _] => Guess::Other("a load"),
        _ => return None,
    })
}
