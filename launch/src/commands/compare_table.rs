//! The table of `krait compare`: figures of two recordings and their difference, in 80 columns.

use crate::print::wrapped;
use krait_report::{Side, Spread, Table};
use serde::Serialize;
use std::collections::BTreeSet;

/// Columns of a terminal of the usual size; only paths may pass them.
pub(super) const COLUMNS: usize = 80;
/// Columns that a name has at least, however wide the numbers are.
const NARROWEST: usize = 24;
/// What stands for a tracking error after too little motion; a line below the table says how much is needed.
const SHORT: &str = "too short";

/// How far off a side was: a snake's bend vector, or all its joints.
pub(super) fn error_of(side: &Side) -> Option<&Spread> {
    side.joints.as_ref().map_or(side.tracking_error_deg.as_ref(), |joints| joints.error.as_ref())
}

pub(super) fn unit_of(side: &Side) -> &'static str {
    side.joints.as_ref().map_or("deg", |joints| joints.unit)
}

/// A row of the table: a name, both sides, and the one less the other, as they are written.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FigureRow {
    name: String,
    a: String,
    b: String,
    difference: String,
}

/// Figures of both sides and what B has more.
pub(super) fn figures(a: &Side, b: &Side) -> Vec<FigureRow> {
    let mut rows = Rows::default();
    rows.numbers("length, s", Some(a.length_s), Some(b.length_s), 2);
    let channels: BTreeSet<_> = a.samples.keys().chain(b.samples.keys()).collect();
    for channel in channels {
        let count = |side: &Side| Some(side.samples.get(channel).copied().unwrap_or(0) as f64);
        rows.numbers(&format!("{channel} samples"), count(a), count(b), 0);
    }
    let mut error = |word: &str, figure: fn(&Spread) -> f64| {
        let units =
            if unit_of(a) == unit_of(b) { unit_of(a).to_owned() } else { format!("{} and {}", unit_of(a), unit_of(b)) };
        let of = |side: &Side| error_of(side).map(figure);
        rows.with(&format!("tracking error {word}, {units}"), of(a), of(b), 3, SHORT);
    };
    error("rms", |error| error.rms);
    error("p95", |error| error.p95);
    error("max", |error| error.max);
    rows.bends(a, b);
    let hops: BTreeSet<_> = a.latency_us.keys().chain(b.latency_us.keys()).collect();
    for hop in hops {
        let of = |side: &Side| side.latency_us.get(hop.as_str()).map(|q| (q.p50, q.p99));
        rows.numbers(&format!("{hop} p50, us"), of(a).map(|q| q.0), of(b).map(|q| q.0), 0);
        rows.numbers(&format!("{hop} p99, us"), of(a).map(|q| q.1), of(b).map(|q| q.1), 0);
    }
    rows.numbers("following, s", Some(a.following_s), Some(b.following_s), 2);
    let states: BTreeSet<_> = a.operating_s.keys().chain(b.operating_s.keys()).collect();
    for state in states {
        let of = |side: &Side| Some(side.operating_s.get(*state).copied().unwrap_or(0.0));
        rows.numbers(&format!("{state}, s"), of(a), of(b), 2);
    }
    rows.numbers("faults", Some(a.n_faults as f64), Some(b.n_faults as f64), 0);
    rows.numbers("commands refused", Some(a.n_refused as f64), Some(b.n_refused as f64), 0);
    let reasons: BTreeSet<_> = a.reasons.keys().chain(b.reasons.keys()).collect();
    for reason in reasons {
        let of = |side: &Side| Some(side.reasons.get(*reason).copied().unwrap_or(0) as f64);
        rows.numbers(reason, of(a), of(b), 0);
    }
    rows.0
}

/// Whether a camera saw anything: what was not measured is no bend of zero.
fn is_measured(side: &Side) -> bool {
    side.samples.get("shape").is_some_and(|n| *n > 0)
}

/// The rows as they come together.
#[derive(Default)]
struct Rows(Vec<FigureRow>);

impl Rows {
    fn numbers(&mut self, name: &str, a: Option<f64>, b: Option<f64>, digits: usize) {
        self.with(name, a, b, digits, "-");
    }

    fn with(&mut self, name: &str, a: Option<f64>, b: Option<f64>, digits: usize, missing: &str) {
        let cell = |value: Option<f64>| value.map_or(missing.to_owned(), |value| format!("{value:.digits$}"));
        let difference = a.zip(b).map_or("-".to_owned(), |(a, b)| format!("{:+.digits$}", b - a));
        self.0.push(FigureRow { name: name.to_owned(), a: cell(a), b: cell(b), difference });
    }

    /// Largest bends commanded and measured: of a snake, or of each joint in its own unit.
    fn bends(&mut self, a: &Side, b: &Side) {
        let mut row =
            |name: String, figure: &dyn Fn(&Side) -> Option<f64>| self.numbers(&name, figure(a), figure(b), 2);
        if a.peak_bend_deg.is_some() || b.peak_bend_deg.is_some() {
            row("largest bend commanded, deg".to_owned(), &|side| side.peak_bend_deg.map(|peak| peak.commanded));
            row("largest bend measured, deg".to_owned(), &|side| side.peak_bend_deg.and_then(|peak| peak.reached));
        }
        if a.jaw.is_some() || b.jaw.is_some() {
            let of = |side: &Side| side.jaw.as_ref()?.joints.first().copied();
            row("jaw, error rms, deg".to_owned(), &|side| of(side)?.error.map(|error| error.rms));
            row("jaw, largest commanded, deg".to_owned(), &|side| of(side).map(|jaw| jaw.peak_commanded));
            row("jaw, largest measured, deg".to_owned(), &|side| {
                of(side).filter(|_| is_measured(side)).map(|jaw| jaw.peak_reached)
            });
        }
        let joints = |side: &Side| side.joints.as_ref().map_or(0, |score| score.joints.len());
        let (each, unit) =
            a.joints.as_ref().or(b.joints.as_ref()).map_or(("joint", ""), |score| (score.each, score.unit));
        for k in 0..joints(a).max(joints(b)) {
            let of = |side: &Side| {
                let score = side.joints.as_ref().filter(|score| (score.each, score.unit) == (each, unit))?;
                score.joints.get(k).copied()
            };
            row(format!("{each} {}, largest commanded, {unit}", k + 1), &|side| {
                of(side).map(|joint| joint.peak_commanded)
            });
            row(format!("{each} {}, largest measured, {unit}", k + 1), &|side| {
                of(side).filter(|_| is_measured(side)).map(|joint| joint.peak_reached)
            });
        }
    }
}

/// The table, no wider than [`COLUMNS`]: a name that is too long goes on in further lines and is never cut, because two that
/// begin alike may mean different things.
pub(super) fn table(rows: &[FigureRow]) -> Table {
    let header = ["A", "B", "B - A"];
    let cells = |row: &FigureRow| [row.a.clone(), row.b.clone(), row.difference.clone()];
    let width = |column: usize| {
        let widths = rows.iter().map(|row| cells(row)[column].chars().count());
        widths.max().unwrap_or(0).max(header[column].len())
    };
    // Two columns before each of the four cells.
    let left = COLUMNS.saturating_sub(8 + (0..3).map(width).sum::<usize>()).max(NARROWEST);
    let mut table = Table::new(&["", header[0], header[1], header[2]]);
    for row in rows {
        let mut own = Some(cells(row));
        for line in wrapped(&row.name, left) {
            table.row([line].into_iter().chain(own.take().unwrap_or_default()).collect());
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::Reason;

    #[test]
    fn a_table_fits_80_columns_and_no_two_reasons_look_alike_in_it() {
        let mut rows = Rows::default();
        for reason in Reason::ALL {
            rows.numbers(reason.sentence(), Some(1_234_567.0), Some(7_654_321.0), 0);
        }
        rows.with("tracking error max, deg", None, None, 3, SHORT);
        let text = table(&rows.0).to_string();
        assert!(text.lines().all(|line| line.chars().count() <= COLUMNS), "{text}");
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>().join(" ");
        let numbers = ["1234567", "7654321", "+6419754"];
        let shown = words(&numbers.iter().fold(text, |text, number| text.replace(number, "")));
        for reason in Reason::ALL {
            assert!(shown.contains(&words(reason.sentence())), "{reason:?} is cut: {shown}");
        }
    }
}
