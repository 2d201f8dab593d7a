//! What the machine remembers: the residual against travel since a reversal, and against time at rest.

use super::picture::{Picture, layout, whiskers};
use super::rows::Rows;
use super::visits::{Points, Visits};
use plotly::layout::{Axis, AxisType};

/// Bins of the travel.
const N_TRAVEL: usize = 16;
/// Bins of the time at rest; each is this many times as long as the one before.
const N_HOLD: usize = 14;
const HOLD_STEP: f64 = 1.7;
/// First bin of the time at rest ends here, s.
const HOLD_FIRST_S: f64 = 0.2;

/// Mean residual in the direction of motion against travel since the last reversal.
pub(super) fn travel(rows: &Rows) -> Picture {
    let title = "Travel since the last reversal";
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    for axis in rows.drawn_axes() {
        let travel = rows.travel(axis);
        let counted = || rows.scored.iter().copied().filter(|&row| travel[row].0 != 0);
        let longest = counted().map(|row| travel[row].1).fold(0.0, f64::max);
        if longest <= 0.0 {
            continue;
        }
        // Squares: what happens after a reversal happens soon.
        let edge = |k: f64| longest * (k / N_TRAVEL as f64).powi(2);
        for (m, (model, _)) in rows.models.iter().enumerate() {
            let mut visits = Visits::new(N_TRAVEL);
            for row in counted() {
                let residual = rows.residual(m, row, axis) * f64::from(travel[row].0);
                let k = ((travel[row].1 / longest).sqrt() * N_TRAVEL as f64) as usize;
                visits.add(Some(k.min(N_TRAVEL - 1)), residual);
            }
            let points = visits.points(|k| edge(k as f64 + 0.5));
            let name = format!("{}, {model}", rows.axes()[axis]);
            traces.push(whiskers(&name, m + 1 + 2 * axis, points));
        }
    }
    if traces.is_empty() {
        return Picture::none(title, "The inputs never reverse, so these data do not show what a reversal does.");
    }
    let sentence = "Mean residual, positive in the direction of motion: a ramp that ends at a level is play, as wide as the \
                    ramp; an exponential approach is micro-slip (Dahl, Bouc-Wen); a level from the start is dry friction. \
                    Whiskers: twice the standard error over visits.";
    let x = format!("travel since the last reversal ({})", rows.unit);
    Picture::new(title, sentence, &x, &format!("residual ({})", rows.unit), traces)
}

/// Change of the residual in rests against time at rest.
pub(super) fn holds(rows: &Rows) -> Picture {
    let title = "Time at rest";
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    for axis in rows.drawn_axes() {
        let travel = rows.travel(axis);
        for (m, (model, _)) in rows.models.iter().enumerate() {
            let points = relaxation(rows, m, axis, &travel);
            if !points.x.is_empty() {
                let name = format!("{}, {model}", rows.axes()[axis]);
                traces.push(whiskers(&name, m + 1 + 2 * axis, points));
            }
        }
    }
    if traces.is_empty() {
        return Picture::none(title, "The machine never rests long enough in these data to show what rest does.");
    }
    let sentence = "Change of the residual since the machine stopped, positive in the direction of the motion before: a slope \
                    on this logarithmic axis is creep or relaxation, a level line means that nothing happens at rest. \
                    Whiskers: twice the standard error over rests.";
    let own = layout("", &format!("change of the residual ({})", rows.unit))
        .x_axis(Axis::new().title("time at rest (s)").type_(AxisType::Log));
    Picture::with_layout(title, sentence, own, traces)
}

fn relaxation(rows: &Rows, model: usize, axis: usize, travel: &[(i8, f64)]) -> Points {
    let mut visits = Visits::new(N_HOLD);
    let mut start = (0.0, 0_usize);
    let mut own: Vec<(f64, f64)> = Vec::new();
    let mut finish = |start: &mut (f64, usize), own: &mut Vec<(f64, f64)>| {
        let first = start.0 / start.1.max(1) as f64;
        for (rest_s, residual) in own.drain(..).filter(|_| start.1 > 0) {
            let k = ((rest_s / HOLD_FIRST_S).ln() / HOLD_STEP.ln()).max(0.0) as usize;
            visits.add(Some(k), residual - first);
        }
        visits.add(None, 0.0);
        *start = (0.0, 0);
    };
    let mut last_s = 0.0;
    for &row in &rows.scored {
        let rest_s = rows.motion[row].rest_s;
        if rest_s < last_s || rest_s == 0.0 {
            finish(&mut start, &mut own);
        }
        last_s = rest_s;
        let residual = rows.residual(model, row, axis) * f64::from(travel[row].0);
        if rest_s > 0.0 && residual.is_finite() && travel[row].0 != 0 {
            if rest_s <= HOLD_FIRST_S {
                start = (start.0 + residual, start.1 + 1);
            } else {
                own.push((rest_s, residual));
            }
        }
    }
    finish(&mut start, &mut own);
    visits.points(|k| HOLD_FIRST_S * HOLD_STEP.powf(k as f64 + 0.5))
}
