//! The simulated bench: the slave's snake under a camera, commanded pose by pose.

use core::f64::consts::PI;
use krait_model::Snake;
use krait_model::oracle::{Compensator, CompensatorParameters};
use krait_report::Spread;
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, lines, three};
use nalgebra::{Vector2, Vector3};

/// Bend at the end of the paper's kind of ramp, deg.
pub const RAMP_END_DEG: f64 = 80.0;
/// Spacing of the poses on that ramp, deg.
const RAMP_STEP_DEG: f64 = 0.2;

/// The default snake under a camera whose standard deviation is the paper's sigma, 1 deg.
pub fn default_truth() -> Truth {
    let mut truth = Truth::default();
    truth.camera.noise_rad = PI / 180.0;
    truth
}

/// One pose of a motion.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Commanded bend vector, rad.
    pub wanted_rad: Vector2<f64>,
    /// Actuator positions, m.
    pub q_tilde_m: Vector3<f64>,
    /// True bend vector, rad.
    pub reached_rad: Vector2<f64>,
    /// Loads at the actuators, N.
    pub tau_tilde_n: Vector3<f64>,
}

/// A snake with power.
pub struct Bench {
    snake: SimulatedSnake,
}

impl Bench {
    /// Straight, unloaded, every line in the middle of its play.
    pub fn new(truth: &Truth) -> anyhow::Result<Self> {
        let mut snake = SimulatedSnake::new(truth);
        snake.set_power(0, true)?;
        Ok(Self { snake })
    }

    /// Moves the actuators (m) and waits until the snake rests.
    pub fn move_to(&mut self, wanted_rad: Vector2<f64>, q_tilde_m: Vector3<f64>) -> anyhow::Result<Pose> {
        self.snake.write(0, lines(q_tilde_m.into()))?;
        let tau_tilde_n = three(&self.snake.read(0)?.tau_n).into();
        Ok(Pose {
            wanted_rad,
            q_tilde_m: self.snake.q_tilde_m().into(),
            reached_rad: self.snake.bend_rad().into(),
            tau_tilde_n,
        })
    }
}

/// Bend vector, rad, of a bend and a plane in degrees.
pub fn bend_rad(bend_deg: f64, delta_deg: f64) -> Vector2<f64> {
    let (sin, cos) = delta_deg.to_radians().sin_cos();
    Vector2::new(cos, sin) * bend_deg.to_radians()
}

/// Bends in one plane after `from_deg` up to and with `to_deg`, in equal steps of about `step_deg`, rad.
pub fn ramp(from_deg: f64, to_deg: f64, delta_deg: f64, step_deg: f64) -> Vec<Vector2<f64>> {
    let n = ((to_deg - from_deg).abs() / step_deg).round().max(1.0) as u32;
    (1..=n).map(|k| bend_rad(from_deg + (to_deg - from_deg) * f64::from(k) / f64::from(n), delta_deg)).collect()
}

/// One turn of the plane at one bend in steps of `step_deg`, beginning after delta = 0, rad.
pub fn turn(bend_deg: f64, step_deg: f64) -> Vec<Vector2<f64>> {
    let n = (360.0 / step_deg).round() as u32;
    (1..=n).map(|k| bend_rad(bend_deg, f64::from(k) * step_deg)).collect()
}

/// Bends in the plane delta = 0 from straight to the end of the paper's ramp, rad.
pub fn one_way_ramp() -> Vec<Vector2<f64>> {
    let mut path = vec![Vector2::zeros()];
    path.extend(ramp(0.0, RAMP_END_DEG, 0.0, RAMP_STEP_DEG));
    path
}

/// The ramp and the way back.
pub fn there_and_back() -> Vec<Vector2<f64>> {
    let there = one_way_ramp();
    there.iter().chain(there.iter().rev().skip(1)).copied().collect()
}

/// Follows a path on a fresh bench.
pub fn follow(
    truth: &Truth,
    path_rad: &[Vector2<f64>],
    mut command: impl FnMut(Vector2<f64>) -> Vector3<f64>,
) -> anyhow::Result<Vec<Pose>> {
    let mut bench = Bench::new(truth)?;
    path_rad.iter().map(|wanted| bench.move_to(*wanted, command(*wanted))).collect()
}

/// Follows a path on a fresh bench with the paper's compensator.
pub fn follow_compensated(
    snake: &Snake,
    truth: &Truth,
    path_rad: &[Vector2<f64>],
    parameters: CompensatorParameters,
) -> anyhow::Result<Vec<Pose>> {
    let mut compensator = Compensator::new(*snake, parameters)?;
    follow(truth, path_rad, |wanted| compensator.step(wanted).q_tilde_m)
}

/// Reached minus commanded bend of a pose in the plane delta = 0, deg: minus the error of theta_L.
pub fn ramp_error_deg(pose: &Pose) -> f64 {
    (pose.reached_rad.x - pose.wanted_rad.x).to_degrees()
}

/// Reached minus commanded bend of a pose in any plane, deg.
pub fn bend_error_deg(pose: &Pose) -> f64 {
    (pose.reached_rad.norm() - pose.wanted_rad.norm()).to_degrees()
}

/// Angle of the reached plane from the commanded one, deg, positive with delta; 0 where either pose is straight.
pub fn plane_error_deg(pose: &Pose) -> f64 {
    let (w, r) = (pose.wanted_rad, pose.reached_rad);
    (w.x * r.y - w.y * r.x).atan2(w.dot(&r)).to_degrees()
}

/// Distance of the reached and the commanded bend vector, deg.
pub fn vector_error_deg(pose: &Pose) -> f64 {
    (pose.reached_rad - pose.wanted_rad).norm().to_degrees()
}

/// Spread of an error over a motion.
pub fn spread(poses: &[Pose], error: impl Fn(&Pose) -> f64) -> Spread {
    Spread::of(poses.iter().map(error))
}
