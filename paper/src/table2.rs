//! Table II: friction of the cone from ten pairs of weights, and what its errors really are.

use anyhow::Context;
use krait_model::MachineParameters;
use krait_model::oracle::{ConeFrictionFit, fit_cone_friction};
use krait_report::Spread;
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

/// The paper's Table II: weight at the snake's end, g, and at the actuator's end, g.
pub const PAIRS_G: [(f64, f64); 10] = [
    (0.0, 255.0),
    (100.0, 420.0),
    (200.0, 525.0),
    (300.0, 630.0),
    (400.0, 750.0),
    (500.0, 850.0),
    (700.0, 1150.0),
    (1000.0, 1500.0),
    (1500.0, 2150.0),
    (1800.0, 2600.0),
];
/// Standard acceleration of gravity, m/s2.
const G_STANDARD: f64 = 9.80665;
/// What the paper must have used to print its f_s, m/s2.
const G_OF_THE_PAPER: f64 = 10.0;

/// Values that the paper prints.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PrintedFriction {
    /// mu, 1.
    pub mu: f64,
    /// f_s, N.
    pub f_s_n: f64,
    /// Error of each weight, g.
    pub weight_error_g: f64,
    /// Error of a weight at the snake's end, g.
    pub small_weight_error_g: f64,
    /// df_s of Eq. (14), N.
    pub df_s_n: f64,
    /// dmu of Eq. (14), 1.
    pub dmu: f64,
}

/// The values beside Table II in the paper.
pub const PRINTED: PrintedFriction = PrintedFriction {
    mu: 0.1727,
    f_s_n: 1.959,
    weight_error_g: 25.0,
    small_weight_error_g: 1.0,
    df_s_n: 0.020,
    dmu: 0.0135,
};

/// mu and f_s with one opinion on how far the readings err.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StandardErrors {
    /// Of mu, 1.
    pub mu: f64,
    /// Of f_s, N.
    pub f_s_n: f64,
}

/// Eq. (14) with the paper's errors of both weights.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Eq14 {
    /// Both errors added, with g = 10 m/s2, N.
    pub df_s_n_with_g_10: f64,
    /// Subtracted as printed, with g = 10 m/s2, N.
    pub df_s_n_subtracted_with_g_10: f64,
    /// Added, with the standard g, N.
    pub df_s_n: f64,
    /// Subtracted, with the standard g, N.
    pub df_s_n_subtracted: f64,
    /// dmu of each row, added, 1.
    pub dmu_of_rows: [f64; 10],
    /// dmu of each row, subtracted as printed, 1.
    pub dmu_of_rows_subtracted: [f64; 10],
    /// dmu at the mean weights of the table, added, 1.
    pub dmu_of_mean_weights: f64,
    /// The load at the actuator for which 25 g alone give the printed dmu, g.
    pub tau_tilde_for_printed_dmu_g: f64,
}

/// The fit of Table II.
#[derive(Clone, Debug, Serialize)]
pub struct Table2 {
    /// The pairs, g.
    pub pairs_g: [(f64, f64); 10],
    /// What the paper prints.
    pub printed: PrintedFriction,
    /// Slope a of tau~ = a tau + c, 1.
    pub slope: f64,
    /// Intercept c, g.
    pub intercept_g: f64,
    /// mu = ln(a) / (2 phi), 1.
    pub mu: f64,
    /// f_s = c / a, g.
    pub f_s_g: f64,
    /// f_s with the standard g, N.
    pub f_s_n: f64,
    /// f_s with 10 m/s2, N.
    pub f_s_n_with_g_10: f64,
    /// What the line leaves over, row by row, g.
    pub residuals_g: [f64; 10],
    /// The same in one.
    pub residual_g: Spread,
    /// Standard deviation of a reading from the residuals (n - 2), g.
    pub reading_sd_g: f64,
    /// chi2 of the residuals with the printed errors of the weights, for 8 degrees of freedom.
    pub chi2: f64,
    /// Standard errors from the residuals.
    pub se: StandardErrors,
    /// Standard errors from the printed errors of the weights.
    pub se_of_25_g: StandardErrors,
    /// Correlation of mu and f_s, 1.
    pub correlation: f64,
    /// (mu, f_s in g) of the fit of logarithms, which counts relative errors.
    pub of_logarithms: (f64, f64),
    /// Eq. (14).
    pub eq_14: Eq14,
}

/// Fits the table.
pub fn fit(machine: &MachineParameters) -> anyhow::Result<Table2> {
    let phi_rad = machine.phi_rad;
    let fit = fit_cone_friction(&PAIRS_G, phi_rad).context("the pairs of Table II determine no friction")?;
    let residuals_g = PAIRS_G.map(|(x, y)| y - fit.slope * x - fit.intercept);
    let square_g2: f64 = residuals_g.iter().map(|r| r * r).sum();
    let reading_g2 = square_g2 / (PAIRS_G.len() - 2) as f64;
    let (big_g, small_g) = (PRINTED.weight_error_g, PRINTED.small_weight_error_g);
    let weights_g2 = big_g.powi(2) + (fit.slope * small_g).powi(2);
    let (se, correlation) = standard_errors(&fit, phi_rad, reading_g2)?;
    let (se_of_25_g, _) = standard_errors(&fit, phi_rad, weights_g2)?;
    Ok(Table2 {
        pairs_g: PAIRS_G,
        printed: PRINTED,
        slope: fit.slope,
        intercept_g: fit.intercept,
        mu: fit.mu,
        f_s_g: fit.f_s,
        f_s_n: newtons(fit.f_s),
        f_s_n_with_g_10: fit.f_s * 1e-3 * G_OF_THE_PAPER,
        residuals_g,
        residual_g: Spread::of(residuals_g),
        reading_sd_g: reading_g2.sqrt(),
        chi2: square_g2 / weights_g2,
        se,
        se_of_25_g,
        correlation,
        of_logarithms: fit_of_logarithms(phi_rad, &fit).context("the logarithms of Table II determine no friction")?,
        eq_14: eq_14(&fit, phi_rad),
    })
}

fn newtons(grams: f64) -> f64 {
    grams * 1e-3 * G_STANDARD
}

/// Standard errors of mu and f_s and their correlation, for readings of one variance, g2.
fn standard_errors(fit: &ConeFrictionFit, phi_rad: f64, variance_g2: f64) -> anyhow::Result<(StandardErrors, f64)> {
    let rows = PAIRS_G.map(|(x, _)| Vector2::new(x, 1.0));
    let normal: Matrix2<f64> = rows.iter().map(|h| h * h.transpose()).sum();
    let covariance = normal.try_inverse().context("Table II has one load only")? * variance_g2;
    let by_mu = Vector2::new(1.0 / (2.0 * phi_rad * fit.slope), 0.0);
    let by_f_s = Vector2::new(-fit.intercept / fit.slope.powi(2), 1.0 / fit.slope);
    let sd = |d: &Vector2<f64>| d.dot(&(covariance * d)).sqrt();
    let correlation = by_mu.dot(&(covariance * by_f_s)) / (sd(&by_mu) * sd(&by_f_s));
    Ok((StandardErrors { mu: sd(&by_mu), f_s_n: newtons(sd(&by_f_s)) }, correlation))
}

/// ln tau~ = 2 mu phi + ln(tau + f_s) by Gauss-Newton from the straight line's answer: (mu, f_s in g).
fn fit_of_logarithms(phi_rad: f64, start: &ConeFrictionFit) -> Option<(f64, f64)> {
    let mut x = Vector2::new(start.mu, start.f_s);
    for _ in 0..100 {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for (tau, tau_tilde) in PAIRS_G {
            let h = Vector2::new(2.0 * phi_rad, 1.0 / (tau + x.y));
            normal += h * h.transpose();
            right += h * (tau_tilde.ln() - 2.0 * x.x * phi_rad - (tau + x.y).ln());
        }
        let step = normal.try_inverse()? * right;
        x += step;
        if step.norm() < 1e-9 {
            return Some((x.x, x.y));
        }
    }
    None
}

fn eq_14(fit: &ConeFrictionFit, phi_rad: f64) -> Eq14 {
    let (big_g, small_g) = (PRINTED.weight_error_g, PRINTED.small_weight_error_g);
    let (added_g, subtracted_g) = (big_g / fit.slope + small_g, big_g / fit.slope - small_g);
    let dmu = |(tau, tau_tilde): (f64, f64), sign: f64| {
        (big_g / tau_tilde + sign * small_g / (fit.f_s + tau)) / (2.0 * phi_rad)
    };
    let n = PAIRS_G.len() as f64;
    let mean_g = PAIRS_G.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0 / n, sum.1 + pair.1 / n));
    Eq14 {
        df_s_n_with_g_10: added_g * 1e-3 * G_OF_THE_PAPER,
        df_s_n_subtracted_with_g_10: subtracted_g * 1e-3 * G_OF_THE_PAPER,
        df_s_n: newtons(added_g),
        df_s_n_subtracted: newtons(subtracted_g),
        dmu_of_rows: PAIRS_G.map(|pair| dmu(pair, 1.0)),
        dmu_of_rows_subtracted: PAIRS_G.map(|pair| dmu(pair, -1.0)),
        dmu_of_mean_weights: dmu(mean_g, 1.0),
        tau_tilde_for_printed_dmu_g: big_g / (PRINTED.dmu * 2.0 * phi_rad),
    }
}
