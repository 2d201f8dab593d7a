//! The simulated gripper: a jaw at the tip on a wire through the central tube, with a drive of its own.
//!
//! The wire lies in the middle of a backbone that keeps its length, so the bend of the snake has no part in it; what it does is the
//! law of a cable-driven joint ([`crate::joint`]).

use crate::hidden::Range;
use crate::joint::Joint;
use crate::joints_truth::JointTruth;
use crate::noise::Noise;
use serde::{Deserialize, Serialize};

/// What a gripper really is, and what is between its jaws. Without one in the model there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GripperTruth {
    /// Metres of wire for one radian of the jaw, m; 1e-4 to 0.02, or 0: as the model says.
    pub radius_m: f64,
    /// Stiffness of the wire, N/m; 100 to 1e7.
    pub cable_n_per_m: f64,
    /// Total slack between drive and jaw, m; 0 to 0.002.
    pub slack_m: f64,
    /// What pulls the jaw back to its zero, N per metre of wire; 0 to 1e5.
    pub spring_n_per_m: f64,
    /// Coulomb friction, as a force of the wire, N; 0 to 30.
    pub friction_n: f64,
    /// Drag, N s/m; 0 to 1e4.
    pub drag_n_s_per_m: f64,
    /// Angle of the jaw while its drive is at zero and its wire slack, rad; -1 to 1.
    pub zero_rad: f64,
    /// Once it was wider open, the jaw meets something hard at this angle and closes no further, rad; -4 to 4. -4: nothing is there.
    pub object_rad: f64,
}

impl Default for GripperTruth {
    fn default() -> Self {
        Self {
            radius_m: 0.0,
            cable_n_per_m: 20e3,
            slack_m: 0.1e-3,
            spring_n_per_m: 100.0,
            friction_n: 2.0,
            drag_n_s_per_m: 5.0,
            zero_rad: 0.0,
            object_rad: -4.0,
        }
    }
}

impl GripperTruth {
    pub(crate) fn ranges(&self) -> [Range; 8] {
        let least_m = if self.radius_m == 0.0 { 0.0 } else { 1e-4 };
        [
            ("gripper.radius_m", self.radius_m, least_m, 0.02),
            ("gripper.cable_n_per_m", self.cable_n_per_m, 100.0, 1e7),
            ("gripper.slack_m", self.slack_m, 0.0, 2e-3),
            ("gripper.spring_n_per_m", self.spring_n_per_m, 0.0, 1e5),
            ("gripper.friction_n", self.friction_n, 0.0, 30.0),
            ("gripper.drag_n_s_per_m", self.drag_n_s_per_m, 0.0, 1e4),
            ("gripper.zero_rad", self.zero_rad, -1.0, 1.0),
            ("gripper.object_rad", self.object_rad, -4.0, 4.0),
        ]
    }

    fn joint(&self, radius_m: f64) -> JointTruth {
        JointTruth {
            radius_m,
            cable_n_per_m: self.cable_n_per_m,
            slack_m: self.slack_m,
            spring_n_per_m: self.spring_n_per_m,
            friction_n: self.friction_n,
            drag_n_s_per_m: self.drag_n_s_per_m,
            zero_rad: self.zero_rad,
            coupling: 0.0,
        }
    }
}

/// A gripper that exists only in numbers, at the zero of its drive.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedGripper {
    joint: Joint,
    /// Where its drive stands, m.
    place_m: f64,
    camera_noise: Noise,
    encoder_noise: Noise,
}

impl SimulatedGripper {
    /// The gripper of a truth that has been checked, with the model's metres of wire for a radian where the truth has none.
    pub(crate) fn new(truth: &GripperTruth, model_m_per_rad: f64, seed: u64) -> Self {
        let radius_m = if truth.radius_m == 0.0 { model_m_per_rad } else { truth.radius_m };
        let stop_m = (truth.object_rad - truth.zero_rad) * radius_m;
        Self {
            joint: Joint::new(&truth.joint(radius_m)).that_stops_at(stop_m),
            place_m: 0.0,
            camera_noise: Noise::new(seed, 3),
            encoder_noise: Noise::new(seed, 4),
        }
    }

    /// Lets time pass, with the drive where it stands.
    pub(crate) fn wait(&mut self, elapsed_ns: i64) {
        if elapsed_ns > 0 {
            self.joint.pull(self.place_m, elapsed_ns as f64 * 1e-9);
        }
    }

    /// Where its drive stands, m.
    pub(crate) fn place_m(&self) -> f64 {
        self.place_m
    }

    /// The drive goes there.
    pub(crate) fn go_to(&mut self, place_m: f64) {
        self.place_m = place_m;
    }

    /// The true angle of the jaw, rad.
    pub(crate) fn jaw_rad(&self) -> f64 {
        self.joint.position_rad()
    }

    /// What a camera sees of the jaw, rad.
    pub(crate) fn seen_rad(&mut self, sigma_rad: f64) -> f64 {
        self.jaw_rad() + sigma_rad * self.camera_noise.pair()[0]
    }

    /// Load of the wire at its drive, N, push positive.
    pub(crate) fn load_n(&self) -> f64 {
        self.joint.load_n()
    }

    /// The noise of its encoder.
    pub(crate) fn encoder_noise(&mut self) -> &mut Noise {
        &mut self.encoder_noise
    }
}
