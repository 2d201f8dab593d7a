//! What the measured bend on both sides of Eq. (20) costs, and that the predicted bend does not: many runs over three ranges.

use crate::fit::{KRAITS_PRIOR, Loads, Photograph, Prior, fit};
use crate::line_1::{Scatter, noisy, photographs};
use crate::noise::CameraNoise;
use anyhow::Context;
use krait_model::Snake;
use krait_sim::Truth;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// Runs of each row.
const N_RUNS: u32 = 2000;
/// Seed of the noise, the same for every row.
const SEED: u64 = 11;
/// Bends at which the compensated bend is compared, deg.
const AT_DEG: [f64; 2] = [30.0, 80.0];

/// A range of photographs.
struct Range {
    name: &'static str,
    sigma_deg: f64,
    commanded_deg: [f64; 10],
}

/// One way to estimate on one range.
#[derive(Clone, Debug, Serialize)]
pub struct BiasRow {
    /// The photographs.
    pub range: &'static str,
    /// Which bend stands in the load, and what was believed before.
    pub method: &'static str,
    /// The loads are at the predicted bend.
    pub predicted: bool,
    /// krait's prior was used.
    pub with_prior: bool,
    /// eta, and half-width in mm, over the runs.
    pub found: Scatter,
    /// Runs in which both were determined.
    pub n_runs: u32,
    /// Mean error of the bend compensated with the estimate, deg, at 30 and at 80 deg.
    pub bend_error_deg: [f64; 2],
    /// What the prior moves the mean by: eta, and half-width in mm; 0 without.
    pub pull_of_the_prior: (f64, f64),
}

/// Every method on every range.
pub fn study(snake: &Snake, truth: &Truth) -> anyhow::Result<Vec<BiasRow>> {
    let wide = core::array::from_fn(|k| 17.0 + 7.0 * k as f64);
    let short = [12.0, 19.0, 22.0, 24.5, 27.5, 29.5, 31.5, 35.0, 23.0, 20.0];
    let ranges = [
        Range { name: "9 to 29 deg, noise 1 deg", sigma_deg: 1.0, commanded_deg: short },
        Range { name: "13 to 70 deg, noise 1 deg", sigma_deg: 1.0, commanded_deg: wide },
        Range { name: "13 to 70 deg, noise 0.3 deg", sigma_deg: 0.3, commanded_deg: wide },
    ];
    let mut rows = Vec::new();
    for range in &ranges {
        let clean = photographs(snake, truth, &range.commanded_deg, 0.0)?;
        let sigma_rad = range.sigma_deg.to_radians();
        for loads in [Loads::AtMeasuredBend, Loads::AtPredictedBend] {
            let plain = row(snake, truth, range, &clean, sigma_rad, loads, None)?;
            let mut prior = row(snake, truth, range, &clean, sigma_rad, loads, Some(KRAITS_PRIOR))?;
            let (with, without) = (prior.found.mean, plain.found.mean);
            prior.pull_of_the_prior = (with.0 - without.0, with.1 - without.1);
            rows.extend([plain, prior]);
        }
    }
    Ok(rows)
}

fn row(
    snake: &Snake,
    truth: &Truth,
    range: &Range,
    clean: &[Photograph],
    sigma_rad: f64,
    loads: Loads,
    prior: Option<Prior>,
) -> anyhow::Result<BiasRow> {
    let mut noise = CameraNoise::new(SEED);
    let runs: Vec<Vector2<f64>> = (0..N_RUNS)
        .filter_map(|_| fit(snake, &noisy(clean, sigma_rad, &mut noise), sigma_rad, loads, prior))
        .map(|fit| fit.value)
        .collect();
    anyhow::ensure!(runs.len() > 1, "no run of {} determined eta and play", range.name);
    let mut found = Scatter::of(&runs);
    (found.mean.1, found.sd.1) = (found.mean.1 * 1e3, found.sd.1 * 1e3);
    let mut bend_error_deg = [0.0; 2];
    for (error, at_deg) in bend_error_deg.iter_mut().zip(AT_DEG) {
        let sum: f64 = runs
            .iter()
            .map(|run| compensated_error_deg(snake, truth, *run, at_deg))
            .sum::<Option<f64>>()
            .context("a compensated bend lies beyond pi")?;
        *error = sum / runs.len() as f64;
    }
    let method = match (loads, prior.is_some()) {
        (Loads::AtMeasuredBend, false) => "measured bend",
        (Loads::AtMeasuredBend, true) => "measured bend, prior",
        (Loads::AtPredictedBend, false) => "predicted bend",
        (Loads::AtPredictedBend, true) => "predicted bend, prior",
    };
    Ok(BiasRow {
        range: range.name,
        method,
        predicted: loads == Loads::AtPredictedBend,
        with_prior: prior.is_some(),
        found,
        n_runs: runs.len() as u32,
        bend_error_deg,
        pull_of_the_prior: (0.0, 0.0),
    })
}

/// What a bend at delta = 0 comes out too large by, deg, when it is compensated with an estimate: to first order.
fn compensated_error_deg(snake: &Snake, truth: &Truth, estimate: Vector2<f64>, at_deg: f64) -> Option<f64> {
    let b = Vector2::new(at_deg.to_radians(), 0.0);
    let signs: Vector3<f64> = snake.q(b).map(f64::signum);
    let of = |eta, half_width_m| snake.extension_with_signs(b, eta, half_width_m, &signs);
    let own = of(truth.effects.load_scale, 0.5 * truth.effects.play_m);
    let k = snake.j_bend_q() * (snake.j_q_bend() + own.alpha_m_per_rad);
    let told_m = of(estimate.x, estimate.y).eps_m - own.eps_m;
    Some((k.try_inverse()? * (snake.j_bend_q() * told_m)).x.to_degrees())
}
