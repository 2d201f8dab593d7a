//! Pose of the end disk and its Jacobian: a circular arc of length L, smooth through the straight pose.
//!
//! With the bend vector (b_x, b_y) the end disk is turned by the rotation vector (b_y, b_x, 0), because the plane of bending
//! has azimuth -delta; its centre is at L (b_x c, -b_y c, s) with c = (1 - cos b)/b^2 and s = sin b / b.

use crate::series::Arc;
use crate::{Psi, Snake};
use nalgebra::{Isometry3, Matrix2, Matrix3, Matrix3x2, Matrix6x2, Rotation3, UnitQuaternion, Vector2, Vector3};

/// Bend rate for a wanted tip velocity, with what was left undone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampedRate {
    /// Rate of the bend vector, rad/s.
    pub bend_vel_rad_per_s: Vector2<f64>,
    /// Smallest singular value of the weighted linear Jacobian at this bend, m/rad.
    pub smallest_singular_value_m_per_rad: f64,
    /// Magnitude of the part of the wanted velocity that the snake does not follow, m/s.
    pub residual_m_per_s: f64,
}

impl Snake {
    /// Centre of the end disk in the base frame, m.
    pub fn tip_pos_in_base_m(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        let arc = Arc::of_square(bend_rad.norm_squared());
        Vector3::new(bend_rad.x * arc.cosc, -bend_rad.y * arc.cosc, arc.sinc) * self.l_m
    }

    /// Rotation of the end disk: R_z(-delta) R_y(b) R_z(delta).
    pub fn base_from_tip_rotation(&self, bend_rad: Vector2<f64>) -> Rotation3<f64> {
        let arc = Arc::of_square(bend_rad.norm_squared());
        let cross = rotation_vector(bend_rad).cross_matrix();
        Rotation3::from_matrix_unchecked(Matrix3::identity() + cross * arc.sinc + cross * cross * arc.cosc)
    }

    /// Pose of the end disk in the base frame, m.
    pub fn base_from_tip(&self, bend_rad: Vector2<f64>) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_scaled_axis(rotation_vector(bend_rad));
        Isometry3::from_parts(self.tip_pos_in_base_m(bend_rad).into(), rotation)
    }

    /// Jacobian of the end disk's twist by the bend vector, 6x2: linear rows (m/rad), then angular rows (rad/rad), base frame.
    pub fn j_x_bend(&self, bend_rad: Vector2<f64>) -> Matrix6x2<f64> {
        let arc = Arc::of_square(bend_rad.norm_squared());
        let mut j = Matrix6x2::zeros();
        j.fixed_view_mut::<3, 2>(0, 0).copy_from(&self.j_v_bend(bend_rad, &arc));
        // Left Jacobian of the rotation vector, applied to d(b_y, b_x, 0)/d bend.
        let cross = rotation_vector(bend_rad).cross_matrix();
        let left = Matrix3::identity() + cross * arc.cosc + cross * cross * arc.sinc3;
        j.fixed_view_mut::<3, 1>(3, 0).copy_from(&left.column(1));
        j.fixed_view_mut::<3, 1>(3, 1).copy_from(&left.column(0));
        j
    }

    /// J_x_psi, 6x2: linear rows (m/rad), then angular rows (rad/rad), base frame.
    pub fn j_x_psi(&self, psi: Psi) -> Matrix6x2<f64> {
        self.j_x_bend(psi.bend()) * psi.j_bend_psi()
    }

    /// Bend rate that moves the end disk's centre as wanted: least squares on the linear rows of the Jacobian.
    ///
    /// minimise |W (J_v b_dot - v)|^2 + k^2 |b_dot|^2 with W = diag(1, 1, `axial_weight`), where k grows from 0 to
    /// `damping_m_per_rad` as the smallest singular value of W J_v falls from `damping_m_per_rad` to 0. With `axial_weight` 1
    /// all three components count and that value stays above 0.4 L up to a bend of 90 deg; with 0 the lateral ones are met
    /// exactly and the axial one follows as it must, which is what a hand that pushes sideways means: two degrees of freedom
    /// cannot choose three components. The lateral rows alone become singular at a bend of 133 deg.
    ///
    /// # Real-time
    /// Closed form, no loop, no allocation. Arguments that are not finite give a result that is not finite.
    pub fn bend_rate_for_tip_velocity(
        &self,
        bend_rad: Vector2<f64>,
        tip_vel_in_base_m_per_s: Vector3<f64>,
        axial_weight: f64,
        damping_m_per_rad: f64,
    ) -> DampedRate {
        let j_v = self.j_v_bend(bend_rad, &Arc::of_square(bend_rad.norm_squared()));
        let weights = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, axial_weight * axial_weight));
        let normal = j_v.transpose() * weights * j_v;
        let smallest = smallest_eigenvalue(&normal).max(0.0).sqrt();
        let nearness = if smallest < damping_m_per_rad { 1.0 - (smallest / damping_m_per_rad).powi(2) } else { 0.0 };
        let damped = normal + Matrix2::identity() * (damping_m_per_rad * damping_m_per_rad * nearness);
        let wanted = j_v.transpose() * weights * tip_vel_in_base_m_per_s;
        // Without damping at a singular pose no rate is the right one; standing still is the safe one.
        let bend_vel_rad_per_s = damped.try_inverse().map_or_else(Vector2::zeros, |inverse| inverse * wanted);
        DampedRate {
            bend_vel_rad_per_s,
            smallest_singular_value_m_per_rad: smallest,
            residual_m_per_s: (tip_vel_in_base_m_per_s - j_v * bend_vel_rad_per_s).norm(),
        }
    }

    fn j_v_bend(&self, bend_rad: Vector2<f64>, arc: &Arc) -> Matrix3x2<f64> {
        let (x, y) = (bend_rad.x, bend_rad.y);
        Matrix3x2::new(
            arc.cosc + x * x * arc.cosc_slope,
            x * y * arc.cosc_slope,
            -x * y * arc.cosc_slope,
            -arc.cosc - y * y * arc.cosc_slope,
            x * arc.sinc_slope,
            y * arc.sinc_slope,
        ) * self.l_m
    }
}

fn rotation_vector(bend_rad: Vector2<f64>) -> Vector3<f64> {
    Vector3::new(bend_rad.y, bend_rad.x, 0.0)
}

fn smallest_eigenvalue(symmetric: &Matrix2<f64>) -> f64 {
    let half_trace = 0.5 * (symmetric.m11 + symmetric.m22);
    half_trace - (0.5 * (symmetric.m11 - symmetric.m22)).hypot(symmetric.m12)
}
