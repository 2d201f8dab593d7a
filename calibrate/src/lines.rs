//! The bend that encoders and parameters predict: Eq. (18) with the signs of motion, for friction of the cone that is lumped at its end or
//! spread along it, and with or without extension of the lines inside the snake.

use krait_model::{MachineParameters, Snake};
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// What friction makes of the load within the cone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ConeFriction {
    /// All of it acts at the cone's end: Eq. (16), the effect `cone-friction`.
    #[default]
    Lumped,
    /// It grows along the cone's two bends, in which lies this share of the cone's length: the effect `distributed-capstan`.
    Distributed {
        /// 2 R phi/L_c.
        arc_share: f64,
    },
}

impl ConeFriction {
    /// Mean load along the cone over that at the snake, where each bend multiplies it by e^u, and its slope by u.
    pub(crate) fn mean_and_slope(self, u: f64) -> (f64, f64) {
        let bend = u.exp();
        match self {
            Self::Lumped => (bend * bend, 2.0 * bend * bend),
            Self::Distributed { arc_share } => {
                // Mean of e^(u x) over 0 <= x <= 1, and its slope, which both are differences of nearly equal numbers near zero.
                let (mean, slope) = if u.abs() < 1e-3 {
                    (1.0 + u / 2.0 + u * u / 6.0, 0.5 + u / 3.0 + u * u / 8.0)
                } else {
                    (u.exp_m1() / u, (bend - u.exp_m1() / u) / u)
                };
                let straight = 1.0 - arc_share;
                (
                    arc_share * 0.5 * mean * (1.0 + bend) + straight * bend,
                    arc_share * 0.5 * (slope * (1.0 + bend) + mean * bend) + straight * bend,
                )
            }
        }
    }
}

/// A snake with its friction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lines {
    snake: Snake,
    /// Mean load along the cone over that at the snake, while the line moves against its load and with it.
    slopes: [f64; 2],
    /// Load at the actuator over that at the snake while the line moves against it.
    capstan: f64,
    f_s_n: f64,
    /// L and E A of a line inside the snake, m and N, and the share of its load that it carries there.
    inside: (f64, f64, f64),
}

impl Lines {
    /// `None` for a machine that the model refuses.
    pub fn new(
        machine: &MachineParameters,
        mu: f64,
        f_s_n: f64,
        cone: ConeFriction,
        inside_share: f64,
    ) -> Option<Self> {
        let slopes = [1.0, -1.0].map(|way| cone.mean_and_slope(way * mu * machine.phi_rad).0);
        let snake = Snake::new(machine).ok()?;
        let ea_n = snake.k_d_n_per_m() * machine.l_d_m;
        Some(Self {
            snake,
            slopes,
            capstan: (2.0 * mu * machine.phi_rad).exp(),
            f_s_n,
            inside: (machine.l_m, ea_n, inside_share),
        })
    }

    /// How the lines move where the snake bends further in a direction, m for one radian.
    pub fn motion(&self, towards: Vector2<f64>) -> Vector3<f64> {
        self.snake.j_q_bend() * towards
    }

    /// Actuator positions, m, at which the snake stands at a bend, rad, with eta, half-width (m) and known signs.
    pub fn encoders_m(
        &self,
        bend_rad: Vector2<f64>,
        signs: &Vector3<f64>,
        eta: f64,
        half_width_m: f64,
    ) -> Vector3<f64> {
        self.snake.q(bend_rad) + self.extension(bend_rad, signs, eta, half_width_m).0
    }

    /// Loads at the actuators there, N.
    pub fn actuator_loads_n(&self, bend_rad: Vector2<f64>, signs: &Vector3<f64>, eta: f64) -> Vector3<f64> {
        (self.snake.tau_n(bend_rad) * eta).zip_map(signs, |tau_n, s| {
            let through_n = tau_n + s * self.f_s_n;
            through_n * if s * through_n < 0.0 { 1.0 / self.capstan } else { self.capstan }
        })
    }

    /// Actuator positions for a bend (rad) with eta, without any sign of motion: the plan of a path.
    pub fn planned_m(&self, bend_rad: Vector2<f64>, eta: f64) -> Vector3<f64> {
        self.snake.q(bend_rad) + self.snake.tau_n(bend_rad) * (eta * self.compliance(self.slopes[0]))
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
        let (q_m, j_q_bend) = (self.snake.q(b), self.snake.j_q_bend());
        let (l_m, ea_n, share) = self.inside;
        let mut alpha = self.snake.j_tau_bend_n(b) * eta;
        let eps_m = Vector3::from_fn(|i, _| {
            let s = signs[i];
            let through = tau_n[i] + s * self.f_s_n;
            let slope = self.slopes[usize::from(s * through < 0.0)];
            // eps_inside = share tau (L + q)/(E A)
            let per_load = share * (l_m + q_m[i]) / ea_n;
            let row = alpha.row(i) * (self.compliance(slope) + per_load) + j_q_bend.row(i) * (share * tau_n[i] / ea_n);
            alpha.set_row(i, &row);
            tau_n[i] / self.snake.k_d_n_per_m()
                + slope * through / self.snake.k_c_n_per_m()
                + per_load * tau_n[i]
                + s * half_width_m
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
