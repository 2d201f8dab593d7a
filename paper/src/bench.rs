//! The simulated bench: the slave's snake under a camera, commanded pose by pose.

use core::f64::consts::PI;
use krait_model::Snake;
use krait_model::oracle::{Compensator, CompensatorParameters};
use krait_report::Spread;
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, ShapeReading};
use nalgebra::{Vector2, Vector3};

/// Bend at the end of the paper's kind of ramp, deg.
pub const RAMP_END_DEG: f64 = 80.0;
/// Spacing of the poses on a ramp, deg.
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

/// A snake with power and a running camera.
pub struct Bench {
    snake: SimulatedSnake,
    stamp_ns: i64,
    period_ns: i64,
}

impl Bench {
    /// Straight, unloaded, every line in the middle of its play.
    pub fn new(truth: &Truth) -> anyhow::Result<Self> {
        let mut snake = SimulatedSnake::new(truth);
        snake.set_power(0, true)?;
        let _the_first_look_starts_the_camera = snake.shape(0);
        Ok(Self { snake, stamp_ns: 0, period_ns: (1e9 / truth.camera.rate_hz) as i64 + 1 })
    }

    /// Moves the actuators (m) and waits until the snake rests.
    pub fn move_to(&mut self, wanted_rad: Vector2<f64>, q_tilde_m: Vector3<f64>) -> anyhow::Result<Pose> {
        self.snake.write(self.stamp_ns, q_tilde_m.into())?;
        Ok(Pose {
            wanted_rad,
            q_tilde_m: self.snake.q_tilde_m().into(),
            reached_rad: self.snake.bend_rad().into(),
            tau_tilde_n: self.snake.actuator_loads_n().into(),
        })
    }

    /// Waits for the camera's next frame.
    pub fn photograph(&mut self) -> Option<ShapeReading> {
        self.stamp_ns += self.period_ns;
        let mut newest = None;
        while let Some(frame) = self.snake.shape(self.stamp_ns) {
            newest = Some(frame);
        }
        newest
    }
}

/// Bends in the plane delta = 0 from straight to the end of the ramp, rad.
pub fn one_way_ramp() -> Vec<Vector2<f64>> {
    let n = (RAMP_END_DEG / RAMP_STEP_DEG).round() as u32;
    (0..=n).map(|k| Vector2::new((f64::from(k) * RAMP_STEP_DEG).to_radians(), 0.0)).collect()
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

/// Follows a path on a fresh bench with the model's compensator.
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
pub fn bend_error_deg(pose: &Pose) -> f64 {
    (pose.reached_rad.x - pose.wanted_rad.x).to_degrees()
}

/// Spread of the error of the bend over a motion in the plane delta = 0, deg.
pub fn bend_errors_deg(poses: &[Pose]) -> Spread {
    Spread::of(poses.iter().map(bend_error_deg))
}

/// Spread of the distance of the bend vectors over any motion, deg.
pub fn vector_errors_deg(poses: &[Pose]) -> Spread {
    Spread::of(poses.iter().map(|p| (p.reached_rad - p.wanted_rad).norm().to_degrees()))
}
