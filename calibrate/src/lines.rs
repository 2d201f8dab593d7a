//! The bend that encoders and parameters predict: Eq. (18) with the signs of motion, for any friction of the cone.

use krait_model::{MachineParameters, Snake};
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// A snake with its friction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lines {
    snake: Snake,
    /// e^(2 mu phi).
    capstan: f64,
    f_s_n: f64,
}

impl Lines {
    /// `None` for a machine that the model refuses.
    pub fn new(machine: &MachineParameters, mu: f64, f_s_n: f64) -> Option<Self> {
        let capstan = (2.0 * mu * machine.phi_rad).exp();
        Some(Self { snake: Snake::new(machine).ok()?, capstan, f_s_n })
    }

    /// Actuator positions for a bend (rad) with eta, without any sign of motion: the plan of a path.
    pub fn planned_m(&self, bend_rad: Vector2<f64>, eta: f64) -> Vector3<f64> {
        self.snake.q(bend_rad) + self.snake.tau_n(bend_rad) * (eta * self.compliance(self.capstan))
    }

    /// Bend, rad, at actuator positions with eta and half-width (m) and known signs; `None` where there is none below pi.
    pub fn bend_rad(
        &self,
        q_tilde_m: Vector3<f64>,
        signs: &Vector3<f64>,
        eta: f64,
        half_width_m: f64,
    ) -> Option<Vector2<f64>> {
        let j_plus = self.snake.j_bend_q();
        let mut b = j_plus * q_tilde_m * 0.5;
        for _ in 0..60 {
            let (eps_m, alpha): (Vector3<f64>, Matrix3x2<f64>) = self.extension(b, signs, eta, half_width_m);
            let excess = j_plus * (self.snake.q(b) + eps_m - q_tilde_m);
            let k: Matrix2<f64> = j_plus * (self.snake.j_q_bend() + alpha);
            let step = k.try_inverse()? * excess;
            b -= step;
            if b.norm() >= core::f64::consts::PI || !b.norm().is_finite() {
                return None;
            }
            if step.norm() < 1e-13 {
                return Some(b);
            }
        }
        None
    }

    fn compliance(&self, slope: f64) -> f64 {
        1.0 / self.snake.k_d_n_per_m() + slope / self.snake.k_c_n_per_m()
    }

    fn extension(
        &self,
        b: Vector2<f64>,
        signs: &Vector3<f64>,
        eta: f64,
        half_width_m: f64,
    ) -> (Vector3<f64>, Matrix3x2<f64>) {
        let tau_n = self.snake.tau_n(b) * eta;
        let mut alpha = self.snake.j_tau_bend_n(b) * eta;
        let eps_m = Vector3::from_fn(|i, _| {
            let s = signs[i];
            let through = tau_n[i] + s * self.f_s_n;
            let slope = if s * through >= 0.0 { self.capstan } else { 1.0 / self.capstan };
            alpha.row_mut(i).scale_mut(self.compliance(slope));
            tau_n[i] / self.snake.k_d_n_per_m() + slope * through / self.snake.k_c_n_per_m() + s * half_width_m
        });
        (eps_m, alpha)
    }
}

/// Which way each line moved last, and whether it has gone through its play and its stick since.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning {
    at_m: Vector3<f64>,
    turned_m: Vector3<f64>,
    sign: Vector3<f64>,
    moved_m: f64,
}

/// Travel that takes up play and stick: 0.18 mm and 0.13 mm at 60 deg, and a little more.
const SETTLED_M: f64 = 0.35e-3;
/// Travel that counts as motion: several steps of an encoder.
const MOVED_M: f64 = 5e-6;

impl Turning {
    pub fn new(at_m: Vector3<f64>) -> Self {
        Self::of(at_m, MOVED_M)
    }

    /// With encoders that move by less than `moved_m` by themselves.
    pub fn of(at_m: Vector3<f64>, moved_m: f64) -> Self {
        Self { at_m, turned_m: at_m, sign: Vector3::zeros(), moved_m: moved_m.max(MOVED_M) }
    }

    /// The actuators have gone straight to a place.
    pub fn follow(&mut self, to_m: Vector3<f64>) {
        for i in 0..3 {
            let moved = to_m[i] - self.at_m[i];
            if moved.abs() < self.moved_m {
                continue;
            }
            if moved.signum() != self.sign[i] {
                self.sign[i] = moved.signum();
                self.turned_m[i] = self.at_m[i];
            }
            self.at_m[i] = to_m[i];
        }
    }

    /// The signs, if every line has gone through its play since it turned.
    pub fn signs(&self) -> Option<Vector3<f64>> {
        let settled = (0..3).all(|i| (self.at_m[i] - self.turned_m[i]).abs() >= SETTLED_M);
        settled.then_some(self.sign)
    }
}
