//! The truth file: what the simulated snake really is, including effects that the model may lack.

use crate::gripper::GripperTruth;
use crate::hidden::{BendingTruth, EncodersTruth, LinesTruth, Range, SightTruth, SlowTruth};
use crate::truth_error::{self, TruthError};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Everything that the simulated snake is made of. A key that a file leaves out keeps its default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Truth {
    /// Dimensions and material.
    pub machine: MachineTruth,
    /// What makes it leave the ideal: friction, play, loads.
    pub effects: EffectsTruth,
    /// What else its lines do; nothing by default.
    pub lines: LinesTruth,
    /// What else the bent snake does; nothing by default.
    pub bending: BendingTruth,
    /// What encoders read of the actuators; just that by default.
    pub encoders: EncodersTruth,
    /// What a camera sees of the arc; just that by default.
    pub sight: SightTruth,
    /// What changes with time; nothing by default.
    pub slow: SlowTruth,
    /// Its gripper, where the model has one.
    pub gripper: GripperTruth,
    /// Actuators and encoders.
    pub drive: DriveTruth,
    /// The camera that measures its shape.
    pub camera: CameraTruth,
}

/// Dimensions and material, physics.md section 1 (Table I of the paper).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MachineTruth {
    /// L: primary backbone, base disk to end disk, m; 0.005 to 0.2.
    pub l_m: f64,
    /// r: pitch radius of the secondary backbones, m; 0.0005 to 0.005, and at most L / 8.
    pub r_m: f64,
    /// E: Young's modulus of all backbones, Pa; 1e9 to 3e11.
    pub e_pa: f64,
    /// Outer diameter of the tubes, m; 1e-4 to 2e-3.
    pub d_outer_m: f64,
    /// Inner diameter of the tubes, m; 0 to 0.95 of the outer one.
    pub d_inner_m: f64,
    /// L_d: length of a line in the holder, m; 0.01 to 3.
    pub l_d_m: f64,
    /// L_c: length of a line in the cone, m; 0.001 to 1.
    pub l_c_m: f64,
    /// φ: angle of each of the cone's two arcs, rad; 0 to 3.2.
    pub phi_rad: f64,
}

/// What makes the snake leave the ideal; each effect is off at its neutral value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EffectsTruth {
    /// Total play of each actuator, m (2 h of the play operator); 0 to 0.002; neutral 0.
    pub play_m: f64,
    /// η: factor on the elastic bending load, 1; 0.2 to 5; neutral 1.
    pub load_scale: f64,
    /// μ: friction of a line in the cone, 1; 0 to 1; neutral 0.
    pub mu: f64,
    /// f_s: friction of the bent-in wire, N; 0 to 20; neutral 0.
    pub f_s_n: f64,
    /// Lines are softer by this part when pulled and stiffer by it when pushed, 1; -0.5 to 0.5; neutral 0.
    pub asymmetry: f64,
    /// Lateral force on the tip in the base frame (x, y), N; each -1 to 1; neutral 0.
    pub tip_force_in_base_n: [f64; 2],
}

/// Actuators and encoders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveTruth {
    /// Distance of the hard stops from zero, m; 0.001 to 0.02.
    pub travel_m: f64,
    /// Speed of the search for zero, m/s; 1e-4 to 0.1.
    pub home_speed_m_per_s: f64,
    /// Step of the encoders, m; 0 (ideal) to 1e-4.
    pub encoder_resolution_m: f64,
    /// Standard deviation of the encoders, m; 0 to 1e-4.
    pub encoder_noise_m: f64,
}

/// The camera that measures the shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraTruth {
    /// Frames per second, Hz; 1 to 240.
    pub rate_hz: f64,
    /// Time from exposure to availability, s; 0 to 0.2.
    pub latency_s: f64,
    /// Standard deviation of each component of the bend vector, rad; 0 to 0.2.
    pub noise_rad: f64,
    /// The measured plane is turned by this angle, rad; -3.2 to 3.2; neutral 0.
    pub plane_offset_rad: f64,
    /// Seed of all noise: any whole number up to 2^63 - 1.
    pub seed: u64,
}

impl Default for MachineTruth {
    fn default() -> Self {
        Self {
            l_m: 26e-3,
            r_m: 1.684e-3,
            e_pa: 54e9,
            d_outer_m: 0.66e-3,
            d_inner_m: 0.50e-3,
            l_d_m: 0.480,
            l_c_m: 0.058,
            phi_rad: 41.0 * core::f64::consts::PI / 180.0,
        }
    }
}

impl Default for EffectsTruth {
    fn default() -> Self {
        Self {
            play_m: 0.178e-3,
            load_scale: 1.22,
            mu: 0.1727,
            f_s_n: 1.959,
            asymmetry: 0.0,
            tip_force_in_base_n: [0.0; 2],
        }
    }
}

impl Default for DriveTruth {
    fn default() -> Self {
        Self { travel_m: 8e-3, home_speed_m_per_s: 5e-3, encoder_resolution_m: 1e-6, encoder_noise_m: 0.0 }
    }
}

impl Default for CameraTruth {
    fn default() -> Self {
        Self {
            rate_hz: 60.0,
            latency_s: 0.0,
            noise_rad: 0.3 * core::f64::consts::PI / 180.0,
            plane_offset_rad: 0.0,
            seed: 20060501,
        }
    }
}

impl DriveTruth {
    /// `most_m`: the longest travel that the machine has room for, m.
    pub(crate) fn ranges(&self, most_m: f64) -> [Range; 4] {
        [
            ("drive.travel_m", self.travel_m, 1e-3, most_m),
            ("drive.home_speed_m_per_s", self.home_speed_m_per_s, 1e-4, 0.1),
            ("drive.encoder_resolution_m", self.encoder_resolution_m, 0.0, 1e-4),
            ("drive.encoder_noise_m", self.encoder_noise_m, 0.0, 1e-4),
        ]
    }
}

impl CameraTruth {
    pub(crate) fn ranges(&self) -> [Range; 4] {
        [
            ("camera.rate_hz", self.rate_hz, 1.0, 240.0),
            ("camera.latency_s", self.latency_s, 0.0, 0.2),
            ("camera.noise_rad", self.noise_rad, 0.0, 0.2),
            ("camera.plane_offset_rad", self.plane_offset_rad, -3.2, 3.2),
        ]
    }
}

impl EffectsTruth {
    /// Every effect at its neutral value: elastic lines alone.
    pub fn none() -> Self {
        Self { play_m: 0.0, load_scale: 1.0, mu: 0.0, f_s_n: 0.0, asymmetry: 0.0, tip_force_in_base_n: [0.0; 2] }
    }
}

impl Truth {
    /// Reads and checks a truth file.
    ///
    /// # Errors
    /// [`TruthError`]: unreadable, not TOML, an unknown key, a value of the wrong kind or out of its range.
    pub fn load(path: &Path) -> Result<Self, TruthError> {
        let (file, text) = truth_error::file_and_text(path)?;
        Self::parse(&text, &file)
    }

    /// Checks the text of a truth file; `file` names it in error sentences.
    ///
    /// # Errors
    /// As [`Truth::load`], except unreadable.
    pub fn parse(text: &str, file: &str) -> Result<Self, TruthError> {
        let table: toml::Table = text.parse().map_err(|e| truth_error::not_toml(file, text, &e))?;
        let known = toml::Table::try_from(Self::default()).map_err(|e| TruthError::NotToml {
            file: file.to_owned(),
            line: 1,
            message: e.to_string(),
        })?;
        truth_error::refuse_unknown_keys(&table, &known, "", file)?;
        let truth: Self = toml::from_str(text).map_err(|e| truth_error::not_toml(file, text, &e))?;
        truth.check(file)?;
        Ok(truth)
    }

    /// Checks every value against its range; `file` names the origin in the error's sentence.
    ///
    /// # Errors
    /// [`TruthError::OutOfRange`].
    pub fn check(&self, file: &str) -> Result<(), TruthError> {
        for (key, found, low, high) in self.ranges() {
            // Written so that NaN is out of range.
            if !(low..=high).contains(&found) {
                return Err(TruthError::OutOfRange { file: file.to_owned(), key, low, high, found });
            }
        }
        Ok(())
    }

    fn ranges(&self) -> Vec<Range> {
        let (m, e) = (&self.machine, &self.effects);
        let mut ranges = vec![
            ("machine.l_m", m.l_m, 5e-3, 0.2),
            // The lines inside a bend must keep a length at every bend that the travel of the actuators allows.
            ("machine.r_m", m.r_m, 5e-4, 5e-3_f64.min(m.l_m / 8.0)),
            ("machine.e_pa", m.e_pa, 1e9, 3e11),
            ("machine.d_outer_m", m.d_outer_m, 1e-4, 2e-3),
            ("machine.d_inner_m", m.d_inner_m, 0.0, 0.95 * m.d_outer_m),
            ("machine.l_d_m", m.l_d_m, 0.01, 3.0),
            ("machine.l_c_m", m.l_c_m, 1e-3, 1.0),
            ("machine.phi_rad", m.phi_rad, 0.0, 3.2),
            ("effects.play_m", e.play_m, 0.0, 2e-3),
            ("effects.load_scale", e.load_scale, 0.2, 5.0),
            ("effects.mu", e.mu, 0.0, 1.0),
            ("effects.f_s_n", e.f_s_n, 0.0, 20.0),
            ("effects.asymmetry", e.asymmetry, -0.5, 0.5),
            ("effects.tip_force_in_base_n", e.tip_force_in_base_n[0], -1.0, 1.0),
            ("effects.tip_force_in_base_n", e.tip_force_in_base_n[1], -1.0, 1.0),
        ];
        // Pushed and pulled lines together can shorten a backbone by 4/3 of the travel at most.
        ranges.extend(self.drive.ranges(2e-2_f64.min(m.l_m / 2.0)));
        ranges.extend(self.camera.ranges());
        ranges.extend(self.lines.ranges(m));
        ranges.extend(self.bending.ranges());
        ranges.extend(self.encoders.ranges());
        ranges.extend(self.sight.ranges());
        ranges.extend(self.slow.ranges());
        ranges.extend(self.gripper.ranges());
        ranges
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_truth_file_equals_the_defaults_and_names_every_key() {
        let text = include_str!("../truth/default.toml");
        assert_eq!(Truth::parse(text, "default.toml").unwrap(), Truth::default());
        let shipped: toml::Table = text.parse().unwrap();
        let known = toml::Table::try_from(Truth::default()).unwrap();
        for (table, keys) in &known {
            for key in keys.as_table().unwrap().keys() {
                assert!(shipped[table].as_table().unwrap().contains_key(key), "{table}.{key} is not documented");
            }
        }
    }

    #[test]
    fn an_empty_file_is_the_default_and_every_default_is_in_range() {
        assert_eq!(Truth::parse("", "empty.toml").unwrap(), Truth::default());
        Truth::default().check("default").unwrap();
    }

    #[test]
    fn an_unknown_key_is_refused_and_the_nearest_known_one_is_named() {
        let sentence = Truth::parse("[effects]\nlode_scale = 1.0\n", "t.toml").unwrap_err().to_string();
        assert!(sentence.contains("effects.lode_scale") && sentence.contains("`effects.load_scale`"), "{sentence}");
        let sentence = Truth::parse("[efects]\nmu = 0.1\n", "t.toml").unwrap_err().to_string();
        assert!(sentence.contains("`effects`"), "{sentence}");
    }

    #[test]
    fn a_value_out_of_range_is_refused_with_file_key_range_and_finding() {
        for (text, key) in [
            ("[effects]\nmu = 3.5", "effects.mu"),
            ("[effects]\nmu = nan", "effects.mu"),
            ("[camera]\nrate_hz = inf", "camera.rate_hz"),
            ("[machine]\nd_inner_m = 0.00066", "machine.d_inner_m"),
            ("[effects]\ntip_force_in_base_n = [0.0, -7.0]", "effects.tip_force_in_base_n"),
            ("[lines]\ncreep_part = 0.7", "lines.creep_part"),
            ("[bending]\nsoft_strain = 0.0", "bending.soft_strain"),
            ("[encoders]\nzero_m = [0.0, nan, 0.0]", "encoders.zero_m"),
            ("[sight]\nclock_error_s = -0.1", "sight.clock_error_s"),
            ("[slow]\ntime_s = 0.0", "slow.time_s"),
            ("[gripper]\nradius_m = 1e-5", "gripper.radius_m"),
        ] {
            let sentence = Truth::parse(text, "t.toml").unwrap_err().to_string();
            assert!(sentence.contains("t.toml") && sentence.contains(key) && sentence.contains(" to "), "{sentence}");
        }
    }

    #[test]
    fn a_value_of_the_wrong_kind_or_broken_toml_is_refused_with_its_line() {
        for text in ["[effects]\n\nmu = \"high\"", "[effects]\n\nmu = = 1", "\n\neffects = 3", "[camera]\n\nseed = -1"]
        {
            let sentence = Truth::parse(text, "t.toml").unwrap_err().to_string();
            assert!(sentence.contains("t.toml, line 3") && !sentence.contains('\n'), "{sentence}");
        }
    }

    #[test]
    fn a_missing_file_is_one_sentence_that_names_it() {
        let sentence = Truth::load(Path::new("/nowhere/truth.toml")).unwrap_err().to_string();
        assert!(sentence.contains("/nowhere/truth.toml"), "{sentence}");
    }
}
