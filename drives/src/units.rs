//! Encoder counts and metres of line: counts = zero + sign × counts per turn × gear × q~ / way per turn.
//!
//! where: q~ line length at the actuator, m, push positive; way per turn: 2 π r of a spool, or the lead of a screw, m. Range: the travel must stay clear of the
//! place where the encoder begins anew.

use crate::{OpenError, Seen};
use core::f64::consts::TAU;
use krait_slave::ActuatorConfig;

/// Counts that travel must stay away from the encoder's first and last, so that an overshoot does not leap.
const CLEARANCE_COUNTS: f64 = 64.0;

/// Units of one actuator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    zero_count: i32,
    /// With the sign.
    counts_per_m: f64,
    /// Largest distance from zero, either way, m.
    pub travel_m: f64,
    /// Estimated load per current, N/A; NaN: not measured.
    pub newton_per_ampere: f64,
    /// Load per torque of the motor, N/(N m); NaN: not measured.
    pub newton_per_newton_metre: f64,
}

impl Units {
    /// Units of the `actuator`-th, from 1, on an encoder of so many counts a turn that begins anew at each turn.
    ///
    /// # Errors
    /// [`OpenError::Wraps`] where the travel comes too near to the place where the encoder begins anew.
    pub fn new(config: &ActuatorConfig, actuator: usize, counts_per_turn: i32) -> Result<Self, OpenError> {
        let zero_count = config.zero_count.unwrap_or(counts_per_turn / 2);
        let units = Self::around(config, zero_count, counts_per_turn);
        let stroke = units.magnitude_counts(config.travel_m);
        let room = f64::from(zero_count).min(f64::from(counts_per_turn) - 1.0 - f64::from(zero_count));
        if stroke + CLEARANCE_COUNTS > room {
            return Err(OpenError::Wraps {
                actuator,
                travel_m: config.travel_m,
                counts: stroke.ceil() as i64,
                zero_count: i64::from(zero_count),
                last_count: counts_per_turn - 1,
            });
        }
        let estimate = config.newton_metre_per_ampere * units.newton_per_newton_metre;
        let newton_per_ampere = if config.newton_metre_per_ampere > 0.0 { estimate } else { f64::NAN };
        Ok(Self { newton_per_ampere, newton_per_newton_metre: f64::NAN, ..units })
    }

    /// Units of the `actuator`-th, from 1, on an encoder that counts on over its turns and says how strong its motor is.
    ///
    /// # Errors
    /// [`OpenError::BeyondCounts`] where the travel is more than can be counted, [`OpenError::ZeroLikePowerOn`] where the zero
    /// cannot be told from what an incremental encoder reads at power-on.
    pub fn endless(config: &ActuatorConfig, actuator: usize) -> Result<Self, OpenError> {
        let zero_count = config.zero_count.unwrap_or(0);
        let units = Self::around(config, zero_count, i32::try_from(config.counts_per_turn).unwrap_or(i32::MAX));
        let stroke = (units.magnitude_counts(config.travel_m) + CLEARANCE_COUNTS).ceil();
        if stroke + f64::from(zero_count).abs() > f64::from(i32::MAX / 2) {
            let (travel_m, counts) = (config.travel_m, stroke as i64);
            return Err(OpenError::BeyondCounts { actuator, travel_m, counts, zero_count });
        }
        let is_near = f64::from(zero_count).abs() <= stroke;
        if config.zero_count.is_some() && is_near && !config.is_absolute {
            let (counts, better) = (stroke as i64, (10 * stroke as i64).min(i64::from(i32::MAX / 2)));
            return Err(OpenError::ZeroLikePowerOn { actuator, zero_count, counts, better });
        }
        Ok(units)
    }

    fn around(config: &ActuatorConfig, zero_count: i32, counts_per_turn: i32) -> Self {
        let metre_per_turn = config.lead_m.unwrap_or(TAU * config.spool_radius_m);
        let sign = f64::from(config.sign);
        Self {
            zero_count,
            counts_per_m: f64::from(counts_per_turn) * config.gear / metre_per_turn * sign,
            travel_m: config.travel_m,
            newton_per_ampere: f64::NAN,
            newton_per_newton_metre: TAU * config.gear * config.efficiency / metre_per_turn * sign,
        }
    }

    /// Load of the `k`-th, counted from 0, N, push positive; NaN: not measured.
    pub(crate) fn load_n(&self, seen: &Seen, k: usize) -> f64 {
        if self.newton_per_ampere.is_finite() {
            return seen.current_a[k] * self.newton_per_ampere;
        }
        seen.torque_nm[k] * self.newton_per_newton_metre
    }

    /// Whether loads are measured.
    pub(crate) fn measures_load(&self) -> bool {
        self.newton_per_ampere.is_finite() || self.newton_per_newton_metre.is_finite()
    }

    /// The count nearest to a position, which must be within travel.
    pub fn counts(&self, q_m: f64) -> i32 {
        (f64::from(self.zero_count) + (q_m * self.counts_per_m).round()) as i32
    }

    /// The position of a count, m.
    pub fn metres(&self, counts: i32) -> f64 {
        (f64::from(counts) - f64::from(self.zero_count)) / self.counts_per_m
    }

    /// Counts for a distance or speed, without sign.
    pub fn magnitude_counts(&self, way_m: f64) -> f64 {
        (way_m * self.counts_per_m).abs()
    }

    /// Metres for a number of counts or a speed of the encoder, without sign.
    pub fn magnitude_m(&self, counts: f64) -> f64 {
        (counts / self.counts_per_m).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_metres_agree_with_the_circumference_of_the_spool_whatever_the_sign() {
        let config = ActuatorConfig { zero_count: Some(2000), spool_radius_m: 0.008, ..ActuatorConfig::default() };
        for sign in [1, -1] {
            let units = Units::new(&ActuatorConfig { sign, ..config.clone() }, 1, 4096).unwrap();
            // An eighth of a turn of an 8 mm spool is 6.283 mm: beyond travel, but arithmetic.
            assert_eq!(units.counts(TAU * 0.008 / 8.0), 2000 + sign * 512);
            for counts in 1500..2500 {
                assert_eq!(units.counts(units.metres(counts)), counts);
            }
            assert!((units.magnitude_m(4096.0) - TAU * 0.008).abs() < 1e-15);
        }
        let geared = Units::new(&ActuatorConfig { gear: 2.0, ..config }, 1, 4096).unwrap();
        assert_eq!(geared.counts(TAU * 0.008 / 8.0), 2000 + 1024);
    }

    #[test]
    fn travel_across_the_place_where_the_encoder_begins_anew_is_refused() {
        for (zero_count, fits) in [(2048, true), (553, true), (552, false), (3542, true), (3543, false), (5000, false)]
        {
            let config = ActuatorConfig { zero_count: Some(zero_count), ..ActuatorConfig::default() };
            let units = Units::new(&config, 2, 4096);
            assert_eq!(units.is_ok(), fits, "{zero_count}: {units:?}");
            if let Err(error) = units {
                assert!(error.to_string().contains("actuator 2") && error.to_string().contains("zero"), "{error}");
            }
        }
    }
}
