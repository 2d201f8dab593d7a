//! The slave's configuration, checked before anything moves.

use crate::{Limits, ShapeSource};
use krait_ipc::{LatencyLimits, WaitMode};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Everything that can be chosen about the slave. A key that is left out keeps its default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SlaveConfig {
    /// Truth file of the simulated snake; none: the built-in default snake (`sim/truth/default.toml`).
    pub truth: Option<PathBuf>,
    /// Who measures the shape. Default camera: the drive's own, where it has one; external: another program, which sends
    /// its shapes through `krait shape`.
    pub shape: ShapeSource,
    /// How the slave waits for commands. Default ahead: cores are shared, and commands come at a steady rate.
    pub wait: WaitMode,
    /// Whether the first `enable` also begins the search for zero. Default true.
    pub home_on_start: bool,
    /// Time without an acceptable command after which the slave is held, ms; 5 to 1000. Default 50 ms: longer than a
    /// scheduling hiccup, shorter than a surgeon's reaction.
    pub watchdog_ms: f64,
    /// How hard the slave brakes when it stops by itself, m/s2; 0.05 to 20. Default 1 m/s2: the largest speed is gone
    /// after 30 ms and 0.45 mm, a hand's usual 3 mm/s after 3 ms and 5 um.
    pub deceleration_m_per_s2: f64,
    /// Limits of the machine.
    pub limits: Limits,
    /// A command that took longer is counted and named. Given by the program from its budget, not by this table.
    #[serde(skip)]
    pub latency_limits: LatencyLimits,
}

impl Default for SlaveConfig {
    fn default() -> Self {
        Self {
            truth: None,
            shape: ShapeSource::Camera,
            wait: WaitMode::Ahead,
            home_on_start: true,
            watchdog_ms: 50.0,
            deceleration_m_per_s2: 1.0,
            limits: Limits::default(),
            latency_limits: LatencyLimits::default(),
        }
    }
}

/// The configuration was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A value outside its range.
    #[error(
        "slave configuration: {key} is {found}, expected {low} to {high}; correct it, or delete it to use the default"
    )]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// Smallest allowed value.
        low: f64,
        /// Largest allowed value.
        high: f64,
        /// The value found.
        found: f64,
    },
    /// A stop would outlast the watchdog.
    #[error(
        "slave configuration: stopping from limits.rate_m_per_s {rate_m_per_s} at deceleration_m_per_s2 {deceleration_m_per_s2} takes {stop_ms:.1} ms, expected less than watchdog_ms {watchdog_ms} less 2 ms; raise the deceleration or the watchdog"
    )]
    StopTooLong {
        /// Largest speed, m/s.
        rate_m_per_s: f64,
        /// Deceleration, m/s2.
        deceleration_m_per_s2: f64,
        /// How long the stop takes, ms.
        stop_ms: f64,
        /// The watchdog's limit, ms.
        watchdog_ms: f64,
    },
}

impl SlaveConfig {
    /// Checks every value and that the values fit each other.
    ///
    /// # Errors
    /// [`ConfigError::OutOfRange`] or [`ConfigError::StopTooLong`].
    pub fn check(&self) -> Result<(), ConfigError> {
        let l = &self.limits;
        let ranges = [
            ("watchdog_ms", self.watchdog_ms, 5.0, 1000.0),
            ("deceleration_m_per_s2", self.deceleration_m_per_s2, 0.05, 20.0),
            ("limits.stroke_m", l.stroke_m, 1e-4, 0.02),
            ("limits.rate_m_per_s", l.rate_m_per_s, 1e-4, 0.5),
            ("limits.acceleration_m_per_s2", l.acceleration_m_per_s2, self.deceleration_m_per_s2, 1000.0),
            ("limits.jerk_m_per_s3", l.jerk_m_per_s3, 100.0, 1e7),
            ("limits.pull_n", no_limit_is_fine(l.pull_n), 1.0, 500.0),
            ("limits.push_n", no_limit_is_fine(l.push_n), 1.0, 500.0),
            ("limits.step_m", l.step_m, 1e-5, 5e-3),
            ("limits.engage_m", l.engage_m, 1e-6, l.step_m),
            ("limits.command_age_ms", l.command_age_ms, 1.0, 1000.0),
            ("limits.late_ms", l.late_ms, 1.0, l.command_age_ms),
            ("limits.following_error_m", l.following_error_m, 1e-5, 5e-3),
        ];
        for (key, found, low, high) in ranges {
            // Written so that NaN is out of range.
            if !(low..=high).contains(&found) {
                return Err(ConfigError::OutOfRange { key, low, high, found });
            }
        }
        let stop_ms = 1e3 * l.rate_m_per_s / self.deceleration_m_per_s2;
        if stop_ms + 2.0 > self.watchdog_ms {
            return Err(ConfigError::StopTooLong {
                rate_m_per_s: l.rate_m_per_s,
                deceleration_m_per_s2: self.deceleration_m_per_s2,
                stop_ms,
                watchdog_ms: self.watchdog_ms,
            });
        }
        Ok(())
    }
}

/// `inf` says that loads are not measured, and passes every range.
fn no_limit_is_fine(load_n: f64) -> f64 {
    if load_n == f64::INFINITY { 1.0 } else { load_n }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_configuration_is_in_range_and_an_empty_text_gives_it() {
        SlaveConfig::default().check().unwrap();
        assert_eq!(toml::from_str::<SlaveConfig>("").unwrap(), SlaveConfig::default());
    }

    #[test]
    fn unknown_keys_and_values_out_of_range_are_refused_by_name() {
        let sentence = toml::from_str::<SlaveConfig>("watchdog = 3").unwrap_err().to_string();
        assert!(sentence.contains("watchdog_ms"), "{sentence}");
        for (text, key) in [
            ("watchdog_ms = 0.0", "watchdog_ms"),
            ("watchdog_ms = nan", "watchdog_ms"),
            ("[limits]\npull_n = -1.0", "limits.pull_n"),
            ("[limits]\npush_n = nan", "limits.push_n"),
            ("[limits]\nengage_m = 0.001", "limits.engage_m"),
        ] {
            let config: SlaveConfig = toml::from_str(text).unwrap();
            let sentence = config.check().unwrap_err().to_string();
            assert!(sentence.contains(key), "{sentence}");
        }
    }

    #[test]
    fn a_stop_that_outlasts_the_watchdog_is_refused() {
        let config = SlaveConfig { watchdog_ms: 20.0, ..SlaveConfig::default() };
        assert!(matches!(config.check(), Err(ConfigError::StopTooLong { .. })));
    }
}
