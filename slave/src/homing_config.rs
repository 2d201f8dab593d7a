//! How an actuator finds its zero at a mechanical stop: `homing` of `[[slave.drive.actuator]]`.

use crate::{ConfigError, Limits};
use krait_ipc::setting::check;
use serde::{Deserialize, Serialize};

/// The table, as an error names it.
const TABLE: &str = "slave.drive.actuator.homing";
/// The search is never faster than this, m/s.
const MOST_M_PER_S: f64 = 2e-3;
/// Nor than this part of what the limiter allows.
const RATE_PART: f64 = 0.5;

/// Ways to find a zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HomingMethod {
    /// The actuator goes slowly to a stop and knows it by its load.
    StopByLoad,
}

/// Where the stop is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HomingDirection {
    /// Where the line is pushed.
    Push,
    /// Where it is pulled.
    Pull,
}

impl HomingDirection {
    /// 1 where the line is pushed, -1 where it is pulled.
    pub fn sign(self) -> f64 {
        match self {
            Self::Push => 1.0,
            Self::Pull => -1.0,
        }
    }
}

/// A search for a stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HomingConfig {
    /// How.
    pub method: HomingMethod,
    /// Where to.
    pub direction: HomingDirection,
    /// Load against the stop, N, and at most that of any other actuator meanwhile.
    pub load_n: f64,
    /// Speed, m/s.
    pub rate_m_per_s: f64,
    /// The stop must come within this way, m.
    pub travel_limit_m: f64,
    /// From the stop so far back is zero, m.
    pub back_off_m: f64,
}

impl HomingConfig {
    /// Checks ranges, and that the limits let the load come about.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        check((TABLE, "load_n"), self.load_n, (0.1, 500.0), "none")?;
        check((TABLE, "rate_m_per_s"), self.rate_m_per_s, (1e-5, MOST_M_PER_S), "none")?;
        check((TABLE, "travel_limit_m"), self.travel_limit_m, (1e-4, 0.1), "none")?;
        check((TABLE, "back_off_m"), self.back_off_m, (1e-4, self.travel_limit_m), "none")?;
        Ok(())
    }

    /// Whether the machine has room for the search of the `actuator`-th, from 1: its load, its speed and its way. The limits are that
    /// actuator's, [`crate::SlaveConfig::limits_of`].
    ///
    /// # Errors
    /// [`ConfigError::Drives`].
    pub fn fits(&self, limits: &Limits, actuator: usize) -> Result<(), ConfigError> {
        let (key, limit_n) = match self.direction {
            HomingDirection::Push => ("push_n", limits.push_n),
            HomingDirection::Pull => ("pull_n", limits.pull_n),
        };
        let refused = |what: String| Err(ConfigError::Drives { what: format!("actuator {actuator}: homing.{what}") });
        if self.load_n >= limit_n {
            return refused(format!(
                "load_n = {}: expected less than {key} = {limit_n}, its limit, beyond which nothing presses; lower it",
                self.load_n
            ));
        }
        // The limiter must never slow it down: an encoder that stands for that reason would look like one at a stop.
        let most_m_per_s = RATE_PART * limits.rate_m_per_s;
        if self.rate_m_per_s > most_m_per_s {
            return refused(format!(
                "rate_m_per_s = {}: expected at most {most_m_per_s}, half of its limit; lower it",
                self.rate_m_per_s
            ));
        }
        let most_m = 2.0 * limits.stroke_m;
        if self.travel_limit_m > most_m {
            return refused(format!(
                "travel_limit_m = {}: expected at most {most_m}, from one end of limits.stroke_m to the other; lower it",
                self.travel_limit_m
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DriveConfig;

    const STOP: &str = "homing = { method = \"stop_by_load\", direction = \"pull\", load_n = 8.0, rate_m_per_s = 0.0005, \
                        travel_limit_m = 0.004, back_off_m = 0.001 }";

    fn checked(bus: &str, homing: &str) -> Result<DriveConfig, String> {
        let text = format!("{bus}[[actuator]]\nid = 1\nvendor = 1\nproduct = 1\n{homing}\n");
        let text = if bus.contains("port") { text.replace("vendor = 1\nproduct = 1\n", "") } else { text };
        let config: DriveConfig = toml::from_str(&text).map_err(|error| error.to_string())?;
        config.check().map_err(|error| error.to_string())?;
        Ok(config)
    }

    #[test]
    fn a_search_for_a_stop_is_whole_in_range_and_for_serial_servos() {
        let serial = "kind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n";
        for kind in [serial, "kind = \"xl330\"\nport = \"/dev/ttyUSB0\"\n"] {
            let homing = checked(kind, STOP).unwrap().actuator[0].homing.unwrap();
            assert_eq!((homing.direction.sign(), homing.load_n), (-1.0, 8.0));
        }
        for (homing, words) in [
            (STOP.replace("load_n = 8.0", "load_n = 0.0"), "load_n = 0"),
            (STOP.replace("0.0005", "0.01"), "rate_m_per_s = 0.01"),
            (STOP.replace("0.004", "nan"), "travel_limit_m = NaN"),
            (STOP.replace("back_off_m = 0.001", "back_off_m = 0.005"), "back_off_m = 0.005: expected 0.0001 to 0.004"),
            (STOP.replace(", back_off_m = 0.001", ""), "back_off_m"),
            (STOP.replace("stop_by_load", "switch"), "stop_by_load"),
            (STOP.replace("load_n", "load"), "load"),
        ] {
            let sentence = checked(serial, &homing).unwrap_err();
            assert!(sentence.contains(words), "{sentence}");
        }
        let can = checked("kind = \"cia402\"\ninterface = \"can0\"\n", STOP).unwrap_err();
        assert!(can.contains("actuator 1: homing is of drives of kind \"sts3215\""), "{can}");
    }

    #[test]
    fn a_search_that_the_machine_has_no_room_for_is_refused() {
        let homing =
            checked("kind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n", STOP).unwrap().actuator[0].homing.unwrap();
        assert_eq!(homing.fits(&Limits { push_n: 1.0, ..Limits::default() }, 2), Ok(()));
        for (limits, words) in [
            (Limits { pull_n: 8.0, ..Limits::default() }, "load_n = 8: expected less than pull_n = 8"),
            (Limits { rate_m_per_s: 0.9e-3, ..Limits::default() }, "rate_m_per_s = 0.0005: expected at most 0.00045"),
            (Limits { stroke_m: 1.9e-3, ..Limits::default() }, "travel_limit_m = 0.004: expected at most 0.0038"),
        ] {
            let sentence = homing.fits(&limits, 2).unwrap_err().to_string();
            assert!(sentence.contains(&format!("actuator 2: homing.{words}")), "{sentence}");
        }
    }
}
