//! What each kind of compensation reaches where lines reverse and the plane turns, which the paper's ramp never shows.

use crate::bench::{Pose, follow, follow_compensated, spread, vector_error_deg};
use core::f64::consts::PI;
use krait_model::Snake;
use krait_model::oracle::{CompensationMode, CompensatorParameters};
use krait_report::Spread;
use krait_sim::Truth;
use nalgebra::Vector2;
use serde::Serialize;

/// One kind of compensation.
#[derive(Clone, Debug, Serialize)]
pub struct MotionRow {
    /// What was compensated.
    pub compensation: &'static str,
    /// Distance of reached and commanded bend vector, deg.
    pub error_deg: Spread,
}

/// Runs the same motion with each compensation, with the bench's own eta and play.
pub fn compare(snake: &Snake, truth: &Truth) -> anyhow::Result<Vec<MotionRow>> {
    let path_rad = operator_like();
    let (eta, play_m) = (truth.effects.load_scale, truth.effects.play_m);
    let with = |mode, eta, lambda_m| CompensatorParameters { mode, eta, lambda_m, ..CompensatorParameters::default() };
    let run = |parameters| follow_compensated(snake, truth, &path_rad, parameters);
    let printed =
        |eta, lambda_m| follow(truth, &path_rad, |b| snake.q(b) + snake.extension_as_printed(b, eta, lambda_m).eps_m);
    let row = |compensation, poses: Vec<Pose>| MotionRow { compensation, error_deg: spread(&poses, vector_error_deg) };
    Ok(vec![
        row("off", run(with(CompensationMode::Off, 1.0, 0.0))?),
        row("naive, Eqs. (15)-(17)", run(with(CompensationMode::Naive, 1.0, 0.0))?),
        row("eta", printed(eta, 0.0)?),
        row("eta and uniform lambda, Eq. (18) as printed", printed(eta, play_m)?),
        row(
            "eta, play and friction with the sign of motion",
            run(with(CompensationMode::Estimated, eta, 0.5 * play_m))?,
        ),
    ])
}

/// Bends up to 60 deg whose amplitude swells and whose plane turns to and fro, rad.
fn operator_like() -> Vec<Vector2<f64>> {
    (0..6000_u32)
        .map(|k| {
            let t = f64::from(k) * 7e-3;
            let amplitude = 0.5 - 0.5 * (2.0 * PI * t / 6.0).cos() * (0.4 + 0.6 * (2.0 * PI * t / 17.0).cos());
            let plane = 2.2 * (2.0 * PI * t / 11.0).sin() + 0.35 * t;
            Vector2::new(plane.cos(), plane.sin()) * (amplitude.clamp(0.0, 1.0) * 60_f64.to_radians())
        })
        .collect()
}
