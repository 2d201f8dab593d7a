//! Table III three times: as printed from its own photographs, line 1 alone on the bench, and contrasts of three lines.

use crate::bench::{RAMP_END_DEG, follow, one_way_ramp};
use crate::fit::{EstimatorFit, KRAITS_PRIOR, Loads, Photograph, fit};
use crate::line_1::{self, LineOne};
use crate::noise::CameraNoise;
use crate::reconstruction::{Reconstruction, reconstruct};
use crate::variants::VariantKind;
use anyhow::Context;
use krait_model::Snake;
use krait_sim::Truth;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// Number of poses, as in the paper.
const N_POSES: u32 = 10;
/// First photographed pose, deg: below it lines 2 and 3 may still be in their play or stick in the cone.
const FIRST_DEG: f64 = 17.0;

/// Values that the paper prints with Eq. (22).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PrintedEstimate {
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
pub const PRINTED: PrintedEstimate =
    PrintedEstimate { eta: 1.220, eta_plus_minus: 0.0019, lambda_mm: 0.1778, lambda_plus_minus_mm: 0.0005 };

/// One row of the table of contrasts.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BenchRow {
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

/// The table as printed, on the bench, and in contrasts.
#[derive(Clone, Debug, Serialize)]
pub struct Table3 {
    /// What the paper prints with Eq. (22).
    pub printed: PrintedEstimate,
    /// The rows as printed, again from the photographs that they contain.
    pub as_printed: Reconstruction,
    /// The same kind of run on the bench, line 1 alone.
    pub line_1: LineOne,
    /// The bench's own eta, 1.
    pub true_eta: f64,
    /// The bench's own half-width of the play, mm.
    pub true_lambda_mm: f64,
    /// Contrasts of three lines after each of ten poses of a one-way ramp, with krait's prior.
    pub rows: Vec<BenchRow>,
    /// eta after the last pose, 1.
    pub eta: f64,
    /// Half-width after the last pose, mm.
    pub lambda_mm: f64,
    /// What the prior moved eta and the half-width (mm) by, after the last pose.
    pub pull_of_the_prior: (f64, f64),
}

/// Photographs of a one-way ramp without noise, and what each pose was told, deg.
pub struct Run {
    commanded_deg: Vec<f64>,
    clean: Vec<Photograph>,
    sigma_rad: f64,
}

/// Every form of the table.
pub fn run(snake: &Snake, truth: &Truth) -> anyhow::Result<Table3> {
    let run = Run::new(snake, truth)?;
    let photographs = run.photographed(truth.camera.seed);
    let estimate = |n: usize| run.fitted(snake, &photographs[..n]);
    let mut rows = Vec::new();
    for (k, photograph) in photographs.iter().enumerate() {
        let found = estimate(k + 1)?;
        rows.push(BenchRow {
            commanded_deg: run.commanded_deg[k],
            measured_deg: photograph.bend_rad.x.to_degrees(),
            eta: found.value.x,
            eta_sd: found.sd().x,
            lambda_mm: found.value.y * 1e3,
            lambda_sd_mm: found.sd().y * 1e3,
            photograph: (photograph.bend_rad, photograph.q_tilde_m),
        });
    }
    let last = estimate(photographs.len())?;
    let without = fit(snake, &photographs, run.sigma_rad, Loads::AtPredictedBend, None)
        .context("ten photographs do not determine eta and play")?;
    let pull = last.value - without.value;
    Ok(Table3 {
        printed: PRINTED,
        as_printed: reconstruct(snake)?,
        line_1: line_1::run(snake, truth)?,
        true_eta: truth.effects.load_scale,
        true_lambda_mm: 0.5e3 * truth.effects.play_m,
        rows,
        eta: last.value.x,
        lambda_mm: last.value.y * 1e3,
        pull_of_the_prior: (pull.x, pull.y * 1e3),
    })
}

impl Run {
    /// Bends a fresh bench once with naive compensation and stops at ten poses.
    pub fn new(snake: &Snake, truth: &Truth) -> anyhow::Result<Self> {
        let poses = follow(truth, &one_way_ramp(), VariantKind::Naive.commands(snake)?)?;
        let (mut commanded_deg, mut clean) = (Vec::new(), Vec::new());
        for pose in poses {
            let due_deg = FIRST_DEG + (RAMP_END_DEG - FIRST_DEG) / f64::from(N_POSES - 1) * clean.len() as f64;
            if pose.wanted_rad.x.to_degrees() < due_deg - 1e-9 {
                continue;
            }
            let signs = pose.q_tilde_m.map(f64::signum);
            commanded_deg.push(pose.wanted_rad.x.to_degrees());
            clean.push(Photograph { bend_rad: pose.reached_rad, q_tilde_m: pose.q_tilde_m, signs });
        }
        // A camera without noise would weigh infinitely much against the prior.
        let sigma_rad = truth.camera.noise_rad.max(1e-6);
        Ok(Self { commanded_deg, clean, sigma_rad })
    }

    /// The photographs as the camera of a seed takes them.
    pub fn photographed(&self, seed: u64) -> Vec<Photograph> {
        line_1::noisy(&self.clean, self.sigma_rad, &mut CameraNoise::new(seed))
    }

    /// eta and half-width (m) from photographs and krait's prior.
    pub fn fitted(&self, snake: &Snake, photographs: &[Photograph]) -> anyhow::Result<EstimatorFit> {
        fit(snake, photographs, self.sigma_rad, Loads::AtPredictedBend, Some(KRAITS_PRIOR))
            .context("the estimate does not settle")
    }
}
