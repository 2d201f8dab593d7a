//! Table III's kind of run: ten poses of a one-way ramp, photographed, and an estimate of eta and lambda after each.

use crate::bench::{Bench, RAMP_END_DEG, one_way_ramp};
use anyhow::{Context, ensure};
use core::f64::consts::PI;
use krait_model::Snake;
use krait_model::oracle::{
    CompensationMode, Compensator, CompensatorParameters, EstimateOutcome, Estimator, EstimatorParameters,
};
use krait_sim::Truth;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// Number of poses, as in the paper.
const N_POSES: u32 = 10;
/// First photographed pose, deg: below it lines 2 and 3 may still be in their play or stick in the cone.
const FIRST_DEG: f64 = 17.0;

/// Values that the paper prints with Eq. (22).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Printed {
    /// eta, 1.
    pub eta: f64,
    /// What stands behind the +- of eta.
    pub eta_plus_minus: f64,
    /// lambda, mm.
    pub lambda_mm: f64,
    /// What stands behind the +- of lambda, mm.
    pub lambda_plus_minus_mm: f64,
}

/// Eq. (22) as printed.
pub const PRINTED: Printed =
    Printed { eta: 1.220, eta_plus_minus: 0.0019, lambda_mm: 0.1778, lambda_plus_minus_mm: 0.0005 };

/// One row of the table.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Commanded bend, deg.
    pub commanded_deg: f64,
    /// Photographed bend in the plane of the ramp, deg.
    pub measured_deg: f64,
    /// Load scale, 1.
    pub eta: f64,
    /// Its standard deviation, 1.
    pub eta_sd: f64,
    /// Half-width of the play, mm.
    pub lambda_mm: f64,
    /// Its standard deviation, mm.
    pub lambda_sd_mm: f64,
    /// What was photographed, for those who compute with it: bend vector, rad, and actuator positions, m.
    #[serde(skip)]
    pub photograph: (Vector2<f64>, Vector3<f64>),
}

/// Ten recursive estimates.
#[derive(Clone, Debug, Serialize)]
pub struct Table3 {
    /// What the paper prints with Eq. (22).
    pub printed: Printed,
    /// The bench's own eta, 1.
    pub true_eta: f64,
    /// The bench's own half-width of the play, mm.
    pub true_lambda_mm: f64,
    /// After each pose.
    pub rows: Vec<Row>,
    /// eta after the last pose, 1.
    pub eta: f64,
    /// lambda after the last pose, mm.
    pub lambda_mm: f64,
}

/// Bends a fresh bench once with naive compensation, photographs ten poses and estimates after each.
pub fn run(snake: &Snake, truth: &Truth) -> anyhow::Result<Table3> {
    let naive = CompensatorParameters { mode: CompensationMode::Naive, ..CompensatorParameters::default() };
    let mut compensator = Compensator::new(*snake, naive)?;
    let mut estimator = Estimator::new(*snake, parameters())?;
    let mut bench = Bench::new(truth)?;
    let mut rows = Vec::new();
    for wanted in one_way_ramp() {
        let pose = bench.move_to(wanted, compensator.step(wanted).q_tilde_m)?;
        estimator.observe_encoders(pose.q_tilde_m);
        let due_deg = FIRST_DEG + (RAMP_END_DEG - FIRST_DEG) / f64::from(N_POSES - 1) * rows.len() as f64;
        let commanded_deg = wanted.x.to_degrees();
        if commanded_deg < due_deg - 1e-9 || rows.len() == N_POSES as usize {
            continue;
        }
        let frame = bench.photograph().context("the camera gave no frame")?;
        let photograph = (Vector2::from(frame.bend_rad), Vector3::from(frame.q_tilde_m));
        let outcome = estimator.observe_shape(photograph.0, photograph.1, 0.0);
        ensure!(outcome == EstimateOutcome::Used, "the pose at {commanded_deg:.1} deg was left out: {outcome:?}");
        let found = estimator.estimate();
        rows.push(Row {
            commanded_deg,
            measured_deg: photograph.0.x.to_degrees(),
            eta: found.eta,
            eta_sd: found.eta_sd,
            lambda_mm: found.lambda_m * 1e3,
            lambda_sd_mm: found.lambda_sd_m * 1e3,
            photograph,
        });
    }
    let last = *rows.last().context("no pose was photographed")?;
    Ok(Table3 {
        printed: PRINTED,
        true_eta: truth.effects.load_scale,
        true_lambda_mm: 0.5e3 * truth.effects.play_m,
        rows,
        eta: last.eta,
        lambda_mm: last.lambda_mm,
    })
}

/// The estimator without fading memory, told of the camera's 1 deg.
fn parameters() -> EstimatorParameters {
    EstimatorParameters { sigma_bend_rad: PI / 180.0, memory_s: f64::INFINITY, ..EstimatorParameters::default() }
}
