//! The redundancy of three lines for two degrees of freedom, resolved in general: Eq. (10) with preload and bounds.
//!
//! Problem: minimise |tau - tau_p|^2 subject to J_q^T tau = g and low <= tau <= high, with J_q = d q / d bend.
//!
//! where: g = eta grad E - J_x^T w is what the lines have to hold, w a wrench applied *on* the end disk; tau_p is the preferred
//! load, the minimum-norm one of Eq. (11) plus a commanded preload tau_m (1, 1, 1); low is a limit of strain, for lines that
//! are pulled, high one of buckling, for lines that are pushed.
//!
//! Solution: the columns of J_q sum to zero over the lines, so that every load that holds g is tau_0 + t (1, 1, 1), with tau_0 of
//! minimum norm and orthogonal to (1, 1, 1). The programme has one parameter: |tau - tau_p|^2 = 3 (t - tau_m)^2 + constant, and
//! each bound says low_i - tau_0i <= t <= high_i - tau_0i. The answer is tau_m clamped to the intersection of the three
//! intervals: Eq. (11) in closed form where no bound is active, exact where one is.
//!
//! Failure: an empty intersection. One line then asks for more push than another can take; the status names both and the
//! gap between them, and the loads share the excess equally, which is the smallest possible.

use crate::parameters::in_range;
use crate::{ParameterError, Snake};
use core::f64::consts::PI;
use nalgebra::{Vector2, Vector3, Vector6};

/// What the lines have to hold, and how they are to share it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadRequest {
    /// (force in N, moment about the end disk's centre in N m) that the environment applies on the snake, base frame.
    pub wrench_on_tip: Vector6<f64>,
    /// Load scale eta on the elastic load, 1.
    pub eta: f64,
    /// Internal load tau_m that all three lines shall share, N, push positive.
    pub preload_n: f64,
}

impl Default for LoadRequest {
    /// Eq. (11): the free snake, the elastic load of Table I, no preload.
    fn default() -> Self {
        Self { wrench_on_tip: Vector6::zeros(), eta: 1.0, preload_n: 0.0 }
    }
}

/// Smallest and largest load of each line, checked: no NaN, low <= high. Infinite bounds are allowed and bind nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadBounds {
    low_n: Vector3<f64>,
    high_n: Vector3<f64>,
}

/// How the redundancy was resolved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadStatus {
    /// The preferred load lies within every bound.
    Preferred,
    /// A bound is active: the internal load differs from the preload asked for.
    Bounded {
        /// The line at its bound, from 0.
        line_idx: usize,
        /// Internal load reached minus internal load asked for, N.
        shift_n: f64,
    },
    /// No load within the bounds holds the snake.
    Infeasible {
        /// The line that would be below its lower bound, from 0.
        low_idx: usize,
        /// The line that would be above its upper bound, from 0.
        high_idx: usize,
        /// By how much one of them misses its bound while the other stands at its own, N.
        gap_n: f64,
    },
    /// A number that was given is not finite; the loads mean nothing.
    NotFinite,
}

/// Loads of the lines with the way they were found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineLoads {
    /// Loads at the snake, N, push positive.
    pub tau_n: Vector3<f64>,
    /// Internal load tau_m in them: their mean, N, push positive.
    pub tau_common_n: f64,
    /// How they were found.
    pub status: LoadStatus,
}

impl LoadBounds {
    /// Bounds of each line, N, push positive.
    ///
    /// # Errors
    /// [`ParameterError`] for a NaN, a lower bound above its upper one, or a bound that no finite load can keep.
    pub fn new(low_n: Vector3<f64>, high_n: Vector3<f64>) -> Result<Self, ParameterError> {
        for i in 0..3 {
            in_range("high_n", high_n[i], f64::MIN, f64::INFINITY, "N")?;
            in_range("low_n", low_n[i], f64::NEG_INFINITY, high_n[i].min(f64::MAX), "N")?;
        }
        Ok(Self { low_n, high_n })
    }

    /// No bounds.
    pub fn none() -> Self {
        Self { low_n: Vector3::repeat(f64::NEG_INFINITY), high_n: Vector3::repeat(f64::INFINITY) }
    }

    /// Bounds from the material at one bend, rad.
    ///
    /// high: Euler's load pi^2 E I / l^2 of a piece of backbone of length `free_length_m` between two guides, both ends taken
    /// for hinges, which is the cautious case. low: the pull at which bending and pulling together strain the outer
    /// fibre by `strain_limit`, E A (strain_limit - strain of bending).
    ///
    /// # Errors
    /// [`ParameterError`] for a length or a limit out of range, and for a bend that strains a backbone beyond the limit by
    /// itself: `strain of bending` is then the value found.
    pub fn of_material(
        snake: &Snake,
        bend_rad: Vector2<f64>,
        free_length_m: f64,
        strain_limit: f64,
    ) -> Result<Self, ParameterError> {
        in_range("free_length_m", free_length_m, 1e-4, 1.0, "m")?;
        in_range("strain_limit", strain_limit, 1e-4, 0.1, "(no unit)")?;
        let bending = snake.bending_strain(bend_rad);
        for strain in bending.iter() {
            in_range("strain of bending", *strain, 0.0, strain_limit, "(no unit)")?;
        }
        let euler_n = PI * PI * snake.bending_stiffness_nm2 / (free_length_m * free_length_m);
        let pull_n = bending.map(|strain| (strain_limit - strain) * snake.axial_stiffness_n());
        Self::new(-pull_n, Vector3::repeat(euler_n))
    }
}

impl Snake {
    /// Loads of the lines at a bend, rad, as asked for and within bounds; Eq. (10).
    ///
    /// # Real-time
    /// Closed form, no allocation, no loop beyond the three lines.
    pub fn line_loads(&self, bend_rad: Vector2<f64>, request: &LoadRequest, bounds: &LoadBounds) -> LineLoads {
        let by_wrench = self.j_x_bend(bend_rad).transpose() * request.wrench_on_tip;
        let moment = self.grad_energy_bend_nm(bend_rad) * request.eta - by_wrench;
        let least_n = self.j_bend_q().transpose() * moment;
        if !(least_n.iter().all(|t| t.is_finite()) && request.preload_n.is_finite()) {
            return LineLoads { tau_n: least_n, tau_common_n: f64::NAN, status: LoadStatus::NotFinite };
        }
        let (low_idx, from_n) = tightest(bounds.low_n - least_n, |a, b| a > b);
        let (high_idx, to_n) = tightest(bounds.high_n - least_n, |a, b| a < b);
        let wanted_n = request.preload_n;
        let (tau_common_n, status) = if from_n > to_n {
            (0.5 * (from_n + to_n), LoadStatus::Infeasible { low_idx, high_idx, gap_n: from_n - to_n })
        } else if wanted_n < from_n {
            (from_n, LoadStatus::Bounded { line_idx: low_idx, shift_n: from_n - wanted_n })
        } else if wanted_n > to_n {
            (to_n, LoadStatus::Bounded { line_idx: high_idx, shift_n: to_n - wanted_n })
        } else {
            (wanted_n, LoadStatus::Preferred)
        };
        LineLoads { tau_n: least_n.add_scalar(tau_common_n), tau_common_n, status }
    }

    /// Largest strain of bending in each secondary backbone, 1: outer radius times bend over its length.
    pub fn bending_strain(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        let bend = bend_rad.norm();
        self.q(bend_rad).map(|q_m| self.outer_radius_m * bend / (self.l_m + q_m))
    }
}

/// The entry that wins against all others, with its index.
fn tightest(limits: Vector3<f64>, wins: impl Fn(f64, f64) -> bool) -> (usize, f64) {
    let mut best = (0, limits[0]);
    for i in 1..3 {
        if wins(limits[i], best.1) {
            best = (i, limits[i]);
        }
    }
    best
}
