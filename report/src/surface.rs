//! Draws surfaces as SVG: each sheet a net of lines in its own colour, seen from above and from the side.

use crate::plot::{
    COLORS, INK, LEGEND_COLUMNS, LEGEND_ROW, PLOT_HEIGHT, PlotError, TITLE_HEIGHT, UNITS, WIDTH, declared, font, plain,
    said,
};
use crate::{Sheet, Surface};
use core::ops::Range;
use plotters::prelude::*;

/// From where it is seen: turned by this about the vertical axis and tilted by that, rad.
const YAW_RAD: f64 = 0.65;
const PITCH_RAD: f64 = 0.25;

/// The surfaces as the text of an SVG file.
///
/// # Errors
/// [`PlotError`].
pub fn surface_svg(surface: &Surface) -> Result<String, PlotError> {
    let mut text = String::new();
    draw(surface, &mut text).map_err(|what| PlotError { file: surface.file.clone(), what })?;
    Ok(declared(&text, WIDTH, height(surface)))
}

fn height(surface: &Surface) -> i32 {
    PLOT_HEIGHT + LEGEND_ROW * surface.sheets.len().div_ceil(2) as i32 + 10
}

fn draw(surface: &Surface, text: &mut String) -> Result<(), String> {
    let size = ((WIDTH * UNITS).unsigned_abs(), (height(surface) * UNITS).unsigned_abs());
    let root = SVGBackend::with_string(text, size).into_drawing_area();
    root.fill(&WHITE).map_err(said)?;
    let (upper, lower) = root.split_vertically(PLOT_HEIGHT * UNITS);
    let (top, plot) = upper.split_vertically(TITLE_HEIGHT * UNITS);
    let at = |y: i32| (LEGEND_COLUMNS[0] * UNITS, y * UNITS);
    top.draw(&Text::new(surface.title.clone(), at(16), font(18))).map_err(said)?;
    let [x, y, z] = &surface.axis_labels;
    let axes = format!("x: {x};  y: {y};  up: {z}");
    plot.draw(&Text::new(axes, at(4), font(13))).map_err(said)?;
    // The library draws its second axis upwards and its third into the depth.
    let [x_range, y_range, z_range] = [0, 1, 2].map(|axis| range(surface, axis));
    let mut chart =
        ChartBuilder::on(&plot).margin(24 * UNITS).build_cartesian_3d(x_range, z_range, y_range).map_err(said)?;
    chart.with_projection(|mut projection| {
        projection.yaw = YAW_RAD;
        projection.pitch = PITCH_RAD;
        projection.scale = 0.85;
        projection.into_matrix()
    });
    let thin = INK.mix(0.25).stroke_width(UNITS.unsigned_abs());
    chart
        .configure_axes()
        .light_grid_style(TRANSPARENT)
        .bold_grid_style(thin)
        .axis_panel_style(TRANSPARENT)
        .label_style(font(12))
        .x_labels(5)
        .y_labels(6)
        .z_labels(5)
        .max_light_lines(1)
        .x_formatter(&|v| plain(*v))
        .y_formatter(&|v| plain(*v))
        .z_formatter(&|v| plain(*v))
        .draw()
        .map_err(said)?;
    for sheet in &surface.sheets {
        let style = color(sheet).mix(0.8).stroke_width(UNITS.unsigned_abs());
        for line in lines(sheet) {
            chart.draw_series(LineSeries::new(line.into_iter().map(|[x, y, z]| (x, z, y)), style)).map_err(said)?;
        }
    }
    for (k, sheet) in surface.sheets.iter().enumerate() {
        let (x, y) = (LEGEND_COLUMNS[k % 2] * UNITS, (LEGEND_ROW * (k / 2) as i32 + 10) * UNITS);
        let style = color(sheet).stroke_width(2 * UNITS.unsigned_abs());
        lower.draw(&PathElement::new(vec![(x, y), (x + 28 * UNITS, y)], style)).map_err(said)?;
        lower.draw(&Text::new(sheet.label.clone(), (x + 36 * UNITS, y - 6 * UNITS), font(13))).map_err(said)?;
    }
    root.present().map_err(said)
}

fn color(sheet: &Sheet) -> RGBColor {
    COLORS[sheet.color_idx % COLORS.len()]
}

/// The rows of a net, then its columns.
fn lines(sheet: &Sheet) -> Vec<Vec<[f64; 3]>> {
    let n_columns = sheet.rows.iter().map(Vec::len).min().unwrap_or(0);
    let columns = (0..n_columns).map(|k| sheet.rows.iter().map(|row| row[k]).collect());
    sheet.rows.iter().cloned().chain(columns).collect()
}

fn range(surface: &Surface, axis: usize) -> Range<f64> {
    let values = surface.sheets.iter().flat_map(|s| &s.rows).flatten().map(|point| point[axis]);
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    low..high
}
