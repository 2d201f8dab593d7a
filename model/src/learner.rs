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
use crate::{Chain, ChainError};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

type Lanes = SVector<f64, MAX_LEARNT>;
type Square = SMatrix<f64, MAX_LEARNT, MAX_LEARNT>;
type Slopes = SMatrix<f64, 2, MAX_LEARNT>;

/// Half a second of a 60 Hz camera: no glitch lasts that long, so that the machine must have changed.
const OUTLIERS_THAT_REOPEN: u32 = 30;
/// Weight of the newest innovation in the reported mean square: about the last 30 measurements.
const INNOVATION_WEIGHT: f64 = 1.0 / 30.0;
/// Travel of two encoders since the start from which on the lines' directions are known: play, stick range, and more, m.
const KNOWN_AFTER_M: f64 = 0.4e-3;
/// Travel of the encoders from which on a measurement says something new, m.
const REST_TRAVEL_M: f64 = 20e-6;
/// Change of what one prior standard deviation does to the shape from which on it does too, in standard deviations of the camera.
const NEW_SLOPE: f64 = 0.1;
/// Longest time that one measurement may stand for, s.
const LONGEST_STEP_S: f64 = 0.1;
/// A parameter is held at its start until, with all others known, its standard deviation is this part of the prior's; and
/// again when it comes back to the second one.
const OBSERVABLE: [f64; 2] = [0.8, 0.95];
/// Two parameters cannot be told apart when they are so correlated and each is known to no better than this part of its prior.
const TIED_CORRELATION: f64 = 0.98;
const TIED_SD: f64 = 0.3;

/// What a learner assumes of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnerParameters {
    /// Standard deviation of each axis of a measured bend vector, rad.
    pub sigma_bend_rad: f64,
    /// Largest distance of a measurement from its prediction, standard deviations.
    pub outlier_sigmas: f64,
}

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learning {
    /// It changed the estimate.
    Used,
    /// The machine has not moved since the last used measurement.
    AtRest,
    /// The lines have not moved enough since the start for their directions to be known.
    NoDirection,
    /// The model cannot explain it.
    Outlier,
    /// A number is not finite.
    NotFinite,
}

/// What a parameter is worth now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learnt {
    /// The value in force, in the parameter's unit.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Whether the motion says anything about it; where not, the value is the start value.
    pub is_observable: bool,
    /// Whether the measurements ask for more than its bounds allow.
    pub is_at_bound: bool,
    /// The learnt parameter, by its place, that the motion cannot tell it from.
    pub tied_to: Option<usize>,
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
    parameters: LearnerParameters,
    predictor: PredictorTangents<MAX_LEARNT>,
    lanes: Vec<LearntParameter>,
    /// Prior standard deviations; 1 in lanes without a parameter.
    sd: Lanes,
    /// Growth of variance, in prior variances per second.
    drift_per_s: Lanes,
    /// Best values and their covariance, in prior standard deviations from the start.
    x: Lanes,
    p: Square,
    /// The values in force, likewise.
    in_force: Lanes,
    observable: [bool; MAX_LEARNT],
    at_bound: [bool; MAX_LEARNT],
    travelled: Option<[Vector3<f64>; 2]>,
    last_used: Option<Sight>,
    innovation: Option<Vector2<f64>>,
    mean_square_rad2: Option<f64>,
    n_outliers_in_a_row: u32,
}

impl Learner {
    /// Starts from the values of the model file, at rest at the straight pose.
    ///
    /// # Errors
    /// None that building the chain would not have met.
    pub fn new(chain: &Chain, parameters: LearnerParameters) -> Result<Self, ChainError> {
        let lanes = chain.learnt().to_vec();
        let of = |f: fn(&LearntParameter) -> f64, otherwise| Lanes::from_fn(|i, _| lanes.get(i).map_or(otherwise, f));
        Ok(Self {
            parameters,
            predictor: chain.learning_predictor()?,
            sd: of(|lane| lane.learn.sd, 1.0),
            drift_per_s: of(|lane| 1.0 / lane.learn.memory_s, 0.0),
            lanes,
            x: Lanes::zeros(),
            p: Square::identity(),
            in_force: Lanes::zeros(),
            observable: [false; MAX_LEARNT],
            at_bound: [false; MAX_LEARNT],
            travelled: None,
            last_used: None,
            innovation: None,
            mean_square_rad2: None,
            n_outliers_in_a_row: 0,
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
            by_parameter: Slopes::from_fn(|i, k| seen.by_parameter[(i, k)] * self.sd[k]),
            values: self.in_force,
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
        let g = &seen.by_parameter;
        let variance = self.parameters.sigma_bend_rad.powi(2);
        let s = g * self.p * g.transpose() + Matrix2::identity() * variance;
        let Some(chol) = s.cholesky() else { return Learning::NotFinite };
        let whitened = |r: Vector2<f64>| chol.l().solve_lower_triangular(&r);
        let unexplained = bend_rad - seen.bend_rad - g * (self.in_force - seen.values);
        self.innovation = whitened(unexplained);
        let moved = self.last_used.is_none_or(|last| is_new(&last, seen, variance.sqrt()));
        if self.travelled.is_none_or(|[low, high]| n_above(high - low, KNOWN_AFTER_M) < 2) {
            return Learning::NoDirection;
        }
        if !moved {
            return Learning::AtRest;
        }
        let r = bend_rad - seen.bend_rad - g * (self.x - seen.values);
        self.note_unexplained(&unexplained);
        let distance = whitened(r).map_or(f64::INFINITY, |r| r.norm());
        if distance > self.parameters.outlier_sigmas {
            self.n_outliers_in_a_row += 1;
            if self.n_outliers_in_a_row >= OUTLIERS_THAT_REOPEN {
                self.n_outliers_in_a_row = 0;
                self.p = Square::identity();
            }
            return Learning::Outlier;
        }
        self.n_outliers_in_a_row = 0;
        self.last_used = Some(*seen);
        self.drift(dt_s.min(LONGEST_STEP_S));
        self.update(g, r, variance);
        self.enforce();
        Learning::Used
    }

    /// What the values in force did not explain of the newest shape, in standard deviations along the axes of the base frame
    /// (second one without what it shares with the first), outliers and shapes at rest too; `None` for a shape that is none.
    pub fn innovation(&self) -> Option<Vector2<f64>> {
        self.innovation
    }

    /// Root mean square of what was not explained of the newest shapes in motion, outliers too, along each axis, rad; 0 before the first.
    pub fn innovation_rms_rad(&self) -> f64 {
        self.mean_square_rad2.unwrap_or(0.0).sqrt()
    }

    /// The parameters that are learnt, in the order of the model file.
    pub fn parameters(&self) -> &[LearntParameter] {
        &self.lanes
    }

    /// What the parameter at a place is worth now; `None` behind the last.
    pub fn learnt(&self, lane: usize) -> Option<Learnt> {
        let own = self.lanes.get(lane)?;
        let is_observable = self.observable[lane];
        let sd = if is_observable { self.p[(lane, lane)].sqrt() } else { 1.0 };
        Some(Learnt {
            value: self.value(lane),
            sd: sd * own.learn.sd,
            is_observable,
            is_at_bound: self.at_bound[lane],
            tied_to: self.tied_to(lane),
        })
    }

    fn value(&self, lane: usize) -> f64 {
        let Some(own) = self.lanes.get(lane) else { return f64::NAN };
        (own.start + self.in_force[lane] * own.learn.sd).clamp(own.low, own.high)
    }

    fn tied_to(&self, lane: usize) -> Option<usize> {
        let sd = |i: usize| self.p[(i, i)].sqrt();
        let unknown = |i: usize| self.observable[i] && sd(i) > TIED_SD;
        let correlation = |i: usize| (self.p[(lane, i)] / (sd(lane) * sd(i))).abs();
        let others = (0..self.lanes.len()).filter(|&i| i != lane && unknown(i) && correlation(i) > TIED_CORRELATION);
        if unknown(lane) { others.max_by(|&a, &b| correlation(a).total_cmp(&correlation(b))) } else { None }
    }

    fn note_unexplained(&mut self, r: &Vector2<f64>) {
        let newest = 0.5 * r.norm_squared();
        let old = self.mean_square_rad2.unwrap_or(newest);
        self.mean_square_rad2 = Some(old + INNOVATION_WEIGHT * (newest - old));
    }

    /// The random walk; nothing is ever less certain than it was at the start.
    fn drift(&mut self, dt_s: f64) {
        for i in 0..MAX_LEARNT {
            self.p[(i, i)] += self.drift_per_s[i] * dt_s;
            let excess = self.p[(i, i)];
            if excess > 1.0 {
                let scale = 1.0 / excess.sqrt();
                self.p.row_mut(i).scale_mut(scale);
                self.p.column_mut(i).scale_mut(scale);
            }
        }
    }

    /// One measurement of two numbers that are not correlated, one after the other, in Joseph's form.
    fn update(&mut self, g: &Slopes, r: Vector2<f64>, variance: f64) {
        let before = self.x;
        for axis in 0..2 {
            let h = g.row(axis).transpose();
            let ph = self.p * h;
            let gain = ph / (h.dot(&ph) + variance);
            let left = r[axis] - h.dot(&(self.x - before));
            self.x += gain * left;
            let keep = Square::identity() - gain * h.transpose();
            self.p = keep * self.p * keep.transpose() + gain * gain.transpose() * variance;
        }
        self.p = (self.p + self.p.transpose()) * 0.5;
    }

    /// Puts the best values in force, as far as they are observable and within their bounds.
    fn enforce(&mut self) {
        if let Some(information) = self.p.cholesky().map(|c| c.inverse()) {
            for i in 0..self.lanes.len() {
                let sd_alone = 1.0 / information[(i, i)].sqrt();
                self.observable[i] = sd_alone < OBSERVABLE[usize::from(self.observable[i])];
            }
        }
        let (mut x, mut p) = (self.x, self.p);
        let n = self.lanes.len();
        for i in (0..n).filter(|&i| !self.observable[i]) {
            hold(&mut x, &mut p, i, 0.0);
        }
        self.at_bound = [false; MAX_LEARNT];
        for _ in 0..n {
            let worst = (0..n)
                .filter(|&i| self.observable[i] && !self.at_bound[i])
                .map(|i| (i, self.within(i, x[i])))
                .max_by(|a, b| (a.1 - x[a.0]).abs().total_cmp(&(b.1 - x[b.0]).abs()));
            let Some((i, bound)) = worst.filter(|&(i, bound)| bound != x[i]) else { break };
            hold(&mut x, &mut p, i, bound);
            self.at_bound[i] = true;
        }
        // What is beyond its bounds by more than a prior's standard deviation would take long to come back.
        for i in 0..n {
            let bound = self.within(i, self.x[i]);
            self.x[i] = self.x[i].clamp(bound - 1.0, bound + 1.0);
        }
        self.in_force = x;
        let values = core::array::from_fn(|i| self.value(i));
        self.predictor.set_parameters(&values);
    }

    /// A value in prior standard deviations from the start, within the bounds.
    fn within(&self, lane: usize, x: f64) -> f64 {
        let Some(own) = self.lanes.get(lane) else { return x };
        x.clamp((own.low - own.start) / own.learn.sd, (own.high - own.start) / own.learn.sd)
    }
}

/// Holds one value, and moves the others to where they are most likely then.
fn hold(x: &mut Lanes, p: &mut Square, i: usize, value: f64) {
    let variance = p[(i, i)];
    if variance <= f64::MIN_POSITIVE {
        return;
    }
    let column: Lanes = p.column(i).into_owned();
    *x += column * ((value - x[i]) / variance);
    x[i] = value;
    *p -= column * column.transpose() / variance;
}

fn n_above(travel_m: Vector3<f64>, limit_m: f64) -> usize {
    travel_m.iter().filter(|travel| **travel > limit_m).count()
}

/// Whether a measurement says something that the last used one did not.
fn is_new(last: &Sight, now: &Sight, sigma_rad: f64) -> bool {
    (now.q_tilde_m - last.q_tilde_m).amax() >= REST_TRAVEL_M
        || (now.by_parameter - last.by_parameter).amax() >= NEW_SLOPE * sigma_rad
}
