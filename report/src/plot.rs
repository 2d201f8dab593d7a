//! Draws a figure as SVG: thin grid, one colour per line or compensation, the legend below, where it hides nothing.
//!
//! The drawing library places everything on whole pixels. It is given a canvas several times as large as the picture, which
//! is then declared in the picture's size, so that lines are smooth.

use crate::{Curve, Figure, Stroke};
use core::fmt::Display;
use core::ops::Range;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

/// Units of the canvas in one pixel of the picture.
pub(crate) const UNITS: i32 = 8;
/// Width of every picture, pixels.
pub(crate) const WIDTH: i32 = 760;
/// Height of the plot with its title and axes, pixels.
pub(crate) const PLOT_HEIGHT: i32 = 450;
/// Part of it that the title takes, pixels.
pub(crate) const TITLE_HEIGHT: i32 = 38;
/// Height of one row of the legend, pixels.
pub(crate) const LEGEND_ROW: i32 = 21;
/// Where the two columns of the legend begin, pixels.
pub(crate) const LEGEND_COLUMNS: [i32; 2] = [72, 400];
/// Okabe and Ito's colours, which all eyes can tell apart: blue, vermilion, grey, purple, black.
pub(crate) const COLORS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(120, 120, 120),
    RGBColor(204, 121, 167),
    RGBColor(30, 30, 30),
];
const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(crate) const INK: RGBColor = RGBColor(40, 40, 40);
pub(crate) const GRID: RGBColor = RGBColor(228, 228, 228);
/// Part of the range of y that stays free above and below the curves.
const MARGIN: f64 = 0.06;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A picture that cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file} cannot be drawn: {what}")]
pub struct PlotError {
    /// Name of the picture's file.
    pub file: String,
    /// What the drawing library says.
    pub what: String,
}

/// The figure as the text of an SVG file.
///
/// # Errors
/// [`PlotError`].
pub fn svg(figure: &Figure) -> Result<String, PlotError> {
    let mut text = String::new();
    draw(figure, &mut text).map_err(|what| PlotError { file: figure.file.clone(), what })?;
    let (width, height) = (WIDTH, height(figure));
    Ok(declared(&text, width, height))
}

/// The same picture with its size in pixels instead of units of the canvas.
pub(crate) fn declared(text: &str, width: i32, height: i32) -> String {
    let size = |w: i32, h: i32| format!("width=\"{w}\" height=\"{h}\"");
    text.replacen(&size(width * UNITS, height * UNITS), &size(width, height), 1)
}

fn height(figure: &Figure) -> i32 {
    let n_entries = named(figure).count() + usize::from(figure.band.is_some());
    PLOT_HEIGHT + LEGEND_ROW * n_entries.div_ceil(2) as i32 + 10
}

/// The curves that the legend names.
fn named(figure: &Figure) -> impl Iterator<Item = &Curve> {
    figure.curves.iter().filter(|curve| !curve.label.is_empty())
}

fn draw(figure: &Figure, text: &mut String) -> Result<(), String> {
    let size = ((WIDTH * UNITS).unsigned_abs(), (height(figure) * UNITS).unsigned_abs());
    let root = SVGBackend::with_string(text, size).into_drawing_area();
    root.fill(&WHITE).map_err(said)?;
    let (upper, lower) = root.split_vertically(PLOT_HEIGHT * UNITS);
    let (top, plot) = upper.split_vertically(TITLE_HEIGHT * UNITS);
    top.draw(&Text::new(figure.title.clone(), (LEGEND_COLUMNS[0] * UNITS, 16 * UNITS), font(18))).map_err(said)?;
    let (x, y) = ranges(figure);
    let mut chart = ChartBuilder::on(&plot)
        .margin(12 * UNITS)
        .x_label_area_size(44 * UNITS)
        .y_label_area_size(60 * UNITS)
        .build_cartesian_2d(x.clone(), y)
        .map_err(said)?;
    mesh(&mut chart, figure)?;
    if let Some(half) = figure.band {
        let band = Rectangle::new([(x.start, half), (x.end, -half)], GREEN.mix(0.14).filled());
        chart.draw_series([band]).map_err(said)?;
    }
    let zero = PathElement::new(vec![(x.start, 0.0), (x.end, 0.0)], INK.mix(0.5).stroke_width(UNITS.unsigned_abs()));
    chart.draw_series([zero]).map_err(said)?;
    for curve in &figure.curves {
        draw_curve(&mut chart, curve)?;
    }
    legend(&lower, figure)?;
    root.present().map_err(said)
}

fn mesh(chart: &mut Chart, figure: &Figure) -> Result<(), String> {
    let thin = UNITS.unsigned_abs();
    chart
        .configure_mesh()
        .x_desc(&figure.x_label)
        .y_desc(&figure.y_label)
        .x_labels(9)
        .y_labels(8)
        .max_light_lines(0)
        .bold_line_style(GRID.stroke_width(thin))
        .axis_style(INK.mix(0.6).stroke_width(thin))
        .set_all_tick_mark_size(5 * UNITS)
        .label_style(font(13))
        .axis_desc_style(font(14))
        .x_label_formatter(&|v| plain(*v))
        .y_label_formatter(&|v| plain(*v))
        .draw()
        .map_err(said)
}

fn draw_curve(chart: &mut Chart, curve: &Curve) -> Result<(), String> {
    let points = curve.points.iter().copied();
    let (style, dash) = (stroke(curve), [7, 5].map(|l| l * UNITS.unsigned_abs()));
    match curve.stroke {
        Stroke::Solid => chart.draw_series(LineSeries::new(points, style)).map(drop),
        Stroke::Dashed => chart.draw_series(DashedLineSeries::new(points, dash[0], dash[1], style)).map(drop),
        Stroke::Dots => chart.draw_series(points.map(|at| Circle::new(at, 4 * UNITS, style.filled()))).map(drop),
        Stroke::Bars { x, y } => {
            let bars = points.flat_map(|(px, py)| [[(px - x, py), (px + x, py)], [(px, py - y), (px, py + y)]]);
            chart.draw_series(bars.map(|ends| PathElement::new(ends.to_vec(), style))).map_err(said)?;
            let centres = curve.points.iter().map(|at| Circle::new(*at, 3 * UNITS, style.filled()));
            chart.draw_series(centres).map(drop)
        }
    }
    .map_err(said)
}

/// Two columns of samples and labels.
fn legend(area: &Area, figure: &Figure) -> Result<(), String> {
    let at = |k: usize| (LEGEND_COLUMNS[k % 2] * UNITS, (LEGEND_ROW * (k / 2) as i32 + 10) * UNITS);
    let label = |(x, y): (i32, i32), words: &str| {
        area.draw(&Text::new(words.to_owned(), (x + 36 * UNITS, y - 6 * UNITS), font(13))).map_err(said)
    };
    for (k, curve) in named(figure).enumerate() {
        let (x, y) = at(k);
        let (style, ends) = (stroke(curve), vec![(x, y), (x + 28 * UNITS, y)]);
        let dash = [7, 5].map(|l| l * UNITS.unsigned_abs());
        match curve.stroke {
            Stroke::Solid => area.draw(&PathElement::new(ends, style)),
            Stroke::Dashed => area.draw(&DashedPathElement::new(ends, dash[0], dash[1], style)),
            Stroke::Dots => area.draw(&Circle::new((x + 14 * UNITS, y), 4 * UNITS, style.filled())),
            Stroke::Bars { .. } => {
                let (middle, half) = (x + 14 * UNITS, 7 * UNITS);
                let bar = PathElement::new(vec![(middle, y - half), (middle, y + half)], style);
                area.draw(&bar).and_then(|()| area.draw(&Circle::new((middle, y), 3 * UNITS, style.filled())))
            }
        }
        .map_err(said)?;
        label((x, y), &curve.label)?;
    }
    if let Some(half) = figure.band {
        let (x, y) = at(named(figure).count());
        let corners = [(x, y - 6 * UNITS), (x + 28 * UNITS, y + 6 * UNITS)];
        area.draw(&Rectangle::new(corners, GREEN.mix(0.25).filled())).map_err(said)?;
        label((x, y), &format!("within {} deg", plain(half)))?;
    }
    Ok(())
}

fn stroke(curve: &Curve) -> ShapeStyle {
    COLORS[curve.color_idx % COLORS.len()].stroke_width(2 * UNITS.unsigned_abs())
}

pub(crate) fn font(pixels: i32) -> TextStyle<'static> {
    ("sans-serif", pixels * UNITS).into_font().color(&INK)
}

fn ranges(figure: &Figure) -> (Range<f64>, Range<f64>) {
    let all = || figure.curves.iter().flat_map(|curve| &curve.points);
    let (left, right) = all().fold((0.0_f64, 0.0_f64), |(left, right), p| (left.min(p.0), right.max(p.0)));
    let (mut low, mut high) = all().fold((0.0_f64, 0.0_f64), |(low, high), p| (low.min(p.1), high.max(p.1)));
    if let Some(half) = figure.band {
        (low, high) = (low.min(-half), high.max(half));
    }
    let margin = MARGIN * (high - low);
    (left..right, low - margin..high + margin)
}

/// A number on an axis, without needless zeros and without a negative zero.
pub(crate) fn plain(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0 + 0.0;
    format!("{rounded}")
}

pub(crate) fn said(error: impl Display) -> String {
    error.to_string()
}
