//! The value of each cell, checked where it stands.

use super::ReadError;
use super::at::At;
use super::dialect::Numbers;
use super::header::{Column, Plan};
use super::role::Role;
use super::stamps::Stamps;
use super::wrap::Turns;
use std::borrow::Cow;
use std::path::Path;

/// What stands in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell<'a> {
    Empty,
    /// Not empty, without blanks round it.
    Text(&'a [u8]),
    /// Not NaN.
    Number(f64),
    Whole(i64),
}

impl<'a> Cell<'a> {
    pub(super) fn of_text(text: &'a [u8]) -> Self {
        match text.trim_ascii() {
            [] => Self::Empty,
            text => Self::Text(text),
        }
    }

    /// Whether it says that nothing was measured, in the words of the programs that write tables.
    fn is_nothing(self) -> bool {
        match self {
            Self::Text(text) => [&b"nan"[..], b"na", b"null"].iter().any(|word| text.eq_ignore_ascii_case(word)),
            own => own == Self::Empty,
        }
    }

    /// Its words, as a CSV file would have them.
    fn words(self) -> Cow<'a, [u8]> {
        match self {
            Self::Empty => Cow::Borrowed(&[]),
            Self::Text(text) => Cow::Borrowed(text),
            Self::Number(number) => Cow::Owned(number.to_string().into_bytes()),
            Self::Whole(whole) => Cow::Owned(whole.to_string().into_bytes()),
        }
    }

    /// A trial's label.
    pub(super) fn label(self) -> Vec<u8> {
        self.words().into_owned()
    }

    /// Whether a trial has this label.
    pub(super) fn is_label(self, label: &[u8]) -> bool {
        *self.words() == *label
    }

    /// For a sentence.
    fn shown(self) -> String {
        let words = self.words();
        String::from_utf8_lossy(words.get(..40).unwrap_or(&words)).into_owned()
    }

    fn number(self, numbers: &mut Numbers) -> Option<f64> {
        match self {
            Self::Empty => None,
            Self::Text(text) => numbers.parse(text),
            Self::Number(number) => Some(number).filter(|number| number.is_finite()),
            Self::Whole(whole) => Some(whole as f64),
        }
    }

    fn whole(self) -> Option<i64> {
        match self {
            Self::Text(text) => std::str::from_utf8(text).ok()?.parse().ok(),
            Self::Whole(whole) => Some(whole),
            _ => None,
        }
    }
}

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
    pub(super) fn value(&mut self, at: At, place: usize, column: &Column, cell: Cell) -> Result<f64, ReadError> {
        let Self { path, numbers, stamps, turns } = self;
        let path: &Path = path;
        let may_be_empty = match column.role {
            Role::Time | Role::Input(_) | Role::StemAngle | Role::Temperature => false,
            // A label, not a number.
            Role::Trial => return Ok(0.0),
            _ => true,
        };
        if may_be_empty && cell.is_nothing() {
            return Ok(f64::NAN);
        }
        // Notes beside the measurements need not be numbers, and do not say how numbers are written.
        if column.role == Role::Extra {
            return Ok(cell.number(&mut { *numbers }).unwrap_or(f64::NAN));
        }
        let Some(number) = cell.number(numbers) else {
            let has_other_mark = matches!(cell, Cell::Text(text) if numbers.has_other_mark(text));
            return Err(not_a_number(path, at, column, cell, may_be_empty, has_other_mark));
        };
        let number = turns.get_mut(place).and_then(Option::as_mut).map_or(number, |turns| turns.next(number));
        let value = match column.role {
            Role::Time => stamps.time_s(cell.whole(), number, column.factor),
            _ => number * column.factor + column.shift,
        };
        let is_beyond = column.limit.as_ref().filter(|(limit, ..)| value.abs() > *limit);
        let must_be_positive =
            matches!(column.role, Role::Sigma) && value <= 0.0 || column.role == Role::Weight && value < 0.0;
        let implausible = |reason: &str| ReadError::Implausible {
            path: path.to_owned(),
            at,
            column: column.name.clone(),
            found: cell.shown(),
            reason: reason.to_owned(),
        };
        match is_beyond {
            Some((_, reason)) => Err(implausible(reason)),
            None if must_be_positive => Err(implausible("not positive; leave the cell empty where it is not known")),
            None => Ok(value),
        }
    }
}

fn not_a_number(
    path: &Path,
    at: At,
    column: &Column,
    cell: Cell,
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
    ReadError::NotNumber { path: path.to_owned(), at, column: column.name.clone(), found: cell.shown(), advice }
}
