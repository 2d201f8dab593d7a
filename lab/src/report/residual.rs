//! What the model leaves, over time and over the position: small differences between two curves are not to be seen otherwise.

use super::picture::{Floor, Picture, layout, output_line};
use super::rows::Rows;

/// The worst stretch is this long, s.
const WORST_S: f64 = 5.0;
/// Loops are drawn for this long around the worst seconds, s.
const LOOP_S: f64 = 30.0;
/// Of noise alone 19 of 20 rows lie within so many of its standard deviations.
const FLOORS: f64 = 2.0;

/// All of it, thinned.
pub(super) fn over_time(rows: &Rows) -> Picture {
    let shown = Rows::thinned(&rows.scored);
    let every = rows.scored.len().div_ceil(shown.len().max(1)).max(1);
    let sentence = format!(
        "Measured minus predicted; where a curve leaves the two lines of the noise floor, the model is wrong. Drag to zoom, click a \
         name to hide its curve (1 row of {every} is drawn){}.",
        rows.left_out()
    );
    draw(rows, "Residual over time", &sentence, &shown)
}

/// The seconds with the largest error.
pub(super) fn worst(rows: &Rows) -> Picture {
    let found = rows.worst(WORST_S);
    let (Some(&first), Some(&last)) = (found.first(), found.last()) else {
        return Picture::none("Worst seconds", "The model has no error anywhere.");
    };
    let mean = found.iter().map(|&row| rows.square(0, row)).sum::<f64>() / found.len() as f64;
    let sentence = format!(
        "The {WORST_S:.0} s with the largest error, from {:.1} s to {:.1} s: {:.2} {} rms. The shape of the residual here is the \
         quickest hint at its cause.",
        rows.data.time_s[first],
        rows.data.time_s[last],
        mean.sqrt(),
        rows.unit
    );
    draw(rows, "Worst seconds", &sentence, &Rows::thinned(&found))
}

fn draw(rows: &Rows, title: &str, sentence: &str, shown: &[usize]) -> Picture {
    let time_s = || shown.iter().map(|&row| rows.data.time_s[row]).collect::<Vec<f64>>();
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    for k in rows.drawn() {
        for (m, (model, _)) in rows.models.iter().enumerate() {
            let off = shown.iter().map(|&row| rows.off(m, row, k)).collect();
            traces.push(output_line(&format!("{}, {model}", rows.outputs()[k]), m + 1, k, time_s(), off));
        }
    }
    let layout = layout("time (s)", &format!("residual ({})", rows.unit));
    Picture::with_layout(title, sentence, floor(rows).on_both_sides(layout), traces)
}

/// Residual against position around the worst seconds, in the order of the motion.
pub(super) fn loops(rows: &Rows) -> Picture {
    let title = "Residual loops";
    let found = Rows::thinned(&rows.worst(LOOP_S));
    if found.is_empty() {
        return Picture::none(title, "The model has no error anywhere.");
    }
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    for axis in rows.drawn_axes() {
        let x = || found.iter().map(|&row| rows.position(row, axis)).collect::<Vec<f64>>();
        for (m, (model, _)) in rows.models.iter().enumerate() {
            let off = found.iter().map(|&row| rows.residual(m, row, axis)).collect();
            traces.push(output_line(&format!("{}, {model}", rows.axes()[axis]), m + 1, axis, x(), off));
        }
    }
    let sentence = format!(
        "{LOOP_S:.0} s around the worst place: a loop is hysteresis that the model lacks, and its height is the hysteresis' width; one \
         curved line there and back is a curve or a gain; a band between the two lines is noise{}.",
        rows.left_out()
    );
    let layout = layout(&rows.position_name(), &format!("residual ({})", rows.unit));
    Picture::with_layout(title, &sentence, floor(rows).on_both_sides(layout), traces)
}

/// The lines between which the noise of one output stays.
fn floor(rows: &Rows) -> Floor {
    Floor::new(rows.floor_of_one().map(|floor| FLOORS * floor), &format!("{FLOORS:.0} x noise floor"), &rows.unit)
}
