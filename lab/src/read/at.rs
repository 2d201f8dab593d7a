//! Where in a file something stands, for sentences: a line of text, or a row of a table that has no lines.

use std::fmt;

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// A line, from 1.
    Line(u64),
    /// A row of numbers, from 1.
    Row(u64),
    /// The names of the columns, where they have no line.
    Names,
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, " line {line}"),
            Self::Row(row) => write!(f, " row {row}"),
            Self::Names => Ok(()),
        }
    }
}
