//! Fig. 11: the same bend in other planes, once while the plane turns, once with each plane bent from straight.

use crate::bench::{Pose, bend_error_deg, follow, plane_error_deg, ramp, spread, turn, vector_error_deg};
use crate::variants::Variant;
use krait_model::Snake;
use krait_report::Spread;
use krait_sim::Truth;
use serde::Serialize;

/// Bends, deg: theta = 30 deg read as the bend, and as the tangent angle theta_L.
pub const BENDS_DEG: [f64; 2] = [30.0, 60.0];
/// Spacing of the poses while the plane turns, deg.
const TURN_STEP_DEG: f64 = 2.0;
/// Spacing of the planes that are bent from straight, deg.
const PLANE_STEP_DEG: u32 = 30;

/// Errors in bend and plane, deg.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TurnErrors {
    /// Reached minus commanded bend.
    pub bend_deg: Spread,
    /// Angle between the planes.
    pub plane_deg: Spread,
    /// Distance of the bend vectors.
    pub vector_deg: Spread,
}

/// One compensation at one bend.
#[derive(Clone, Debug, Serialize)]
pub struct TurnRow {
    /// Name for programs.
    pub key: &'static str,
    /// What was compensated.
    pub compensation: &'static str,
    /// The bend, deg.
    pub bend_deg: f64,
    /// Bent at delta = 0, then turned once.
    pub turning: TurnErrors,
    /// Each of 12 planes bent from straight.
    pub from_straight: TurnErrors,
    /// The turn, for pictures.
    #[serde(skip)]
    pub turned: Vec<Pose>,
    /// The planes bent from straight, for pictures.
    #[serde(skip)]
    pub straight: Vec<Pose>,
}

/// Runs both protocols at both bends with each compensation.
pub fn run(snake: &Snake, truth: &Truth, variants: &[Variant]) -> anyhow::Result<Vec<TurnRow>> {
    let mut rows = Vec::new();
    for bend_deg in BENDS_DEG {
        for variant in variants {
            let turned = turned(snake, truth, variant, bend_deg)?;
            let straight = straight(snake, truth, variant, bend_deg)?;
            rows.push(TurnRow {
                key: variant.key,
                compensation: variant.label,
                bend_deg,
                turning: errors(&turned),
                from_straight: errors(&straight),
                turned,
                straight,
            });
        }
    }
    Ok(rows)
}

fn turned(snake: &Snake, truth: &Truth, variant: &Variant, bend_deg: f64) -> anyhow::Result<Vec<Pose>> {
    let mut path = ramp(0.0, bend_deg, 0.0, 1.0);
    let n_ramp = path.len();
    path.extend(turn(bend_deg, TURN_STEP_DEG));
    Ok(follow(truth, &path, variant.kind.commands(snake)?)?.split_off(n_ramp))
}

fn straight(snake: &Snake, truth: &Truth, variant: &Variant, bend_deg: f64) -> anyhow::Result<Vec<Pose>> {
    let mut ends = Vec::new();
    for plane in (0..360).step_by(PLANE_STEP_DEG as usize) {
        let path = ramp(0.0, bend_deg, f64::from(plane), 1.0);
        ends.extend(follow(truth, &path, variant.kind.commands(snake)?)?.last().copied());
    }
    Ok(ends)
}

fn errors(poses: &[Pose]) -> TurnErrors {
    TurnErrors {
        bend_deg: spread(poses, bend_error_deg),
        plane_deg: spread(poses, plane_error_deg),
        vector_deg: spread(poses, vector_error_deg),
    }
}
