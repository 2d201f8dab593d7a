//! Table III's kind of run as the paper did it, line 1 alone, on the bench; and the same photographs in contrasts of three lines.

use crate::bench::{follow, ramp};
use crate::fit::{EstimatorFit, Loads, Photograph, fit};
use crate::noise::CameraNoise;
use crate::reconstruction::{PhotographRow, recursion, variances};
use crate::variants::VariantKind;
use anyhow::Context;
use krait_model::Snake;
use krait_model::oracle::F_S_N;
use krait_sim::Truth;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// What the poses were told, deg: bends like those of the reconstructed photographs.
const COMMANDED_DEG: [f64; 11] = [3.0, 12.0, 19.0, 22.0, 24.5, 27.5, 29.5, 31.5, 35.0, 23.0, 20.0];
/// Line 1 is pushed in this plane, deg.
const DELTA_DEG: f64 = 180.0;
/// Runs with noise.
const N_RUNS: u32 = 4000;
/// Seed of their noise.
const SEED: u64 = 20_060_501;
/// The camera's standard deviation, rad: the paper's 1 deg.
pub const SIGMA_RAD: f64 = core::f64::consts::PI / 180.0;

/// Mean and standard deviation of eta and lambda (mm) over runs with noise.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Scatter {
    /// Mean.
    pub mean: (f64, f64),
    /// Standard deviation.
    pub sd: (f64, f64),
}

/// Table III on the bench.
#[derive(Clone, Debug, Serialize)]
pub struct LineOne {
    /// What the poses were told, deg.
    pub commanded_deg: [f64; 11],
    /// What they reached, deg.
    pub reached_deg: Vec<f64>,
    /// The row that each gives without noise.
    pub photographs: Vec<PhotographRow>,
    /// The ten estimates without noise: eta, and lambda in mm.
    pub rows: Vec<(f64, f64)>,
    /// Variances by Eq. (21).
    pub variances: (f64, f64),
    /// The first estimate over runs with 1 deg of noise.
    pub first: Scatter,
    /// The last one.
    pub last: Scatter,
    /// What line 1 alone takes for lambda on this bench, mm: (4/3) (h + g f_s / K_c).
    pub lambda_closed_form_mm: f64,
    /// eta and half-width (mm) from contrasts of the last ten poses without noise.
    pub contrasts: (f64, f64),
}

/// Runs the poses, each from straight with naive compensation, and estimates.
pub fn run(snake: &Snake, truth: &Truth) -> anyhow::Result<LineOne> {
    let photographs = photographs(snake, truth, &COMMANDED_DEG, DELTA_DEG)?;
    let rows = rows(snake, &photographs);
    let (estimates, _) = recursion(&rows).context("line 1 alone determines nothing on this bench")?;
    let zeta = variances(&rows).context("line 1 alone determines nothing on this bench")?;
    let (first, last) = with_noise(snake, &photographs)?;
    let lag_mm = 0.5e3 * truth.effects.play_m + 1e3 * snake.capstan() * F_S_N / snake.k_c_n_per_m();
    let contrasts = contrasts(snake, &photographs).context("contrasts determine nothing on this bench")?;
    Ok(LineOne {
        commanded_deg: COMMANDED_DEG,
        reached_deg: photographs.iter().map(|p| p.bend_rad.norm().to_degrees()).collect(),
        photographs: rows,
        rows: estimates.iter().map(|e| (e.x, e.y)).collect(),
        variances: (zeta.x, zeta.y),
        first,
        last,
        lambda_closed_form_mm: 4.0 / 3.0 * lag_mm,
        contrasts: (contrasts.value.x, contrasts.value.y * 1e3),
    })
}

/// Poses, each from straight on a fresh bench with naive compensation in steps of half a degree, without noise.
pub fn photographs(
    snake: &Snake,
    truth: &Truth,
    commanded_deg: &[f64],
    delta_deg: f64,
) -> anyhow::Result<Vec<Photograph>> {
    let one = |bend_deg: &f64| {
        let poses = follow(truth, &ramp(0.0, *bend_deg, delta_deg, 0.5), VariantKind::Naive.commands(snake)?)?;
        let last = poses.last().context("a ramp has an end")?;
        // A line that does not move in this plane says nothing about its play.
        let signs = snake.q(last.wanted_rad).map(|q| if q.abs() < 1e-9 { 0.0 } else { q.signum() });
        Ok(Photograph { bend_rad: last.reached_rad, q_tilde_m: last.q_tilde_m, signs })
    };
    commanded_deg.iter().map(one).collect()
}

/// The same photographs with noise of one standard deviation, rad, on each component of the bend vector.
pub fn noisy(photographs: &[Photograph], sigma_rad: f64, noise: &mut CameraNoise) -> Vec<Photograph> {
    photographs.iter().map(|p| Photograph { bend_rad: p.bend_rad + noise.pair() * sigma_rad, ..*p }).collect()
}

/// x and z of line 1 as the paper takes them: load at the measured bend, f_s as printed.
fn rows(snake: &Snake, photographs: &[Photograph]) -> Vec<PhotographRow> {
    let f_s_m = snake.capstan() * F_S_N / snake.k_c_n_per_m();
    let row = |p: &Photograph| {
        let eps_m: Vector3<f64> = p.q_tilde_m - snake.q(p.bend_rad);
        let x_m = snake.loading_compliance_m_per_n() * snake.tau_n(p.bend_rad).x;
        PhotographRow { x_mm: 1e3 * x_m, z_mm: 1e3 * (eps_m.x - f_s_m) }
    };
    photographs.iter().map(row).collect()
}

/// Contrasts of every pose but the first, which may still be in the play of lines 2 and 3.
fn contrasts(snake: &Snake, photographs: &[Photograph]) -> Option<EstimatorFit> {
    fit(snake, photographs.get(1..)?, SIGMA_RAD, Loads::AtPredictedBend, None)
}

fn with_noise(snake: &Snake, photographs: &[Photograph]) -> anyhow::Result<(Scatter, Scatter)> {
    let mut noise = CameraNoise::new(SEED);
    let (mut first, mut last) = (Vec::new(), Vec::new());
    for _ in 0..N_RUNS {
        let rows = rows(snake, &noisy(photographs, SIGMA_RAD, &mut noise));
        let (estimates, _) = recursion(&rows).context("a run with noise determines nothing")?;
        first.extend(estimates.first().copied());
        last.extend(estimates.last().copied());
    }
    Ok((Scatter::of(&first), Scatter::of(&last)))
}

impl Scatter {
    /// Mean and standard deviation of runs.
    pub fn of(runs: &[Vector2<f64>]) -> Self {
        let n = runs.len() as f64;
        let mean = runs.iter().sum::<Vector2<f64>>() / n;
        let square: Vector2<f64> = runs.iter().map(|r| (r - mean).component_mul(&(r - mean))).sum();
        let sd = (square / (n - 1.0)).map(f64::sqrt);
        Self { mean: (mean.x, mean.y), sd: (sd.x, sd.y) }
    }
}
