//! What the direction of motion does: mean residuals out and back, and loops.

use super::picture::{COLOURS, Picture, output_line, plain, short};
use super::rows::Rows;
use crate::Quantity;
use crate::noise::bounds;
use plotly::Scatter;
use plotly::common::{ErrorData, ErrorType, Line, LineShape, Mode};

/// Bins of the position.
const N_BINS: usize = 12;
/// Loops are drawn for this long around the worst seconds, s.
const LOOP_S: f64 = 30.0;
/// Joints that are drawn; more curves cannot be told apart.
const MOST_AXES: usize = 4;

/// Mean residual over position, separately for both directions.
pub(super) fn split(rows: &Rows) -> Picture {
    let title = "Direction split";
    if !rows.moves() || rows.scored.is_empty() {
        return Picture::none(title, "The inputs do not move.");
    }
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    let n_axes = if rows.is_snake() { 1 } else { rows.data.n_outputs.min(MOST_AXES) };
    for axis in 0..n_axes {
        let travel = rows.travel(axis);
        for (m, (model, _)) in rows.models.iter().enumerate() {
            for (sign, name) in [1_i8, -1].into_iter().zip(rows.directions()) {
                let (x, y, whiskers) = means(rows, m, axis, &|row| travel[row].0 == sign);
                let name = format!("{}, {name}, {model}", rows.axes()[axis]);
                let colour = COLOURS[(m + 1 + 2 * axis) % COLOURS.len()];
                let dash = if sign > 0 { plotly::common::DashType::Solid } else { plotly::common::DashType::Dot };
                let own = Scatter::new(x, y)
                    .mode(Mode::LinesMarkers)
                    .name(plain(&name))
                    .line(Line::new().color(colour).dash(dash).shape(LineShape::Linear))
                    .error_y(ErrorData::new(ErrorType::Data).array(whiskers));
                traces.push(own);
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

/// Place, mean and twice its standard error in bins of the position; rows in a row are one visit.
fn means(rows: &Rows, model: usize, axis: usize, counts: &dyn Fn(usize) -> bool) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let all = rows.scored.iter().map(|&row| rows.position(row, axis));
    let (low, high) = bounds(all);
    let bin_of = |row: usize| {
        let part = (rows.position(row, axis) - low) / (high - low).max(1e-12);
        ((part * N_BINS as f64) as usize).min(N_BINS - 1)
    };
    let mut visits: Vec<Vec<(f64, usize)>> = vec![Vec::new(); N_BINS];
    let mut last = None;
    for &row in &rows.scored {
        let residual = rows.residual(model, row, axis);
        let bin = (counts(row) && residual.is_finite()).then(|| bin_of(row));
        if let Some(own) = bin.and_then(|bin| visits.get_mut(bin)) {
            match own.last_mut().filter(|_| last == bin) {
                Some(visit) => *visit = (visit.0 + residual, visit.1 + 1),
                None => own.push((residual, 1)),
            }
        }
        last = bin;
    }
    let mut points = (Vec::new(), Vec::new(), Vec::new());
    for (k, own) in visits.iter().enumerate().filter(|(_, own)| own.len() > 1) {
        let n = own.len() as f64;
        let total: usize = own.iter().map(|(_, n)| n).sum();
        let mean = own.iter().map(|(sum, _)| sum).sum::<f64>() / total as f64;
        // Visits count by their rows, so that a long one weighs as much in the error as in the mean.
        let spread: f64 = own.iter().map(|(sum, rows)| (sum - mean * *rows as f64).powi(2)).sum();
        let error = (spread * n / (n - 1.0)).sqrt() / total as f64;
        points.0.push(short(low + (high - low) * (k as f64 + 0.5) / N_BINS as f64));
        points.1.push(short(mean));
        points.2.push(short(2.0 * error));
    }
    points
}

/// One input against its output around the worst seconds.
pub(super) fn loops(rows: &Rows) -> Picture {
    let title = "Loops";
    if rows.data.quantity == Quantity::Segments {
        return Picture::none(title, "No encoder belongs to one component of a bend: every line bends in both.");
    }
    let found = Rows::thinned(&rows.worst(LOOP_S));
    if found.is_empty() {
        return Picture::none(title, "The model has no error anywhere.");
    }
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    let n = if rows.is_snake() { 1 } else { rows.data.n_outputs.min(rows.data.n_inputs).min(MOST_AXES) };
    for k in 0..n {
        let x = || found.iter().map(|&row| input(rows, row, k)).collect::<Vec<f64>>();
        let output = if rows.is_snake() { "bend x".to_owned() } else { rows.data.names.output(k) };
        let measured = found.iter().map(|&row| rows.measured(row, k)).collect();
        traces.push(output_line(&format!("{output}, measured"), 0, k, x(), measured));
        for (m, (model, _)) in rows.models.iter().enumerate() {
            let predicted = found.iter().map(|&row| rows.predicted(m, row, k)).collect();
            traces.push(output_line(&format!("{output}, {model}"), m + 1, k, x(), predicted));
        }
    }
    let what = if rows.is_snake() { "encoder of line 1, without what all lines share" } else { "commanded position" };
    let sentence = format!(
        "{LOOP_S:.0} s around the worst place: the measured loop's width is the hysteresis that the model must have; a model \
         without it draws a line."
    );
    let y = if rows.is_snake() { "bend x" } else { "measured position" };
    Picture::new(title, &sentence, &format!("{what} ({})", rows.input_unit.0), &format!("{y} ({})", rows.unit), traces)
}

fn input(rows: &Rows, row: usize, k: usize) -> f64 {
    let own = rows.data.input(row);
    let shared = if rows.is_snake() { own.iter().sum::<f64>() / own.len().max(1) as f64 } else { 0.0 };
    own.get(k).map_or(f64::NAN, |q| (q - shared) * rows.input_unit.1)
}
