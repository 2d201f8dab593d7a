//! How well the loads of real drives are known: a relative standard deviation of their gain, which the configuration states.
//!
//! Problem: a current or a torque of a motor becomes newtons by a constant that differs by tens of percent from one gear to the next,
//! and whoever fits a model to such loads must know by how much.
//!
//! Intuition: one number for all actuators of a bus, because they are of one make: they read too much or too little together. It is
//! part of the recorded configuration, so it stands beside the loads wherever these are read.
//!
//! Failure: where nobody has stated it, loads are shown and nothing is concluded from them.

use crate::{ConfigError, DriveConfig, DriveKind};
use krait_ipc::setting::check;

/// Least and largest part of one that can be stated.
const RANGE: (f64, f64) = (0.001, 1.0);

impl DriveConfig {
    /// Checks what is stated of the loads' gain.
    pub(crate) fn check_load_gain(&self) -> Result<(), ConfigError> {
        let Some(gain_sd) = self.load_gain_sd else { return Ok(()) };
        check((Self::TABLE, "load_gain_sd"), gain_sd, RANGE, "not stated")?;
        // A CAN drive measures torque; a servo's load is made of its current.
        let is_blind = |k: usize| self.kind != DriveKind::Cia402 && self.actuator[k].newton_metre_per_ampere == 0.0;
        match (0..self.n_together()).find(|k| is_blind(*k)) {
            None => Ok(()),
            Some(k) => Err(ConfigError::Drives {
                what: format!(
                    "load_gain_sd = {gain_sd}, and actuator {} measures no load; give it newton_metre_per_ampere, or delete load_gain_sd",
                    k + 1
                ),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(text: &str) -> Result<(), String> {
        let bus = "kind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n";
        let config: DriveConfig = toml::from_str(&format!("{bus}{text}")).map_err(|error| error.to_string())?;
        config.check().map_err(|error| error.to_string())
    }

    #[test]
    fn an_uncertainty_is_stated_only_where_loads_are_measured_and_is_a_part_of_one() {
        let known = "[[actuator]]\nid = 1\nnewton_metre_per_ampere = 0.8\n";
        assert_eq!(checked(&format!("load_gain_sd = 0.3\n{known}")), Ok(()));
        for gain_sd in ["0.0", "1.5", "nan", "-0.1"] {
            let sentence = checked(&format!("load_gain_sd = {gain_sd}\n{known}")).unwrap_err();
            assert!(
                sentence.contains("[slave.drive] load_gain_sd = ") && sentence.contains("expected 0.001 to 1"),
                "{sentence}"
            );
        }
        let blind = checked(&format!("load_gain_sd = 0.3\n{known}[[actuator]]\nid = 2\n")).unwrap_err();
        assert!(blind.contains("load_gain_sd = 0.3, and actuator 2 measures no load"), "{blind}");
        // A gripper's wire is no line.
        let jaw = "[[actuator]]\nid = 2\njaw_m_per_rad = 0.002\n";
        assert_eq!(checked(&format!("load_gain_sd = 0.3\n{known}{jaw}")), Ok(()));
    }
}
