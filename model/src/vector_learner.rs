//! Learns parameters of joints and of segments while they move, by the recursion of [`crate::Learner`] on their own predictions.
//!
//! Problem: as there, with Y measured numbers for the shape and U commands for the encoders. Each number is counted in standard
//! deviations of its own measurement, so that numbers of any unit weigh what they are worth.
//!
//! Failure: as there. New values count from the next step on.

use crate::chain::MAX_LEARNT;
use crate::recursion::{Lanes, Recursion, Residual, Slopes};
use crate::{Circumstances, Learning, Learnt, LearntParameter};
use nalgebra::{SMatrix, SVector};

/// Change of what one prior standard deviation does to a number from which on a measurement says something new, in standard
/// deviations of it.
const NEW_SLOPE: f64 = 0.1;

/// A model with memory that predicts Y numbers for U commands, with its slopes by the parameters that are learnt. What is behind the last
/// number and the last command is zero.
pub trait SlopedPredictor<const Y: usize, const U: usize> {
    /// The numbers for the next commands, and their slopes by each parameter, per prior standard deviation. Allocates nothing.
    fn step(&mut self, u: &[f64; U], at: &Circumstances) -> ([f64; Y], SMatrix<f64, Y, MAX_LEARNT>);
    /// Sets the learnt parameters; NaN in lanes without one. Allocates nothing.
    fn set(&mut self, values: &[f64; MAX_LEARNT]);
}

/// What a learner assumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VectorLearnerParameters {
    /// Largest distance of a measurement from its prediction, standard deviations.
    pub outlier_sigmas: f64,
    /// Travel of a command since the start from which on its play is known to be taken up, in units of u.
    pub known_after: f64,
    /// So many commands must have gone that far before anything is learnt.
    pub n_known: usize,
    /// Travel of a command from which on a measurement says something new, in units of u.
    pub rest_travel: f64,
}

/// What the model saw at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VectorSight<const Y: usize, const U: usize> {
    /// The numbers that it predicts, in units of y; 0 behind the last.
    pub y: [f64; Y],
    /// The commands that the drives have carried out, in units of u; 0 behind the last.
    pub u: [f64; U],
    slopes: Slopes<Y>,
    values: Lanes,
}

impl<const Y: usize, const U: usize> Default for VectorSight<Y, U> {
    fn default() -> Self {
        Self { y: [0.0; Y], u: [0.0; U], slopes: Slopes::zeros(), values: Lanes::zeros() }
    }
}

/// Learns the parameters that a model names; owns the memory of every effect.
#[derive(Clone, Debug)]
pub struct VectorLearner<P, const Y: usize, const U: usize> {
    parameters: VectorLearnerParameters,
    predictor: P,
    recursion: Recursion,
    n: usize,
    travelled: Option<[[f64; U]; 2]>,
    last_used: Option<VectorSight<Y, U>>,
    innovation: Option<SVector<f64, Y>>,
}

impl<P: SlopedPredictor<Y, U>, const Y: usize, const U: usize> VectorLearner<P, Y, U> {
    /// Starts from the values of the model file; `n` numbers are measured.
    pub(crate) fn new(predictor: P, learnt: &[LearntParameter], n: usize, parameters: VectorLearnerParameters) -> Self {
        let recursion = Recursion::new(learnt, parameters.outlier_sigmas);
        Self { parameters, predictor, recursion, n, travelled: None, last_used: None, innovation: None }
    }

    /// Follows the drives at their full rate: `u` are their readings as commands, in units of u.
    ///
    /// # Real-time
    /// No allocation.
    pub fn follow(&mut self, u: &[f64], at: &Circumstances) -> VectorSight<Y, U> {
        let mut own = [0.0; U];
        own.iter_mut().zip(u).for_each(|(own, u)| *own = *u);
        let (y, slopes) = self.predictor.step(&own, at);
        let [low, high] = self.travelled.get_or_insert([own; 2]);
        for ((low, high), u) in low.iter_mut().zip(high).zip(&own) {
            (*low, *high) = (low.min(*u), high.max(*u));
        }
        VectorSight { y, u: own, slopes, values: self.recursion.in_force() }
    }

    /// Takes measured numbers and their standard deviations, in units of y, with what the model saw at their instant, `dt_s` after those
    /// before.
    ///
    /// # Real-time
    /// No allocation.
    pub fn take(&mut self, y: &[f64], sigma: &[f64], seen: &VectorSight<Y, U>, dt_s: f64) -> Learning {
        self.innovation = None;
        let is_complete = y.len() == self.n && sigma.len() == self.n && dt_s >= 0.0;
        if !is_complete || !sigma.iter().all(|sigma| *sigma > 0.0) {
            return Learning::NotFinite;
        }
        let per_sigma = |k: usize| sigma.get(k).map_or(0.0, |sigma| 1.0 / sigma);
        let residual: Residual<Y> = Residual {
            r: SVector::from_fn(|k, _| y.get(k).map_or(0.0, |y| (y - seen.y[k]) * per_sigma(k))),
            g: Slopes::from_fn(|k, lane| seen.slopes[(k, lane)] * per_sigma(k)),
            values: seen.values,
            variance: 1.0,
        };
        let is_finite = residual.r.iter().chain(residual.g.iter()).all(|own| own.is_finite());
        let Some(spread) = self.recursion.spread(&residual).filter(|_| is_finite) else { return Learning::NotFinite };
        let unexplained = self.recursion.unexplained(&residual);
        self.innovation = spread.l().solve_lower_triangular(&unexplained);
        let is_known = |[low, high]: [[f64; U]; 2]| {
            let far = low.iter().zip(&high).filter(|(low, high)| *high - *low > self.parameters.known_after);
            far.count() >= self.parameters.n_known
        };
        if !self.travelled.is_some_and(is_known) {
            return Learning::NoDirection;
        }
        if !self.last_used.is_none_or(|last| self.is_new(&last, seen, &per_sigma)) {
            return Learning::AtRest;
        }
        // In the numbers' unit again.
        let mean_square =
            sigma.iter().zip(unexplained.iter()).map(|(s, r)| (s * r).powi(2)).sum::<f64>() / self.n as f64;
        self.recursion.note_unexplained(mean_square);
        let learning = self.recursion.take(&residual, &spread, dt_s);
        if learning == Learning::Used {
            self.last_used = Some(*seen);
            self.predictor.set(&self.recursion.values());
        }
        learning
    }

    fn is_new(&self, last: &VectorSight<Y, U>, now: &VectorSight<Y, U>, per_sigma: &impl Fn(usize) -> f64) -> bool {
        let moved = last.u.iter().zip(&now.u).any(|(last, now)| (now - last).abs() >= self.parameters.rest_travel);
        let change = now.slopes - last.slopes;
        moved || change.row_iter().enumerate().any(|(k, row)| row.amax() * per_sigma(k) >= NEW_SLOPE)
    }

    /// What the values in force did not explain of the newest measurement, in standard deviations (each number without what it shares
    /// with those before it), outliers and measurements at rest too; `None` for one that is none.
    pub fn innovation(&self) -> Option<SVector<f64, Y>> {
        self.innovation
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
