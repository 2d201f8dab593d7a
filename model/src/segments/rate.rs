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

use super::{Bends, MAX_BENDS, Segments, TwistByBends};
use nalgebra::{SMatrix, SVector, Vector2, Vector6};

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
    /// Whether the lateral motion itself was damped.
    pub is_near_singular: bool,
}

impl Segments {
    /// Rates of the bends that move the tip as wanted; `j` is the Jacobian of [`Segments::tip`], `twist` is (m/s, rad/s) in the base frame.
    ///
    /// # Real-time
    /// No allocation; two factors of as many rows as there are bends, and where a direction is damped one eigenvalue
    /// decomposition with a bounded number of rounds.
    pub fn bend_rates(&self, j: &TwistByBends, twist: &Vector6<f64>, weights: &SegmentRateWeights) -> SegmentRate {
        let SegmentRateWeights { axial, turn_m_per_rad: turn, damping_m_per_rad: damping } = *weights;
        let weight = Vector6::new(1.0, 1.0, axial, turn, turn, turn);
        let weighted = TwistByBends::from_fn(|i, k| weight[i] * j[(i, k)]);
        let twist = weight.component_mul(twist);
        // Columns of segments that are not there would cost as much as those of others.
        let undamped = match self.n {
            1 => undamped::<2>(&weighted, &twist, damping),
            2 => undamped::<4>(&weighted, &twist, damping),
            _ => undamped::<MAX_BENDS>(&weighted, &twist, damping),
        };
        let bends_vel_rad_per_s = undamped.unwrap_or_else(|| damped(&weighted, &twist, damping));
        let lateral = j.fixed_rows::<2>(0) * j.fixed_rows::<2>(0).transpose();
        let apart = Vector2::new(0.5 * (lateral.m11 - lateral.m22), lateral.m12);
        let (middle, half) = (0.5 * (lateral.m11 + lateral.m22), apart.norm());
        let is_near_singular = (middle - half).max(0.0).sqrt() < 4.0 * damping;
        SegmentRate { bends_vel_rad_per_s, is_near_singular }
    }
}

/// The least squares over the first N columns where no direction is damped: every gain is at least `damping` where what is left of the
/// normal matrix without its square still is positive definite.
fn undamped<const N: usize>(weighted: &TwistByBends, twist: &Vector6<f64>, damping: f64) -> Option<Bends> {
    let own: SMatrix<f64, 6, N> = weighted.fixed_columns::<N>(0).into_owned();
    let normal: SMatrix<f64, N, N> = own.tr_mul(&own);
    factor(&(normal - SMatrix::from_diagonal_element(damping * damping)))?;
    let rates = solved(&factor(&normal)?, own.tr_mul(twist));
    let mut all = Bends::zeros();
    all.fixed_rows_mut::<N>(0).copy_from(&rates);
    Some(all)
}

/// L and the reciprocals of D, on the diagonal, of a symmetric matrix L D L^T, where L has ones on its diagonal; `None` where the matrix
/// is not positive definite. The library's Cholesky factor takes twice as long at these sizes, in each step of `resolve`.
fn factor<const N: usize>(symmetric: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    // L D, column by column.
    let mut scaled = *symmetric;
    let mut l = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        for row in column..N {
            scaled[(row, column)] -= (0..column).map(|k| scaled[(row, k)] * l[(column, k)]).sum::<f64>();
        }
        let per_d = Some(scaled[(column, column)]).filter(|d| *d > 0.0)?.recip();
        l[(column, column)] = per_d;
        (column + 1..N).for_each(|row| l[(row, column)] = scaled[(row, column)] * per_d);
    }
    Some(l)
}

/// The solution x of L D L^T x = right side, of a factor as [`factor`] gives it.
fn solved<const N: usize>(l: &SMatrix<f64, N, N>, mut x: SVector<f64, N>) -> SVector<f64, N> {
    for row in 0..N {
        x[row] -= (0..row).map(|k| l[(row, k)] * x[k]).sum::<f64>();
    }
    for row in (0..N).rev() {
        x[row] = x[row] * l[(row, row)] - (row + 1..N).map(|k| l[(k, row)] * x[k]).sum::<f64>();
    }
    x
}

/// The same with every direction damped by its own gain; directions of segments that are not there have none.
fn damped(weighted: &TwistByBends, twist: &Vector6<f64>, damping: f64) -> Bends {
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
