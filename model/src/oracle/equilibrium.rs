//! The forward model psi(q~) without hysteresis: where a bent snake rests on its elastic lines.
//!
//! Problem: given q~, find the bend with J_q^+ q~ = bend + c eta J_q^+ tau(bend), c the compliance of a line. Because J_q^+ tau is
//! (2/(3 r^2)) grad E, this is where the convex function |bend|^2/2 + k E(bend) - bend . J_q^+ q~ has its minimum, and Newton's
//! method, with steps halved while they do not reduce the residual, finds it. The mean of q~ does not bend the snake: it
//! becomes the internal load tau_m = mean(q~) / (c + 3 L/(E A)).
//!
//! Failure: only beyond a bend of pi, where a backbone's length would vanish; the status says so.

use crate::Snake;
use core::f64::consts::PI;
use nalgebra::{Matrix2, Vector2, Vector3};

/// How a search for the equilibrium ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EquilibriumStatus {
    /// The residual is at rounding level.
    Converged,
    /// No step reduced the residual any further; the bend is the best one found.
    Stuck,
    /// The input was not finite, or the equilibrium lies beyond a bend of pi.
    OutOfRange,
}

/// Where the snake rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equilibrium {
    /// Bend vector, rad.
    pub bend_rad: Vector2<f64>,
    /// Internal load tau_m that all three lines share, N, push positive.
    pub tau_common_n: f64,
    /// How the search ended.
    pub status: EquilibriumStatus,
    /// Newton steps taken.
    pub n_iterations: u32,
    /// Norm of what is left of the equation, rad.
    pub residual_rad: f64,
}

/// Newton converges in 4 to 6 steps from the linear guess; more than this means that it does not.
const MAX_ITERATIONS: u32 = 30;
/// Rounding level of the residual for bends of the order of 1 rad.
const TOLERANCE_RAD: f64 = 4e-16;
/// A step that had to be halved this often reduces nothing.
const MAX_HALVINGS: u32 = 12;

impl Snake {
    /// Equilibrium for actuator positions q~ (m) with lines of one compliance (m/N) and load scale eta (1).
    ///
    /// With [`Snake::frictionless_compliance_m_per_n`] this inverts q~ = q + eps without friction; with
    /// [`Snake::loading_compliance_m_per_n`] it inverts Eqs. (16) and (18) as printed, whose f_s and lambda are common to
    /// all lines.
    pub fn equilibrium(&self, q_tilde_m: Vector3<f64>, compliance_m_per_n: f64, eta: f64) -> Equilibrium {
        let target = self.bend_from_q(q_tilde_m);
        let gain = compliance_m_per_n * eta * 2.0 / (3.0 * self.r_m * self.r_m);
        let residual = |bend: Vector2<f64>| bend + self.grad_energy_bend_nm(bend) * gain - target;
        let slope = |bend: Vector2<f64>| Matrix2::identity() + self.hess_energy_bend_nm(bend) * gain;
        let tau_common_n = q_tilde_m.mean() / (compliance_m_per_n + self.axial_m_per_n);
        let linear = slope(Vector2::zeros()).try_inverse().map_or(target, |inverse| inverse * target);

        let mut found = Equilibrium {
            bend_rad: linear,
            tau_common_n,
            status: EquilibriumStatus::OutOfRange,
            n_iterations: 0,
            residual_rad: residual(linear).norm(),
        };
        while found.in_range() && found.n_iterations < MAX_ITERATIONS {
            if found.residual_rad <= TOLERANCE_RAD * (1.0 + target.norm()) {
                found.status = EquilibriumStatus::Converged;
                return found;
            }
            found.n_iterations += 1;
            if !found.improve(&residual, &slope) {
                break;
            }
        }
        if found.in_range() {
            // Rounding may stop the search a few units short of the tolerance: that is converged as well.
            let close = found.residual_rad <= 16.0 * TOLERANCE_RAD * (1.0 + target.norm());
            found.status = if close { EquilibriumStatus::Converged } else { EquilibriumStatus::Stuck };
        }
        found
    }
}

impl Equilibrium {
    fn in_range(&self) -> bool {
        self.residual_rad.is_finite() && self.bend_rad.norm() < PI
    }

    /// One Newton step, halved until it helps; says whether it did.
    fn improve(
        &mut self,
        residual: &impl Fn(Vector2<f64>) -> Vector2<f64>,
        slope: &impl Fn(Vector2<f64>) -> Matrix2<f64>,
    ) -> bool {
        let Some(inverse) = slope(self.bend_rad).try_inverse() else { return false };
        let mut step = inverse * residual(self.bend_rad);
        for _ in 0..MAX_HALVINGS {
            let trial = self.bend_rad - step;
            let trial_residual_rad = residual(trial).norm();
            if trial_residual_rad < self.residual_rad {
                self.bend_rad = trial;
                self.residual_rad = trial_residual_rad;
                return true;
            }
            step *= 0.5;
        }
        false
    }
}
