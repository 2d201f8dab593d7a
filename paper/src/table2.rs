//! Table II: friction of the cone from ten pairs of weights, and what its errors really are.

use anyhow::Context;
use krait_model::MachineParameters;
use krait_model::oracle::fit_cone_friction;
use krait_report::Spread;
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
pub struct Printed {
    /// mu, 1.
    pub mu: f64,
    /// f_s, N.
    pub f_s_n: f64,
    /// Error of each weight, g.
    pub weight_error_g: f64,
    /// df_s of Eq. (14), N.
    pub df_s_n: f64,
}

/// The values beside Table II in the paper.
pub const PRINTED: Printed = Printed { mu: 0.1727, f_s_n: 1.959, weight_error_g: 25.0, df_s_n: 0.020 };

/// The fit of Table II.
#[derive(Clone, Debug, Serialize)]
pub struct Table2 {
    /// The pairs, g.
    pub pairs_g: [(f64, f64); 10],
    /// What the paper prints.
    pub printed: Printed,
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
    /// What the line leaves over, g.
    pub residual_g: Spread,
    /// Eq. (14) for the printed error of the weight at the actuator alone: e^(-2 mu phi) dtau~, N.
    pub df_s_of_one_weight_n: f64,
    /// The same for the root mean square of the residuals, N.
    pub df_s_of_residual_n: f64,
    /// The same with the printed error in both weights, which add, N.
    pub df_s_of_both_weights_n: f64,
}

/// Fits the table.
pub fn fit(machine: &MachineParameters) -> anyhow::Result<Table2> {
    let fit = fit_cone_friction(&PAIRS_G, machine.phi_rad).context("the pairs of Table II determine no friction")?;
    let residuals: Vec<f64> = PAIRS_G.iter().map(|(x, y)| y - fit.slope * x - fit.intercept).collect();
    let newtons = |grams: f64| grams * 1e-3 * G_STANDARD;
    let residual_g = Spread::of(&residuals);
    Ok(Table2 {
        pairs_g: PAIRS_G,
        printed: PRINTED,
        slope: fit.slope,
        intercept_g: fit.intercept,
        mu: fit.mu,
        f_s_g: fit.f_s,
        f_s_n: newtons(fit.f_s),
        f_s_n_with_g_10: fit.f_s * 1e-3 * G_OF_THE_PAPER,
        residual_g,
        df_s_of_one_weight_n: newtons(PRINTED.weight_error_g) / fit.slope,
        df_s_of_residual_n: newtons(residual_g.rms) / fit.slope,
        df_s_of_both_weights_n: newtons(PRINTED.weight_error_g) * (1.0 + 1.0 / fit.slope),
    })
}
