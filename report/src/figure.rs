//! What a picture shows, before it is drawn: curves with their labels over two axes.

use serde::Serialize;

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stroke {
    /// A line.
    Solid,
    /// A dashed line.
    Dashed,
    /// Points without a line.
    Dots,
    /// Points with the error of each, half of the bar in the units of the axes.
    Bars {
        /// Along x.
        x: f64,
        /// Along y.
        y: f64,
    },
}

/// One curve.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// What the legend says; empty for a curve that goes on from one that it names.
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

/// One sheet of a surface.
#[derive(Clone, Debug, Serialize)]
pub struct Sheet {
    /// What the legend says.
    pub label: String,
    /// Which colour, from 0.
    pub color_idx: usize,
    /// Points (x, y, z) in the units of the axes, in rows of one length.
    pub rows: Vec<Vec<[f64; 3]>>,
}

/// A picture of surfaces over a plane, as nets of lines.
#[derive(Clone, Debug, Serialize)]
pub struct Surface {
    /// Name of the picture's file.
    pub file: String,
    /// What it shows.
    pub title: String,
    /// Labels of x, y and z, with their units.
    pub axis_labels: [String; 3],
    /// The sheets.
    pub sheets: Vec<Sheet>,
    /// What is ours in it, and what is known of the paper's.
    pub caption: String,
}
