//! The pictures of an experiment, as `krait paper` draws its own: measured points with their errors over the bench's lines.

use super::outcome::{FigureOutcome, PassOutcome, PoseOutcome};
use super::protocol::{FigureKind, Part};
use crate::GOAL_DEG;
use crate::figures::{BEND_AXIS, DELTA_AXIS, Strip, curve, figure};
use krait_model::Snake;
use krait_report::{Figure, Stroke};

/// Bars are drawn as this many standard errors.
const BARS: f64 = 2.0;

/// Every picture.
pub(super) fn all(outcome: &FigureOutcome, snake: &Snake) -> Vec<Figure> {
    match outcome.protocol.figure {
        FigureKind::Fig10 => vec![
            ramp(outcome, Part::Up, "fig-10.svg", "Fig. 10, measured: error of the bend at delta = 0"),
            ramp(outcome, Part::Back, "fig-10-back.svg", "The same on the way back, which the paper does not show"),
        ],
        FigureKind::Fig11 => {
            let mut figures = Vec::new();
            for part in [Part::Turn, Part::FromStraight] {
                if outcome.passes.iter().any(|pass| pass.poses.iter().any(|pose| pose.part == part)) {
                    figures.extend([planes(outcome, part, "bend"), planes(outcome, part, "plane")]);
                }
            }
            figures
        }
        FigureKind::Poses => vec![strip(outcome, snake)],
    }
}

/// The compensations keep the colours that `krait paper` gives them.
fn color(compensation: &str, place: usize) -> usize {
    match compensation {
        "estimated" => 0,
        "naive" => 1,
        "off" => 2,
        _ => 3 + place % 2,
    }
}

fn ramp(outcome: &FigureOutcome, part: Part, file: &str, title: &str) -> Figure {
    let x = |pose: &PoseOutcome| pose.wanted_deg[0];
    let y = |pose: &PoseOutcome| (pose.bend_error_deg, pose.bend_se_deg, pose.bench_bend_error_deg);
    let mut figure = figure(
        file,
        title,
        [BEND_AXIS, "measured minus commanded bend, deg"],
        curves(outcome, part, x, y),
        "Points: the mean of the shapes measured at rest, bars of two standard errors, from the recording. Lines: the same poses on the \
         paper's bench, without noise. The band is the paper's goal of 1 deg.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn planes(outcome: &FigureOutcome, part: Part, what: &str) -> Figure {
    let x = |pose: &PoseOutcome| pose.wanted_deg[1];
    let y = |pose: &PoseOutcome| match what {
        "bend" => (pose.bend_error_deg, pose.bend_se_deg, pose.bench_bend_error_deg),
        _ => (pose.plane_error_deg, pose.plane_se_deg, pose.bench_plane_error_deg),
    };
    let bend_deg = outcome.protocol.poses.first().map_or(0.0, |pose| pose.bend_deg);
    let mut figure = figure(
        &format!("fig-11-{}-{what}.svg", part.name().replace(' ', "-")),
        &format!("Fig. 11, measured: error of the {what} at a bend of {bend_deg:.0} deg, {}", part.name()),
        [DELTA_AXIS, &format!("error of the {what}, deg")],
        curves(outcome, part, x, y),
        "Points: the mean of the shapes measured at rest, bars of two standard errors, from the recording. Lines: the same poses on the \
         paper's bench, without noise.",
    );
    figure.band = Some(GOAL_DEG);
    figure
}

fn curves(
    outcome: &FigureOutcome,
    part: Part,
    x: impl Fn(&PoseOutcome) -> f64,
    y: impl Fn(&PoseOutcome) -> (f64, f64, f64),
) -> Vec<krait_report::Curve> {
    let mut curves = Vec::new();
    for (place, pass) in outcome.passes.iter().enumerate() {
        let poses: Vec<&PoseOutcome> = pass.poses.iter().filter(|pose| pose.part == part).collect();
        if poses.is_empty() {
            continue;
        }
        let color = color(&pass.compensation, place);
        let largest = poses.iter().map(|pose| y(pose).1).fold(0.0, f64::max);
        let bars = Stroke::Bars { x: 0.0, y: BARS * largest };
        let points = |pick: fn((f64, f64, f64)) -> f64| poses.iter().map(|pose| (x(pose), pick(y(pose)))).collect();
        curves.push(curve(&pass.compensation, color, bars, points(|y| y.0)));
        curves.push(curve("", color, Stroke::Solid, points(|y| y.2)));
    }
    curves
}

fn strip(outcome: &FigureOutcome, snake: &Snake) -> Figure {
    let mut strip = Strip::new(snake);
    let is_shown = |(_, pass): &(usize, &PassOutcome)| !pass.poses.is_empty();
    for (k, wanted) in outcome.protocol.poses.iter().enumerate() {
        let wanted_rad = crate::bench::bend_rad(wanted.bend_deg, wanted.delta_deg);
        strip.add("wanted", 4, Stroke::Dashed, k, wanted.delta_deg, wanted_rad);
        for (place, pass) in outcome.passes.iter().enumerate().filter(is_shown) {
            let Some(pose) = pass.poses.iter().find(|pose| pose.pose as usize == k + 1) else { continue };
            let reached_rad = pose.measured_deg.map(f64::to_radians).into();
            strip.add(
                &pass.compensation,
                color(&pass.compensation, place),
                Stroke::Solid,
                k,
                wanted.delta_deg,
                reached_rad,
            );
        }
    }
    let list: Vec<String> =
        outcome.protocol.poses.iter().map(|p| format!("{:.0} deg at {:.0}", p.bend_deg, p.delta_deg)).collect();
    figure(
        "fig-12.svg",
        "Fig. 12, measured: poses, each in its own plane of bending",
        ["in the plane of bending, mm; bases 24 mm apart", "along the base axis, mm"],
        strip.curves,
        &format!("Arcs of the measured bends: {}.", list.join(", ")),
    )
}
