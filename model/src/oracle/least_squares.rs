//! Recursive least squares for two parameters, with fading memory that cannot wind up: Eqs. (19)-(23), corrected.
//!
//! P is the covariance after *all* rows so far, the innovation and its gain use only the new row: k = P h / (1 + h^T P h),
//! x <- x + k (z - h^T x), P <- (I - k h^T) P, for rows whose noise has been scaled to one. Before new rows are taken P grows
//! by 1/forgetting, but never beyond its value at the start.

use nalgebra::{Matrix2, Vector2};

/// One scaled measurement: z = h . x + noise of variance one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ScaledRow {
    pub h: Vector2<f64>,
    pub z: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LeastSquares {
    x: Vector2<f64>,
    p: Matrix2<f64>,
    p_start: Matrix2<f64>,
}

impl LeastSquares {
    pub(crate) fn new(x: Vector2<f64>, sd: Vector2<f64>) -> Self {
        let p = Matrix2::from_diagonal(&sd.component_mul(&sd));
        Self { x, p, p_start: p }
    }

    /// What the estimate does not explain of at most two rows, each in standard deviations: taken one after the other they
    /// are independent. Zero for a row that is not there.
    pub(crate) fn innovations(&self, rows: &[ScaledRow]) -> Vector2<f64> {
        let mut trial = *self;
        let mut innovations = Vector2::zeros();
        for (innovation, row) in innovations.iter_mut().zip(rows) {
            let variance = 1.0 + row.h.dot(&(trial.p * row.h));
            *innovation = (row.z - row.h.dot(&trial.x)) / variance.sqrt();
            trial.take(row);
        }
        innovations
    }

    /// Grows P by 1/`keep`, 0 < keep <= 1, within its value at the start.
    pub(crate) fn fade(&mut self, keep: f64) {
        self.p /= keep;
        for i in 0..2 {
            let excess = self.p[(i, i)] / self.p_start[(i, i)];
            if excess > 1.0 {
                let scale = 1.0 / excess.sqrt();
                self.p.row_mut(i).scale_mut(scale);
                self.p.column_mut(i).scale_mut(scale);
            }
        }
    }

    pub(crate) fn take(&mut self, row: &ScaledRow) {
        let p_h = self.p * row.h;
        let gain = p_h / (1.0 + row.h.dot(&p_h));
        self.x += gain * (row.z - row.h.dot(&self.x));
        self.p -= gain * p_h.transpose();
        self.p = (self.p + self.p.transpose()) * 0.5;
    }

    /// Forgets what was certain, keeps the values: for a machine that has changed.
    pub(crate) fn reopen(&mut self) {
        self.p = self.p_start;
    }

    /// The most likely parameters within bounds: a bound that is passed is put in force and the other parameter follows it
    /// along the correlation of the two, within its own bounds.
    pub(crate) fn within(&self, low: Vector2<f64>, high: Vector2<f64>) -> Vector2<f64> {
        let mut best = self.x;
        let mut least = f64::INFINITY;
        for (i, k) in [(0, 1), (1, 0)] {
            let bound = self.x[i].clamp(low[i], high[i]);
            if bound != self.x[i] {
                let mut candidate = self.x;
                candidate[i] = bound;
                let follows = self.p[(i, k)] / self.p[(i, i)] * (bound - self.x[i]);
                candidate[k] = (self.x[k] + follows).clamp(low[k], high[k]);
                let distance = self.distance_to(candidate);
                if distance < least {
                    (best, least) = (candidate, distance);
                }
            }
        }
        best
    }

    /// Squared distance of other parameters from the estimate, times det P: enough to compare two of them.
    fn distance_to(&self, other: Vector2<f64>) -> f64 {
        let d = other - self.x;
        let adjugate = Matrix2::new(self.p.m22, -self.p.m12, -self.p.m21, self.p.m11);
        d.dot(&(adjugate * d))
    }

    pub(crate) fn sd(&self) -> Vector2<f64> {
        self.p.diagonal().map(|v| v.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<ScaledRow> {
        let wave = |k: f64| ((12.9898 * k).sin() * 43_758.547).fract();
        (0..400_u16)
            .map(f64::from)
            .map(|k| {
                let h = Vector2::new(40.0 * wave(k), 9e4 * wave(k + 0.5).signum());
                ScaledRow { h, z: h.dot(&Vector2::new(1.22, 0.89e-4)) + wave(k + 0.25) }
            })
            .collect()
    }

    #[test]
    fn recursive_equals_batch_without_forgetting() {
        let (x, sd) = (Vector2::new(1.0, 0.0), Vector2::new(0.3, 1e-4));
        let mut recursive = LeastSquares::new(x, sd);
        let mut information = Matrix2::from_diagonal(&sd.map(|s| 1.0 / (s * s)));
        let mut right_side = information * x;
        for row in rows() {
            recursive.fade(1.0);
            recursive.take(&row);
            information += row.h * row.h.transpose();
            right_side += row.h * row.z;
        }
        let batch = information.try_inverse().unwrap() * right_side;
        let covariance = information.try_inverse().unwrap();
        for i in 0..2 {
            assert!((recursive.x[i] / batch[i] - 1.0).abs() < 1e-9, "{} {}", recursive.x, batch);
            assert!((recursive.p[(i, i)] / covariance[(i, i)] - 1.0).abs() < 1e-9);
        }
        assert!((recursive.x.x - 1.22).abs() < 0.01 && recursive.x != x);
    }

    #[test]
    fn p_does_not_wind_up_while_nothing_is_learnt() {
        let mut fit = LeastSquares::new(Vector2::new(1.0, 0.0), Vector2::new(0.3, 1e-4));
        for row in rows() {
            fit.take(&row);
        }
        let learnt = fit.sd();
        for _ in 0..10_000 {
            fit.fade(0.99);
        }
        assert!(fit.sd().x > 10.0 * learnt.x && fit.sd().x <= 0.3 * (1.0 + 1e-12), "{}", fit.sd());
        assert!(fit.p.determinant() >= 0.0);
    }

    #[test]
    fn bounds_give_the_most_likely_point_of_the_box() {
        let (low, high) = (Vector2::new(0.5, 0.0), Vector2::new(2.5, 3e-4));
        for z in [-60.0, -10.0, 20.0, 45.0, 60.0, 70.0, 120.0, 300.0] {
            let mut fit = LeastSquares::new(Vector2::new(1.0, 0.5e-4), Vector2::new(0.3, 1e-4));
            fit.take(&ScaledRow { h: Vector2::new(50.0, 3e5), z });
            let found = fit.distance_to(fit.within(low, high));
            let steps =
                (0..=200).flat_map(|i| (0..=200).map(move |k| Vector2::new(f64::from(i), f64::from(k)) / 200.0));
            let least = steps.map(|u| fit.distance_to(low + u.component_mul(&(high - low)))).fold(f64::MAX, f64::min);
            assert!(found <= least, "{z}: {found:e} {least:e}");
            let inside = (0..2).all(|i| (low[i]..=high[i]).contains(&fit.x[i]));
            assert_eq!(inside, [60.0, 70.0, 120.0].contains(&z), "{z} {}", fit.x);
        }
    }

    #[test]
    fn distance_of_two_rows_is_that_of_their_joint_covariance() {
        let fit = LeastSquares::new(Vector2::new(1.0, 0.0), Vector2::new(0.3, 1e-4));
        let pair = [ScaledRow { h: Vector2::new(5.0, 3e4), z: 1.0 }, ScaledRow { h: Vector2::new(2.0, -1e4), z: 3.0 }];
        let h = Matrix2::from_rows(&[pair[0].h.transpose(), pair[1].h.transpose()]);
        let innovation = Vector2::new(pair[0].z, pair[1].z) - h * fit.x;
        let joint = (Matrix2::identity() + h * fit.p * h.transpose()).try_inverse().unwrap();
        let expected = innovation.dot(&(joint * innovation));
        assert!((fit.innovations(&pair).norm_squared() / expected - 1.0).abs() < 1e-12);
    }
}
