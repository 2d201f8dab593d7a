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

use super::{Bends, MAX_BENDS, Segments};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

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
    /// No allocation; two Cholesky factors of as many rows as there are bends, and where a direction is damped one eigenvalue
    /// decomposition with a bounded number of rounds.
    pub fn bend_rates(&self, bends_rad: &Bends, twist: &Vector6<f64>, weights: &SegmentRateWeights) -> SegmentRate {
        let SegmentRateWeights { axial, turn_m_per_rad: turn, damping_m_per_rad: damping } = *weights;
        let (tip_pos_in_base_m, j) = self.tip(bends_rad);
        let weight = Vector6::new(1.0, 1.0, axial, turn, turn, turn);
        let weighted = SMatrix::<f64, 6, MAX_BENDS>::from_fn(|i, k| weight[i] * j[(i, k)]);
        let twist = weight.component_mul(twist);
        // Columns of segments that are not there would cost as much as those of others.
        let undamped = match self.n {
            1 => undamped::<2>(&weighted, &twist, damping),
            2 => undamped::<4>(&weighted, &twist, damping),
            _ => undamped::<MAX_BENDS>(&weighted, &twist, damping),
        };
        let bends_vel_rad_per_s = undamped.unwrap_or_else(|| damped(&weighted, &twist, damping));
        let lateral = j.fixed_rows::<2>(0) * j.fixed_rows::<2>(0).transpose();
        let (middle, half) =
            (0.5 * (lateral.m11 + lateral.m22), (0.5 * (lateral.m11 - lateral.m22)).hypot(lateral.m12));
        let is_near_singular = (middle - half).max(0.0).sqrt() < 4.0 * damping;
        SegmentRate { bends_vel_rad_per_s, tip_pos_in_base_m, is_near_singular }
    }
}

/// The least squares over the first N columns where no direction is damped: every gain is at least `damping` where what is left of the
/// normal matrix without its square still has a Cholesky factor.
fn undamped<const N: usize>(
    weighted: &SMatrix<f64, 6, MAX_BENDS>,
    twist: &Vector6<f64>,
    damping: f64,
) -> Option<Bends> {
    let own: SMatrix<f64, 6, N> = weighted.fixed_columns::<N>(0).into_owned();
    let normal: SMatrix<f64, N, N> = own.tr_mul(&own);
    (normal - SMatrix::from_diagonal_element(damping * damping)).cholesky()?;
    let rates: SVector<f64, N> = normal.cholesky()?.solve(&own.tr_mul(twist));
    let mut all = Bends::zeros();
    all.fixed_rows_mut::<N>(0).copy_from(&rates);
    Some(all)
}

/// The same with every direction damped by its own gain; directions of segments that are not there have none.
fn damped(weighted: &SMatrix<f64, 6, MAX_BENDS>, twist: &Vector6<f64>, damping: f64) -> Bends {
    let mut rates = Bends::zeros();
    let wanted = weighted.tr_mul(twist);
    let Some(eigen) = weighted.tr_mul(weighted).try_symmetric_eigen(f64::EPSILON, MAX_ROUNDS) else { return rates };
    for (direction, square) in eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter()) {
        let gain = square.max(0.0).sqrt();
        let extra = if gain < damping { damping * damping - gain * gain } else { 0.0 };
        let divisor = gain * gain + extra;
        if divisor > 0.0 {
            rates += direction * (direction.dot(&wanted) / divisor);
        }
    }
    rates
}

/// Rounds of the decomposition; 10 to 20 are usual.
const MAX_ROUNDS: usize = 200;
