//! What a step is told besides its input, and what it says about itself.

use crate::effects::prepared::Now;
use core::f64::consts::PI;

/// Columns beside the encoders or the setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circumstances {
    /// Time of the sample, s, on any clock that does not run backwards.
    pub time_s: f64,
    /// Angle of the flexible stem, rad, limited to a turn either way; NaN where it is not measured.
    pub stem_angle_rad: f64,
    /// Temperature, degrees Celsius, limited to -100 to 400; NaN where it is not measured.
    pub temperature_c: f64,
}

impl Circumstances {
    /// A time, s, and nothing else.
    pub fn at(time_s: f64) -> Self {
        Self { time_s, stem_angle_rad: f64::NAN, temperature_c: f64::NAN }
    }
}

/// What a step says about its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChainStatus {
    /// Nothing to say.
    Good,
    /// The input was not finite; the step before was repeated and nothing is remembered.
    NotFinite,
    /// The wanted shape strains the backbones beyond the limit, and the shape was limited to it.
    BeyondStrain {
        /// Strain of the outer fibre that the input asks for, 1.
        strain: f64,
        /// Limit, 1.
        limit: f64,
    },
    /// Forward: the equilibrium lies beyond the machine's largest bend; the shape of the step before stands.
    OutOfRange,
    /// Forward: no step reduced the residual any further; the shape is the best one found.
    Stuck,
}

/// A shorter step is no step: no speed can be told from it.
const SHORTEST_STEP_S: f64 = 1e-9;

/// The clock of a runner: time between steps, never negative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Clock {
    last_s: Option<f64>,
}

impl Clock {
    /// Circumstances of a step at this time. A time that is not finite or runs backwards counts as the time before.
    pub(crate) fn now(&self, at: &Circumstances) -> Now {
        let last_s = self.last_s.unwrap_or(if at.time_s.is_finite() { at.time_s } else { 0.0 });
        let time_s = if at.time_s > last_s { at.time_s.min(f64::MAX) } else { last_s };
        let dt_s = (time_s - last_s).min(f64::MAX);
        Now {
            time_s,
            dt_s: if dt_s < SHORTEST_STEP_S { 0.0 } else { dt_s },
            // A NaN stays one: the column is missing.
            stem_angle_rad: at.stem_angle_rad.clamp(-2.0 * PI, 2.0 * PI),
            temperature_c: at.temperature_c.clamp(-100.0, 400.0),
            commit: false,
            fresh: false,
        }
    }

    pub(crate) fn tick(&mut self, now: &Now) {
        self.last_s = Some(now.time_s);
    }
}
