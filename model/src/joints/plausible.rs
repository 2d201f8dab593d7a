//! Whether a model of joints may steer a machine: a file can be right in every number and still be nonsense as a whole.
//!
//! **Walk.** From zero to the upper end of the range, to the lower one and to rest there, in small steps: each joint by itself,
//! then all together; the memory of every effect goes along. At each step
//! - every number is finite;
//! - no command is corrected by more than 2.5 times the longest way that a command goes without effects: as for a snake's lines;
//! - what is asked of the transmission is continuous: a hundredth of the way asks for less than a tenth of it. The command
//!   itself may be fast where it crosses a play;
//! - the inverse exists: the model, fed with the commands, takes the wanted positions, at the latest a second later.

use super::{JointChain, JointCompensator, JointInverseSettings, JointPredictor};
use crate::{ChainError, Circumstances};

/// Steps from zero to the end of a range.
const N_STEPS: u32 = 150;
/// Time that a step stands for, s: slow enough for every play and drift of the catalogue.
const STEP_S: f64 = 0.02;
/// Steps within which a wanted position must be reached: a second, 20 times what the inverse takes to turn back.
const N_LATE: u32 = 50;
/// Largest plausible correction, in the longest ways of a command.
const MOST_OF_WAY: f64 = 2.5;
/// A step that asks for more of the longest way is a jump: without effects it asks for less than a hundredth.
const LARGE_STEP: f64 = 0.1;
/// Largest distance of the model's position from what was wanted, as a part of the longest range.
const ROUND_TRIP: f64 = 0.02;

/// Why a model of joints must not steer a machine. Positions are in units of y, commands in units of u.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum JointImplausible {
    /// A command is not a number.
    #[error("with joint {joint} at {y:.4} its command is not finite; correct the effect that has no value there")]
    NotFinite {
        /// Which joint, from 1.
        joint: usize,
        /// Where it shall be.
        y: f64,
    },
    /// A command is corrected by more than it moves.
    #[error(
        "with joint {joint} at {y:.4} it corrects the command by {found:.4}, expected at most {limit:.4}, 2.5 times the longest way of any command; correct the effect that is worth so much (units are those of [machine])"
    )]
    Correction {
        /// Which joint, from 1.
        joint: usize,
        /// Where it shall be.
        y: f64,
        /// The correction.
        found: f64,
        /// Largest that is plausible.
        limit: f64,
    },
    /// What is asked of the transmission jumps.
    #[error(
        "with joint {joint} at {y:.4} what it asks of the transmission jumps by {found:.4}, expected a continuous motion; smooth the effect that jumps"
    )]
    Jump {
        /// Which joint, from 1.
        joint: usize,
        /// Where it shall be.
        y: f64,
        /// The jump.
        found: f64,
    },
    /// The commands do not lead to the wanted positions.
    #[error(
        "with joint {joint} at {y:.4} its own forward model stays {found:.4} beside what was wanted, expected at most {limit:.4}, so it has no inverse there; an effect is too strong"
    )]
    NoInverse {
        /// Which joint, from 1.
        joint: usize,
        /// Where it shall be.
        y: f64,
        /// How far it is off.
        found: f64,
        /// Largest that is plausible.
        limit: f64,
    },
}

impl JointChain {
    /// Looks whether this model may steer a machine from `low` to `high`, each with one entry for each joint, in units of y;
    /// zero lies between them. Takes some ten milliseconds for three joints.
    ///
    /// # Errors
    /// [`ChainError`] when it has no compensator at all; inside, [`JointImplausible`] with the place and the numbers.
    pub fn plausible(&self, low: &[f64], high: &[f64]) -> Result<Result<(), JointImplausible>, ChainError> {
        let compensator = self.compensator(JointInverseSettings::default())?;
        let (mut way, mut range) = (0.0_f64, 0.0_f64);
        for moving in self.movings() {
            for end in [low, high] {
                let u = compensator.without_effects(&self.wanted(moving, end, 1.0));
                let rest = compensator.without_effects(&self.wanted(moving, end, 0.0));
                way = u.iter().zip(&rest).fold(way, |most, (u, rest)| most.max((u - rest).abs()));
                range = end.iter().fold(range, |most, y| most.max(y.abs()));
            }
        }
        let walk = |moving| {
            let (compensator, predictor) = (compensator.clone(), self.predictor());
            Walk { chain: self, compensator, predictor, moving, low, high, way, range, n_late: 0 }.go()
        };
        Ok(self.movings().try_for_each(walk))
    }

    /// Which joint moves: each, then all.
    fn movings(&self) -> impl Iterator<Item = Option<usize>> + use<> {
        let all = (self.n() > 1).then_some(None);
        (0..self.n()).map(Some).chain(all)
    }

    /// Where the joints shall be at a part of the way from zero to an end.
    fn wanted(&self, moving: Option<usize>, end: &[f64], part: f64) -> Vec<f64> {
        let of = |(joint, y): (usize, &f64)| if moving.is_none_or(|own| own == joint) { y * part } else { 0.0 };
        end.iter().take(self.n()).enumerate().map(of).collect()
    }
}

struct Walk<'a> {
    chain: &'a JointChain,
    compensator: JointCompensator,
    predictor: JointPredictor,
    moving: Option<usize>,
    low: &'a [f64],
    high: &'a [f64],
    /// Longest way of a command without effects.
    way: f64,
    /// Longest range of a joint, from zero.
    range: f64,
    /// Steps for which the positions have not been what was wanted.
    n_late: u32,
}

impl Walk<'_> {
    fn go(mut self) -> Result<(), JointImplausible> {
        for step in 0..=3 * N_STEPS + N_LATE {
            let before = self.compensator.x_wanted();
            let (wanted, at) = self.place(f64::from(step));
            let command = self.compensator.step(&wanted, &at);
            let plain = self.compensator.without_effects(&wanted);
            let u = &command.u[..wanted.len()];
            for (idx, (u, y)) in u.iter().zip(&wanted).enumerate() {
                let (joint, y) = (idx + 1, *y);
                if !u.is_finite() {
                    return Err(JointImplausible::NotFinite { joint, y });
                }
                let (found, limit) = ((u - plain[idx]).abs(), MOST_OF_WAY * self.way);
                if found > limit {
                    return Err(JointImplausible::Correction { joint, y, found, limit });
                }
            }
            let ways = self.compensator.x_wanted().into_iter().zip(before).map(|(x, before)| (x - before).abs());
            if let Some((idx, found)) = ways.enumerate().find(|(_, way)| step > 0 && *way > LARGE_STEP * self.way) {
                return Err(JointImplausible::Jump { joint: idx + 1, y: wanted[idx], found });
            }
            let reached = self.predictor.step(u, &at);
            let off = reached.iter().zip(&wanted).map(|(reached, wanted)| (reached - wanted).abs());
            // A distance that is not a number is the largest.
            let (idx, found) = off.enumerate().fold((0, 0.0), |most, next| if next.1 <= most.1 { most } else { next });
            let limit = ROUND_TRIP * self.range;
            self.n_late = if found <= limit { 0 } else { self.n_late + 1 };
            if self.n_late >= N_LATE {
                return Err(JointImplausible::NoInverse { joint: idx + 1, y: wanted[idx], found, limit });
            }
        }
        Ok(())
    }

    /// Where the joints shall be after so many steps, and when that is.
    fn place(&self, steps: f64) -> (Vec<f64>, Circumstances) {
        let n = f64::from(N_STEPS);
        let part = if steps <= n { steps / n } else { (2.0 - steps / n).max(-1.0) };
        let (end, part) = if part < 0.0 { (self.low, -part) } else { (self.high, part) };
        (self.chain.wanted(self.moving, end, part), Circumstances::at(steps * STEP_S))
    }
}
