//! Which column is the time, and in which unit.

use super::Column;
use super::name::NamedUnit;
use super::role::Guess;
use crate::read::{Dimension, EPOCH_S, Unit};

/// Steps that are read as times of rows, s: 20000 rows a second to one row in 10 s.
const STEPS_S: (f64, f64) = (5e-5, 10.0);
/// Seconds since 1970 of the years 2001 to 2103.
const EPOCHS_S: (f64, f64) = (1e9, 4.2e9);
/// Where names do not tell, the unit is taken that comes nearest to this.
const USUAL_STEP_S: f64 = 0.01;
const UNITS: [&str; 4] = ["s", "ms", "us", "ns"];
/// Share of the steps that go forward in a column of times.
const MOSTLY: f64 = 0.9;

/// The column of times.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    pub place: usize,
    pub unit: Unit,
    pub step_s: f64,
    pub why: String,
    pub is_guess: bool,
}

/// Finds it among the columns.
///
/// # Errors
/// A reason: there is none, or its unit contradicts its values.
pub(super) fn find(columns: &[Column], given: Option<usize>) -> Result<Found, String> {
    let rises = |place: &usize| columns.get(*place).is_some_and(|column| rising_step(column).is_some());
    let named = |wanted: bool| {
        move |(_, column): &(usize, &Column)| match column.guess {
            Guess::Time => wanted,
            Guess::Unclear => !wanted,
            _ => false,
        }
    };
    let of = |wanted: bool| columns.iter().enumerate().filter(named(wanted)).map(|(place, _)| place).find(rises);
    let by_name = of(true);
    let Some(place) = given.or(by_name).or_else(|| of(false)) else {
        return Err(none(columns));
    };
    let column = columns.get(place).ok_or("the columns have changed")?;
    let step = rising_step(column).ok_or_else(|| {
        format!("column {:?} was named as the time, but it does not rise from row to row; name another", column.name())
    })?;
    let first = column.looked.numbers().next().unwrap_or(0.0);
    let named = match column.words.unit {
        NamedUnit::Known(unit) if unit.dimension == Dimension::Time => Some(unit),
        _ => None,
    };
    let how = if by_name == Some(place) || given.is_some() { "named so" } else { "rises in every row" };
    match named {
        Some(unit) if fits(unit, first, step) => {
            Ok(Found { place, unit, step_s: step * unit.factor, why: how.to_owned(), is_guess: false })
        }
        Some(unit) => Err(contradiction(column.name(), unit, first, step)),
        None => {
            let unit = likeliest(first, step).ok_or_else(|| {
                format!("column {:?} rises in steps of {step}, which are times in no unit; name the time with --map time_s=NAME:UNIT", column.name())
            })?;
            let why = format!("{how}; {:.4} rows a second", 1.0 / (step * unit.factor));
            Ok(Found { place, unit, step_s: step * unit.factor, why, is_guess: true })
        }
    }
}

/// Why no column is the time.
fn none(columns: &[Column]) -> String {
    let n_rows = columns.iter().map(|own| own.looked.values.len()).max().unwrap_or(0);
    if n_rows < 2 {
        let found = if n_rows == 0 { "is no row" } else { "is one row" };
        return format!("there {found} below the names, expected 10 or more; give a file with measurements");
    }
    let text = columns.iter().find(|own| matches!(own.guess, Guess::Time) && own.looked.n_texts > 0);
    match text {
        Some(own) => format!(
            "column {:?} is named as the time, and {} of its cells hold no number; write it in seconds, or as stamps since 1970",
            own.name(),
            own.looked.n_texts
        ),
        None => "no column holds the time, expected one that rises from row to row; add one, or name it with --map time_s=NAME:UNIT"
            .to_owned(),
    }
}

/// The median step forward of a column that rises nearly everywhere: a new trial may begin anew.
fn rising_step(column: &Column) -> Option<f64> {
    let values: Vec<f64> = column.looked.numbers().collect();
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    if steps.is_empty() || (steps.len() as f64) < MOSTLY * (values.len() as f64 - 1.0) {
        return None;
    }
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

fn fits(unit: Unit, first: f64, step: f64) -> bool {
    let (first_s, step_s) = ((first * unit.factor).abs(), step * unit.factor);
    let is_time = first_s < EPOCH_S || (EPOCHS_S.0..EPOCHS_S.1).contains(&first_s);
    is_time && (STEPS_S.0..=STEPS_S.1).contains(&step_s)
}

fn likeliest(first: f64, step: f64) -> Option<Unit> {
    let fitting = UNITS.into_iter().filter_map(Unit::from_suffix).filter(|unit| fits(*unit, first, step));
    let distance = |unit: &Unit| (step * unit.factor / USUAL_STEP_S).ln().abs();
    fitting.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

fn contradiction(name: &str, unit: Unit, first: f64, step: f64) -> String {
    let rate = |unit: Unit| 1.0 / (step * unit.factor);
    let advice = match likeliest(first, step) {
        Some(other) => format!(
            "in {} they are {:.4}; if so, say --map 'time_s={name}:{}'",
            other.suffix,
            rate(other),
            other.suffix
        ),
        None => "no unit fits; name the time with --map time_s=NAME:UNIT".to_owned(),
    };
    format!(
        "column {name:?} names the unit {}, in which it begins at {first} and steps of {step} are {:.4} rows a second; {advice}",
        unit.suffix,
        rate(unit)
    )
}
