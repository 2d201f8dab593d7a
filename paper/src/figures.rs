//! The pictures of Figs. 8 to 12, and of one more that the paper lacks: the way back.

use crate::GOAL_DEG;
use crate::bench::{Pose, bend_error_deg, plane_error_deg, ramp_error_deg};
use crate::fig_9::Point;
use crate::table2::Table2;
use crate::table3::Table3;
use crate::{fig_10, fig_11, fig_12};
use krait_model::Snake;
use krait_report::{Curve, Figure, Sheet, Stroke, Surface};
use nalgebra::Vector2;

pub const BEND_AXIS: &str = "commanded bend, deg";
pub const DELTA_AXIS: &str = "commanded plane delta, deg";
/// Distance between the bases of two poses of Fig. 12, mm.
const STRIP_MM: f64 = 24.0;

/// Every picture of curves.
pub fn all(
    snake: &Snake,
    table_2: &Table2,
    table_3: &Table3,
    ramps: &[fig_10::RampRow],
    turns: &[fig_11::TurnRow],
    poses: &[fig_12::PoseRow],
) -> Vec<Figure> {
    let mut figures = vec![loads(table_2), residuals(table_2), ramp(ramps), way_back(ramps), estimate(table_3, ramps)];
    for bend_deg in fig_11::BENDS_DEG {
        let rows: Vec<&fig_11::TurnRow> = turns.iter().filter(|row| row.bend_deg == bend_deg).collect();
        figures.extend([
            planes(&rows, bend_deg, "turning", "bend", |row| &row.turned, bend_error_deg),
            planes(&rows, bend_deg, "turning", "plane", |row| &row.turned, plane_error_deg),
            planes(&rows, bend_deg, "from straight", "bend", |row| &row.straight, bend_error_deg),
            planes(&rows, bend_deg, "from straight", "plane", |row| &row.straight, plane_error_deg),
        ]);
    }
    figures.push(strip(snake, poses));
    figures
}

/// Every picture of surfaces: line 1 over the workspace.
pub fn surfaces(points: &[Vec<Point>]) -> Vec<Surface> {
    let sheet = |label: &str, color_idx, z: fn(&Point) -> f64| Sheet {
        label: label.to_owned(),
        color_idx,
        // Every third plane and every second bend: enough lines to see the form.
        rows: points
            .iter()
            .step_by(2)
            .map(|row| row.iter().step_by(3).map(|p| [p.bend_deg, p.delta_deg, z(p)]).collect())
            .collect(),
    };
    let surface = |file: &str, title: &str, z: &str, sheets, caption: &str| Surface {
        file: file.to_owned(),
        title: title.to_owned(),
        axis_labels: ["bend, deg", "delta, deg", z].map(str::to_owned),
        sheets,
        caption: caption.to_owned(),
    };
    vec![
        surface(
            "fig-9-extension.svg",
            "Fig. 9: extension eps of line 1 over the workspace",
            "eps, mm",
            vec![
                sheet("naive, Eqs. (15)-(17)", 2, |p| p.eps_naive_mm),
                sheet("as printed, Eq. (18) with Eq. (22)", 3, |p| p.eps_printed_mm),
                sheet("sign of motion: pushed", 0, |p| p.eps_pushed_mm),
                sheet("sign of motion: drawn back", 1, |p| p.eps_drawn_mm),
            ],
            "Ours: the equations with Table I. The paper's caption: compensated length of backbone 1 over the whole workspace; its \
             axes and units are not known. With the sign of motion there are two sheets, and which holds depends on how a pose is reached.",
        ),
        surface(
            "fig-9-length.svg",
            "Fig. 9: compensated length q~ of line 1 over the workspace",
            "q~, mm",
            vec![
                sheet("q, Eq. (1)", 4, |p| p.q_mm),
                sheet("naive, Eqs. (15)-(17)", 2, |p| p.q_mm + p.eps_naive_mm),
                sheet("as printed, Eq. (18) with Eq. (22)", 3, |p| p.q_mm + p.eps_printed_mm),
                sheet("sign of motion: pushed", 0, |p| p.q_mm + p.eps_pushed_mm),
                sheet("sign of motion: drawn back", 1, |p| p.q_mm + p.eps_drawn_mm),
            ],
            "Ours: the same surfaces with q of Eq. (1) in them.",
        ),
    ]
}

/// Fig. 8 is Table II: ten pairs of weights and the line through them.
fn loads(table: &Table2) -> Figure {
    let bars = Stroke::Bars { x: table.printed.small_weight_error_g, y: table.printed.weight_error_g };
    let line = |slope: f64, intercept: f64| vec![(0.0, intercept), (1800.0, slope * 1800.0 + intercept)];
    figure(
        "fig-8-loads.svg",
        "Fig. 8: loads at both ends of the cone, and the fitted line",
        ["load at the snake tau, g", "load at the actuator tau~, g"],
        vec![
            curve("Table II, +-1 g and +-25 g", 0, bars, table.pairs_g.to_vec()),
            curve("tau~ = a tau + c", 1, Stroke::Solid, line(table.slope, table.intercept_g)),
            curve("tau~ = tau", 2, Stroke::Dashed, line(1.0, 0.0)),
        ],
        "The paper's points and errors (Table II), our fit. The paper's axes are not known.",
    )
}

fn residuals(table: &Table2) -> Figure {
    let points = table.pairs_g.iter().zip(table.residuals_g).map(|((tau, _), r)| (*tau, r)).collect();
    let bars = Stroke::Bars { x: table.printed.small_weight_error_g, y: table.printed.weight_error_g };
    figure(
        "fig-8-residuals.svg",
        "Fig. 8, second panel: what the line leaves over",
        ["load at the snake tau, g", "tau~ - (a tau + c), g"],
        vec![curve("Table II minus the line, +-25 g", 0, bars, points)],
        "Ours: ordinary least squares.",
    )
}

/// The compensations that a picture of the ramp shows, with colour and stroke.
fn shown(key: &str) -> Option<(usize, Stroke)> {
    match key {
        "off" => Some((2, Stroke::Solid)),
        "naive" => Some((1, Stroke::Solid)),
        "printed_1.22_0.178" => Some((3, Stroke::Dashed)),
        "load_sign_1.22_0.089" => Some((4, Stroke::Dashed)),
        "motion_sign_1.22_0.089" => Some((0, Stroke::Solid)),
        _ => None,
    }
}

fn ramp(rows: &[fig_10::RampRow]) -> Figure {
    let curves = rows.iter().filter_map(|row| {
        let (color, stroke) = shown(row.key)?;
        Some(curve(row.compensation, color, stroke, over_bend(row.there())))
    });
    let mut figure = figure(
        "fig-10.svg",
        "Fig. 10: error of the bend at delta = 0",
        [BEND_AXIS, "reached minus commanded bend, deg"],
        curves.collect(),
        "Ours: true bend of the simulated snake on a one-way ramp; the error of theta_L is minus what is drawn. The paper's text: \
         naive compensation fails 1 deg, not linear at small and nearly linear at large bends; estimation reaches 1 deg.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn way_back(rows: &[fig_10::RampRow]) -> Figure {
    let curves = rows.iter().filter(|row| row.key != "off").filter_map(|row| {
        let (color, stroke) = shown(row.key)?;
        Some(curve(row.compensation, color, stroke, over_bend(&row.poses)))
    });
    let mut figure = figure(
        "beyond-the-way-back.svg",
        "Not in the paper: the same ramp and the way back",
        [BEND_AXIS, "reached minus commanded bend, deg"],
        curves.collect(),
        "Ours: a one-way ramp cannot show what happens when the lines turn round; the sign of the load is no sign of motion.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn estimate(table: &Table3, rows: &[fig_10::RampRow]) -> Figure {
    let photographed = table.rows.iter().map(|r| (r.commanded_deg, r.measured_deg - r.commanded_deg)).collect();
    let of = |key: &str| rows.iter().find(|row| row.key == key).map_or(Vec::new(), |row| over_bend(row.there()));
    let mut figure = figure(
        "fig-10-photographs.svg",
        "Fig. 10: the naive ramp and the ten photographs behind our estimate",
        [BEND_AXIS, "reached minus commanded bend, deg"],
        vec![
            curve("naive, Eqs. (15)-(17)", 1, Stroke::Solid, of("naive")),
            curve("ten photographs, camera 1 deg", 1, Stroke::Dots, photographed),
            curve("sign of motion", 0, Stroke::Solid, of("motion_sign_1.22_0.089")),
        ],
        "Ours: contrasts of three lines estimate eta and the play from these photographs.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn planes(
    rows: &[&fig_11::TurnRow],
    bend_deg: f64,
    protocol: &str,
    what: &str,
    poses: impl Fn(&fig_11::TurnRow) -> &Vec<Pose>,
    error: fn(&Pose) -> f64,
) -> Figure {
    let over_delta = |pose: &Pose| {
        let delta_deg = pose.wanted_rad.y.atan2(pose.wanted_rad.x).to_degrees();
        (if delta_deg < -1e-9 { delta_deg + 360.0 } else { delta_deg }, error(pose))
    };
    let points = |row: &fig_11::TurnRow| {
        let mut points: Vec<(f64, f64)> = poses(row).iter().map(over_delta).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let curves = rows.iter().filter_map(|row| {
        let (color, stroke) = shown(row.key)?;
        Some(curve(row.compensation, color, stroke, points(row)))
    });
    let mut figure = figure(
        &format!("fig-11-{bend_deg:.0}-{}-{what}.svg", protocol.replace(' ', "-")),
        &format!("Fig. 11: error of the {what} at a bend of {bend_deg:.0} deg, {protocol}"),
        [DELTA_AXIS, &format!("error of the {what}, deg")],
        curves.collect(),
        "Ours. Whether the paper's figure shows the bend or the plane, and how its poses were reached, is not known: while the plane \
         turns, the bend alone looks good even as printed, and the plane does not.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

/// Each pose drawn in its own wanted plane, one beside the other.
fn strip(snake: &Snake, poses: &[fig_12::PoseRow]) -> Figure {
    let mut strip = Strip::new(snake);
    for (k, row) in poses.iter().enumerate() {
        let wanted = crate::bench::bend_rad(row.bend_deg, row.delta_deg);
        strip.add("wanted", 4, Stroke::Dashed, k, row.delta_deg, wanted);
        for (reached, color) in row.reached.iter().zip([2, 1, 0]) {
            strip.add(reached.compensation, color, Stroke::Solid, k, row.delta_deg, reached.bend_rad.into());
        }
    }
    figure(
        "fig-12.svg",
        "Fig. 12: poses, each in its own plane of bending",
        ["in the plane of bending, mm; bases 24 mm apart", "along the base axis, mm"],
        strip.curves,
        "Ours: bends 15, 30, 45, 60, 80, 90 deg at delta = 0, then 60 deg at delta = 180 and 90 deg. The paper's poses are not known.",
    )
}

/// Arcs side by side.
pub struct Strip<'a> {
    snake: &'a Snake,
    /// The arcs, for a figure.
    pub curves: Vec<Curve>,
}

impl<'a> Strip<'a> {
    /// An empty one.
    pub fn new(snake: &'a Snake) -> Self {
        Self { snake, curves: Vec::new() }
    }

    /// A bend, rad, at place `k`, seen along the normal of a plane; named in the legend where it stands first.
    pub fn add(&mut self, label: &str, color_idx: usize, stroke: Stroke, k: usize, delta_deg: f64, b: Vector2<f64>) {
        let label = if k == 0 { label } else { "" };
        self.curves.push(curve(label, color_idx, stroke, shape(self.snake, b, delta_deg, k as f64 * STRIP_MM)));
    }
}

/// The backbone of a bend, a circular arc, seen along the normal of a plane, mm.
fn shape(snake: &Snake, b: Vector2<f64>, delta_deg: f64, offset_mm: f64) -> Vec<(f64, f64)> {
    let (sin, cos) = delta_deg.to_radians().sin_cos();
    (0..=24_u32)
        .map(|k| {
            // The first part of an arc is an arc of that length and bend.
            let part = f64::from(k) / 24.0;
            let at_mm = snake.tip_pos_in_base_m(b * part) * (part * 1e3);
            (offset_mm + at_mm.x * cos - at_mm.y * sin, at_mm.z)
        })
        .collect()
}

/// A picture without a band.
pub fn figure(file: &str, title: &str, [x_label, y_label]: [&str; 2], curves: Vec<Curve>, caption: &str) -> Figure {
    Figure {
        file: file.to_owned(),
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        band: None,
        curves,
        caption: caption.to_owned(),
    }
}

/// One curve.
pub fn curve(label: &str, color_idx: usize, stroke: Stroke, points: Vec<(f64, f64)>) -> Curve {
    Curve { label: label.to_owned(), color_idx, stroke, points }
}

/// Error over the commanded bend of a motion at delta = 0.
fn over_bend(poses: &[Pose]) -> Vec<(f64, f64)> {
    poses.iter().map(|p| (p.wanted_rad.x.to_degrees(), ramp_error_deg(p))).collect()
}
