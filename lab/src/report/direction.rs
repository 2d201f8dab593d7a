//! What the direction of motion does: mean residuals out and back.

use super::picture::{COLOURS, Picture, whiskers};
use super::rows::Rows;
use super::visits::{Points, Visits};
use crate::noise::bounds;
use plotly::common::{DashType, Line};

/// Bins of the position.
const N_BINS: usize = 12;

/// Mean residual over position, separately for both directions.
pub(super) fn split(rows: &Rows) -> Picture {
    let title = "Direction split";
    if !rows.moves() || rows.scored.is_empty() {
        return Picture::none(title, "The inputs do not move.");
    }
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    for axis in rows.drawn_axes() {
        let travel = rows.travel(axis);
        for (m, (model, _)) in rows.models.iter().enumerate() {
            for (sign, name) in [1_i8, -1].into_iter().zip(rows.directions()) {
                let points = means(rows, m, axis, &|row| travel[row].0 == sign);
                let name = format!("{}, {name}, {model}", rows.axes()[axis]);
                let colour = m + 1 + 2 * axis;
                let dash = if sign > 0 { DashType::Solid } else { DashType::Dot };
                let line = Line::new().color(COLOURS[colour % COLOURS.len()]).dash(dash);
                traces.push(whiskers(&name, colour, points).line(line));
            }
        }
    }
    let [out, back] = rows.directions();
    let sentence = format!(
        "Mean residual while {out} and while {back} (whiskers: twice the standard error over visits): a gap of constant \
         height is backlash or dry friction, one that grows with the bend or load is friction in the cone, no gap means no \
         hysteresis."
    );
    Picture::new(title, &sentence, &rows.position_name(), &format!("mean residual ({})", rows.unit), traces)
}

/// Means in bins of the position.
fn means(rows: &Rows, model: usize, axis: usize, counts: &dyn Fn(usize) -> bool) -> Points {
    let (low, high) = bounds(rows.scored.iter().map(|&row| rows.position(row, axis)));
    let bin_of = |row: usize| {
        let part = (rows.position(row, axis) - low) / (high - low).max(1e-12);
        ((part * N_BINS as f64) as usize).min(N_BINS - 1)
    };
    let mut visits = Visits::new(N_BINS);
    for &row in &rows.scored {
        visits.add(counts(row).then(|| bin_of(row)), rows.residual(model, row, axis));
    }
    visits.points(|k| low + (high - low) * (k as f64 + 0.5) / N_BINS as f64)
}
