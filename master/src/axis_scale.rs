//! How much of the full deflection a place, a speed or two keys of a device are, with rest, noise and sign. Pure.
//!
//! place: a = sign (|v - rest| - noise) / (end - rest - noise) towards either end of the range,   0 within the noise,   at most 1
//! way: a = sign w / full,   at most 1
//! keys: a = sign (plus - minus) part
//!
//! where: a: the hand's axis, as a part of the full deflection, written as counts of -350..=350 like every other hand's; v: the
//! device's value, counts; w: its speed and full: the speed that is a full deflection, counts/s; plus, minus: 1 for a key that is down.

use crate::evdev_decoder::AxisInfo;
use crate::evdev_names::axis_name;
use crate::{AXIS_LIMIT_COUNTS, AxisPlace, ProfileAxis};

impl ProfileAxis {
    /// The hand's counts of a part of the full deflection, which may be beyond it.
    fn counts_of(&self, part: f64) -> i16 {
        let sign = if self.is_negated { -1.0 } else { 1.0 };
        (sign * part.clamp(-1.0, 1.0) * f64::from(AXIS_LIMIT_COUNTS)).round() as i16
    }

    /// Of a place, with its range.
    pub(crate) fn counts_of_place(&self, scale: &PlaceScale, value: i32) -> i16 {
        self.counts_of(scale.part(value))
    }

    /// Of a speed.
    pub(crate) fn counts_of_speed(&self, counts_per_s: f64, full_counts_per_s: f64) -> i16 {
        self.counts_of(counts_per_s / full_counts_per_s)
    }

    /// Of two keys: whether that of the positive and that of the negative direction is down.
    pub(crate) fn counts_of_keys(&self, is_down: [bool; 2], deflection_ratio: f64) -> i16 {
        let [plus, minus] = is_down.map(f64::from);
        self.counts_of((plus - minus) * deflection_ratio)
    }
}

/// The range of one absolute axis, counts of the device.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaceScale {
    low: f64,
    high: f64,
    rest: f64,
    noise: f64,
}

impl PlaceScale {
    /// # Errors
    /// One phrase: the device does not have the axis, or it and the profile do not fit.
    pub(crate) fn new(axis: &AxisPlace, info: &AxisInfo) -> Result<Self, String> {
        let [low, high] = axis.range.unwrap_or([info.min, info.max]).map(f64::from);
        let name = axis_name(axis.code);
        if low >= high {
            return Err(format!("axis {name}, which the device does not have, or whose range it does not tell"));
        }
        let rest = axis.rest.map_or((low + high) / 2.0, f64::from);
        let noise = f64::from(axis.noise.unwrap_or(info.fuzz.max(info.flat)).max(0));
        if !(low..=high).contains(&rest) || noise > (high - low) / 4.0 {
            return Err(format!("axis {name} with rest {rest} and noise {noise} in the range {low} to {high}"));
        }
        Ok(Self { low, high, rest, noise })
    }

    /// -1 to 1; a value beyond the range is a full deflection.
    fn part(&self, value: i32) -> f64 {
        let away = f64::from(value) - self.rest;
        let way = if away < 0.0 { self.rest - self.low } else { self.high - self.rest } - self.noise;
        if away.abs() <= self.noise || way <= 0.0 {
            return 0.0;
        }
        away.signum() * ((away.abs() - self.noise) / way).min(1.0)
    }
}
