//! What a line gives under load, and how fast that changes with the bend: Eqs. (15)-(18) and alpha of Eq. (25).
//!
//! eps_i = eta tau_i / K_d + tau~_i / K_c + play, with tau~ from the friction of the cone. alpha = d eps / d bend follows in
//! closed form because the load's Jacobian does: alpha_i = eta (1/K_d + (d tau~/d tau)/K_c) d tau_i / d bend.

use super::ConeLoad;
use crate::{Psi, Snake};
use nalgebra::{Matrix3x2, Vector2, Vector3};

/// Extension of the three lines at one bend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extension {
    /// Loads of the lines at the snake, eta times the minimum-norm loads, N, push positive.
    pub tau_n: Vector3<f64>,
    /// eps, m: what the actuator has to move more than the snake needs.
    pub eps_m: Vector3<f64>,
    /// alpha = d eps / d bend at constant signs of motion, 3x2, m/rad.
    pub alpha_m_per_rad: Matrix3x2<f64>,
}

impl Snake {
    /// Eqs. (15)-(17): no load scale, no backlash, loading branch of the friction on every line.
    pub fn extension_naive(&self, bend_rad: Vector2<f64>) -> Extension {
        self.extension_as_printed(bend_rad, 1.0, 0.0)
    }

    /// Eq. (18) as printed: load scale eta (1), and lambda (m) added to all three lines alike.
    ///
    /// f_s and lambda come out the same on every line here, so that they preload the snake and cannot bend it.
    pub fn extension_as_printed(&self, bend_rad: Vector2<f64>, eta: f64, lambda_m: f64) -> Extension {
        self.extension(bend_rad, eta, Vector3::repeat(lambda_m), |_, tau_n| self.cone_load_as_printed(tau_n))
    }

    /// Eq. (18) with the signs of motion where the physics has them: in f_s, in the capstan exponent and in the play.
    ///
    /// `lambda_m` is the half-width of the play, m; `signs` in -1..=1 per line, +1 while the line is pushed.
    pub fn extension_with_signs(
        &self,
        bend_rad: Vector2<f64>,
        eta: f64,
        lambda_m: f64,
        signs: &Vector3<f64>,
    ) -> Extension {
        self.extension(bend_rad, eta, signs * lambda_m, |i, tau_n| self.cone_load_with_sign(tau_n, signs[i]))
    }

    /// alpha = d eps / d psi, 3x2, m/rad, of an extension that was computed at `psi.bend()`; Eq. (25).
    pub fn alpha_psi(&self, extension: &Extension, psi: Psi) -> Matrix3x2<f64> {
        extension.alpha_m_per_rad * psi.j_bend_psi()
    }

    fn extension(
        &self,
        bend_rad: Vector2<f64>,
        eta: f64,
        play_m: Vector3<f64>,
        cone: impl Fn(usize, f64) -> ConeLoad,
    ) -> Extension {
        let tau_n = self.tau_n(bend_rad) * eta;
        let mut eps_m = play_m + tau_n * self.c_d_m_per_n;
        let mut alpha_m_per_rad = self.j_tau_bend_n(bend_rad) * eta;
        for i in 0..3 {
            let load = cone(i, tau_n[i]);
            eps_m[i] += load.tau_tilde_n * self.c_c_m_per_n;
            alpha_m_per_rad.row_mut(i).scale_mut(self.c_d_m_per_n + load.slope * self.c_c_m_per_n);
        }
        Extension { tau_n, eps_m, alpha_m_per_rad }
    }
}
