//! Line displacements q and configuration, Eqs. (1)-(7): the bend vector inside, psi = (theta_L, delta) at the edges.
//!
//! With g_i = (i-1) 120 deg, Eq. (1) in the bend vector is linear: q_i = -r (b_x cos g_i - b_y sin g_i). Its Jacobian is
//! constant, J^T J = (3/2) r^2 I, and the three lines sum to zero. In psi the same map is singular at the straight pose,
//! where delta has no meaning; functions that need its inverse return `None` there.

use crate::Snake;
use core::f64::consts::{FRAC_PI_2, PI};
use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, Vector2, Vector3};

/// 120 degrees between neighbouring secondary backbones, rad.
const BETA_RAD: f64 = 2.0 * PI / 3.0;

/// Below this bend delta carries no information, and inverses in psi are refused.
const STRAIGHT_RAD: f64 = 1e-9;

/// The paper's configuration (theta_L, delta).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Psi {
    /// Tangent angle of the end disk in the snake plane, rad; pi/2 is straight, smaller is bent.
    pub theta_l_rad: f64,
    /// Plane of bending, rad: its azimuth in the base frame is -delta.
    pub delta_rad: f64,
}

impl Psi {
    /// Configuration of a bend vector: theta_L <= pi/2, delta in (-pi, pi], delta = 0 at the straight pose.
    pub fn from_bend(bend_rad: Vector2<f64>) -> Self {
        Self { theta_l_rad: FRAC_PI_2 - bend_rad.norm(), delta_rad: bend_rad.y.atan2(bend_rad.x) }
    }

    /// The bend vector b (cos delta, sin delta), rad.
    pub fn bend(&self) -> Vector2<f64> {
        let (sin, cos) = self.delta_rad.sin_cos();
        Vector2::new(cos, sin) * self.bend_angle_rad()
    }

    /// The bend b = pi/2 - theta_L, rad.
    pub fn bend_angle_rad(&self) -> f64 {
        FRAC_PI_2 - self.theta_l_rad
    }

    /// d bend / d psi, 2x2, rad/rad; singular at the straight pose.
    pub fn j_bend_psi(&self) -> Matrix2<f64> {
        let (sin, cos) = self.delta_rad.sin_cos();
        let b = self.bend_angle_rad();
        Matrix2::new(-cos, -b * sin, -sin, b * cos)
    }

    /// Whether delta is without meaning here.
    pub(crate) fn is_straight(&self) -> bool {
        self.bend_angle_rad().abs() < STRAIGHT_RAD
    }

    fn delta_i(&self, i: usize) -> f64 {
        self.delta_rad + BETA_RAD * [0.0, 1.0, 2.0][i]
    }
}

impl Snake {
    /// Line displacements q, m, push positive, of a bend vector in rad; Eq. (1).
    pub fn q(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        self.j_q_bend * bend_rad
    }

    /// Line displacements q, m, of psi; Eq. (1) as printed.
    pub fn q_of_psi(&self, psi: Psi) -> Vector3<f64> {
        Vector3::from_fn(|i, _| -self.r_m * psi.delta_i(i).cos() * psi.bend_angle_rad())
    }

    /// Bend vector, rad, that fits three line displacements, m, best; Eqs. (2)-(3) by least squares from all three lines.
    ///
    /// Dividing by cos delta_i, as Eq. (2) does, has false singularities; this has none. A common displacement of all lines
    /// has no effect.
    pub fn bend_from_q(&self, q_m: Vector3<f64>) -> Vector2<f64> {
        self.j_bend_q() * q_m
    }

    /// d q / d bend, 3x2, m/rad: constant.
    pub fn j_q_bend(&self) -> Matrix3x2<f64> {
        self.j_q_bend
    }

    /// Pseudo-inverse of [`Snake::j_q_bend`], 2x3, rad/m: constant.
    pub fn j_bend_q(&self) -> Matrix2x3<f64> {
        self.j_q_bend.transpose() * (2.0 / (3.0 * self.r_m * self.r_m))
    }

    /// J_q_psi = d q / d psi, 3x2, m/rad.
    pub fn j_q_psi(&self, psi: Psi) -> Matrix3x2<f64> {
        let b = psi.bend_angle_rad();
        Matrix3x2::from_fn(|i, column| {
            let (sin, cos) = psi.delta_i(i).sin_cos();
            self.r_m * if column == 0 { cos } else { sin * b }
        })
    }

    /// J_psi_q from lines 1 and 2, 2x2, rad/m: Eq. (7), with (theta_L - theta_0) where the second row is printed with theta_L.
    ///
    /// `None` at the straight pose, where delta is not defined.
    pub fn j_psi_q12(&self, psi: Psi) -> Option<Matrix2<f64>> {
        if psi.is_straight() {
            return None;
        }
        let (s_1, c_1) = psi.delta_i(0).sin_cos();
        let (s_2, c_2) = psi.delta_i(1).sin_cos();
        let theta = -psi.bend_angle_rad();
        Some(Matrix2::new(s_2, -s_1, c_2 / theta, -c_1 / theta) / (self.r_m * BETA_RAD.sin()))
    }

    /// J_psi_q from all three lines, 2x3, rad/m: the pseudo-inverse (J^T J)^-1 J^T of J_q_psi.
    ///
    /// `None` at the straight pose, where delta is not defined.
    pub fn j_psi_q(&self, psi: Psi) -> Option<Matrix2x3<f64>> {
        if psi.is_straight() {
            return None;
        }
        // The columns of J_q_psi are orthogonal with squared norms (3/2) r^2 and (3/2) r^2 b^2.
        let b = psi.bend_angle_rad();
        let weights = Matrix2::from_diagonal(&Vector2::new(1.0, 1.0 / (b * b)));
        Some(weights * self.j_q_psi(psi).transpose() * (2.0 / (3.0 * self.r_m * self.r_m)))
    }
}
