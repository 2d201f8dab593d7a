//! Measurement and prediction over time, whole and at the worst seconds.

use super::picture::{Picture, output_line};
use super::rows::Rows;

/// The worst stretch is this long, s.
const WORST_S: f64 = 5.0;

/// All of it, thinned.
pub(super) fn whole(rows: &Rows) -> Picture {
    let shown = Rows::thinned(&rows.scored);
    let every = rows.scored.len().div_ceil(shown.len().max(1)).max(1);
    let sentence = format!(
        "Where the coloured curves leave the grey one, the model is wrong; drag to zoom, click a name to hide its curve \
         (1 row of {every} is drawn)."
    );
    draw(rows, "Whole record", &sentence, &shown)
}

/// The seconds with the largest error.
pub(super) fn worst(rows: &Rows) -> Picture {
    let found = rows.worst(WORST_S);
    let (Some(&first), Some(&last)) = (found.first(), found.last()) else {
        return Picture::none("Worst seconds", "The model has no error anywhere.");
    };
    let mean = found.iter().map(|&row| rows.square(0, row)).sum::<f64>() / found.len() as f64;
    let sentence = format!(
        "The {WORST_S:.0} s with the largest error, from {:.1} s to {:.1} s: {:.2} {} rms. The shape of the gap here is the \
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
    for (k, output) in rows.outputs().iter().enumerate() {
        let measured = shown.iter().map(|&row| rows.measured(row, k)).collect();
        traces.push(output_line(&format!("{output}, measured"), 0, k, time_s(), measured));
        for (m, (model, _)) in rows.models.iter().enumerate() {
            let predicted = shown.iter().map(|&row| rows.predicted(m, row, k)).collect();
            traces.push(output_line(&format!("{output}, {model}"), m + 1, k, time_s(), predicted));
        }
    }
    Picture::new(title, sentence, "time (s)", &format!("output ({})", rows.unit), traces)
}
