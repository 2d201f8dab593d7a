//! Rates of all bends for a wanted motion of the tip, over every component that the segments can reach.
//!
//! Problem: minimise |W (J_x b_dot - v)|^2 + |K b_dot|^2, with v the tip's twist (m/s three times, rad/s three times, base frame), J_x its
//! Jacobian, 6x(2 segments), W = diag(1, 1, axial, turn, turn, turn).
//!
//! Intuition: a turn weight of half a millimetre per radian makes turning the second aim. Where the segments can move the tip's centre as
//! wanted, they do, but for a part of about the square of turn over that direction's gain; what freedom is left turns the tip.
//!
//! Damping: k grows from 0 to `damping` as a direction's gain falls from `damping` to 0, in every eigendirection by itself. So the
//! straight pose, where no segment can advance the tip, costs no other direction anything.

use super::{Bends, BendsByBends, MAX_BENDS, Segments};
use nalgebra::{SMatrix, Vector3, Vector6};

/// How much the components of the tip's motion count beside the lateral ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentRateWeights {
    /// Of the motion along the base's axis, 1.
    pub axial: f64,
    /// Of turning, m/rad.
    pub turn_m_per_rad: f64,
    /// Gain below which a direction is damped, m/rad.
    pub damping_m_per_rad: f64,
}

/// Rates of the bends with what was left undone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentRate {
    /// Rates of the bends, rad/s.
    pub bends_vel_rad_per_s: Bends,
    /// Centre of the last disk in the base frame, m.
    pub tip_pos_in_base_m: Vector3<f64>,
    /// Whether the lateral motion itself was damped.
    pub is_near_singular: bool,
}

impl Segments {
    /// Rates of the bends that move the tip as wanted; `twist` is (m/s, rad/s) in the base frame.
    ///
    /// # Real-time
    /// No allocation; two Cholesky factors of 6x6, and where a direction is damped one eigenvalue decomposition with a bounded number of
    /// rounds.
    pub fn bend_rates(&self, bends_rad: &Bends, twist: &Vector6<f64>, weights: &SegmentRateWeights) -> SegmentRate {
        let SegmentRateWeights { axial, turn_m_per_rad: turn, damping_m_per_rad: damping } = *weights;
        let (tip_pos_in_base_m, j) = self.tip(bends_rad);
        let weight = Vector6::new(1.0, 1.0, axial, turn, turn, turn);
        let weighted = SMatrix::<f64, 6, MAX_BENDS>::from_fn(|i, k| weight[i] * j[(i, k)]);
        let wanted = weighted.transpose() * weight.component_mul(twist);
        let normal = weighted.transpose() * weighted;
        let mut bends_vel_rad_per_s = Bends::zeros();
        if let Some(undamped) = self.undamped(&normal, &wanted, damping) {
            bends_vel_rad_per_s = undamped;
        } else if let Some(eigen) = normal.try_symmetric_eigen(f64::EPSILON, MAX_ROUNDS) {
            for (direction, square) in eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter()) {
                let gain = square.max(0.0).sqrt();
                let extra = if gain < damping { damping * damping - gain * gain } else { 0.0 };
                let divisor = gain * gain + extra;
                if divisor > 0.0 {
                    bends_vel_rad_per_s += direction * (direction.dot(&wanted) / divisor);
                }
            }
        }
        let lateral = j.fixed_rows::<2>(0) * j.fixed_rows::<2>(0).transpose();
        let (middle, half) =
            (0.5 * (lateral.m11 + lateral.m22), (0.5 * (lateral.m11 - lateral.m22)).hypot(lateral.m12));
        let is_near_singular = (middle - half).max(0.0).sqrt() < 4.0 * damping;
        SegmentRate { bends_vel_rad_per_s, tip_pos_in_base_m, is_near_singular }
    }
}

impl Segments {
    /// The same where no direction is damped, for a part of the time: every gain is at least `damping` where what is left of the normal
    /// matrix without its square still has a Cholesky factor.
    fn undamped(&self, normal: &BendsByBends, wanted: &Bends, damping: f64) -> Option<Bends> {
        let mut left = *normal;
        (0..self.n_bends()).for_each(|k| left[(k, k)] -= damping * damping);
        self.padded(left).cholesky()?;
        Some(self.padded(*normal).cholesky()?.solve(wanted))
    }
}

/// Rounds of the decomposition; 10 to 20 are usual.
const MAX_ROUNDS: usize = 200;
