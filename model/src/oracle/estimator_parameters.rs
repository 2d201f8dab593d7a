//! Settings of the estimator, each with its unit, range, default and reason.

use crate::ParameterError;
use crate::parameters::in_range;
use core::f64::consts::PI;
use serde::{Deserialize, Serialize};

/// Settings of an [`super::Estimator`]. Every key is optional.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EstimatorParameters {
    /// Load scale at the start, 1, within its bounds; default 1.
    pub eta: f64,
    /// Half-width of the play at the start, m, within its bounds; default 0.
    pub lambda_m: f64,
    /// Standard deviation of eta at the start, 1, 1e-6 to 10; default 0.3. Fading memory never exceeds it.
    pub eta_sd: f64,
    /// Standard deviation of lambda at the start, m, 1e-9 to 0.001; default 0.1 mm. Fading memory never exceeds it.
    pub lambda_sd_m: f64,
    /// Standard deviation of each component of a measured bend vector, rad, 1e-6 to 0.2; default 0.3 deg.
    pub sigma_bend_rad: f64,
    /// Time after which a measurement weighs 1/e, s of motion, 0.5 to infinity; default 20.
    pub memory_s: f64,
    /// Smallest eta, 1, 0.1 to 10; default 0.5.
    pub eta_min: f64,
    /// Largest eta, 1, `eta_min` to 10; default 2.5.
    pub eta_max: f64,
    /// Largest lambda, m, 0 to 0.002; default 0.3 mm. The smallest is 0.
    pub lambda_max_m: f64,
    /// Distance from its prediction at which a measurement is left out, standard deviations, 2 to 100; default 6.
    pub outlier_sigmas: f64,
    /// Travel of an encoder that is taken for noise, m, 0 to 0.0001; default 2 micrometres.
    pub dead_travel_m: f64,
    /// Travel since the last used measurement below which the snake counts as at rest, m, 0 to 0.001; default 20 micrometres.
    pub rest_travel_m: f64,
}

impl Default for EstimatorParameters {
    fn default() -> Self {
        Self {
            eta: 1.0,
            lambda_m: 0.0,
            eta_sd: 0.3,
            lambda_sd_m: 0.1e-3,
            sigma_bend_rad: 0.3 * PI / 180.0,
            memory_s: 20.0,
            eta_min: 0.5,
            eta_max: 2.5,
            lambda_max_m: 0.3e-3,
            outlier_sigmas: 6.0,
            dead_travel_m: 2e-6,
            rest_travel_m: 20e-6,
        }
    }
}

impl EstimatorParameters {
    /// Checks every value.
    ///
    /// # Errors
    /// [`ParameterError`] naming the first key that is not finite or out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        in_range("eta_min", self.eta_min, 0.1, 10.0, "(no unit)")?;
        in_range("eta_max", self.eta_max, self.eta_min, 10.0, "(no unit)")?;
        in_range("lambda_max_m", self.lambda_max_m, 0.0, 2e-3, "m")?;
        in_range("eta", self.eta, self.eta_min, self.eta_max, "(no unit)")?;
        in_range("lambda_m", self.lambda_m, 0.0, self.lambda_max_m, "m")?;
        in_range("eta_sd", self.eta_sd, 1e-6, 10.0, "(no unit)")?;
        in_range("lambda_sd_m", self.lambda_sd_m, 1e-9, 1e-3, "m")?;
        in_range("sigma_bend_rad", self.sigma_bend_rad, 1e-6, 0.2, "rad")?;
        in_range("memory_s", self.memory_s, 0.5, f64::INFINITY, "s")?;
        in_range("outlier_sigmas", self.outlier_sigmas, 2.0, 100.0, "standard deviations")?;
        in_range("dead_travel_m", self.dead_travel_m, 0.0, 1e-4, "m")?;
        in_range("rest_travel_m", self.rest_travel_m, 0.0, 1e-3, "m")
    }
}
