//! The recursion that every learner shares: recursive Gauss-Newton with a prior, a drift and bounds for each parameter.
//!
//! Problem, notation and what is in force beside the best values: see [`crate::Learner`]. Here a measurement is M numbers that are
//! not correlated and have one variance; who measures in other units scales them.

use crate::chain::{LearntParameter, MAX_LEARNT};
use nalgebra::{Cholesky, Const, SMatrix, SVector};

pub(crate) type Lanes = SVector<f64, MAX_LEARNT>;
type Square = SMatrix<f64, MAX_LEARNT, MAX_LEARNT>;
/// d prediction / d parameters, in prior standard deviations of each.
pub(crate) type Slopes<const M: usize> = SMatrix<f64, M, MAX_LEARNT>;
/// Of the spread S of what a measurement may differ from its prediction by.
pub(crate) type Spread<const M: usize> = Cholesky<f64, Const<M>>;

/// Half a second of a 60 Hz camera: no glitch lasts that long, so that the machine must have changed.
const OUTLIERS_THAT_REOPEN: u32 = 30;
/// Weight of the newest innovation in the reported mean square: about the last 30 measurements.
const INNOVATION_WEIGHT: f64 = 1.0 / 30.0;
/// Longest time that one measurement may stand for, s.
const LONGEST_STEP_S: f64 = 0.1;
/// A parameter is held at its start until, with all others known, its standard deviation is this part of the prior's; and
/// again when it comes back to the second one.
const OBSERVABLE: [f64; 2] = [0.8, 0.95];
/// Two parameters cannot be told apart when they are so correlated and each is known to no better than this part of its prior.
const TIED_CORRELATION: f64 = 0.98;
const TIED_SD: f64 = 0.3;

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

/// One measurement beside what was predicted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Residual<const M: usize> {
    /// Measured minus predicted.
    pub r: SVector<f64, M>,
    /// The prediction's slopes.
    pub g: Slopes<M>,
    /// The values that the prediction was made with.
    pub values: Lanes,
    /// Of each number.
    pub variance: f64,
}

/// Best values, their covariance, and what of them is in force.
#[derive(Clone, Debug)]
pub(crate) struct Recursion {
    outlier_sigmas: f64,
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
    mean_square: Option<f64>,
    n_outliers_in_a_row: u32,
}

impl Recursion {
    /// Starts from the values of the model file. `outlier_sigmas` is the largest distance of a measurement from its prediction,
    /// standard deviations.
    pub fn new(lanes: &[LearntParameter], outlier_sigmas: f64) -> Self {
        let of = |f: fn(&LearntParameter) -> f64, otherwise| Lanes::from_fn(|i, _| lanes.get(i).map_or(otherwise, f));
        Self {
            outlier_sigmas,
            sd: of(|lane| lane.learn.sd, 1.0),
            drift_per_s: of(|lane| 1.0 / lane.learn.memory_s, 0.0),
            lanes: lanes.to_vec(),
            x: Lanes::zeros(),
            p: Square::identity(),
            in_force: Lanes::zeros(),
            observable: [false; MAX_LEARNT],
            at_bound: [false; MAX_LEARNT],
            mean_square: None,
            n_outliers_in_a_row: 0,
        }
    }

    /// Prior standard deviation of a lane, in the parameter's unit.
    pub fn sd(&self, lane: usize) -> f64 {
        self.sd[lane]
    }

    /// The values in force, in prior standard deviations from the start.
    pub fn in_force(&self) -> Lanes {
        self.in_force
    }

    /// The values in force, in their units; NaN in lanes without a parameter.
    pub fn values(&self) -> [f64; MAX_LEARNT] {
        core::array::from_fn(|lane| self.value(lane))
    }

    /// The parameters, in the order of the model file.
    pub fn parameters(&self) -> &[LearntParameter] {
        &self.lanes
    }

    /// S = G P G^T + variance; `None` where numbers are not finite.
    pub fn spread<const M: usize>(&self, seen: &Residual<M>) -> Option<Spread<M>> {
        let s = seen.g * self.p * seen.g.transpose() + SMatrix::<f64, M, M>::identity() * seen.variance;
        s.cholesky()
    }

    /// What the values in force do not explain of a measurement.
    pub fn unexplained<const M: usize>(&self, seen: &Residual<M>) -> SVector<f64, M> {
        seen.r - seen.g * (self.in_force - seen.values)
    }

    /// Takes a measurement, `dt_s` after the one before: [`Learning::Used`] or [`Learning::Outlier`].
    pub fn take<const M: usize>(&mut self, seen: &Residual<M>, spread: &Spread<M>, dt_s: f64) -> Learning {
        let r = seen.r - seen.g * (self.x - seen.values);
        let distance = spread.l().solve_lower_triangular(&r).map_or(f64::INFINITY, |r| r.norm());
        if distance > self.outlier_sigmas {
            self.n_outliers_in_a_row += 1;
            if self.n_outliers_in_a_row >= OUTLIERS_THAT_REOPEN {
                self.n_outliers_in_a_row = 0;
                self.p = Square::identity();
            }
            return Learning::Outlier;
        }
        self.n_outliers_in_a_row = 0;
        self.drift(dt_s.min(LONGEST_STEP_S));
        self.update(&seen.g, r, seen.variance);
        self.enforce();
        Learning::Used
    }

    /// Root mean square of what was not explained of the newest shapes in motion; 0 before the first.
    pub fn innovation_rms(&self) -> f64 {
        self.mean_square.unwrap_or(0.0).sqrt()
    }

    /// Takes the mean square of what was not explained of the newest shape, rad^2.
    pub fn note_unexplained(&mut self, newest: f64) {
        let old = self.mean_square.unwrap_or(newest);
        self.mean_square = Some(old + INNOVATION_WEIGHT * (newest - old));
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

    /// One measurement of numbers that are not correlated, one after the other, in Joseph's form.
    fn update<const M: usize>(&mut self, g: &Slopes<M>, r: SVector<f64, M>, variance: f64) {
        let before = self.x;
        for axis in 0..M {
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
