//! What a step is told besides its input, and what it says about itself.

use crate::effects::MAX_COLUMNS;
use crate::effects::prepared::Now;

/// Columns beside the encoders or the setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circumstances {
    /// Time of the sample, s, on any clock that does not run backwards.
    pub time_s: f64,
    /// Angle of the flexible stem, rad, limited to a turn either way; NaN where it is not measured.
    pub stem_angle_rad: f64,
    /// Temperature, degrees Celsius, limited to -100 to 400; NaN where it is not measured.
    pub temperature_c: f64,
    /// Columns with names of their own, in the order of [`crate::joints::JointChain::columns`]; NaN where they are not measured.
    pub columns: [f64; MAX_COLUMNS],
}

impl Circumstances {
    /// A time, s, and nothing else.
    pub fn at(time_s: f64) -> Self {
        Self { time_s, stem_angle_rad: f64::NAN, temperature_c: f64::NAN, columns: [f64::NAN; MAX_COLUMNS] }
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clock {
    /// NaN before the first step.
    last_s: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { last_s: f64::NAN }
    }
}

impl Clock {
    /// Circumstances of a step at this time. A time that is not finite, runs backwards or has hardly moved on counts as the
    /// time before.
    #[inline(always)]
    pub(crate) fn now(&self, at: &Circumstances) -> Now {
        let dt_s = at.time_s - self.last_s;
        let moves_on = (SHORTEST_STEP_S..=f64::MAX).contains(&dt_s);
        let (time_s, dt_s) = if moves_on { (at.time_s, dt_s) } else { self.exceptional(at.time_s) };
        Now {
            time_s,
            dt_s,
            stem_column_rad: at.stem_angle_rad,
            temperature_column_c: at.temperature_c,
            commit: false,
            fresh: false,
        }
    }

    #[inline(always)]
    pub(crate) fn tick(&mut self, now: &Now) {
        self.last_s = now.time_s;
    }

    #[cold]
    fn exceptional(&self, time_s: f64) -> (f64, f64) {
        match (time_s.is_finite(), self.last_s.is_finite()) {
            (true, false) => (time_s, 0.0),
            (false, false) => (0.0, 0.0),
            // Two finite times may be infinitely far apart.
            (true, true) if time_s - self.last_s > f64::MAX => (time_s, f64::MAX),
            (_, true) => (self.last_s, 0.0),
        }
    }
}
