//! The curves of Figs. 8 to 11, and of one more figure that the paper lacks: the way back.

use crate::GOAL_DEG;
use crate::bench::{Pose, RAMP_END_DEG, bend_error_deg, follow_compensated, one_way_ramp, there_and_back};
use crate::table3::Table3;
use krait_model::Snake;
use krait_model::oracle::{CompensationMode, CompensatorParameters};
use krait_report::{Curve, Figure, Stroke};
use krait_sim::Truth;
use nalgebra::Vector2;

/// The one-way ramp with each compensation, and the way back with two of them.
pub struct Ramps {
    /// q~ = q.
    pub off: Vec<Pose>,
    /// Eqs. (15)-(17).
    pub naive: Vec<Pose>,
    /// Eq. (18) with the tenth estimate of Table III.
    pub estimated: Vec<Pose>,
    back_as_printed: Vec<Pose>,
    back_with_signs: Vec<Pose>,
}

impl Ramps {
    /// Runs the bench five times.
    pub fn run(snake: &Snake, truth: &Truth, table: &Table3) -> anyhow::Result<Self> {
        let ramp = |mode| {
            let parameters = CompensatorParameters { mode, ..CompensatorParameters::default() };
            follow_compensated(snake, truth, &one_way_ramp(), parameters)
        };
        let printed = |b| snake.q(b) + snake.extension_as_printed(b, table.eta, 2e-3 * table.lambda_mm).eps_m;
        Ok(Self {
            off: ramp(CompensationMode::Off)?,
            naive: ramp(CompensationMode::Naive)?,
            estimated: estimated_ramp(snake, truth, table)?,
            back_as_printed: crate::bench::follow(truth, &there_and_back(), printed)?,
            back_with_signs: follow_compensated(snake, truth, &there_and_back(), estimated(table))?,
        })
    }
}

/// The one-way ramp on a fresh bench, compensated with the last estimate of a Table III run.
pub fn estimated_ramp(snake: &Snake, truth: &Truth, table: &Table3) -> anyhow::Result<Vec<Pose>> {
    follow_compensated(snake, truth, &one_way_ramp(), estimated(table))
}

/// Every figure.
pub fn all(snake: &Snake, table: &Table3, ramps: &Ramps) -> Vec<Figure> {
    vec![
        loads(snake, table, ramps),
        extension(snake),
        actuation(snake, table, ramps),
        without_and_naive(ramps),
        naive_and_estimated(table, ramps),
        way_back(ramps),
    ]
}

const BEND_AXIS: &str = "commanded bend, deg";

fn estimated(table: &Table3) -> CompensatorParameters {
    CompensatorParameters {
        mode: CompensationMode::Estimated,
        eta: table.eta,
        lambda_m: table.lambda_mm * 1e-3,
        ..CompensatorParameters::default()
    }
}

fn loads(snake: &Snake, table: &Table3, ramps: &Ramps) -> Figure {
    let eta = table.true_eta;
    let at_snake = |i: usize| sampled(|b| snake.tau_n(b)[i]);
    let at_actuator =
        |i: usize, sign| sampled(move |b| snake.cone_load_with_sign(eta * snake.tau_n(b)[i], sign).tau_tilde_n);
    let bench = |i: usize| dotted(&ramps.estimated, |p| p.reached_rad.x.to_degrees(), move |p| p.tau_tilde_n[i]);
    figure(
        "fig-8-loads.svg",
        "Fig. 8a: loads of the lines over the bend",
        ["bend, deg", "load, N (push positive)"],
        vec![
            curve("line 1 at the snake, Eq. (11)", 0, Stroke::Solid, at_snake(0)),
            curve("lines 2, 3 at the snake", 1, Stroke::Solid, at_snake(1)),
            curve("line 1 at the actuator, Eq. (13), eta of the bench", 0, Stroke::Dashed, at_actuator(0, -1.0)),
            curve("lines 2, 3 at the actuator", 1, Stroke::Dashed, at_actuator(1, 1.0)),
            curve("bench, line 1", 0, Stroke::Dots, bench(0)),
            curve("bench, line 2", 1, Stroke::Dots, bench(1)),
        ],
        "Ours: the lines are Eqs. (11) and (13) in the plane delta = 0, the dots the loads that the simulated drives report on \
         the one-way ramp. Of the paper's figure we know only that it shows loads and extension over the bend.",
    )
}

fn extension(snake: &Snake) -> Figure {
    let eps = |i: usize| sampled(move |b| snake.extension_naive(b).eps_m[i] * 1e3);
    let q = |i: usize| sampled(move |b| snake.q(b)[i] * 1e3);
    figure(
        "fig-8-extension.svg",
        "Fig. 8b: extension of the lines over the bend",
        ["bend, deg", "extension, displacement, mm (push positive)"],
        vec![
            curve("eps of line 1, Eqs. (15)-(16)", 0, Stroke::Solid, eps(0)),
            curve("eps of lines 2, 3", 1, Stroke::Solid, eps(1)),
            curve("q of line 1, Eq. (1)", 0, Stroke::Dashed, q(0)),
            curve("q of lines 2, 3", 1, Stroke::Dashed, q(1)),
        ],
        "Ours: the equations alone, with Table I. The lines stretch by nearly as much as they move the snake, which is why an \
         uncompensated snake bends little more than half.",
    )
}

fn actuation(snake: &Snake, table: &Table3, ramps: &Ramps) -> Figure {
    let told = |poses: &[Pose]| line(poses, |p| p.q_tilde_m.x * 1e3);
    let needed = dotted(&ramps.estimated, |p| p.reached_rad.x.to_degrees(), |p| p.q_tilde_m.x * 1e3);
    let printed =
        |b: Vector2<f64>| (snake.q(b) + snake.extension_as_printed(b, table.eta, 2e-3 * table.lambda_mm).eps_m).x * 1e3;
    figure(
        "fig-9.svg",
        "Fig. 9: actuation of line 1",
        [BEND_AXIS, "actuator position of line 1, mm (push positive)"],
        vec![
            curve("none: q", 2, Stroke::Solid, told(&ramps.off)),
            curve("naive, Eqs. (15)-(17)", 1, Stroke::Solid, told(&ramps.naive)),
            curve("estimated, signs of motion", 0, Stroke::Solid, told(&ramps.estimated)),
            curve("estimated, Eq. (18) as printed", 3, Stroke::Dashed, sampled(printed)),
            curve("what the bench needed", 4, Stroke::Dots, needed),
        ],
        "Ours: every curve. The dots are the actuator's position over the bend that it really gave. As printed, lambda is added \
         although line 1 is pulled: it shortens the pull by the whole play instead of lengthening it by half of it.",
    )
}

fn without_and_naive(ramps: &Ramps) -> Figure {
    figure(
        "fig-10.svg",
        "Fig. 10: error of the bend without and with naive compensation",
        [BEND_AXIS, "reached minus commanded bend, deg"],
        vec![
            curve("none", 2, Stroke::Solid, line(&ramps.off, bend_error_deg)),
            curve("naive, Eqs. (15)-(17)", 1, Stroke::Solid, line(&ramps.naive, bend_error_deg)),
        ],
        "Ours: true bend of the simulated snake on a one-way ramp in the plane delta = 0; the error of theta_L is minus what is \
         drawn. The paper's curves show camera data of a real snake, which are not available.",
    )
}

fn naive_and_estimated(table: &Table3, ramps: &Ramps) -> Figure {
    let photographed = table.rows.iter().map(|r| (r.commanded_deg, r.measured_deg - r.commanded_deg)).collect();
    let mut figure = figure(
        "fig-11.svg",
        "Fig. 11: error of the bend with naive and with estimated compensation",
        [BEND_AXIS, "reached minus commanded bend, deg"],
        vec![
            curve("naive, Eqs. (15)-(17)", 1, Stroke::Solid, line(&ramps.naive, bend_error_deg)),
            curve("the ten photographs behind the estimate", 1, Stroke::Dots, photographed),
            curve("estimated, tenth row of Table III", 0, Stroke::Solid, line(&ramps.estimated, bend_error_deg)),
        ],
        "Ours: as Fig. 10, compensated with the eta and lambda that ten photographs of the naive ramp gave. The band is the \
         1 deg that the paper asks for.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn way_back(ramps: &Ramps) -> Figure {
    let mut figure = figure(
        "beyond-the-way-back.svg",
        "Not in the paper: the same ramp and the way back",
        [BEND_AXIS, "reached minus commanded bend, deg"],
        vec![
            curve("estimated, Eq. (18) as printed", 3, Stroke::Dashed, line(&ramps.back_as_printed, bend_error_deg)),
            curve("estimated, signs of motion", 0, Stroke::Solid, line(&ramps.back_with_signs, bend_error_deg)),
        ],
        "Ours: a one-way ramp cannot show what happens when the lines turn round. Both runs use the same estimate.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn figure(file: &str, title: &str, [x_label, y_label]: [&str; 2], curves: Vec<Curve>, caption: &str) -> Figure {
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

fn curve(label: &str, color_idx: usize, stroke: Stroke, points: Vec<(f64, f64)>) -> Curve {
    Curve { label: label.to_owned(), color_idx, stroke, points }
}

/// A function of the bend in the plane delta = 0, at every whole degree.
fn sampled(f: impl Fn(Vector2<f64>) -> f64) -> Vec<(f64, f64)> {
    (0..=RAMP_END_DEG as u32).map(|d| (f64::from(d), f(Vector2::new(f64::from(d).to_radians(), 0.0)))).collect()
}

/// Every second pose of a motion over its commanded bend.
fn line(poses: &[Pose], y: impl Fn(&Pose) -> f64) -> Vec<(f64, f64)> {
    poses.iter().step_by(2).map(|p| (p.wanted_rad.x.to_degrees(), y(p))).collect()
}

/// A few poses of a motion.
fn dotted(poses: &[Pose], x: impl Fn(&Pose) -> f64, y: impl Fn(&Pose) -> f64) -> Vec<(f64, f64)> {
    poses.iter().step_by(40).skip(1).map(|p| (x(p), y(p))).collect()
}
