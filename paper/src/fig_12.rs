//! Fig. 12: poses to photograph, with the tip that each should have and the one that each compensation gives it.

use crate::bench::{bend_rad, follow, ramp};
use crate::variants::Variant;
use anyhow::Context;
use krait_model::Snake;
use krait_sim::Truth;
use nalgebra::Vector3;
use serde::Serialize;

/// Bend and plane of each pose, deg.
pub const POSES_DEG: [(f64, f64); 8] =
    [(15.0, 0.0), (30.0, 0.0), (45.0, 0.0), (60.0, 0.0), (80.0, 0.0), (90.0, 0.0), (60.0, 180.0), (60.0, 90.0)];
/// The compensations that are drawn over each other.
const SHOWN: [&str; 3] = ["off", "naive", "motion_sign_1.22_0.089"];

/// One pose.
#[derive(Clone, Debug, Serialize)]
pub struct PoseRow {
    /// Bend, deg.
    pub bend_deg: f64,
    /// Plane, deg.
    pub delta_deg: f64,
    /// Where the end disk's centre should be, base frame, mm.
    pub tip_mm: [f64; 3],
    /// Displacements of the lines, mm, push positive.
    pub q_mm: [f64; 3],
    /// What each compensation reaches from straight.
    pub reached: Vec<Reached>,
}

/// A pose as it came out.
#[derive(Clone, Debug, Serialize)]
pub struct Reached {
    /// What was compensated.
    pub compensation: &'static str,
    /// Bend vector, rad.
    pub bend_rad: [f64; 2],
    /// The end disk's centre, base frame, mm.
    pub tip_mm: [f64; 3],
    /// Its distance from where it should be, mm.
    pub error_mm: f64,
}

/// Takes every pose from straight with three of the compensations.
pub fn run(snake: &Snake, truth: &Truth, variants: &[Variant]) -> anyhow::Result<Vec<PoseRow>> {
    POSES_DEG.iter().map(|(bend_deg, delta_deg)| row(snake, truth, variants, *bend_deg, *delta_deg)).collect()
}

fn row(snake: &Snake, truth: &Truth, variants: &[Variant], bend_deg: f64, delta_deg: f64) -> anyhow::Result<PoseRow> {
    let wanted = bend_rad(bend_deg, delta_deg);
    let tip_mm = snake.tip_pos_in_base_m(wanted) * 1e3;
    let mut reached = Vec::new();
    for variant in variants.iter().filter(|v| SHOWN.contains(&v.key)) {
        let path = ramp(0.0, bend_deg, delta_deg, 1.0);
        let poses = follow(truth, &path, variant.kind.commands(snake)?)?;
        let last = poses.last().context("a ramp has an end")?;
        let own_mm = snake.tip_pos_in_base_m(last.reached_rad) * 1e3;
        reached.push(Reached {
            compensation: variant.label,
            bend_rad: last.reached_rad.into(),
            tip_mm: own_mm.into(),
            error_mm: (own_mm - tip_mm).norm(),
        });
    }
    let q_mm: Vector3<f64> = snake.q(wanted) * 1e3;
    Ok(PoseRow { bend_deg, delta_deg, tip_mm: tip_mm.into(), q_mm: q_mm.into(), reached })
}
