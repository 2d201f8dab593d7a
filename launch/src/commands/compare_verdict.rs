//! The verdict of `krait compare`, for the table, for `--json` and so for the page: which of two recordings follows better.

use crate::commands::compare_table::{error_of, unit_of};
use krait_report::{Side, Spread};
use serde::Serialize;

/// Tracking errors and lengths that differ by less than this part are alike.
const ALIKE: f64 = 0.05;

/// Both tracking errors over the time that both have: a longer recording is not judged by more motion.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct CommonTime {
    /// It begins so long after the first motion, s.
    from_s: f64,
    /// It ends so long after the first motion, s.
    to_s: f64,
    /// Tracking error of A, in the unit of its score; null where it has none.
    a: Option<Spread>,
    /// The same of B.
    b: Option<Spread>,
}

impl CommonTime {
    pub(super) fn of(a: &Side, b: &Side) -> Self {
        let end_s = |side: &Side| side.series.error.last().map_or(0.0, |(at_s, _)| *at_s);
        let (from_s, to_s) = (a.scored_from_s.max(b.scored_from_s), end_s(a).min(end_s(b)));
        let scored = |side: &Side| {
            error_of(side)?;
            within(&side.series.error, from_s, to_s)
        };
        Self { from_s, to_s, a: scored(a), b: scored(b) }
    }
}

/// The spread of a curve between two instants, both included.
fn within(curve: &[(f64, f64)], from_s: f64, to_s: f64) -> Option<Spread> {
    // The clocks of two cameras never tick at the same instant.
    let is_in = |at_s: f64| (from_s..=to_s + 0.5e-3).contains(&at_s);
    Spread::of_any(curve.iter().filter(|(at_s, _)| is_in(*at_s)).map(|(_, error)| *error))
}

/// Which follows better, in one sentence; lengths that differ are said, because the motion may be another then.
pub(super) fn verdict(a: &Side, b: &Side, common: &CommonTime) -> String {
    let unit = unit_of(a);
    if unit != unit_of(b) || a.joints.is_some() != b.joints.is_some() {
        return "none; the two are of different machines.".to_owned();
    }
    let sentence = match (common.a, common.b) {
        (Some(a), Some(b)) if (a.rms - b.rms).abs() <= ALIKE * a.rms.max(b.rms) => {
            format!("both follow alike, within {:.0} %", 100.0 * ALIKE)
        }
        (Some(a), Some(b)) if b.rms < a.rms => {
            format!("B follows better, {:.3} {unit} rms where A has {:.3}", b.rms, a.rms)
        }
        (Some(a), Some(b)) => format!("A follows better, {:.3} {unit} rms where B has {:.3}", a.rms, b.rms),
        _ => return "none; a tracking error takes more than 10 s of motion on both sides.".to_owned(),
    };
    let over = format!("{sentence}, from {:.0} s to {:.1} s after the first motion", common.from_s, common.to_s);
    if (a.length_s - b.length_s).abs() > ALIKE * a.length_s.max(b.length_s) {
        return format!("{over}; their lengths differ, so the motion may be another.");
    }
    format!("{over}.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_time_between_counts() {
        let curve: Vec<(f64, f64)> = (0..40).map(|k| (f64::from(k), if k < 20 { 1.0 } else { 9.0 })).collect();
        let rms = |from_s, to_s| within(&curve, from_s, to_s).map(|spread| (spread.n, spread.rms));
        assert_eq!(rms(10.0, 19.0), Some((10, 1.0)));
        assert_eq!(rms(20.0, 39.0), Some((20, 9.0)));
        assert_eq!(rms(30.0, 20.0), None);
    }
}
