//! One measured shape as rows of the regression for eta and lambda: the corrected Eq. (20).
//!
//! A contrast w of the lines (unit length, entries summing to zero) turns the three equations
//! z_i - g_i f_s s_i / K_c = eta (1/K_d + g_i/K_c) tau_i + lambda s_i into one row without the common mode, whose noise is
//! sigma w^T (J_q + alpha). Two contrasts exist where all directions are known, one where a line is left out.

use super::least_squares::ScaledRow;
use crate::Snake;
use core::f64::consts::FRAC_1_SQRT_2;
use nalgebra::{Matrix3x2, Vector2, Vector3};

/// What is known when a shape has been measured.
pub(crate) struct Scene<'a> {
    pub snake: &'a Snake,
    /// (eta, lambda in m): decides on which branch of the friction a line is, and how large alpha is.
    pub estimate: Vector2<f64>,
    pub sigma_bend_rad: f64,
    pub bend_rad: Vector2<f64>,
    pub q_tilde_m: Vector3<f64>,
}

/// One or two rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    scaled: [ScaledRow; 2],
    n: usize,
    innovation_mean_square_m2: f64,
}

impl Rows {
    /// The rows with noise of variance one, independent of each other.
    pub(crate) fn scaled(&self) -> &[ScaledRow] {
        self.scaled.get(..self.n).unwrap_or_default()
    }

    /// Mean square over the three lines of what the estimate does not explain, without the common mode, m2.
    pub(crate) fn innovation_mean_square_m2(&self) -> f64 {
        self.innovation_mean_square_m2
    }
}

impl Scene<'_> {
    /// Rows for the lines whose sign is known; `None` for fewer than two of them or numbers that cannot be scaled.
    pub(crate) fn rows(&self, signs: &[Option<f64>; 3]) -> Option<Rows> {
        let s = Vector3::from_fn(|i, _| signs[i].unwrap_or(0.0));
        let (z_m, load_column_m) = self.equations(&s);
        let (contrasts, n) = self.contrasts(signs)?;
        let plain = contrasts.map(|w| ScaledRow { h: Vector2::new(w.dot(&load_column_m), w.dot(&s)), z: w.dot(&z_m) });

        let sum_m2: f64 = plain.iter().take(n).map(|row| (row.z - row.h.dot(&self.estimate)).powi(2)).sum();
        // The three lines have two contrasts; a single one stands for both.
        let innovation_mean_square_m2 = sum_m2 * (2.0 / n as f64) / 3.0;

        let [eta, lambda_m] = self.estimate.into();
        let alpha = self.snake.extension_with_signs(self.bend_rad, eta, lambda_m, &s).alpha_m_per_rad;
        let noise_m = (self.snake.j_q_bend() + alpha) * self.sigma_bend_rad;
        Some(Rows {
            scaled: whitened(&plain, &contrasts.map(|w| noise_m.transpose() * w), n)?,
            n,
            innovation_mean_square_m2,
        })
    }

    /// Left side and the column of eta of each line's equation, m.
    fn equations(&self, s: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let tau_n = self.snake.tau_n(self.bend_rad);
        let (mut z_m, mut load_column_m) = (self.q_tilde_m - self.snake.q(self.bend_rad), tau_n);
        for i in 0..3 {
            let slope = self.snake.cone_load_with_sign(self.estimate.x * tau_n[i], s[i]).slope;
            z_m[i] -= slope * super::F_S_N * s[i] * self.snake.c_c_m_per_n;
            load_column_m[i] *= self.snake.c_d_m_per_n + slope * self.snake.c_c_m_per_n;
        }
        (z_m, load_column_m)
    }

    fn contrasts(&self, signs: &[Option<f64>; 3]) -> Option<([Vector3<f64>; 2], usize)> {
        let unknown = signs.iter().filter(|s| s.is_none()).count();
        match (unknown, signs.iter().position(Option::is_none)) {
            (0, _) => {
                let w: Matrix3x2<f64> = self.snake.j_q_bend() / (self.snake.r_m() * 1.5_f64.sqrt());
                Some(([w.column(0).into(), w.column(1).into()], 2))
            }
            (1, Some(left_out)) => {
                let mut w = Vector3::zeros();
                w[(left_out + 1) % 3] = FRAC_1_SQRT_2;
                w[(left_out + 2) % 3] = -FRAC_1_SQRT_2;
                Some(([w, Vector3::zeros()], 1))
            }
            _ => None,
        }
    }
}

/// Divides rows by the Cholesky factor of their covariance, given the noise vector of each.
fn whitened(plain: &[ScaledRow; 2], noise_m: &[Vector2<f64>; 2], n: usize) -> Option<[ScaledRow; 2]> {
    let [first, second] = *plain;
    let l_11 = noise_m[0].norm();
    let a = ScaledRow { h: first.h / l_11, z: first.z / l_11 };
    if n == 1 {
        return finite([a, a]);
    }
    let l_21 = noise_m[1].dot(&noise_m[0]) / l_11;
    let l_22 = (noise_m[1].norm_squared() - l_21 * l_21).sqrt();
    finite([a, ScaledRow { h: (second.h - a.h * l_21) / l_22, z: (second.z - a.z * l_21) / l_22 }])
}

fn finite(rows: [ScaledRow; 2]) -> Option<[ScaledRow; 2]> {
    rows.iter().all(|row| row.z.is_finite() && row.h.iter().all(|h| h.is_finite())).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_rows_have_independent_noise_of_variance_one() {
        let noise_m = [Vector2::new(3e-5, 1e-5), Vector2::new(2e-5, -4e-5)];
        let row = |z| ScaledRow { h: Vector2::new(z, -z), z };
        // Each of the two sources of noise as a left side: what comes out is a column of the scaled noise.
        let by_source = [0, 1].map(|k| whitened(&noise_m.map(|n| row(n[k])), &noise_m, 2).unwrap());
        let [x, y] = [0, 1].map(|i| Vector2::new(by_source[0][i].z, by_source[1][i].z));
        assert!((x.norm() - 1.0).abs() < 1e-12 && (y.norm() - 1.0).abs() < 1e-12 && x.dot(&y).abs() < 1e-12);
        assert!(by_source.iter().flatten().all(|row| row.h == Vector2::new(row.z, -row.z)));
        assert!(whitened(&[row(1.0), row(1.0)], &[Vector2::zeros(); 2], 2).is_none());
    }
}
