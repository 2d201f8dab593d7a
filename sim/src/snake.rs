//! The simulated snake as a drive: plant, encoders, line loads and camera behind the trait that hardware implements.

use crate::actuators::SimulatedActuators;
use crate::camera::Camera;
use crate::encoders::Encoders;
use crate::gripper::SimulatedGripper;
use crate::noise::Noise;
use crate::plant::Plant;
use crate::sight::Sight;
use crate::truth::Truth;
use krait_ipc::message::{Actuators, GRIPPER_WIRE, N_LINES, lines, n_of_snake, three};
use krait_slave::{Drive, DriveError, DriveReading, DriveTraits, Homing, ShapeReading, Switching};

/// While commands come faster than this, the time between them belongs to their motions; slower, and a snake that is looked
/// at waits.
const WAIT_NS: i64 = 5_000_000;

/// A snake that exists only in numbers. It starts straight, unloaded, without power.
#[derive(Clone, Debug)]
pub struct SimulatedSnake {
    plant: Plant,
    sight: Sight,
    encoders: Encoders,
    camera: Camera,
    actuators: SimulatedActuators,
    encoder_noise: Noise,
    stamp_ns: i64,
    /// When the plant was last stepped.
    moved_ns: i64,
    /// Where the actuators were told to go: a drive returns when it has been told, and the snake is moved when it is next
    /// looked at, so that solving its equilibrium is no part of a command's latency.
    target_m: Option<[f64; 3]>,
    gripper: Option<SimulatedGripper>,
}

impl SimulatedSnake {
    /// The straight snake of a truth that has been checked ([`Truth::check`]).
    pub fn new(truth: &Truth) -> Self {
        Self {
            plant: Plant::new(truth),
            sight: Sight::new(&truth.sight),
            encoders: Encoders::new(&truth.encoders),
            camera: Camera::new(&truth.camera, truth.sight.clock_error_s),
            encoder_noise: Noise::new(truth.camera.seed, 2),
            actuators: SimulatedActuators::new(&truth.drive),
            stamp_ns: i64::MIN,
            moved_ns: i64::MIN,
            target_m: None,
            gripper: None,
        }
    }

    /// The same with a gripper at its end, of which the model says how many metres of wire one radian of the jaw is.
    pub fn with_gripper(truth: &Truth, model_m_per_rad: f64) -> Self {
        let gripper = SimulatedGripper::new(&truth.gripper, model_m_per_rad, truth.camera.seed);
        Self { gripper: Some(gripper), ..Self::new(truth) }
    }

    /// The true angle of the jaw, rad, as it stands after the last look; what no sensor tells exactly.
    pub fn jaw_rad(&self) -> Option<f64> {
        self.gripper.as_ref().map(SimulatedGripper::jaw_rad)
    }

    /// The true bend vector, rad: what no sensor tells exactly.
    pub fn bend_rad(&self) -> [f64; 2] {
        self.settled(|snake| snake.plant.bend_rad())
    }

    /// What a camera without noise would stamp with this instant, rad, the snake standing there as it does now.
    ///
    /// Instants must not fall.
    pub fn seen_rad(&mut self, stamp_ns: i64) -> [f64; 2] {
        self.settle();
        let seen_rad = self.sight.seen_rad(stamp_ns, self.plant.bend_rad());
        self.camera.look(stamp_ns, seen_rad)
    }

    /// What the encoders would read without noise and steps, m.
    pub fn reading_m(&self) -> [f64; 3] {
        self.settled(|snake| snake.encoders.reading_m(snake.plant.q_tilde_m()))
    }

    /// The true actuator positions q~, m.
    pub fn q_tilde_m(&self) -> [f64; 3] {
        self.settled(|snake| snake.plant.q_tilde_m())
    }

    /// The true line loads at the actuators, N, push positive.
    pub fn actuator_loads_n(&self) -> [f64; 3] {
        self.settled(|snake| snake.plant.actuator_loads_n())
    }

    /// Equilibria that did not converge; 0 unless the truth is extreme.
    pub fn n_unsolved(&self) -> u64 {
        self.settled(|snake| snake.plant.n_unsolved())
    }

    /// A value of the snake where the actuators were told to go.
    fn settled<T>(&self, value: impl Fn(&Self) -> T) -> T {
        if self.target_m.is_none() {
            return value(self);
        }
        let mut snake = self.clone();
        snake.settle();
        value(&snake)
    }

    /// Moves the snake where the actuators were told to go.
    fn settle(&mut self) {
        if let Some(place_m) = self.target_m.take() {
            self.move_to(place_m);
        }
    }

    /// The camera sees the snake as it stood until now.
    fn observe(&mut self, stamp_ns: i64) {
        self.settle();
        if let Some(gripper) = self.gripper.as_mut().filter(|_| self.stamp_ns != i64::MIN) {
            gripper.wait(stamp_ns.saturating_sub(self.stamp_ns));
        }
        self.stamp_ns = self.stamp_ns.max(stamp_ns);
        let q_tilde_m = self.encoders.read_m(self.plant.q_tilde_m()).map(|q| self.actuators.quantised(q));
        let seen_rad = self.sight.seen_rad(self.stamp_ns, self.plant.bend_rad());
        self.camera.observe(self.stamp_ns, seen_rad, q_tilde_m, self.gripper.as_mut());
    }

    /// Lets time pass where nobody commands.
    fn wait(&mut self, stamp_ns: i64) {
        self.settle();
        let idle_ns = stamp_ns.saturating_sub(self.moved_ns);
        if self.moved_ns != i64::MIN && idle_ns >= WAIT_NS && self.plant.depends_on_time() {
            self.stamp_ns = self.stamp_ns.max(stamp_ns);
            self.move_to(self.plant.q_tilde_m());
        }
    }

    /// Moves the actuators from where they were at the last motion to a place now.
    fn move_to(&mut self, place_m: [f64; 3]) {
        let elapsed_ns = if self.moved_ns == i64::MIN { 0 } else { self.stamp_ns - self.moved_ns };
        self.moved_ns = self.stamp_ns;
        self.plant.move_to(place_m, elapsed_ns as f64 * 1e-9);
        self.sight.follow(self.plant.bend_rad());
    }
}

impl Drive for SimulatedSnake {
    fn n_actuators(&self) -> usize {
        n_of_snake(self.gripper.is_some())
    }

    fn traits(&self) -> DriveTraits {
        DriveTraits { n_together: N_LINES, ..self.actuators.traits(self.n_actuators()) }
    }

    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        self.actuators.check(&q_tilde_m[..self.n_actuators()])?;
        self.observe(stamp_ns);
        self.target_m = Some(self.encoders.place_m(three(&q_tilde_m)));
        if let Some(gripper) = &mut self.gripper {
            gripper.go_to(q_tilde_m[GRIPPER_WIRE]);
        }
        Ok(())
    }

    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        self.settle();
        let mut q_tilde_m = self.encoders.read_m(self.plant.q_tilde_m());
        if self.actuators.encoder_noise_m() > 0.0 {
            let ([a, b], [c, _]) = (self.encoder_noise.pair(), self.encoder_noise.pair());
            for (q, noise) in q_tilde_m.iter_mut().zip([a, b, c]) {
                *q += self.actuators.encoder_noise_m() * noise;
            }
        }
        let mut tau_n = lines(self.plant.actuator_loads_n());
        let mut q_tilde_m = lines(q_tilde_m.map(|q| self.actuators.quantised(q)));
        if let Some(gripper) = &mut self.gripper {
            q_tilde_m[GRIPPER_WIRE] = self.actuators.shown_m(gripper.place_m(), gripper.encoder_noise());
            tau_n[GRIPPER_WIRE] = gripper.load_n();
        }
        Ok(self.actuators.reading(self.n_actuators(), stamp_ns, (q_tilde_m, tau_n)))
    }

    /// The jaw stays where it is: it may hold something.
    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        self.settle();
        let from = self.reading_m();
        self.actuators.check(&from)?;
        let elapsed_ns = stamp_ns.saturating_sub(self.stamp_ns);
        self.observe(stamp_ns);
        let part = self.actuators.home_part(&from, elapsed_ns);
        if part == 0.0 {
            self.move_to(self.encoders.place_m([0.0; 3]));
            return Ok(Homing::Done);
        }
        self.move_to(self.encoders.place_m(from.map(|q| q * part)));
        Ok(Homing::Busy)
    }

    fn set_power(&mut self, _stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        self.actuators.powered = on;
        Ok(Switching::Done)
    }

    /// Simulated actuators have no motion of their own: they stand where they were last told to be.
    fn quick_stop(&mut self, _stamp_ns: i64) {}

    fn has_camera(&self) -> bool {
        true
    }

    fn shape(&mut self, stamp_ns: i64) -> Option<ShapeReading> {
        self.wait(stamp_ns);
        self.observe(stamp_ns);
        self.camera.take(stamp_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn powered() -> SimulatedSnake {
        let mut snake = SimulatedSnake::new(&Truth::default());
        snake.set_power(0, true).unwrap();
        snake
    }

    #[test]
    fn a_write_without_power_is_refused_and_moves_nothing() {
        let mut snake = SimulatedSnake::new(&Truth::default());
        let before = snake.read(0).unwrap();
        assert_eq!(snake.write(0, lines([1e-3, -5e-4, -5e-4])), Err(DriveError::NotPowered));
        assert_eq!(snake.read(0).unwrap(), before);
    }

    #[test]
    fn a_write_beyond_the_hard_stops_or_not_finite_is_refused_and_moves_nothing() {
        let mut snake = powered();
        let error = snake.write(0, lines([0.0, 9e-3, 0.0])).unwrap_err();
        assert_eq!(error, DriveError::OutOfTravel { actuator: 2, found_m: 9e-3, limit_m: 8e-3 });
        assert!(matches!(snake.write(0, lines([0.0, 0.0, f64::NAN])), Err(DriveError::NotFinite { actuator: 3, .. })));
        assert_eq!(snake.q_tilde_m(), [0.0; 3]);
    }

    #[test]
    fn encoders_are_quantised_and_noisy_as_the_truth_says() {
        let mut truth = Truth::default();
        truth.drive.encoder_noise_m = 5e-6;
        let mut snake = SimulatedSnake::new(&truth);
        let readings: Vec<f64> = (0..1000).map(|k| snake.read(k).unwrap().q_tilde_m[0]).collect();
        let sd = (readings.iter().map(|q| q * q).sum::<f64>() / 1000.0).sqrt();
        assert!((sd / 5e-6 - 1.0).abs() < 0.1, "sd {sd}");
        for q in readings {
            assert!((q * 1e6 - (q * 1e6).round()).abs() < 1e-6, "{q} is no whole micrometre");
        }
    }

    #[test]
    fn homing_brings_a_bent_snake_to_its_zero_at_the_homing_speed() {
        let mut snake = powered();
        snake.write(0, lines([1e-3, -5e-4, -5e-4])).unwrap();
        let mut stamp_ns = 0;
        let mut n_busy = 0;
        loop {
            stamp_ns += 1_000_000;
            if snake.home(stamp_ns).unwrap() == Homing::Done {
                break;
            }
            n_busy += 1;
        }
        assert_eq!(snake.q_tilde_m(), [0.0; 3]);
        assert!((198..=200).contains(&n_busy), "1 mm at 5 mm/s in steps of 1 ms: {n_busy}");
    }
}
