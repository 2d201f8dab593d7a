//! Learns parameters of a chain while the machine moves: recursive Gauss-Newton on the chain's own predictions.
//!
//! Problem: after each measured shape z, find the parameters theta that explain all shapes so far, each weighed by the camera's
//! noise, with a prior for each parameter and a slow drift. A [`PredictorTangents`] gives the predicted shape and its slope
//! G = d prediction / d theta, carried through the whole history, hysteresis included; so
//!     r = z - prediction - G (theta - theta then),   S = G P G^T + sigma^2,   theta += P G^T S^-1 r,   P -= P G^T S^-1 G P,
//! and P grows by sd^2 dt / memory_s for each parameter (a random walk) while the machine moves. The new values are set in
//! the predictor, whose memory follows to first order: every prediction is the one that the newest values would have given.
//!
//! where theta is counted in prior standard deviations from its start, so that P begins as the identity and never exceeds it.
//!
//! What is in force differs from theta in two ways, and the rest follows in the metric of P:
//! - a parameter of which the motion says nothing (its standard deviation, with all others known, is nearly the prior's) is held at its start;
//! - a parameter beyond its bounds is held at the bound.
//!
//! Failure: at rest nothing new is said and nothing is forgotten. A measurement that the model cannot explain is left out; a
//! long series of them reopens the estimate. Until the lines have moved their direction is unknown, and nothing is learnt.

use crate::chain::{Circumstances, LearntParameter, MAX_LEARNT, PredictorTangents};
use crate::recursion::{Lanes, Learning, Learnt, Recursion, Residual};
use crate::{Chain, ChainError};
use nalgebra::{SMatrix, Vector2, Vector3};

type Slopes = SMatrix<f64, 2, MAX_LEARNT>;

/// Travel of two encoders since the start from which on the lines' directions are known: play, stick range, and more, m.
const KNOWN_AFTER_M: f64 = 0.4e-3;
/// Travel of the encoders from which on a measurement says something new, m.
const REST_TRAVEL_M: f64 = 20e-6;
/// Change of what one prior standard deviation does to the shape from which on it does too, in standard deviations of the camera.
const NEW_SLOPE: f64 = 0.1;

/// What a learner assumes of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnerParameters {
    /// Standard deviation of each axis of a measured bend vector, rad.
    pub sigma_bend_rad: f64,
    /// Largest distance of a measurement from its prediction, standard deviations.
    pub outlier_sigmas: f64,
}

/// What the model saw at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// The shape that it predicts, rad.
    pub bend_rad: Vector2<f64>,
    /// The encoders, m.
    pub q_tilde_m: Vector3<f64>,
    by_parameter: Slopes,
    values: Lanes,
}

impl Default for Sight {
    fn default() -> Self {
        Self {
            bend_rad: Vector2::zeros(),
            q_tilde_m: Vector3::zeros(),
            by_parameter: Slopes::zeros(),
            values: Lanes::zeros(),
        }
    }
}

/// Learns the parameters that a chain names; owns the memory of every effect.
#[derive(Clone, Debug)]
pub struct Learner {
    sigma_bend_rad: f64,
    predictor: PredictorTangents<MAX_LEARNT>,
    recursion: Recursion,
    travelled: Option<[Vector3<f64>; 2]>,
    last_used: Option<Sight>,
    innovation: Option<Vector2<f64>>,
}

impl Learner {
    /// Starts from the values of the model file, at rest at the straight pose.
    ///
    /// # Errors
    /// None that building the chain would not have met.
    pub fn new(chain: &Chain, parameters: LearnerParameters) -> Result<Self, ChainError> {
        Ok(Self {
            sigma_bend_rad: parameters.sigma_bend_rad,
            predictor: chain.learning_predictor()?,
            recursion: Recursion::new(chain.learnt(), parameters.outlier_sigmas),
            travelled: None,
            last_used: None,
            innovation: None,
        })
    }

    /// Follows the encoders, m, push positive, at their full rate: a reversal between two shapes must not be missed.
    ///
    /// # Real-time
    /// No allocation.
    pub fn follow(&mut self, q_tilde_m: Vector3<f64>, at: &Circumstances) -> Sight {
        let seen = self.predictor.step(q_tilde_m, at);
        let [low, high] = self.travelled.get_or_insert([q_tilde_m; 2]);
        if q_tilde_m.norm().is_finite() {
            (*low, *high) = (low.inf(&q_tilde_m), high.sup(&q_tilde_m));
        }
        Sight {
            bend_rad: seen.prediction.observed_bend_rad,
            q_tilde_m,
            by_parameter: Slopes::from_fn(|i, k| seen.by_parameter[(i, k)] * self.recursion.sd(k)),
            values: self.recursion.in_force(),
        }
    }

    /// Takes a measured bend vector (rad) with what the model saw at its exposure, `dt_s` after the one before.
    ///
    /// # Real-time
    /// No allocation.
    pub fn take(&mut self, bend_rad: Vector2<f64>, seen: &Sight, dt_s: f64) -> Learning {
        self.innovation = None;
        let finite = bend_rad.norm().is_finite() && seen.bend_rad.norm().is_finite() && dt_s >= 0.0;
        if !finite || !seen.by_parameter.iter().all(|slope| slope.is_finite()) {
            return Learning::NotFinite;
        }
        let residual = Residual {
            r: bend_rad - seen.bend_rad,
            g: seen.by_parameter,
            values: seen.values,
            variance: self.sigma_bend_rad.powi(2),
        };
        let Some(spread) = self.recursion.spread(&residual) else { return Learning::NotFinite };
        let unexplained = self.recursion.unexplained(&residual);
        self.innovation = spread.l().solve_lower_triangular(&unexplained);
        let moved = self.last_used.is_none_or(|last| is_new(&last, seen, residual.variance.sqrt()));
        if self.travelled.is_none_or(|[low, high]| n_above(high - low, KNOWN_AFTER_M) < 2) {
            return Learning::NoDirection;
        }
        if !moved {
            return Learning::AtRest;
        }
        self.recursion.note_unexplained(0.5 * unexplained.norm_squared());
        let learning = self.recursion.take(&residual, &spread, dt_s);
        if learning == Learning::Used {
            self.last_used = Some(*seen);
            self.predictor.set_parameters(&self.recursion.values());
        }
        learning
    }

    /// What the values in force did not explain of the newest shape, in standard deviations along the axes of the base frame
    /// (second one without what it shares with the first), outliers and shapes at rest too; `None` for a shape that is none.
    pub fn innovation(&self) -> Option<Vector2<f64>> {
        self.innovation
    }

    /// Root mean square of what was not explained of the newest shapes in motion, outliers too, along each axis, rad; 0 before the first.
    pub fn innovation_rms_rad(&self) -> f64 {
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

fn n_above(travel_m: Vector3<f64>, limit_m: f64) -> usize {
    travel_m.iter().filter(|travel| **travel > limit_m).count()
}

/// Whether a measurement says something that the last used one did not.
fn is_new(last: &Sight, now: &Sight, sigma_rad: f64) -> bool {
    (now.q_tilde_m - last.q_tilde_m).amax() >= REST_TRAVEL_M
        || (now.by_parameter - last.by_parameter).amax() >= NEW_SLOPE * sigma_rad
}
