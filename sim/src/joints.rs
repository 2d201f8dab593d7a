//! Simulated cable-driven joints as a drive: joints, encoders, cable loads, and what measures the joints.

use crate::actuators::SimulatedActuators;
use crate::joint::Joint;
use crate::joints_truth::JointsTruth;
use crate::noise::Noise;
use crate::shutter::Shutter;
use krait_ipc::message::{Actuators, MAX_ACTUATORS, MAX_JOINTS};
use krait_slave::{Drive, DriveError, DriveReading, DriveTraits, Homing, SeenShape, ShapeReading, Switching};

/// Joints that exist only in numbers, each with a cable and a drive. They start at their zero, without power.
#[derive(Clone, Debug)]
pub struct SimulatedJoints {
    joints: Vec<Joint>,
    coupling: Vec<f64>,
    shutter: Shutter<ShapeReading>,
    camera_noise: Noise,
    camera_noise_rad: f64,
    actuators: SimulatedActuators,
    encoder_noise: Noise,
    /// Where the drives stand.
    place_m: Actuators,
    /// When the joints were last looked at; they move on when they are looked at next, as a bus returns when it has told.
    stamp_ns: i64,
}

impl SimulatedJoints {
    /// The joints of a truth that has been checked ([`JointsTruth::check`]), at their zero.
    pub fn new(truth: &JointsTruth) -> Self {
        let mut joints = Self {
            joints: truth.joint.iter().map(Joint::new).collect(),
            coupling: truth.joint.iter().map(|joint| joint.coupling).collect(),
            shutter: Shutter::new(truth.camera.rate_hz, truth.camera.latency_s),
            camera_noise: Noise::new(truth.camera.seed, 1),
            camera_noise_rad: truth.camera.noise_rad,
            encoder_noise: Noise::new(truth.camera.seed, 2),
            actuators: SimulatedActuators::new(&truth.drive),
            place_m: [0.0; MAX_ACTUATORS],
            stamp_ns: i64::MIN,
        };
        joints.joints.truncate(MAX_JOINTS);
        joints
    }

    /// The true positions of the joints, rad (m for a sliding joint), as they stand after the last look.
    pub fn positions_rad(&self) -> impl Iterator<Item = f64> {
        self.joints.iter().map(Joint::position_rad)
    }

    /// Lets time pass up to an instant, with the drives where they stand, and measures the joints if it is time to.
    fn observe(&mut self, stamp_ns: i64) {
        let elapsed_ns = if self.stamp_ns == i64::MIN { 0 } else { stamp_ns.saturating_sub(self.stamp_ns) };
        self.stamp_ns = self.stamp_ns.max(stamp_ns);
        if elapsed_ns > 0 {
            let mut before_m = 0.0;
            for ((joint, coupling), cable_m) in self.joints.iter_mut().zip(&self.coupling).zip(self.place_m) {
                joint.pull(cable_m - coupling * before_m, elapsed_ns as f64 * 1e-9);
                before_m = joint.pulley_m();
            }
        }
        let Some(exposure_ns) = self.shutter.exposes(self.stamp_ns) else { return };
        let mut positions_rad = [0.0; MAX_JOINTS];
        let mut noise = [0.0; 2];
        for (k, (own, joint)) in positions_rad.iter_mut().zip(&self.joints).enumerate() {
            if k % 2 == 0 {
                noise = self.camera_noise.pair();
            }
            *own = joint.position_rad() + self.camera_noise_rad * noise[k % 2];
        }
        let frame = ShapeReading {
            exposure_ns,
            seen: SeenShape::Joints(positions_rad, self.joints.len()),
            jaw_rad: f64::NAN,
            sigma_rad: self.camera_noise_rad,
            q_tilde_m: [f64::NAN; 3],
        };
        self.shutter.put(exposure_ns, frame);
    }
}

impl Drive for SimulatedJoints {
    fn n_actuators(&self) -> usize {
        self.joints.len()
    }

    fn traits(&self) -> DriveTraits {
        self.actuators.traits(self.joints.len())
    }

    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        self.actuators.check(&q_tilde_m[..self.joints.len()])?;
        self.observe(stamp_ns);
        self.place_m = q_tilde_m;
        Ok(())
    }

    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        let (mut q_tilde_m, mut tau_n) = ([0.0; MAX_ACTUATORS], [0.0; MAX_ACTUATORS]);
        for (k, joint) in self.joints.iter().enumerate() {
            q_tilde_m[k] = self.actuators.shown_m(self.place_m[k], &mut self.encoder_noise);
            tau_n[k] = joint.load_n();
        }
        Ok(self.actuators.reading(self.joints.len(), stamp_ns, (q_tilde_m, tau_n)))
    }

    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        let from_m = self.place_m;
        self.actuators.check(&from_m[..self.joints.len()])?;
        let elapsed_ns = stamp_ns.saturating_sub(self.stamp_ns);
        self.observe(stamp_ns);
        let part = self.actuators.home_part(&from_m, elapsed_ns);
        self.place_m = from_m.map(|q| q * part);
        Ok(if part == 0.0 { Homing::Done } else { Homing::Busy })
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
        self.observe(stamp_ns);
        self.shutter.take(stamp_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn powered(n: usize) -> SimulatedJoints {
        let mut joints = SimulatedJoints::new(&JointsTruth::of(n));
        joints.set_power(0, true).unwrap();
        joints
    }

    #[test]
    fn writes_without_power_beyond_the_stops_or_not_finite_are_refused_and_move_nothing() {
        let mut joints = SimulatedJoints::new(&JointsTruth::of(8));
        let mut wanted = [0.0; MAX_ACTUATORS];
        assert_eq!(joints.write(0, wanted), Err(DriveError::NotPowered));
        joints.set_power(0, true).unwrap();
        wanted[7] = 9e-3;
        let refused = DriveError::OutOfTravel { actuator: 8, found_m: 9e-3, limit_m: 8e-3 };
        assert_eq!(joints.write(MS, wanted), Err(refused));
        wanted[7] = f64::NAN;
        assert!(matches!(joints.write(MS, wanted), Err(DriveError::NotFinite { actuator: 8, .. })));
        assert_eq!(joints.read(MS).unwrap().q_tilde_m, [0.0; MAX_ACTUATORS]);
    }

    #[test]
    fn a_cable_that_runs_over_the_joint_before_is_pulled_by_its_motion() {
        let mut truth = JointsTruth::of(2);
        truth.joint[1].coupling = -0.3;
        let mut joints = SimulatedJoints::new(&truth);
        joints.set_power(0, true).unwrap();
        for k in 1..=300 {
            let mut wanted = [0.0; MAX_ACTUATORS];
            wanted[0] = 4e-3 * k as f64 / 300.0;
            joints.write(k * MS, wanted).unwrap();
        }
        joints.shape(301 * MS);
        let positions: Vec<f64> = joints.positions_rad().collect();
        assert!(positions[0] > 0.6 && positions[1] > 0.1, "{positions:?}");
    }

    #[test]
    fn the_camera_measures_every_joint_at_its_rate_and_homing_ends_at_the_zero_of_the_drives() {
        let mut joints = powered(5);
        let (mut n, mut newest) = (0, None);
        for k in 1..=1000 {
            joints.write(k * MS, core::array::from_fn(|i| if i < 5 { 1e-3 } else { 0.0 })).unwrap();
            while let Some(frame) = joints.shape(k * MS) {
                (n, newest) = (n + 1, Some(frame));
            }
        }
        assert!((59..=60).contains(&n), "{n} in a second");
        let SeenShape::Joints(positions, 5) = newest.unwrap().seen else { panic!("five joints") };
        let truth: Vec<f64> = joints.positions_rad().collect();
        assert!(positions.iter().zip(&truth).all(|(seen, is)| (seen - is).abs() < 6e-3), "{positions:?} for {truth:?}");
        let n_busy = (1001..2000).take_while(|k| joints.home(k * MS).unwrap() == Homing::Busy).count();
        assert!((198..=200).contains(&n_busy), "1 mm at 5 mm/s in steps of 1 ms: {n_busy}");
        assert_eq!(joints.read(2000 * MS).unwrap().q_tilde_m, [0.0; MAX_ACTUATORS]);
    }
}
