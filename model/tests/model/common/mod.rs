//! A quasi-static snake with play, stretch and cone friction, and a motion like an operator's: shares no physics with the crate.

#![allow(dead_code, reason = "each test file uses its own part")]

use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::PI;

/// Truth of a plant, SI.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub play_half_m: f64,
    pub load_scale: f64,
    pub mu: f64,
    pub f_s_n: f64,
}

impl Default for Truth {
    fn default() -> Self {
        Self { play_half_m: 0.089e-3, load_scale: 1.22, mu: 0.1727, f_s_n: 1.959 }
    }
}

const L: f64 = 26e-3;
const R: f64 = 1.684e-3;
const EA: f64 = 54e9 * PI / 4.0 * (0.66e-3 * 0.66e-3 - 0.5e-3 * 0.5e-3);
const C_D: f64 = 0.480 / EA;
const C_C: f64 = 0.058 / EA;

pub struct Plant {
    truth: Truth,
    /// Outputs of the actuators' plays.
    p: Vector3<f64>,
    /// Positions of the lines in the cone: they change only while the load at the actuator is at a limit of friction.
    held: Vector3<f64>,
    /// (b_x, b_y, tau_m).
    pub state: Vector3<f64>,
}

impl Plant {
    pub fn new(truth: Truth) -> Self {
        Self { truth, p: Vector3::zeros(), held: Vector3::zeros(), state: Vector3::zeros() }
    }

    pub fn bend(&self) -> Vector2<f64> {
        self.state.xy()
    }

    /// Moves the actuators and returns the bend vector at which the snake comes to rest.
    pub fn step(&mut self, q_tilde: Vector3<f64>) -> Vector2<f64> {
        let h = self.truth.play_half_m;
        self.p = self.p.zip_map(&q_tilde, |p, q| p.clamp(q - h, q + h));
        let mut y = self.state;
        let mut f = self.mismatch(&y);
        for _ in 0..60 {
            if f.norm() < 1e-13 {
                break;
            }
            let steps = Vector3::new(1e-6, 1e-6, 1e-5);
            let jacobian = Matrix3::from_fn(|i, k| {
                let mut z = y;
                z[k] += steps[k];
                (self.mismatch(&z)[i] - f[i]) / steps[k]
            });
            let mut dy = jacobian.lu().solve(&f).unwrap();
            for _ in 0..10 {
                if self.mismatch(&(y - dy)).norm() < f.norm() {
                    break;
                }
                dy *= 0.5;
            }
            y -= dy;
            f = self.mismatch(&y);
        }
        assert!(f.norm() < 1e-9, "the test's own plant did not settle: {:e} m", f.norm());
        self.state = y;
        self.held = self.now_held(&y);
        self.bend()
    }

    fn mismatch(&self, y: &Vector3<f64>) -> Vector3<f64> {
        self.line_positions(y) - self.now_held(y)
    }

    fn now_held(&self, y: &Vector3<f64>) -> Vector3<f64> {
        let tau = self.loads(y);
        Vector3::from_fn(|i, _| {
            let (low, high) = (self.branch(tau[i], -1.0), self.branch(tau[i], 1.0));
            self.held[i].clamp(self.p[i] - C_C * high, self.p[i] - C_C * low)
        })
    }

    /// Load at the actuator of a line that slides in direction s.
    fn branch(&self, tau: f64, s: f64) -> f64 {
        let x = tau + s * self.truth.f_s_n;
        x * (s * x.signum() * 2.0 * self.truth.mu * 41.0 * PI / 180.0).exp()
    }

    fn line_positions(&self, y: &Vector3<f64>) -> Vector3<f64> {
        let tau = self.loads(y);
        displacements(y.xy()) + (tau * C_D).add_scalar(3.0 * L / EA * y.z)
    }

    /// Polar closed form of the minimum-norm loads, energy differentiated numerically, plus the internal load.
    fn loads(&self, y: &Vector3<f64>) -> Vector3<f64> {
        let (b, delta) = (y.xy().norm(), y.y.atan2(y.x));
        let h = 1e-4;
        let by_b = (energy(b + h, delta) - energy(b - h, delta)) / (2.0 * h);
        let by_delta = (energy(b, delta + h) - energy(b, delta - h)) / (2.0 * h);
        let turning = if b > 1e-6 { by_delta / b } else { 0.0 };
        Vector3::from_fn(|i, _| {
            let (sin, cos) = (delta + i as f64 * 2.0 * PI / 3.0).sin_cos();
            self.truth.load_scale * -2.0 / (3.0 * R) * (cos * by_b - sin * turning) + y.z
        })
    }
}

fn displacements(bend: Vector2<f64>) -> Vector3<f64> {
    let (b, delta) = (bend.norm(), bend.y.atan2(bend.x));
    Vector3::from_fn(|i, _| -R * b * (delta + i as f64 * 2.0 * PI / 3.0).cos())
}

fn energy(b: f64, delta: f64) -> f64 {
    let inertia = PI / 64.0 * (0.66e-3_f64.powi(4) - 0.5e-3_f64.powi(4));
    let lines: f64 = (0..3).map(|i| 1.0 / (L - R * b * (delta + f64::from(i) * 2.0 * PI / 3.0).cos())).sum();
    54e9 * inertia * b * b / 2.0 * (1.0 / L + lines)
}

/// A bend vector as an operator would ask for: reversals, plane rotations, rests, up to 60 deg; smooth in time.
pub fn operator_bend(t_s: f64) -> Vector2<f64> {
    // Every 7 s the hand rests for a second: the motion's own time stands still, and starts and stops smoothly.
    let (whole, part) = ((t_s / 7.0).floor(), t_s % 7.0);
    let moved = if part < 6.0 { part - 6.0 / (2.0 * PI) * (2.0 * PI * part / 6.0).sin() } else { 6.0 };
    let u = whole * 6.0 + moved;
    let amplitude = (0.55 * u).sin() * 0.75 + 0.25 * (1.7 * u).sin();
    let turn = 1.3 * (0.4 * u).sin() + 0.35 * u;
    Vector2::new(turn.cos(), turn.sin()) * (60_f64.to_radians() * amplitude)
}

/// Gaussian noise of a fixed seed, variance one.
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Error of the bend vector over a run, degrees.
#[derive(Clone, Debug, Default)]
pub struct Errors(Vec<f64>);

impl Errors {
    pub fn add(&mut self, wanted: Vector2<f64>, reached: Vector2<f64>) {
        self.0.push((wanted - reached).norm().to_degrees());
    }

    pub fn rms(&self) -> f64 {
        (self.0.iter().map(|e| e * e).sum::<f64>() / self.0.len() as f64).sqrt()
    }

    pub fn quantile(&self, part: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[((sorted.len() - 1) as f64 * part) as usize]
    }
}
