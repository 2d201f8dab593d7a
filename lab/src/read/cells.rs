//! The value of each cell, checked where it stands.

use super::ReadError;
use super::dialect::Numbers;
use super::header::{Column, Plan};
use super::role::Role;
use super::stamps::Stamps;
use super::wrap::Turns;
use std::path::Path;

/// What was read of a file so far, as far as the next cell depends on it.
pub(super) struct Cells<'a> {
    path: &'a Path,
    numbers: Numbers,
    stamps: Stamps,
    /// Of each column that wraps.
    turns: Vec<Option<Turns>>,
}

impl<'a> Cells<'a> {
    pub(super) fn new(path: &'a Path, numbers: Numbers, plan: &Plan) -> Self {
        let turns = plan.columns.iter().map(|column| column.wraps.map(Turns::new)).collect();
        Self { path, numbers, stamps: Stamps::default(), turns }
    }

    /// Begins a trial: encoders that wrap begin anew.
    pub(super) fn restart(&mut self) {
        self.turns.iter_mut().flatten().for_each(Turns::restart);
    }

    /// The value of a cell in the lab's units, by its column's place in the plan; NaN for one that may be empty and is.
    pub(super) fn value(&mut self, line: u64, place: usize, column: &Column, cell: &[u8]) -> Result<f64, ReadError> {
        let Self { path, numbers, stamps, turns } = self;
        let path: &Path = path;
        let may_be_empty = match column.role {
            Role::Time | Role::Input(_) | Role::StemAngle | Role::Temperature => false,
            // A label, not a number.
            Role::Trial => return Ok(0.0),
            _ => true,
        };
        if cell.is_empty() && may_be_empty {
            return Ok(f64::NAN);
        }
        // Notes beside the measurements need not be numbers, and do not say how numbers are written.
        if column.role == Role::Extra {
            return Ok({ *numbers }.parse(cell).unwrap_or(f64::NAN));
        }
        let Some(number) = numbers.parse(cell) else {
            let has_other_mark = numbers.has_other_mark(cell);
            return Err(not_a_number(path, line, column, cell, may_be_empty, has_other_mark));
        };
        let number = turns.get_mut(place).and_then(Option::as_mut).map_or(number, |turns| turns.next(number));
        let value = match column.role {
            Role::Time => stamps.time_s(cell, number, column.factor),
            _ => number * column.factor + column.shift,
        };
        let is_beyond = column.limit.as_ref().filter(|(limit, ..)| value.abs() > *limit);
        let must_be_positive =
            matches!(column.role, Role::Sigma) && value <= 0.0 || column.role == Role::Weight && value < 0.0;
        let implausible = |what: &str, advice: &str| ReadError::Implausible {
            path: path.to_owned(),
            line,
            column: column.name.clone(),
            found: String::from_utf8_lossy(cell).into_owned(),
            reason: format!("{what}; {advice}"),
        };
        match is_beyond {
            Some((_, what, advice)) => Err(implausible(what, advice)),
            None if must_be_positive => Err(implausible("not positive", "leave the cell empty where it is not known")),
            None => Ok(value),
        }
    }
}

fn not_a_number(
    path: &Path,
    line: u64,
    column: &Column,
    cell: &[u8],
    may_be_empty: bool,
    has_other_mark: bool,
) -> ReadError {
    let advice = match column.role {
        _ if has_other_mark => {
            "other fractions of the file have a comma where this one has a point, or the reverse; write all alike"
        }
        Role::Output(_) | Role::ThetaL | Role::Delta => "leave the shape's cells empty where the camera gave none",
        _ if may_be_empty => "leave the cell empty where nothing was measured",
        _ => "this column needs a number in every row",
    };
    ReadError::NotNumber {
        path: path.to_owned(),
        line,
        column: column.name.clone(),
        found: String::from_utf8_lossy(cell.get(..40).unwrap_or(cell)).into_owned(),
        advice,
    }
}
