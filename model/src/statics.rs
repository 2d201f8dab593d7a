//! Elastic energy of the bent backbones and the minimum-norm loads that hold them, Eqs. (9)-(11).
//!
//! E = (E I b^2 / 2) (1/L + sum 1/L_i), L_i = L + q_i. In the bend vector, q is linear, so that E, its gradient and its Hessian
//! are smooth everywhere. Virtual work gives J_q^T tau = grad E - J_x^T w for a wrench w applied *on* the snake by its
//! environment; the solution of least norm is tau = J_q (J_q^T J_q)^-1 (grad E - J_x^T w), the same in either coordinates.

use crate::{Psi, Snake};
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3, Vector6};

impl Snake {
    /// Elastic energy of all four backbones, J.
    pub fn energy_j(&self, bend_rad: Vector2<f64>) -> f64 {
        0.5 * self.bending_stiffness_nm2 * bend_rad.norm_squared() * self.inverse_lengths(bend_rad)
    }

    /// d E / d bend, N m.
    pub fn grad_energy_bend_nm(&self, bend_rad: Vector2<f64>) -> Vector2<f64> {
        let slope = self.inverse_lengths_slope(bend_rad);
        (bend_rad * self.inverse_lengths(bend_rad) + slope * (0.5 * bend_rad.norm_squared()))
            * self.bending_stiffness_nm2
    }

    /// d2 E / d bend2, N m/rad; positive definite.
    pub fn hess_energy_bend_nm(&self, bend_rad: Vector2<f64>) -> Matrix2<f64> {
        let slope = self.inverse_lengths_slope(bend_rad);
        let cubes = self.lengths_m(bend_rad).map(|l| 2.0 / (l * l * l));
        let curvature = self.j_q_bend.transpose() * Matrix3x2::from_fn(|i, k| cubes[i] * self.j_q_bend[(i, k)]);
        let mixed = bend_rad * slope.transpose();
        (Matrix2::identity() * self.inverse_lengths(bend_rad)
            + mixed
            + mixed.transpose()
            + curvature * (0.5 * bend_rad.norm_squared()))
            * self.bending_stiffness_nm2
    }

    /// d E / d psi, N m: Eq. (9).
    pub fn grad_energy_psi_nm(&self, psi: Psi) -> Vector2<f64> {
        psi.j_bend_psi().transpose() * self.grad_energy_bend_nm(psi.bend())
    }

    /// d2 E / d psi2, N m/rad.
    pub fn hess_energy_psi_nm(&self, psi: Psi) -> Matrix2<f64> {
        let bend_rad = psi.bend();
        let j = psi.j_bend_psi();
        let grad = self.grad_energy_bend_nm(bend_rad);
        let (sin, cos) = psi.delta_rad.sin_cos();
        // d2 bend / (d theta_L d delta) = (sin, -cos) and d2 bend / d delta2 = -bend.
        let mixed = grad.x * sin - grad.y * cos;
        let turning = -grad.dot(&bend_rad);
        j.transpose() * self.hess_energy_bend_nm(bend_rad) * j + Matrix2::new(0.0, mixed, mixed, turning)
    }

    /// Minimum-norm loads of the lines, N, push positive, without external wrench: Eq. (11).
    pub fn tau_n(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        self.loads_for_moment(self.grad_energy_bend_nm(bend_rad))
    }

    /// Minimum-norm loads, N, when the environment applies a wrench on the end disk.
    ///
    /// `wrench_on_tip` is (force in N, moment about the disk's centre in N m), base frame. The sign is that of a wrench *on*
    /// the snake; Eq. (11) as printed takes the wrench that the snake exerts.
    pub fn tau_with_wrench_n(&self, bend_rad: Vector2<f64>, wrench_on_tip: &Vector6<f64>) -> Vector3<f64> {
        let moment = self.j_x_bend(bend_rad).transpose() * wrench_on_tip;
        self.loads_for_moment(self.grad_energy_bend_nm(bend_rad) - moment)
    }

    /// d tau / d bend, 3x2, N/rad, of [`Snake::tau_n`].
    pub fn j_tau_bend_n(&self, bend_rad: Vector2<f64>) -> Matrix3x2<f64> {
        self.j_bend_q().transpose() * self.hess_energy_bend_nm(bend_rad)
    }

    /// d tau / d psi, 3x2, N/rad, of [`Snake::tau_n`].
    pub fn j_tau_psi_n(&self, psi: Psi) -> Matrix3x2<f64> {
        self.j_tau_bend_n(psi.bend()) * psi.j_bend_psi()
    }

    /// J (J^T J)^-1 is the transpose of the pseudo-inverse.
    fn loads_for_moment(&self, moment_nm: Vector2<f64>) -> Vector3<f64> {
        self.j_bend_q().transpose() * moment_nm
    }

    fn lengths_m(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        self.q(bend_rad).add_scalar(self.l_m)
    }

    fn inverse_lengths(&self, bend_rad: Vector2<f64>) -> f64 {
        1.0 / self.l_m + self.lengths_m(bend_rad).map(|l| 1.0 / l).sum()
    }

    fn inverse_lengths_slope(&self, bend_rad: Vector2<f64>) -> Vector2<f64> {
        self.j_q_bend.transpose() * self.lengths_m(bend_rad).map(|l| -1.0 / (l * l))
    }
}
