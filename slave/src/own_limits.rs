//! Limits of single actuators: speed, acceleration and load, each of which an actuator's table may narrow.
//!
//! An own limit is never wider than that of all in `[slave.limits]`. So whatever is checked with those of all (that a stop ends within the
//! watchdog's time, that a line bears its load) holds for each. Braking takes speed off all by one common factor, and off none faster than
//! `deceleration_m_per_s2`, which no acceleration is below.

use crate::{ActuatorConfig, ConfigError, DriveKind, Limits, SlaveConfig};
use core::ops::RangeInclusive;
use krait_ipc::message::{Actuators, MAX_ACTUATORS};

/// Slowest that a speed may be limited to, m/s, and the smallest load, N.
const LEAST: (f64, f64) = (1e-4, 0.1);

impl SlaveConfig {
    /// Speed of each actuator, m/s.
    pub fn rates_m_per_s(&self) -> Actuators {
        self.of_each(|own| own.rate_m_per_s, self.limits.rate_m_per_s)
    }

    /// Acceleration of each actuator, m/s2.
    pub fn accelerations_m_per_s2(&self) -> Actuators {
        self.of_each(|own| own.acceleration_m_per_s2, self.limits.acceleration_m_per_s2)
    }

    /// Load beyond which that of an actuator is not increased further, pull or push, N; infinite: those of all are the only ones.
    pub fn own_loads_n(&self) -> Actuators {
        self.of_each(|own| own.load_n, f64::INFINITY)
    }

    /// What holds for the actuator at a place, from 0.
    pub fn limits_of(&self, actuator: usize) -> Limits {
        let place = actuator.min(MAX_ACTUATORS - 1);
        let (l, load_n) = (&self.limits, self.own_loads_n()[place]);
        Limits {
            rate_m_per_s: self.rates_m_per_s()[place],
            acceleration_m_per_s2: self.accelerations_m_per_s2()[place],
            pull_n: l.pull_n.min(load_n),
            push_n: l.push_n.min(load_n),
            jaw_n: l.jaw_n.min(load_n),
            ..l.clone()
        }
    }

    /// The table of an actuator of a real bus, from 0.
    pub(crate) fn real_actuator(&self, actuator: usize) -> Option<&ActuatorConfig> {
        self.drive.actuator.get(actuator).filter(|_| self.drive.kind != DriveKind::Sim)
    }

    fn of_each(&self, own: fn(&ActuatorConfig) -> Option<f64>, of_all: f64) -> Actuators {
        core::array::from_fn(|k| self.real_actuator(k).and_then(own).unwrap_or(of_all))
    }

    /// Checks that no own limit is wider than that of all, nor too narrow for a stop.
    ///
    /// # Errors
    /// [`ConfigError::Drives`] names the first.
    pub(crate) fn check_own_limits(&self) -> Result<(), ConfigError> {
        let (l, (slowest, lightest)) = (&self.limits, LEAST);
        for k in 0..self.drive.actuator.len() {
            let Some(own) = self.real_actuator(k) else { continue };
            let (load_of_all, most_n) = match own.jaw_m_per_rad {
                Some(_) => ("which is limits.jaw_n of all", l.jaw_n),
                None => ("which is limits.pull_n and push_n of all", l.pull_n.min(l.push_n)),
            };
            let stop = self.deceleration_m_per_s2;
            let within = |key: &str, found: Option<f64>, range: RangeInclusive<f64>, whose: &str| match found {
                Some(found) if !range.contains(&found) => {
                    let (from, to) = (range.start(), range.end());
                    let what = format!(
                        "actuator {}: {key} = {found}: expected {from} to {to}, {whose}; correct it, or leave it out for that of all",
                        k + 1
                    );
                    Err(ConfigError::Drives { what })
                }
                _ => Ok(()),
            };
            within("rate_m_per_s", own.rate_m_per_s, slowest..=l.rate_m_per_s, "which is limits.rate_m_per_s of all")?;
            let from_to = "from deceleration_m_per_s2 of a stop to limits.acceleration_m_per_s2 of all";
            within("acceleration_m_per_s2", own.acceleration_m_per_s2, stop..=l.acceleration_m_per_s2, from_to)?;
            within("load_n", own.load_n, lightest..=most_n, load_of_all)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(kind: &str, first: &str, second: &str) -> SlaveConfig {
        let text = format!(
            "[drive]\nkind = \"{kind}\"\nport = \"/dev/ttyUSB0\"\n[[drive.actuator]]\nid = 1\n{first}\n[[drive.actuator]]\nid = 2\n{second}\n"
        );
        toml::from_str(&text).unwrap()
    }

    #[test]
    fn an_actuator_without_own_limits_has_those_of_all_and_simulated_ones_have_no_tables() {
        let own = "rate_m_per_s = 0.01\nacceleration_m_per_s2 = 5.0\nload_n = 8.0";
        let narrowed = config("sts3215", "", own);
        narrowed.check().unwrap();
        assert_eq!(narrowed.rates_m_per_s()[..3], [0.03, 0.01, 0.03]);
        assert_eq!(narrowed.accelerations_m_per_s2()[..3], [20.0, 5.0, 20.0]);
        assert_eq!(narrowed.own_loads_n()[..3], [f64::INFINITY, 8.0, f64::INFINITY]);
        let l = narrowed.limits_of(1);
        assert_eq!((l.rate_m_per_s, l.acceleration_m_per_s2, l.pull_n, l.push_n), (0.01, 5.0, 8.0, 8.0));
        assert_eq!(narrowed.limits_of(0), narrowed.limits);
        assert_eq!(config("sim", "", own).rates_m_per_s(), [0.03; MAX_ACTUATORS]);
    }

    #[test]
    fn an_own_limit_wider_than_that_of_all_or_too_narrow_for_a_stop_is_refused_in_one_sentence() {
        for (own, words) in [
            ("rate_m_per_s = 0.031", "rate_m_per_s = 0.031: expected 0.0001 to 0.03, which is limits.rate_m_per_s"),
            ("rate_m_per_s = nan", "rate_m_per_s = NaN: expected"),
            (
                "acceleration_m_per_s2 = 0.9",
                "acceleration_m_per_s2 = 0.9: expected 1 to 20, from deceleration_m_per_s2",
            ),
            ("acceleration_m_per_s2 = 21.0", "acceleration_m_per_s2 = 21: expected 1 to 20"),
            ("load_n = 61.0", "load_n = 61: expected 0.1 to 60, which is limits.pull_n and push_n of all"),
            ("load_n = 0.0", "load_n = 0: expected 0.1 to 60"),
            ("jaw_m_per_rad = 0.002\nload_n = 16.0", "load_n = 16: expected 0.1 to 15, which is limits.jaw_n of all"),
        ] {
            let sentence = config("sts3215", "", own).check().unwrap_err().to_string();
            assert!(sentence.starts_with("[slave.drive]: actuator 2: ") && sentence.contains(words), "{sentence}");
            assert!(sentence.contains("leave it out") && !sentence.contains('\n'), "{sentence}");
        }
    }
}
