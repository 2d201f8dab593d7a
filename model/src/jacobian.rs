//! The corrected Jacobian J~ = (I + J alpha)^-1 J of Eq. (26), and its right inverse J_q + alpha, in both coordinates.
//!
//! From all three lines J is the pseudo-inverse of J_q; from lines 1 and 2 it is Eq. (7). The two agree on rates that sum to
//! zero and differ otherwise: a common rate of all three lines moves nothing in the first and bends the snake in the second.

use crate::{Psi, Snake};
use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, Vector2, Vector3};

impl Snake {
    /// J~ in the bend vector from all three lines, 2x3, rad/m. `alpha_m_per_rad` is d eps / d bend.
    ///
    /// `None` where I + J alpha cannot be inverted, which no machine within the ranges of its parameters reaches.
    pub fn j_tilde_bend(&self, alpha_m_per_rad: &Matrix3x2<f64>) -> Option<Matrix2x3<f64>> {
        let j = self.j_bend_q();
        Some((Matrix2::identity() + j * alpha_m_per_rad).try_inverse()? * j)
    }

    /// J~ in psi from all three lines, 2x3, rad/m. `alpha_m_per_rad` is d eps / d psi.
    ///
    /// `None` at the straight pose, where delta is not defined.
    pub fn j_tilde_psi(&self, psi: Psi, alpha_m_per_rad: &Matrix3x2<f64>) -> Option<Matrix2x3<f64>> {
        let j = self.j_psi_q(psi)?;
        Some((Matrix2::identity() + j * alpha_m_per_rad).try_inverse()? * j)
    }

    /// J~ in psi from lines 1 and 2 as printed, 2x2, rad/m. `alpha_m_per_rad` is d eps / d psi.
    ///
    /// `None` at the straight pose, where delta is not defined.
    pub fn j_tilde_psi_q12(&self, psi: Psi, alpha_m_per_rad: &Matrix3x2<f64>) -> Option<Matrix2<f64>> {
        let j = self.j_psi_q12(psi)?;
        let alpha = alpha_m_per_rad.fixed_rows::<2>(0);
        Some((Matrix2::identity() + j * alpha).try_inverse()? * j)
    }

    /// Actuator rates q~_dot = (J_q + alpha) b_dot, m/s, for a bend rate in rad/s: the right inverse of J~.
    pub fn q_tilde_vel_m_per_s(
        &self,
        alpha_m_per_rad: &Matrix3x2<f64>,
        bend_vel_rad_per_s: Vector2<f64>,
    ) -> Vector3<f64> {
        (self.j_q_bend + alpha_m_per_rad) * bend_vel_rad_per_s
    }
}
