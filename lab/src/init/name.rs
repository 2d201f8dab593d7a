//! A column's name taken apart: words, numbers, and the unit at its end.

use crate::read::{Dimension, Unit, in_brackets};

/// Units of positions that the lab counts as they are.
const COUNTS: [&str; 8] = ["count", "counts", "tick", "ticks", "step", "steps", "pulse", "pulses"];
/// Ends of names that are units of something else than a position.
const OTHERS: [&str; 7] = ["nm", "nmm", "ma", "mv", "hz", "rpm", "bar"];

/// What a name says.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    /// Lower case; a number is a word of its own.
    pub words: Vec<String>,
    pub unit: NamedUnit,
}

/// The unit in a name.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum NamedUnit {
    None,
    /// One that the lab converts.
    Known(Unit),
    /// A position in a unit of the machine's own.
    Counts(String),
    /// Of a speed, a torque, a current.
    Other(String),
}

impl NamedUnit {
    pub(super) fn dimension(&self) -> Option<Dimension> {
        match self {
            Self::Known(unit) => Some(unit.dimension),
            Self::Counts(_) => Some(Dimension::Number),
            Self::None | Self::Other(_) => None,
        }
    }

    pub(super) fn text(&self) -> &str {
        match self {
            Self::None => "",
            Self::Known(unit) => unit.suffix,
            Self::Counts(text) | Self::Other(text) => text,
        }
    }
}

impl Name {
    pub(super) fn of(name: &str) -> Self {
        if let Some((stem, unit)) = in_brackets(name) {
            return Self { words: words(stem), unit: bracket(unit) };
        }
        let mut words = words(name);
        let unit = match words.as_slice() {
            [_, .., before, last] if last == "s" && (before == "per" || Unit::from_suffix(before).is_some()) => {
                NamedUnit::Other(format!("{before}/s"))
            }
            [_, .., last] => last_word(last),
            _ => NamedUnit::None,
        };
        if unit != NamedUnit::None {
            words.pop();
        }
        Self { words, unit }
    }

    pub(super) fn has(&self, word: &str) -> bool {
        self.words.iter().any(|own| own == word)
    }

    /// The last number among the words, and the words without it.
    pub(super) fn numbered(&self) -> Option<(u32, Vec<&str>)> {
        let place = self.words.iter().rposition(|word| word.parse::<u32>().is_ok())?;
        let number = self.words.get(place)?.parse().ok()?;
        let others = self.words.iter().enumerate().filter(|(k, _)| *k != place);
        Some((number, others.map(|(_, word)| word.as_str()).collect()))
    }
}

fn bracket(text: &str) -> NamedUnit {
    let lower = text.to_lowercase();
    match Unit::from_suffix(&lower) {
        Some(unit) => NamedUnit::Known(unit),
        None if lower.is_empty() || lower == "-" => NamedUnit::None,
        None if COUNTS.contains(&lower.as_str()) => NamedUnit::Counts(lower),
        None => NamedUnit::Other(text.chars().filter(|c| !c.is_control()).collect()),
    }
}

fn last_word(word: &str) -> NamedUnit {
    match Unit::from_suffix(word) {
        // A number at the end is a joint's, and so is a letter.
        Some(unit) if !["1", "c", "k"].contains(&unit.suffix) => NamedUnit::Known(unit),
        _ if COUNTS.contains(&word) => NamedUnit::Counts(word.to_owned()),
        _ if OTHERS.contains(&word) => NamedUnit::Other(word.to_owned()),
        _ => NamedUnit::None,
    }
}

/// Words end where letters end, where digits begin, and where a capital follows a small letter.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in text.chars() {
        let is_new = !before.is_alphanumeric()
            || before.is_numeric() != c.is_numeric()
            || (before.is_lowercase() && c.is_uppercase());
        if c.is_alphanumeric() {
            if is_new {
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.extend(c.to_lowercase());
            }
        }
        before = c;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(name: &str) -> (String, String) {
        let name = Name::of(name);
        (name.words.join(" "), name.unit.text().to_owned())
    }

    #[test]
    fn names_come_apart_into_words_and_a_unit() {
        for (name, words, unit) in [
            ("Time [ms]", "time", "ms"),
            ("q1 (deg)", "q 1", "deg"),
            ("pos_mm", "pos", "mm"),
            ("targetJoint2Pos", "target joint 2 pos", ""),
            ("u10_rad", "u 10", "rad"),
            ("q1_deg_s", "q 1 deg", "deg/s"),
            ("jaw_torque_nm", "jaw torque", "nm"),
            ("Winkel [\u{b0}]", "winkel", "deg"),
            ("load1", "load 1", ""),
            ("s", "s", ""),
            ("observation.state.elbow (deg/s)", "observation state elbow", "deg/s"),
            ("", "", ""),
            ("](", "", ""),
        ] {
            assert_eq!(parts(name), (words.to_owned(), unit.to_owned()), "{name}");
        }
    }
}
