//! What can be wrong with a model file: one sentence each, with line and key.

use crate::{ChainError, nearest_name};

/// A model file cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelFileError {
    /// Not TOML.
    #[error("line {line}: {reason}; correct the TOML")]
    Syntax {
        /// Where.
        line: usize,
        /// What the parser says.
        reason: String,
    },
    /// A key that does not exist here.
    #[error("line {line}: unknown key `{key}` in {place}; did you mean `{nearest}`?")]
    UnknownKey {
        /// Where.
        line: usize,
        /// The key.
        key: String,
        /// The table.
        place: String,
        /// The known key that looks most like it.
        nearest: String,
    },
    /// A key is missing.
    #[error("line {line}: `{key}` is missing in {place}, expected {expected}; add it")]
    MissingKey {
        /// Where the table begins.
        line: usize,
        /// The key.
        key: &'static str,
        /// The table.
        place: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// A value of the wrong kind.
    #[error("line {line}: `{key}` is {found}, expected {expected}; correct it")]
    WrongKind {
        /// Where.
        line: usize,
        /// The key.
        key: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A word that does not exist.
    #[error("line {line}: `{key}` is {found:?}, which is not known; did you mean {nearest:?}?")]
    UnknownWord {
        /// Where.
        line: usize,
        /// The key.
        key: String,
        /// The word.
        found: String,
        /// The known word that looks most like it.
        nearest: String,
    },
    /// A value lies outside its range.
    #[error("line {line}: `{key}` is {found}, expected {low} to {high} {unit}; correct it")]
    OutOfRange {
        /// Where.
        line: usize,
        /// The key.
        key: String,
        /// What was found.
        found: f64,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Unit of the three numbers.
        unit: &'static str,
    },
    /// The wrong number of values.
    #[error("line {line}: `{key}` has {found} values, expected {expected}; correct it")]
    Count {
        /// Where.
        line: usize,
        /// The key.
        key: String,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// An effect makes no sense for a machine of this kind.
    #[error(
        "line {line}: effect {effect} makes no sense for a machine of kind {machine}, expected one of {allowed}; remove it"
    )]
    NotForMachine {
        /// Where.
        line: usize,
        /// The effect.
        effect: &'static str,
        /// The machine's kind.
        machine: &'static str,
        /// The effects that do.
        allowed: String,
    },
    /// A gripper on a machine that has no place for one.
    #[error("line {line}: [gripper] is for a machine of kind snake, and this one is of kind {machine}; remove it")]
    NoGripper {
        /// Where.
        line: usize,
        /// The machine's kind.
        machine: &'static str,
    },
    /// The machine or the chain refuses it.
    #[error("line {line}: {source}")]
    Chain {
        /// Where.
        line: usize,
        /// Why.
        source: ChainError,
    },
}

/// The known word that looks most like one.
pub(super) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest_name(word, known).unwrap_or("nothing at all").to_owned()
}
