//! Where the model fails: the error over bend and plane, and over speed.

use super::picture::{Floor, Picture, axis, layout, short, whiskers};
use super::rows::Rows;
use super::visits::{Points, Visits};
use crate::Quantity;
use crate::noise::bounds;
use plotly::HeatMap;
use plotly::common::{ColorBar, ColorScale, ColorScalePalette};

/// Cells along the bend or the position.
const N_PLACES: usize = 9;
/// Sectors of the plane.
const N_SECTORS: usize = 12;
/// Bins of the speed, with equally many rows each.
const N_SPEEDS: usize = 10;
/// Fewer rows than this make no cell.
const FEWEST: usize = 5;

/// Error of the last model over bend and plane; for joints over each joint's position.
pub(super) fn map(rows: &Rows) -> Picture {
    let model = rows.models.len().saturating_sub(1);
    let name = rows.models.get(model).map_or("", |(name, _)| name.as_str());
    if rows.is_snake() { snake(rows, model, name) } else { joints(rows, model, name) }
}

fn snake(rows: &Rows, model: usize, name: &str) -> Picture {
    let largest = rows.scored.iter().map(|&row| rows.position(row, 0)).fold(0.0, f64::max).max(1e-9);
    let step = 360.0 / N_SECTORS as f64;
    let place = |row: usize| {
        let azimuth = rows.predicted(0, row, 1).atan2(rows.predicted(0, row, 0)).to_degrees();
        let sector = (azimuth / step).round().rem_euclid(N_SECTORS as f64) as usize % N_SECTORS;
        (cell(rows.position(row, 0), 0.0, largest), sector)
    };
    let mut sums = vec![vec![(0.0, 0usize); N_SECTORS]; N_PLACES];
    for &row in &rows.scored {
        let (bend, sector) = place(row);
        let own = &mut sums[bend][sector];
        *own = (own.0 + rows.square(model, row), own.1 + 1);
    }
    let delta: Vec<f64> = (0..N_SECTORS).map(|k| k as f64 * step).collect();
    let bend = centres(0.0, largest);
    draw(
        rows,
        &format!(
            "Error ({name}) by bend and plane: an even colour means that no pose is special, a bright row that large (or \
             small) bends are, a bright column that one plane is; empty cells were not visited."
        ),
        ("plane delta (deg)", "predicted bend (deg)"),
        (delta, bend),
        sums,
    )
}

fn joints(rows: &Rows, model: usize, name: &str) -> Picture {
    let n = rows.data.n_outputs;
    let mut sums = vec![vec![(0.0, 0usize); N_PLACES]; n];
    for (k, own) in sums.iter_mut().enumerate() {
        let all = rows.scored.iter().map(|&row| rows.position(row, k));
        let (low, high) = bounds(all);
        for &row in &rows.scored {
            let place = &mut own[cell(rows.position(row, k), low, high)];
            *place = (place.0 + rows.residual(model, row, k).powi(2), place.1 + 1);
        }
    }
    let one = if rows.data.quantity == Quantity::Segments { "component" } else { "joint" };
    draw(
        rows,
        &format!(
            "Error ({name}) by each {one}'s own position, from the low end of its range (0 %) to the high end (100 %): a \
             bright cell is a place where this {one} fails."
        ),
        ("position (% of the range)", "output"),
        (centres(0.0, 100.0), (1..=n).map(|k| k as f64).collect()),
        sums,
    )
}

fn draw(
    rows: &Rows,
    sentence: &str,
    axes: (&str, &str),
    at: (Vec<f64>, Vec<f64>),
    sums: Vec<Vec<(f64, usize)>>,
) -> Picture {
    let rms = |(sum, n): &(f64, usize)| if *n < FEWEST { f64::NAN } else { short((sum / *n as f64).sqrt()) };
    let z: Vec<Vec<f64>> = sums.iter().map(|row| row.iter().map(rms).collect()).collect();
    let round = |values: Vec<f64>| values.into_iter().map(short).collect::<Vec<f64>>();
    let bar = ColorBar::new().title(format!("rms ({})", super::html::escape(&rows.unit)));
    let trace = HeatMap::new(round(at.0), round(at.1), z)
        .color_bar(bar)
        .color_scale(ColorScale::Palette(ColorScalePalette::Viridis))
        .name("rms");
    let layout =
        if rows.is_snake() { layout(axes.0, axes.1) } else { layout(axes.0, axes.1).y_axis(axis(axes.1).dtick(1.0)) };
    Picture::with_layout("Map", sentence, layout, vec![trace])
}

fn cell(value: f64, low: f64, high: f64) -> usize {
    let part = (value - low) / (high - low).max(1e-12) * N_PLACES as f64;
    (part.max(0.0) as usize).min(N_PLACES - 1)
}

fn centres(low: f64, high: f64) -> Vec<f64> {
    (0..N_PLACES).map(|k| low + (high - low) * (k as f64 + 0.5) / N_PLACES as f64).collect()
}

/// Error over the inputs' speed.
pub(super) fn speed(rows: &Rows) -> Picture {
    let scale = rows.input_unit.1;
    let speed_of = |row: usize| rows.motion.get(row).filter(|m| m.is_moving).map(|m| m.speed * scale);
    let mut moving: Vec<(f64, usize)> = rows.scored.iter().filter_map(|&row| Some((speed_of(row)?, row))).collect();
    if moving.len() < N_SPEEDS * FEWEST {
        return Picture::none("Speed", "Too few rows in motion for a picture by speed.");
    }
    moving.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let size = moving.len().div_ceil(N_SPEEDS);
    let middle: Vec<f64> = moving.chunks(size).map(|bin| bin[bin.len() / 2].0).collect();
    let mut bin_of: Vec<(usize, usize)> = moving.iter().enumerate().map(|(k, (_, row))| (*row, k / size)).collect();
    bin_of.sort_unstable();
    let traces = rows.models.iter().enumerate().map(|(m, (name, _))| {
        let mut visits = Visits::new(N_SPEEDS);
        let mut last = None;
        for &(row, bin) in &bin_of {
            if last.is_some_and(|last| row > last + 1) {
                visits.add(None, 0.0);
            }
            visits.add(Some(bin), rows.square(m, row));
            last = Some(row);
        }
        whiskers(name, m + 1, roots(visits.points(|bin| middle[bin]))) as Box<dyn plotly::Trace>
    });
    let traces = traces.collect();
    let sentence = "A curve that rises with speed points to latency or viscous friction, a level one to effects that do not \
                    know time (each point: a tenth of the rows in motion; whiskers: twice the standard error over visits).";
    let x = format!("speed of the inputs ({}/s)", rows.input_unit.0);
    let layout = layout(&x, &format!("error, rms ({})", rows.unit));
    let floor = Floor::new(rows.floor, "noise floor", &rows.unit);
    Picture::with_layout("Speed", sentence, floor.on(layout), traces)
}

/// Root mean squares of mean squares: d rms = d (mean square) / (2 rms).
fn roots(points: Points) -> Points {
    let mean: Vec<f64> = points.mean.iter().map(|square| square.sqrt()).collect();
    let whisker = points.whisker.iter().zip(&mean).map(|(whisker, rms)| whisker / (2.0 * rms)).collect();
    Points { mean, whisker, ..points }
}
