//! Does an encoder begin anew after a turn? Its range is then nearly a whole turn, and it jumps by nearly one.

use super::Column;
use super::name::NamedUnit;
use super::role::Guess;
use crate::read::{Dimension, Turns};
use core::f64::consts::TAU;

/// Share of a turn that the range of a wrapped reading has at least.
const NEARLY: f64 = 0.9;
/// Steps that are no jump are smaller than this share of a turn.
const SMALL: f64 = 0.25;
/// Ticks of a turn: a power of two, at least this one.
const LEAST_TICKS: f64 = 1024.0;

/// Makes a column continuous that wraps; gives its turn, in the column's unit.
pub(super) fn unwrap(column: &mut Column) -> Option<f64> {
    if !matches!(column.guess, Guess::Command(_) | Guess::Measured(_)) {
        return None;
    }
    let (low, high) = column.looked.range()?;
    let turn = match &column.words.unit {
        NamedUnit::Known(unit) if unit.dimension == Dimension::Angle => TAU / unit.factor,
        NamedUnit::Counts(_) => ticks(high - low)?,
        _ => return None,
    };
    let values: Vec<f64> = column.looked.numbers().collect();
    let steps = || values.windows(2).map(|pair| (pair[1] - pair[0]).abs() / turn);
    let has_jumps = steps().any(|step| step > 1.0 - SMALL);
    let is_clear = steps().all(|step| !(SMALL..=1.0 - SMALL).contains(&step));
    let is_whole = (NEARLY * turn..=turn).contains(&(high - low));
    if !(has_jumps && is_clear && is_whole) {
        return None;
    }
    let mut turns = Turns::new(turn);
    column.looked.values.iter_mut().filter(|value| value.is_finite()).for_each(|value| *value = turns.next(*value));
    Some(turn)
}

/// The power of two that a range of ticks nearly fills.
fn ticks(range: f64) -> Option<f64> {
    let turn = range.log2().ceil().exp2();
    (turn.is_finite() && turn >= LEAST_TICKS).then_some(turn)
}
