//! The slave's configuration, checked before anything moves.

use crate::{DriveConfig, Limits, ShapeSource};
use krait_ipc::setting::{SettingError, check};
use krait_ipc::{LatencyLimits, WaitMode, settings};
use std::path::PathBuf;

settings! {
    /// Everything that can be chosen about the slave. A key that is left out keeps its default.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SlaveConfig in "slave" {
        /// Truth file of the simulated snake; none: the built-in default snake (`sim/truth/default.toml`).
        truth: Option<PathBuf> = None;
        /// Who measures the shape. "camera": the drive's own, where it has one; "external": another program, which sends
        /// its shapes through `krait shape`.
        shape: ShapeSource = ShapeSource::Camera;
        /// How the slave waits for commands. "ahead": cores are shared, and commands come at a steady rate.
        wait: WaitMode = WaitMode::Ahead;
        /// Whether the first `enable` also begins the search for zero.
        home_on_start: bool = true;
        /// Time without an acceptable command after which the slave is held, ms. 50 ms: longer than a scheduling hiccup,
        /// shorter than a surgeon's reaction.
        watchdog_ms: f64 = 50.0, 5.0..=1000.0;
        /// How hard the slave brakes when it stops by itself, m/s2. 1 m/s2: the largest speed is gone after 30 ms and
        /// 0.45 mm, a hand's usual 3 mm/s after 3 ms and 5 um.
        deceleration_m_per_s2: f64 = 1.0, 0.05..=20.0;
        /// Limits of the machine.
        limits: Limits = Limits::default();
        /// The drives.
        drive: DriveConfig = DriveConfig::default();
        /// A command that took longer is counted and named. Given by the program from its budget, not by this table.
        #[serde(skip)]
        latency_limits: LatencyLimits = LatencyLimits::default();
    }
}

/// The configuration was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A value outside its range.
    #[error(transparent)]
    OutOfRange(#[from] SettingError),
    /// A stop would outlast the watchdog.
    #[error(
        "[slave]: stopping from limits.rate_m_per_s {rate_m_per_s} at deceleration_m_per_s2 {deceleration_m_per_s2} takes {stop_ms:.1} ms, expected less than watchdog_ms {watchdog_ms} less 2 ms; raise the deceleration or the watchdog"
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
    /// The drives' table does not fit.
    #[error("[slave.drive]: {what}")]
    Drives {
        /// What does not.
        what: String,
    },
    /// A limit asks for more than the drives can do.
    #[error("[slave.limits] {key} = {found}: these drives can do {able:.4} {unit} at most; {advice}")]
    BeyondDrives {
        /// The limit.
        key: &'static str,
        /// What it is.
        found: f64,
        /// What the drives can do.
        able: f64,
        /// Unit of both.
        unit: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// The encoders would be behind the setpoint by more than what is a fault.
    #[error(
        "[slave.limits] following_error_m = {following_error_m}: at rate_m_per_s {rate_m_per_s} these drives are {behind_m:.5} m behind, because their readings come {delay_ms:.1} ms late; raise it, or lower rate_m_per_s"
    )]
    AlwaysBehind {
        /// The limit, m.
        following_error_m: f64,
        /// Distance at the largest speed, m.
        behind_m: f64,
        /// The largest speed, m/s.
        rate_m_per_s: f64,
        /// From a wish to its reading, ms.
        delay_ms: f64,
    },
    /// Loads are limited that nobody measures.
    #[error(
        "[slave.limits] pull_n = {pull_n}, push_n = {push_n}: these drives do not measure loads, and motion would be refused; set both to inf and bound the load in the drives"
    )]
    LoadsNotMeasured {
        /// The limit, N.
        pull_n: f64,
        /// The other, N.
        push_n: f64,
    },
    /// The same for a gripper's wire.
    #[error(
        "[slave.limits] jaw_n = {jaw_n}: these drives do not measure the load of the jaw's wire, and motion would be refused; set it to inf and bound the load in the drive (torque_limit)"
    )]
    JawLoadNotMeasured {
        /// The limit, N.
        jaw_n: f64,
    },
}

impl SlaveConfig {
    /// Checks every value and that the values fit each other.
    ///
    /// # Errors
    /// [`ConfigError::OutOfRange`] or [`ConfigError::StopTooLong`].
    pub fn check(&self) -> Result<(), ConfigError> {
        self.check_ranges()?;
        let l = &self.limits;
        l.check()?;
        self.drive.check()?;
        self.check_own_limits()?;
        let table = Limits::TABLE;
        let fastest = l.acceleration_m_per_s2;
        check((table, "acceleration_m_per_s2"), fastest, (self.deceleration_m_per_s2, 1000.0), 20)?;
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
            ("[limits]\npull_n = -1.0", "[slave.limits] pull_n"),
            ("[limits]\npush_n = nan", "[slave.limits] push_n"),
            ("[limits]\nengage_m = 0.001", "[slave.limits] engage_m"),
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
