//! Size and correlation in time of innovations, gathered one by one without keeping them.

use super::slow_noise::SlowNoise;
use nalgebra::Vector2;

/// Distances in time at which the correlation is looked at, in innovations.
pub(super) const LAGS: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Innovations kept: those up to the longest distance.
const N_KEPT: usize = 64;
/// A pause longer than this many periods ends a stretch: what is beyond it is not one sample away.
const GAP_PERIODS: f64 = 2.5;

/// Sums over the innovations so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Learning {
    kept: [Vector2<f64>; N_KEPT],
    /// Innovations since the last pause.
    n_unbroken: usize,
    n: f64,
    sum: Vector2<f64>,
    squares: f64,
    products: [f64; LAGS.len()],
    pairs: [f64; LAGS.len()],
    period_s: f64,
    seconds: f64,
}

impl Learning {
    pub(super) fn new() -> Self {
        Self {
            kept: [Vector2::zeros(); N_KEPT],
            n_unbroken: 0,
            n: 0.0,
            sum: Vector2::zeros(),
            squares: 0.0,
            products: [0.0; LAGS.len()],
            pairs: [0.0; LAGS.len()],
            period_s: f64::INFINITY,
            seconds: 0.0,
        }
    }

    pub(super) fn take(&mut self, r: Vector2<f64>, dt_s: f64) {
        if dt_s > 0.0 {
            self.period_s = self.period_s.min(dt_s);
        }
        if dt_s > GAP_PERIODS * self.period_s {
            self.n_unbroken = 0;
        } else {
            self.seconds += dt_s;
        }
        for (k, lag) in LAGS.into_iter().enumerate() {
            if lag <= self.n_unbroken {
                self.products[k] += r.dot(&self.kept[(self.n_unbroken - lag) % N_KEPT]);
                self.pairs[k] += 2.0;
            }
        }
        self.kept[self.n_unbroken % N_KEPT] = r;
        self.n_unbroken += 1;
        self.n += 2.0;
        self.sum += r;
        self.squares += r.norm_squared();
    }

    /// Time in motion, s, without pauses.
    pub(super) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Shortest time between two innovations, s.
    pub(super) fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Their mean.
    pub(super) fn mean(&self) -> Vector2<f64> {
        self.sum * (2.0 / self.n)
    }

    /// The noise about the mean that these innovations are; `None` where they are all the same.
    pub(super) fn noise(&self) -> Option<SlowNoise> {
        let shared = 0.5 * self.mean().norm_squared();
        let variance = self.squares / self.n - shared;
        let mut covariances = [0.0; LAGS.len()];
        for (k, covariance) in covariances.iter_mut().enumerate() {
            *covariance = if self.pairs[k] > 0.0 { self.products[k] / self.pairs[k] - shared } else { 0.0 };
        }
        (variance.is_finite() && variance > 0.0)
            .then(|| SlowNoise::of(variance, &covariances, self.pairs[0], self.period_s))
    }
}
