//! What drives can do, and whether the slave's limits ask for more.

use crate::{ConfigError, SlaveConfig};
use krait_ipc::message::Actuators;

/// What a back-end can do, fixed after opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveTraits {
    /// How many actuators there are.
    pub n_actuators: usize,
    /// How many of them, from the first, hold each other through one machine: all, or all but the last, a gripper's wire, which
    /// stands alone.
    pub n_together: usize,
    /// Where the drives know by their encoders where the jaw stands when power comes, m of wire for one radian of it. None: where it was
    /// last told to be.
    pub jaw_m_per_rad: Option<f64>,
    /// Period at which actuators are told and asked, ns.
    pub period_ns: i64,
    /// How far each may go from zero, either way, m.
    pub travel_m: Actuators,
    /// How fast each can go, m/s.
    pub rate_m_per_s: Actuators,
    /// From a wish to the reading that shows it, ns.
    pub delay_ns: i64,
    /// Whether loads are measured.
    pub measures_load: bool,
    /// Whether `home` moves nothing: the encoders know their place, and have only to stand within their travel of zero.
    pub homes_in_place: bool,
    /// What a fault does to the power.
    pub on_fault: OnFault,
}

/// What becomes of the power when the slave goes to FAULT.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnFault {
    /// The actuators brake to rest and stay under power: right where they would let go of stretched lines.
    #[default]
    Hold,
    /// As "hold"; where the failed actuator says that it has let go of its line, the others then give way, a bounded way.
    Relax,
    /// Power is taken away: right where they hold their place without it.
    PowerOff,
}

impl DriveTraits {
    /// The place of the actuator that stands alone, from 0, if one does.
    pub fn alone(&self) -> Option<usize> {
        (self.n_together < self.n_actuators).then_some(self.n_together)
    }

    /// Whether the drives can do what the limits of a checked configuration allow, those of all and those of single actuators.
    ///
    /// # Errors
    /// [`ConfigError`] names the first limit that asks for more.
    pub fn check(&self, config: &SlaveConfig) -> Result<(), ConfigError> {
        let limits = &config.limits;
        let smallest = |values: &Actuators| values.iter().take(self.n_actuators).copied().fold(f64::INFINITY, f64::min);
        let travel_m = smallest(&self.travel_m);
        let beyond = |key, found, able, unit, advice| Err(ConfigError::BeyondDrives { key, found, able, unit, advice });
        if limits.stroke_m > travel_m {
            return beyond("stroke_m", limits.stroke_m, travel_m, "m", "lower it, or give the drives more travel_m");
        }
        let rates_m_per_s = config.rates_m_per_s();
        for (k, (rate_m_per_s, able_m_per_s)) in rates_m_per_s.into_iter().zip(self.rate_m_per_s).enumerate() {
            if k >= self.n_actuators || rate_m_per_s <= able_m_per_s {
                continue;
            }
            if config.real_actuator(k).is_some_and(|own| own.rate_m_per_s.is_some()) {
                let what = format!(
                    "actuator {}: rate_m_per_s = {rate_m_per_s}: its drive can do {able_m_per_s:.4} m/s at most; lower it",
                    k + 1
                );
                return Err(ConfigError::Drives { what });
            }
            let advice = "lower it, give the slowest a rate_m_per_s of its own, or use faster drives or larger spools";
            let slowest_m_per_s = smallest(&self.rate_m_per_s);
            return beyond("rate_m_per_s", limits.rate_m_per_s, slowest_m_per_s, "m/s", advice);
        }
        let fastest_m_per_s = rates_m_per_s.into_iter().take(self.n_actuators).fold(0.0, f64::max);
        let behind_m = fastest_m_per_s * self.delay_ns as f64 * 1e-9;
        if limits.following_error_m < behind_m {
            return Err(ConfigError::AlwaysBehind {
                following_error_m: limits.following_error_m,
                behind_m,
                rate_m_per_s: fastest_m_per_s,
                delay_ms: self.delay_ns as f64 * 1e-6,
            });
        }
        if !self.measures_load && (limits.pull_n.is_finite() || limits.push_n.is_finite()) {
            return Err(ConfigError::LoadsNotMeasured { pull_n: limits.pull_n, push_n: limits.push_n });
        }
        let own_loads_n = config.own_loads_n();
        if let (false, Some(k)) = (self.measures_load, own_loads_n.iter().position(|load_n| load_n.is_finite())) {
            let what = format!(
                "actuator {}: load_n = {}: these drives do not measure loads, and motion would be refused; delete it, and bound the load in the drive (torque_limit)",
                k + 1,
                own_loads_n[k]
            );
            return Err(ConfigError::Drives { what });
        }
        if !self.measures_load && self.alone().is_some() && limits.jaw_n.is_finite() {
            return Err(ConfigError::JawLoadNotMeasured { jaw_n: limits.jaw_n });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActuatorConfig, DriveConfig, DriveKind, Limits};
    use krait_ipc::message::MAX_ACTUATORS;

    const ABLE: DriveTraits = DriveTraits {
        n_actuators: 3,
        n_together: 3,
        jaw_m_per_rad: None,
        period_ns: 5_000_000,
        travel_m: [6e-3; MAX_ACTUATORS],
        rate_m_per_s: [0.04; MAX_ACTUATORS],
        delay_ns: 9_000_000,
        measures_load: true,
        homes_in_place: true,
        on_fault: OnFault::Hold,
    };

    #[test]
    fn limits_within_what_the_drives_can_do_pass_and_each_beyond_is_named() {
        let config = SlaveConfig::default();
        assert_eq!(ABLE.check(&config), Ok(()));
        let mut short = ABLE;
        short.travel_m[1] = 5e-3;
        let mut slow = ABLE;
        slow.rate_m_per_s[2] = 0.02;
        for (drives, key) in [
            (short, "stroke_m"),
            (slow, "rate_m_per_s"),
            (DriveTraits { delay_ns: 12_000_000, ..ABLE }, "following_error_m"),
            (DriveTraits { measures_load: false, ..ABLE }, "pull_n"),
        ] {
            let sentence = drives.check(&config).unwrap_err().to_string();
            assert!(sentence.contains("[slave.limits]") && sentence.contains(key), "{sentence}");
        }
        let limits = Limits { pull_n: f64::INFINITY, push_n: f64::INFINITY, ..Limits::default() };
        let without_lines = SlaveConfig { limits, ..SlaveConfig::default() };
        let blind = DriveTraits { measures_load: false, ..ABLE };
        assert_eq!(blind.check(&without_lines), Ok(()), "no jaw, no limit of it");
        let sentence = DriveTraits { n_together: 2, ..blind }.check(&without_lines).unwrap_err().to_string();
        assert!(sentence.contains("[slave.limits] jaw_n = 15"), "{sentence}");
        short.n_actuators = 1;
        assert_eq!(short.check(&config), Ok(()), "actuators behind the last do not count");
    }
    #[test]
    fn a_slow_drive_passes_with_a_rate_of_its_own_and_one_beyond_it_or_a_load_that_nobody_measures_is_named() {
        let with = |change: fn(&mut ActuatorConfig)| {
            let mut actuator = vec![ActuatorConfig::default(); 3];
            change(&mut actuator[2]);
            let drive = DriveConfig { kind: DriveKind::Sts3215, actuator, ..DriveConfig::default() };
            SlaveConfig { drive, ..SlaveConfig::default() }
        };
        let mut slow = ABLE;
        slow.rate_m_per_s[2] = 0.02;
        let sentence = slow.check(&with(|_| {})).unwrap_err().to_string();
        assert!(sentence.contains("[slave.limits] rate_m_per_s = 0.03: these drives can do 0.0200 m/s"), "{sentence}");
        assert_eq!(slow.check(&with(|actuator| actuator.rate_m_per_s = Some(0.02))), Ok(()));
        let sentence = slow.check(&with(|actuator| actuator.rate_m_per_s = Some(0.021))).unwrap_err().to_string();
        assert!(sentence.contains("actuator 3: rate_m_per_s = 0.021: its drive can do 0.0200 m/s"), "{sentence}");
        let mut blind = with(|actuator| actuator.load_n = Some(5.0));
        (blind.limits.pull_n, blind.limits.push_n) = (f64::INFINITY, f64::INFINITY);
        let sentence = DriveTraits { measures_load: false, ..ABLE }.check(&blind).unwrap_err().to_string();
        assert!(sentence.contains("actuator 3: load_n = 5: these drives do not measure loads"), "{sentence}");
        assert_eq!(ABLE.check(&blind), Ok(()));
    }
}
