//! What a picture shows, before it is drawn: curves with their labels over two axes.

use serde::Serialize;

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stroke {
    /// A line.
    Solid,
    /// A dashed line.
    Dashed,
    /// Points without a line.
    Dots,
}

/// One curve.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// What the legend says.
    pub label: String,
    /// Which colour, from 0; curves that belong together share one.
    pub color_idx: usize,
    /// How it is drawn.
    pub stroke: Stroke,
    /// (x, y) in the units of the axes.
    pub points: Vec<(f64, f64)>,
}

/// One picture.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    /// Name of the picture's file.
    pub file: String,
    /// What it shows.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// Half-width of a shaded band around zero, in the unit of y.
    pub band: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
    /// What is ours in it, and what is known of the paper's.
    pub caption: String,
}
