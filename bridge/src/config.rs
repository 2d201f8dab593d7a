//! What can be set about the bridge: every value with its unit, default, range and reason.

use core::ops::RangeInclusive;
use krait_ipc::WaitMode;
use serde::{Deserialize, Serialize};

/// A value is outside its range.
#[derive(Debug, thiserror::Error, PartialEq)]
#[error("[{section}] {key} = {found}: expected {low} to {high}; {why}")]
pub struct ConfigError {
    /// Table of the configuration file.
    pub section: &'static str,
    /// Key in that table.
    pub key: &'static str,
    /// What was given.
    pub found: f64,
    /// Smallest value that is allowed.
    pub low: f64,
    /// Largest value that is allowed.
    pub high: f64,
    /// Why the range is what it is.
    pub why: &'static str,
}

/// One check of one key.
type Check = (&'static str, f64, RangeInclusive<f64>, &'static str);

fn check_all(section: &'static str, checks: &[Check]) -> Result<(), ConfigError> {
    for (key, found, range, why) in checks {
        if !range.contains(found) {
            let (low, high) = (*range.start(), *range.end());
            return Err(ConfigError { section, key, found: *found, low, high, why });
        }
    }
    Ok(())
}

/// `resolve`: limits of the operator's motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ResolveConfig {
    /// Largest bend, rad. 1.31 rad (75 deg) keeps the outer fibre of the tubes below 1.7 % strain.
    pub max_bend_rad: f64,
    /// The outward part of the motion fades out over this much bend before the limit, rad.
    pub bend_margin_rad: f64,
    /// Fastest bending, rad/s.
    pub max_bend_vel_rad_per_s: f64,
    /// Largest change of the bending rate, rad/s^2; every stop and start is at most this sharp.
    pub max_bend_accel_rad_per_s2: f64,
    /// How much the axial component of the wanted tip velocity counts beside the lateral ones, 0..=1. 0: a hand that pushes
    /// sideways gets exactly that, and the tip sinks as its arc makes it; 1: least squares over all three components.
    pub axial_weight: f64,
    /// Damping of the least-squares inverse of the tip Jacobian, m/rad.
    pub damping_m_per_rad: f64,
    /// Roll of the camera's view about the snake's straight axis, rad: `base_from_view` = Rz(view_roll_rad).
    pub view_roll_rad: f64,
    /// An operator input older than this when it is taken is not followed, ms.
    pub input_stale_ms: f64,
    /// A slave state older than this is not trusted, ms.
    pub state_stale_ms: f64,
    /// How the process waits for operator input.
    pub wait: WaitMode,
}

impl Default for ResolveConfig {
    fn default() -> Self {
        Self {
            max_bend_rad: 75f64.to_radians(),
            bend_margin_rad: 4f64.to_radians(),
            max_bend_vel_rad_per_s: 2.0,
            max_bend_accel_rad_per_s2: 40.0,
            axial_weight: 0.0,
            damping_m_per_rad: 0.5e-3,
            view_roll_rad: 0.0,
            input_stale_ms: 50.0,
            state_stale_ms: 100.0,
            wait: WaitMode::Ahead,
        }
    }
}

impl ResolveConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        check_all(
            "resolve",
            &[
                ("max_bend_rad", self.max_bend_rad, 0.05..=1.6, "the model holds up to 90 deg of bend"),
                ("bend_margin_rad", self.bend_margin_rad, 0.001..=0.5, "the motion must fade out over some bend"),
                ("max_bend_vel_rad_per_s", self.max_bend_vel_rad_per_s, 0.01..=10.0, "a snake bends at most this fast"),
                ("max_bend_accel_rad_per_s2", self.max_bend_accel_rad_per_s2, 0.1..=1000.0, "a stop takes some time"),
                ("axial_weight", self.axial_weight, 0.0..=1.0, "1 counts like a lateral component"),
                ("damping_m_per_rad", self.damping_m_per_rad, 0.0..=0.02, "more damping than L moves nothing"),
                ("view_roll_rad", self.view_roll_rad, -3.2..=3.2, "an angle in radians"),
                ("input_stale_ms", self.input_stale_ms, 1.0..=1000.0, "older input is not the operator's wish"),
                ("state_stale_ms", self.state_stale_ms, 1.0..=1000.0, "older state says nothing about now"),
            ],
        )
    }
}

/// `compensate`: the limits of the actuator command.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CompensateConfig {
    /// Fastest change of a learnt value while an update is blended in, prior standard deviations per second.
    pub blend_sds_per_s: f64,
    /// Speed at which a difference to the slave's setpoint is eased out at engagement, m/s.
    pub ease_m_per_s: f64,
    /// Actuator stroke, m: |q~| at most. A bend of 80 deg needs 4.98 mm on the default machine.
    pub max_stroke_m: f64,
    /// Actuator rate, m/s.
    pub max_rate_m_per_s: f64,
    /// Load of a line by the model, N: |tau| at most. A bend of 80 deg needs 48 N on the default machine.
    pub max_load_n: f64,
    /// A setpoint older than this when it is taken is not followed, ms.
    pub setpoint_stale_ms: f64,
    /// A slave state older than this is not trusted, ms.
    pub state_stale_ms: f64,
    /// How the process waits for setpoints.
    pub wait: WaitMode,
}

impl Default for CompensateConfig {
    fn default() -> Self {
        Self {
            blend_sds_per_s: 0.6,
            ease_m_per_s: 1e-3,
            max_stroke_m: 5.2e-3,
            max_rate_m_per_s: 20e-3,
            max_load_n: 55.0,
            setpoint_stale_ms: 50.0,
            state_stale_ms: 100.0,
            wait: WaitMode::Ahead,
        }
    }
}

impl CompensateConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        check_all(
            "compensate",
            &[
                ("blend_sds_per_s", self.blend_sds_per_s, 1e-3..=10.0, "a model changes smoothly"),
                ("ease_m_per_s", self.ease_m_per_s, 1e-5..=20e-3, "an engagement is eased in"),
                ("max_stroke_m", self.max_stroke_m, 0.1e-3..=20e-3, "the actuators' stroke"),
                ("max_rate_m_per_s", self.max_rate_m_per_s, 0.1e-3..=0.2, "the actuators' rate"),
                ("max_load_n", self.max_load_n, 1.0..=200.0, "a line buckles or yields beyond it"),
                ("setpoint_stale_ms", self.setpoint_stale_ms, 1.0..=1000.0, "older setpoints are not followed"),
                ("state_stale_ms", self.state_stale_ms, 1.0..=1000.0, "older state says nothing about now"),
            ],
        )
    }
}

/// `estimate`: what it assumes of the measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EstimateConfig {
    /// Standard deviation of each axis of the measured bend vector, rad, where the camera states none.
    pub sigma_bend_rad: f64,
    /// Largest distance of a measurement from its prediction, standard deviations.
    pub outlier_sigmas: f64,
    /// A shape whose encoders are further away in time than this is left out, ms.
    pub max_state_gap_ms: f64,
    /// How often "something has changed" may be said per hour of motion though nothing has, 1/h.
    pub false_alarms_per_hour: f64,
    /// Motion from which is learnt how well the model explains the camera before a change can be seen, s.
    pub learn_s: f64,
}

impl Default for EstimateConfig {
    fn default() -> Self {
        Self {
            sigma_bend_rad: 0.3f64.to_radians(),
            outlier_sigmas: 6.0,
            max_state_gap_ms: 5.0,
            false_alarms_per_hour: 1.0,
            learn_s: 30.0,
        }
    }
}

impl EstimateConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        check_all(
            "estimate",
            &[
                ("sigma_bend_rad", self.sigma_bend_rad, 1e-5..=0.2, "a camera sees a bend to 0.001 to 10 deg"),
                ("outlier_sigmas", self.outlier_sigmas, 2.0..=100.0, "fewer would refuse good measurements"),
                ("max_state_gap_ms", self.max_state_gap_ms, 0.1..=100.0, "encoders and camera must be of one instant"),
                (
                    "false_alarms_per_hour",
                    self.false_alarms_per_hour,
                    1e-4..=1e3,
                    "rarer means later, never means never",
                ),
                ("learn_s", self.learn_s, 2.0..=600.0, "what is normal takes some motion to learn"),
            ],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_in_range() {
        ResolveConfig::default().check().expect("resolve");
        CompensateConfig::default().check().expect("compensate");
        EstimateConfig::default().check().expect("estimate");
    }

    #[test]
    fn a_value_out_of_range_is_named_with_its_range() {
        let error = ResolveConfig { max_bend_rad: 60.0, ..ResolveConfig::default() }.check().expect_err("60 rad");
        assert!(error.to_string().starts_with("[resolve] max_bend_rad = 60: expected 0.05 to 1.6;"), "{error}");
        let error = CompensateConfig { max_load_n: f64::NAN, ..CompensateConfig::default() }.check().expect_err("NaN");
        assert_eq!(error.key, "max_load_n");
    }
}
