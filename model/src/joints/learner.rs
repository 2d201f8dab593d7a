//! Learns parameters of joints while they move, by the recursion of [`crate::Learner`] on their own predictions.
//!
//! Problem: as there, with the measured positions of the joints for the shape. Each joint is counted in standard deviations of its
//! own measurement, so that joints of any unit weigh what they are worth.
//!
//! Failure: as there. New values count from the next step on; a play or a friction remembers where it was, and comes to what the
//! new values make of it when the joint turns or slides.

use super::slopes::JointSlopes;
use super::{JointChain, MAX_JOINTS};
use crate::recursion::{Lanes, Recursion, Residual, Slopes};
use crate::{Circumstances, Learning, Learnt, LearntParameter};
use nalgebra::SVector;

/// Change of what one prior standard deviation does to a joint from which on a measurement says something new, in standard
/// deviations of it.
const NEW_SLOPE: f64 = 0.1;

/// What a learner of joints assumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLearnerParameters {
    /// Largest distance of a measurement from its prediction, standard deviations.
    pub outlier_sigmas: f64,
    /// Travel of a command since the start from which on plays are known to be taken up, in units of u.
    pub known_after: f64,
    /// Travel of a command from which on a measurement says something new, in units of u.
    pub rest_travel: f64,
}

/// What the model saw at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSight {
    /// The positions that it predicts, in units of y; 0 behind the last joint.
    pub y: [f64; MAX_JOINTS],
    /// The commands that the drives have carried out, in units of u.
    pub u: [f64; MAX_JOINTS],
    slopes: Slopes<MAX_JOINTS>,
    values: Lanes,
}

impl Default for JointSight {
    fn default() -> Self {
        Self { y: [0.0; MAX_JOINTS], u: [0.0; MAX_JOINTS], slopes: Slopes::zeros(), values: Lanes::zeros() }
    }
}

/// Learns the parameters that a chain of joints names; owns the memory of every effect.
#[derive(Clone, Debug)]
pub struct JointLearner {
    parameters: JointLearnerParameters,
    joints: JointSlopes,
    recursion: Recursion,
    n: usize,
    travelled: Option<[[f64; MAX_JOINTS]; 2]>,
    last_used: Option<JointSight>,
}

impl JointLearner {
    /// Starts from the values of the model file.
    pub fn new(chain: &JointChain, parameters: JointLearnerParameters) -> Self {
        Self {
            parameters,
            joints: JointSlopes::new(chain),
            recursion: Recursion::new(chain.learnt(), parameters.outlier_sigmas),
            n: chain.n(),
            travelled: None,
            last_used: None,
        }
    }

    /// Follows the drives at their full rate: `u` are their readings as commands, one for each joint, in units of u.
    ///
    /// # Real-time
    /// No allocation.
    pub fn follow(&mut self, u: &[f64], at: &Circumstances) -> JointSight {
        let (y, slopes) = self.joints.step(u, at);
        let mut own = [0.0; MAX_JOINTS];
        own.iter_mut().zip(u).for_each(|(own, u)| *own = *u);
        let [low, high] = self.travelled.get_or_insert([own; 2]);
        for ((low, high), u) in low.iter_mut().zip(high).zip(&own) {
            (*low, *high) = (low.min(*u), high.max(*u));
        }
        JointSight { y, u: own, slopes, values: self.recursion.in_force() }
    }

    /// Takes measured positions and their standard deviations, one of each for each joint, in units of y, with what the model
    /// saw at their instant, `dt_s` after those before.
    ///
    /// # Real-time
    /// No allocation.
    pub fn take(&mut self, y: &[f64], sigma: &[f64], seen: &JointSight, dt_s: f64) -> Learning {
        let is_complete = y.len() == self.n && sigma.len() == self.n && dt_s >= 0.0;
        if !is_complete || !sigma.iter().all(|sigma| *sigma > 0.0) {
            return Learning::NotFinite;
        }
        let per_sigma = |joint: usize| sigma.get(joint).map_or(0.0, |sigma| 1.0 / sigma);
        let residual: Residual<MAX_JOINTS> = Residual {
            r: SVector::from_fn(|joint, _| y.get(joint).map_or(0.0, |y| (y - seen.y[joint]) * per_sigma(joint))),
            g: Slopes::from_fn(|joint, lane| seen.slopes[(joint, lane)] * per_sigma(joint)),
            values: seen.values,
            variance: 1.0,
        };
        let is_finite = residual.r.iter().chain(residual.g.iter()).all(|own| own.is_finite());
        let Some(spread) = self.recursion.spread(&residual).filter(|_| is_finite) else { return Learning::NotFinite };
        let travel = |[low, high]: [[f64; MAX_JOINTS]; 2]| {
            low.iter().zip(&high).any(|(l, h)| h - l > self.parameters.known_after)
        };
        if !self.travelled.is_some_and(travel) {
            return Learning::NoDirection;
        }
        if !self.last_used.is_none_or(|last| self.is_new(&last, seen, &per_sigma)) {
            return Learning::AtRest;
        }
        let unexplained = self.recursion.unexplained(&residual);
        // In the positions' unit again.
        let mean_square =
            sigma.iter().zip(unexplained.iter()).map(|(s, r)| (s * r).powi(2)).sum::<f64>() / self.n as f64;
        self.recursion.note_unexplained(mean_square);
        let learning = self.recursion.take(&residual, &spread, dt_s);
        if learning == Learning::Used {
            self.last_used = Some(*seen);
            self.joints.set(&self.recursion.values());
        }
        learning
    }

    fn is_new(&self, last: &JointSight, now: &JointSight, per_sigma: &impl Fn(usize) -> f64) -> bool {
        let moved = last.u.iter().zip(&now.u).any(|(last, now)| (now - last).abs() >= self.parameters.rest_travel);
        let change = now.slopes - last.slopes;
        moved || change.row_iter().enumerate().any(|(joint, row)| row.amax() * per_sigma(joint) >= NEW_SLOPE)
    }

    /// Root mean square of what was not explained of the newest measurements in motion, in units of y; 0 before the first.
    pub fn innovation_rms(&self) -> f64 {
        self.recursion.innovation_rms()
    }

    /// The parameters that are learnt, in the order of the model file.
    pub fn parameters(&self) -> &[LearntParameter] {
        self.recursion.parameters()
    }

    /// What the parameter at a place is worth now; `None` behind the last.
    pub fn learnt(&self, lane: usize) -> Option<Learnt> {
        self.recursion.learnt(lane)
    }
}
