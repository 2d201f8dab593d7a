//! Whether a chain of effects may steer a machine: a file can be right in every number and still be nonsense as a whole.
//!
//! **Walk.** From straight outward along rays, to the largest bend that shall be allowed, in small steps; the memory of every
//! effect goes along. At each step
//! - every number is finite;
//! - no line is corrected by much more than the longest way that a line goes at all, |eps| <= 2.5 max |q| over the walk: long
//!   lines stretch by as much as they move, and a load scale of 2.5 is the largest that is learnt;
//! - the command is continuous: where it moves by much, the step is halved again and again, and the way must shrink with it;
//! - the inverse exists: the forward model, fed with the commands, takes the shape that was wanted.

use super::{Chain, ChainCompensator, ChainError, ChainStatus, Circumstances, Predictor};
use core::f64::consts::TAU;
use nalgebra::{Vector2, Vector3};

/// Rays around the straight pose: lines are 120 deg apart, and 7 rays meet each at another angle.
const N_RAYS: u32 = 7;
/// Steps along a ray: a quarter of a degree on the default machine.
const N_STEPS: u32 = 300;
/// Time that a step stands for, s: slow enough for every drift and delay of the catalogue.
const STEP_S: f64 = 0.02;
/// Largest plausible correction, in the longest ways of a line.
const MOST_OF_Q: f64 = 2.5;
/// A step that moves a line by more is looked at more closely, m.
const LARGE_STEP_M: f64 = 50e-6;
/// A step is halved so often: 1/4096 of a quarter of a degree is less than any encoder sees.
const N_HALVES: u32 = 12;
/// Largest distance of the forward model's shape from what was wanted, rad (1 deg): what smoothed inverses leave is less.
const ROUND_TRIP_RAD: f64 = 0.0175;

/// Why a chain must not steer a machine.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Implausible {
    /// A command is not a number.
    #[error(
        "at a bend of {bend_deg:.1} deg in the direction {direction_deg:.0} deg its command is not finite; correct the effect that has no value there"
    )]
    NotFinite {
        /// Bend, deg.
        bend_deg: f64,
        /// Direction, deg.
        direction_deg: f64,
    },
    /// A line is corrected by more than it moves.
    #[error(
        "at a bend of {bend_deg:.1} deg in the direction {direction_deg:.0} deg it corrects a line by {found_mm:.3} mm, expected at most {limit_mm:.3} mm, 2.5 times the longest way of any line; correct the effect that is worth so much (units are m)"
    )]
    Correction {
        /// Bend, deg.
        bend_deg: f64,
        /// Direction, deg.
        direction_deg: f64,
        /// The correction, mm.
        found_mm: f64,
        /// Largest that is plausible, mm.
        limit_mm: f64,
    },
    /// The command jumps.
    #[error(
        "at a bend of {bend_deg:.1} deg in the direction {direction_deg:.0} deg its command jumps by {found_mm:.3} mm, expected a continuous one; smooth the effect that jumps"
    )]
    Jump {
        /// Bend, deg.
        bend_deg: f64,
        /// Direction, deg.
        direction_deg: f64,
        /// The jump, mm.
        found_mm: f64,
    },
    /// The commands do not lead to the wanted shapes.
    #[error(
        "at a bend of {bend_deg:.1} deg in the direction {direction_deg:.0} deg its own forward model bends {found_deg:.2} deg beside what was wanted, expected at most {limit_deg:.2} deg, so it has no inverse there; an effect is too strong"
    )]
    NoInverse {
        /// Bend, deg.
        bend_deg: f64,
        /// Direction, deg.
        direction_deg: f64,
        /// How far the shape is off, deg; NaN where there is none.
        found_deg: f64,
        /// Largest that is plausible, deg.
        limit_deg: f64,
    },
}

impl Chain {
    /// Looks whether this chain may steer a machine up to a bend, rad. Takes some ten milliseconds.
    ///
    /// # Errors
    /// [`ChainError`] when it has no compensator at all; inside, [`Implausible`] with the place and the numbers.
    pub fn plausible(&self, max_bend_rad: f64) -> Result<Result<(), Implausible>, ChainError> {
        let compensator = self.compensator()?;
        let max_bend_rad = max_bend_rad.min(self.max_bend_rad());
        let mut limit_m: f64 = 0.0;
        for ray in 0..N_RAYS {
            let mut way = compensator.clone();
            let q_m = way.step(direction(ray) * max_bend_rad, &Circumstances::at(0.0)).q_m;
            limit_m = limit_m.max(MOST_OF_Q * q_m.amax());
        }
        let walk = |ray| Walk::new(&compensator, self.predictor(), ray, max_bend_rad, limit_m).go();
        Ok((0..N_RAYS).try_for_each(walk))
    }
}

fn direction(ray: u32) -> Vector2<f64> {
    let (y, x) = (TAU * f64::from(ray) / f64::from(N_RAYS)).sin_cos();
    Vector2::new(x, y)
}

struct Walk {
    compensator: ChainCompensator,
    predictor: Predictor,
    ray: u32,
    max_bend_rad: f64,
    limit_m: f64,
}

impl Walk {
    fn new(compensator: &ChainCompensator, predictor: Predictor, ray: u32, max_bend_rad: f64, limit_m: f64) -> Self {
        Self { compensator: compensator.clone(), predictor, ray, max_bend_rad, limit_m }
    }

    fn go(mut self) -> Result<(), Implausible> {
        for step in 0..=N_STEPS {
            let before = self.compensator.clone();
            let part = f64::from(step) / f64::from(N_STEPS);
            let at = Circumstances::at(f64::from(step) * STEP_S);
            let wanted = direction(self.ray) * (self.max_bend_rad * part);
            let command = self.compensator.step(wanted, &at);
            let (bend_deg, direction_deg) =
                (wanted.norm().to_degrees(), 360.0 * f64::from(self.ray) / f64::from(N_RAYS));
            if !command.q_tilde_m.iter().all(|q| q.is_finite()) {
                return Err(Implausible::NotFinite { bend_deg, direction_deg });
            }
            if command.eps_m.amax() > self.limit_m {
                let (found_mm, limit_mm) = (command.eps_m.amax() * 1e3, self.limit_m * 1e3);
                return Err(Implausible::Correction { bend_deg, direction_deg, found_mm, limit_mm });
            }
            if step > 0
                && let Some(found_m) = self.jump(before, step)
            {
                return Err(Implausible::Jump { bend_deg, direction_deg, found_mm: found_m * 1e3 });
            }
            let found = self.predictor.step(command.q_tilde_m, &at);
            let off_rad = (found.observed_bend_rad - wanted).norm().min((found.bend_rad - wanted).norm());
            // Written so that NaN is refused.
            if found.status != ChainStatus::Good || !(0.0..=ROUND_TRIP_RAD).contains(&off_rad) {
                let (found_deg, limit_deg) = (off_rad.to_degrees(), ROUND_TRIP_RAD.to_degrees());
                return Err(Implausible::NoInverse { bend_deg, direction_deg, found_deg, limit_deg });
            }
        }
        Ok(())
    }

    /// How far the command jumps within a step, if it does: the half that moves the most is halved again, and a jump stays.
    fn jump(&self, mut from: ChainCompensator, step: u32) -> Option<f64> {
        let place = |part: f64| {
            let steps = f64::from(step - 1) + part;
            (direction(self.ray) * (self.max_bend_rad * steps / f64::from(N_STEPS)), Circumstances::at(steps * STEP_S))
        };
        let ask = |compensator: &mut ChainCompensator, part: f64| -> Vector3<f64> {
            let (bend, at) = place(part);
            compensator.step(bend, &at).q_tilde_m
        };
        let (mut low, mut high) = (0.0, 1.0);
        let mut at_low = from.last_command().q_tilde_m;
        let mut at_high = ask(&mut from.clone(), high);
        for _ in 0..N_HALVES {
            if (at_high - at_low).amax() <= LARGE_STEP_M {
                return None;
            }
            let middle = 0.5 * (low + high);
            let mut halfway = from.clone();
            let at_middle = ask(&mut halfway, middle);
            if (at_middle - at_low).amax() >= (at_high - at_middle).amax() {
                (high, at_high) = (middle, at_middle);
            } else {
                (low, at_low, from) = (middle, at_middle, halfway);
            }
        }
        Some((at_high - at_low).amax())
    }
}
