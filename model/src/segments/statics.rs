//! Elastic energy of the bent backbones of all segments, its derivatives, and what the lines' loads give along the snake.
//!
//! E_j = |b_j|^2/2 S_j(b_j) with S_j = E I_j/L_j + sum over the lines that run in segment j of E I_k/(L_j + J_k b_j). E is the sum
//! over the segments, so that its Hessian is block diagonal; the segments meet in J^T tau = eta grad E alone.

use super::{Bends, BendsByBends, LineValues, LinesByBends, MAX_BENDS, MAX_SEGMENTS, Segments};
use nalgebra::{Matrix2, RowSVector, Vector2};

/// S_j, its gradient and its Hessian.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stiffness {
    value: f64,
    slope: Vector2<f64>,
    curvature: Matrix2<f64>,
}

/// Of each segment; nothing behind the last.
pub(super) type Stiffnesses = [Stiffness; MAX_SEGMENTS];

impl Segments {
    /// Elastic energy of all backbones, J.
    pub fn energy_j(&self, bends_rad: &Bends) -> f64 {
        let of = |j: usize| {
            let bend = self.bend(bends_rad, j);
            0.5 * bend.norm_squared() * self.stiffness(j, bend).value
        };
        (0..self.n).map(of).sum()
    }

    /// d E / d bends, N m.
    pub fn grad_energy_nm(&self, bends_rad: &Bends) -> Bends {
        self.grad_energy_with_nm(bends_rad, &self.stiffnesses(bends_rad))
    }

    /// The same where the stiffnesses at these bends are known.
    pub(super) fn grad_energy_with_nm(&self, bends_rad: &Bends, stiffnesses: &Stiffnesses) -> Bends {
        let mut grad = Bends::zeros();
        for (j, stiffness) in stiffnesses.iter().enumerate().take(self.n) {
            let bend = self.bend(bends_rad, j);
            let own = bend * stiffness.value + stiffness.slope * (0.5 * bend.norm_squared());
            grad.fixed_rows_mut::<2>(2 * j).copy_from(&own);
        }
        grad
    }

    /// d2 E / d bends2, N m/rad: block diagonal, positive definite.
    pub fn hess_energy_nm(&self, bends_rad: &Bends) -> BendsByBends {
        let mut hess = BendsByBends::zeros();
        for j in 0..self.n {
            let bend = self.bend(bends_rad, j);
            let Stiffness { value, slope, curvature } = self.stiffness(j, bend);
            let mixed = bend * slope.transpose();
            let own = Matrix2::identity() * value + mixed + mixed.transpose() + curvature * (0.5 * bend.norm_squared());
            hess.fixed_view_mut::<2, 2>(2 * j, 2 * j).copy_from(&own);
        }
        hess
    }

    /// How fast d E / d bends changes while the bends do, N m/s: [`Segments::hess_energy_nm`] times their rates, without the matrix.
    pub(super) fn grad_energy_vel_nm_per_s(
        &self,
        bends_rad: &Bends,
        vel_rad_per_s: &Bends,
        stiffnesses: &Stiffnesses,
    ) -> Bends {
        let mut rates = Bends::zeros();
        for (j, Stiffness { value, slope, curvature }) in stiffnesses.iter().enumerate().take(self.n) {
            let (bend, vel) = (self.bend(bends_rad, j), self.bend(vel_rad_per_s, j));
            let mixed = bend * slope.dot(&vel) + slope * bend.dot(&vel);
            let own = vel * *value + mixed + curvature * vel * (0.5 * bend.norm_squared());
            rates.fixed_rows_mut::<2>(2 * j).copy_from(&own);
        }
        rates
    }

    /// Loads of least norm with J^T tau = moments, N, push positive.
    pub fn least_loads_n(&self, moments_nm: &Bends) -> LineValues {
        self.pinv().tr_mul(moments_nm)
    }

    /// What the loads stretch the primary backbones by, u_j of each segment, summed up for each line, m.
    pub fn axial_give_m(&self, tau_n: &LineValues) -> LineValues {
        let mut give_m = LineValues::zeros();
        for j in 0..self.n {
            let u_m = self.axial_m_per_n[j] * self.passing(j).map(|k| tau_n[k]).sum::<f64>();
            self.passing(j).for_each(|k| give_m[k] += u_m);
        }
        give_m
    }

    /// The same for each column of d tau / d bends, m/rad.
    pub(super) fn axial_give_by_bends(&self, j_tau: &LinesByBends) -> LinesByBends {
        let mut give = LinesByBends::zeros();
        for j in 0..self.n {
            let loads: RowSVector<f64, MAX_BENDS> = self.passing(j).map(|k| j_tau.row(k).into_owned()).sum();
            let stretch = loads * self.axial_m_per_n[j];
            for k in self.passing(j) {
                let row = give.row(k) + stretch;
                give.set_row(k, &row);
            }
        }
        give
    }

    pub(super) fn stiffnesses(&self, bends_rad: &Bends) -> Stiffnesses {
        let nothing = Stiffness { value: 0.0, slope: Vector2::zeros(), curvature: Matrix2::zeros() };
        let mut all = [nothing; MAX_SEGMENTS];
        for (j, own) in all.iter_mut().enumerate().take(self.n) {
            *own = self.stiffness(j, self.bend(bends_rad, j));
        }
        all
    }

    fn stiffness(&self, j: usize, bend: Vector2<f64>) -> Stiffness {
        let mut sum = Stiffness {
            value: self.primary_nm2[j] / self.l_m[j],
            slope: Vector2::zeros(),
            curvature: Matrix2::zeros(),
        };
        for k in self.passing(j) {
            let row = self.rows[k];
            let per_length = 1.0 / (self.l_m[j] + row.dot(&bend));
            let share = self.line_nm2[k] * per_length;
            sum.value += share;
            sum.slope -= row * (share * per_length);
            sum.curvature += row * row.transpose() * (2.0 * share * per_length * per_length);
        }
        sum
    }
}
