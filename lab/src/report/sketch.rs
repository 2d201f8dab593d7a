//! The sketch of an effect as a small drawing: what it adds over the position, with the size of both written at the axes.

use super::html::escape;
use crate::diagnose::Sketch;
use crate::noise::bounds;
use core::fmt::Write;

const WIDTH: f64 = 260.0;
const HEIGHT: f64 = 130.0;
/// Around the curve.
const MARGIN: f64 = 18.0;

/// The drawing. Equal curves give equal bytes.
pub(super) fn svg(sketch: &Sketch) -> String {
    let (left, right) = bounds(sketch.position.iter().copied());
    let (low, high) = bounds(sketch.change.iter().copied());
    let (low, high) = (low.min(0.0), high.max(0.0));
    let place = |value: f64, from: f64, to: f64, length: f64| {
        MARGIN + (length - 2.0 * MARGIN) * (value - from) / (to - from).max(f64::MIN_POSITIVE)
    };
    let x = |value: f64| place(value, left, right, WIDTH);
    let y = |value: f64| HEIGHT - place(value, low, high, HEIGHT);
    let mut points = String::new();
    for (position, change) in sketch.position.iter().zip(&sketch.change) {
        // Writing to a string cannot fail.
        let _ok = write!(points, "{:.1},{:.1} ", x(*position), y(*change));
    }
    let unit = escape(&sketch.unit);
    let what = if sketch.is_across { "across the motion" } else { "along the motion" };
    let zero = y(0.0);
    let (end, foot) = (WIDTH - MARGIN, HEIGHT - 4.0);
    format!(
        "<figure class=\"sketch\"><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\" \
         aria-label=\"what it adds over the position\"><line x1=\"{MARGIN}\" y1=\"{zero:.1}\" x2=\"{end}\" y2=\"{zero:.1}\" \
         stroke=\"#999\"></line><polyline points=\"{}\" fill=\"none\" stroke=\"#0072b2\" stroke-width=\"1.5\"></polyline>\
         <text x=\"{MARGIN}\" y=\"12\" font-size=\"11\">{low:.3} to {high:.3} {unit} {what}</text>\
         <text x=\"{MARGIN}\" y=\"{foot}\" font-size=\"11\">position, {left:.1} to {right:.1} {unit}</text></svg>\
         <figcaption>What this effect alone adds in a slow motion out and back, and in a smaller one inside it.</figcaption>\
         </figure>\n",
        points.trim_end()
    )
}
