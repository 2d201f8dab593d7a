//! Fig. 10: error of the bend on a one-way ramp in the plane delta = 0, and on the way back, which the paper does not show.

use crate::bench::{Pose, RAMP_END_DEG, follow, ramp, ramp_error_deg, spread};
use crate::variants::Variant;
use krait_model::Snake;
use krait_report::Spread;
use krait_sim::Truth;
use serde::Serialize;

/// Spacing of the poses, deg.
const STEP_DEG: f64 = 1.0;
/// The way back counts down to this bend, deg: below it the lines are in their play.
const BACK_TO_DEG: f64 = 5.0;

/// One compensation on the ramp.
#[derive(Clone, Debug, Serialize)]
pub struct RampRow {
    /// Name for programs.
    pub key: &'static str,
    /// What was compensated.
    pub compensation: &'static str,
    /// Error of the bend while bending, deg.
    pub there_deg: Spread,
    /// The same at 10, 20 ... 80 deg.
    pub at_10_to_80_deg: Vec<f64>,
    /// Error on the way back, deg.
    pub back_deg: Spread,
    /// The same at 70, 60 ... 10 deg.
    pub at_70_to_10_deg: Vec<f64>,
    /// The motion, for pictures.
    #[serde(skip)]
    pub poses: Vec<Pose>,
}

impl RampRow {
    /// The way out.
    pub fn there(&self) -> &[Pose] {
        self.poses.get(..n_there()).unwrap_or(&self.poses)
    }
}

fn n_there() -> usize {
    (RAMP_END_DEG / STEP_DEG) as usize
}

/// Runs the ramp there and back with each compensation.
pub fn run(snake: &Snake, truth: &Truth, variants: &[Variant]) -> anyhow::Result<Vec<RampRow>> {
    let mut path = ramp(0.0, RAMP_END_DEG, 0.0, STEP_DEG);
    path.extend(ramp(RAMP_END_DEG, 0.0, 0.0, STEP_DEG));
    variants.iter().map(|variant| row(variant, follow(truth, &path, variant.kind.commands(snake)?)?)).collect()
}

fn row(variant: &Variant, poses: Vec<Pose>) -> anyhow::Result<RampRow> {
    let (there, back) = poses.split_at(n_there());
    let counted = back.len() - (BACK_TO_DEG / STEP_DEG) as usize;
    let every_tenth = |part: &[Pose], n: usize| part.iter().skip(9).step_by(10).take(n).map(ramp_error_deg).collect();
    Ok(RampRow {
        key: variant.key,
        compensation: variant.label,
        there_deg: spread(there, ramp_error_deg),
        at_10_to_80_deg: every_tenth(there, 8),
        back_deg: spread(&back[..counted], ramp_error_deg),
        at_70_to_10_deg: every_tenth(back, 7),
        poses,
    })
}
