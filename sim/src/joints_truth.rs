//! The truth file of simulated joints: what the cable-driven joints really are.

use crate::hidden::Range;
use crate::truth::DriveTruth;
use crate::truth_error::{self, TruthError};
use krait_ipc::message::MAX_JOINTS;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Everything that simulated joints are made of. A key that a file leaves out keeps its default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointsTruth {
    /// One table for each joint, at most 8; none: as many default joints as the model has.
    pub joint: Vec<JointTruth>,
    /// Actuators and encoders.
    pub drive: DriveTruth,
    /// What measures the joints.
    pub camera: JointCameraTruth,
}

/// One joint, its cable and its pulley.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointTruth {
    /// Radius of the pulley: metres of cable for one radian, m; 0.0005 to 2. 1 for a sliding joint.
    pub radius_m: f64,
    /// Stiffness of the cable, N/m; 100 to 1e7.
    pub cable_n_per_m: f64,
    /// Total slack between drive and cable, m; 0 to 0.002.
    pub slack_m: f64,
    /// What pulls the joint back to its zero, N per metre of cable; 0 to 1e5.
    pub spring_n_per_m: f64,
    /// Coulomb friction of the pulley, as a force of the cable, N; 0 to 30.
    pub friction_n: f64,
    /// Drag of the pulley, N s/m; 0 to 1e4.
    pub drag_n_s_per_m: f64,
    /// Position of the joint while its drive is at zero and its cable slack, rad (m for a sliding joint); -1 to 1.
    pub zero_rad: f64,
    /// Part of the way of the joint before it that its own cable is paid out or taken up by, 1; -0.5 to 0.5.
    pub coupling: f64,
}

/// What measures the joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointCameraTruth {
    /// Measurements per second, Hz; 1 to 240.
    pub rate_hz: f64,
    /// Time from measurement to availability, s; 0 to 0.2.
    pub latency_s: f64,
    /// Standard deviation of each position, rad (m for a sliding joint); 0 to 0.2.
    pub noise_rad: f64,
    /// Seed of all noise: any whole number up to 2^63 - 1.
    pub seed: u64,
}

impl Default for JointTruth {
    fn default() -> Self {
        Self {
            radius_m: 5.6e-3,
            cable_n_per_m: 20e3,
            slack_m: 0.2e-3,
            spring_n_per_m: 100.0,
            friction_n: 3.0,
            drag_n_s_per_m: 5.0,
            zero_rad: 0.02,
            coupling: 0.0,
        }
    }
}

impl Default for JointCameraTruth {
    fn default() -> Self {
        Self { rate_hz: 60.0, latency_s: 0.0, noise_rad: 1e-3, seed: 1 }
    }
}

impl JointsTruth {
    /// As many default joints.
    pub fn of(n: usize) -> Self {
        Self { joint: vec![JointTruth::default(); n], ..Self::default() }
    }

    /// Reads and checks a truth file of `n` joints.
    ///
    /// # Errors
    /// [`TruthError`]: unreadable, not TOML, an unknown key, a value of the wrong kind or out of its range, another number of
    /// joints.
    pub fn load(path: &Path, n: usize) -> Result<Self, TruthError> {
        let (file, text) = truth_error::file_and_text(path)?;
        Self::parse(&text, &file, n)
    }

    /// Checks the text of a truth file; `file` names it in error sentences.
    ///
    /// # Errors
    /// As [`JointsTruth::load`], except unreadable.
    pub fn parse(text: &str, file: &str, n: usize) -> Result<Self, TruthError> {
        let mut truth: Self = toml::from_str(text).map_err(|e| truth_error::not_toml(file, text, &e))?;
        if truth.joint.is_empty() {
            truth.joint = Self::of(n).joint;
        }
        truth.check(file, n)?;
        Ok(truth)
    }

    /// Checks every value against its range, and the number of joints.
    ///
    /// # Errors
    /// [`TruthError::OutOfRange`] or [`TruthError::OtherNumber`].
    pub fn check(&self, file: &str, n: usize) -> Result<(), TruthError> {
        if self.joint.len() != n || n == 0 || n > MAX_JOINTS {
            return Err(TruthError::OtherNumber { file: file.to_owned(), found: self.joint.len(), expected: n });
        }
        let c = &self.camera;
        let camera = [
            ("camera.rate_hz", c.rate_hz, 1.0, 240.0),
            ("camera.latency_s", c.latency_s, 0.0, 0.2),
            ("camera.noise_rad", c.noise_rad, 0.0, 0.2),
        ];
        for (key, found, low, high) in
            self.drive.ranges(0.5).into_iter().chain(camera).chain(self.joint.iter().flat_map(JointTruth::ranges))
        {
            // Written so that NaN is out of range.
            if !(low..=high).contains(&found) {
                return Err(TruthError::OutOfRange { file: file.to_owned(), key, low, high, found });
            }
        }
        Ok(())
    }
}

impl JointTruth {
    fn ranges(&self) -> [Range; 8] {
        [
            ("joint.radius_m", self.radius_m, 5e-4, 2.0),
            ("joint.cable_n_per_m", self.cable_n_per_m, 100.0, 1e7),
            ("joint.slack_m", self.slack_m, 0.0, 2e-3),
            ("joint.spring_n_per_m", self.spring_n_per_m, 0.0, 1e5),
            ("joint.friction_n", self.friction_n, 0.0, 30.0),
            ("joint.drag_n_s_per_m", self.drag_n_s_per_m, 0.0, 1e4),
            ("joint.zero_rad", self.zero_rad, -1.0, 1.0),
            ("joint.coupling", self.coupling, -0.5, 0.5),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_names_every_key_with_its_default() {
        let truth = JointsTruth::parse(include_str!("../truth/wrist.toml"), "wrist.toml", 3).unwrap();
        assert_eq!(truth, JointsTruth::of(3));
    }

    #[test]
    fn unknown_keys_values_out_of_range_and_another_number_of_joints_are_refused_in_one_sentence() {
        for (text, word) in [
            ("[[joint]]\nslak_m = 0.0", "slack_m"),
            ("[[joint]]\nfriction_n = -1.0", "joint.friction_n is -1, expected 0 to 30"),
            ("[[joint]]\nradius_m = nan", "joint.radius_m"),
            ("[camera]\nrate_hz = inf", "camera.rate_hz"),
            ("[[joint]]\n[[joint]]", "2 joints, expected 1"),
        ] {
            let sentence = JointsTruth::parse(text, "t.toml", 1).unwrap_err().to_string();
            assert!(sentence.contains(word) && sentence.contains("t.toml") && !sentence.contains('\n'), "{sentence}");
        }
        assert!(JointsTruth::of(9).check("nine", 9).is_err());
    }
}
