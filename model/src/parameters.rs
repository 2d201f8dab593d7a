//! What a machine is made of, checked once, so that no formula behind it meets a length of zero or a NaN.

use core::f64::consts::PI;
use serde::{Deserialize, Serialize};

/// A parameter cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// A value is not finite or lies outside its range.
    #[error("parameter {key} is {found}, expected {low} to {high} {unit}; correct it in the model file")]
    OutOfRange {
        /// Name of the parameter.
        key: &'static str,
        /// Smallest value allowed.
        low: f64,
        /// Largest value allowed.
        high: f64,
        /// What was given.
        found: f64,
        /// Unit of all three numbers.
        unit: &'static str,
    },
    /// A value contradicts another one.
    #[error("parameter {key} is {found} m, expected less than {limit} m, {reason}; correct one of the two")]
    Contradiction {
        /// Name of the parameter.
        key: &'static str,
        /// What was given, m.
        found: f64,
        /// What it has to stay below, m.
        limit: f64,
        /// Where the limit comes from.
        reason: &'static str,
    },
}

/// Geometry and material of a snake and its lines. Every key is optional; defaults are the paper's Table I.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MachineParameters {
    /// Length L of the primary backbone from base disk to end disk, m, 0.005 to 0.5.
    pub l_m: f64,
    /// Pitch radius r of the secondary backbones, m, 0.0003 to 0.02. Not in Table I: it follows from "1 deg equals 0.0294 mm".
    pub r_m: f64,
    /// Young's modulus E of all backbones, Pa, 1e9 to 4e11.
    pub e_pa: f64,
    /// Outer diameter of all backbones, m, 0.00005 to 0.005.
    pub d_outer_m: f64,
    /// Inner diameter of all backbones, m, 0 to less than the outer diameter.
    pub d_inner_m: f64,
    /// Length L_d of a line in the holder, m, 0.001 to 10.
    pub l_d_m: f64,
    /// Length L_c of a line in the cone, m, 0.001 to 10.
    pub l_c_m: f64,
    /// Angle phi of each of the two arcs in the cone, rad, 0 to pi.
    pub phi_rad: f64,
    /// Whether the lines are taken for rigid: they then give nothing under load, and q~ = q.
    pub rigid_lines: bool,
}

impl Default for MachineParameters {
    fn default() -> Self {
        Self {
            l_m: 26e-3,
            r_m: 1.684e-3,
            e_pa: 54e9,
            d_outer_m: 0.66e-3,
            d_inner_m: 0.50e-3,
            l_d_m: 0.480,
            l_c_m: 0.058,
            phi_rad: 41.0 * PI / 180.0,
            rigid_lines: false,
        }
    }
}

impl MachineParameters {
    /// Checks every value.
    ///
    /// # Errors
    /// [`ParameterError`] naming the first key that is not finite, out of range or at odds with another one.
    pub fn check(&self) -> Result<(), ParameterError> {
        for range in &RANGES {
            in_range(range.key, (range.get)(self), range.low, range.high, range.unit)?;
        }
        below("d_inner_m", self.d_inner_m, self.d_outer_m, "the outer diameter d_outer_m")?;
        // A secondary backbone of length L + q_i has to keep a positive length up to a bend of pi.
        below("r_m", self.r_m, self.l_m / PI, "the length l_m divided by pi")
    }
}

/// A parameter with its range.
pub(crate) struct ParameterRange {
    pub key: &'static str,
    pub get: fn(&MachineParameters) -> f64,
    pub low: f64,
    pub high: f64,
    pub unit: &'static str,
}

/// Every parameter that is a number.
#[rustfmt::skip]
const RANGES: [ParameterRange; 8] = [
    ParameterRange { key: "l_m", get: |p| p.l_m, low: 0.005, high: 0.5, unit: "m" },
    ParameterRange { key: "r_m", get: |p| p.r_m, low: 0.0003, high: 0.02, unit: "m" },
    ParameterRange { key: "e_pa", get: |p| p.e_pa, low: 1e9, high: 4e11, unit: "Pa" },
    ParameterRange { key: "d_outer_m", get: |p| p.d_outer_m, low: 0.00005, high: 0.005, unit: "m" },
    ParameterRange { key: "d_inner_m", get: |p| p.d_inner_m, low: 0.0, high: 0.005, unit: "m" },
    ParameterRange { key: "l_d_m", get: |p| p.l_d_m, low: 0.001, high: 10.0, unit: "m" },
    ParameterRange { key: "l_c_m", get: |p| p.l_c_m, low: 0.001, high: 10.0, unit: "m" },
    ParameterRange { key: "phi_rad", get: |p| p.phi_rad, low: 0.0, high: PI, unit: "rad" },
];

/// The range of a parameter; `None` for a name that is none.
pub(crate) fn range_of(key: &str) -> Option<&'static ParameterRange> {
    RANGES.iter().find(|range| range.key == key)
}

pub(crate) fn in_range(
    key: &'static str,
    found: f64,
    low: f64,
    high: f64,
    unit: &'static str,
) -> Result<(), ParameterError> {
    if (low..=high).contains(&found) { Ok(()) } else { Err(ParameterError::OutOfRange { key, low, high, found, unit }) }
}

fn below(key: &'static str, found: f64, limit: f64, reason: &'static str) -> Result<(), ParameterError> {
    if found < limit { Ok(()) } else { Err(ParameterError::Contradiction { key, found, limit, reason }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_pass() {
        assert_eq!(MachineParameters::default().check(), Ok(()));
    }

    #[test]
    fn a_missing_key_takes_the_papers_value() {
        let read: MachineParameters = serde_json::from_str(r#"{"r_m": 0.0016}"#).unwrap();
        assert_eq!(read, MachineParameters { r_m: 0.0016, ..MachineParameters::default() });
    }

    #[test]
    fn an_unknown_key_is_refused_by_name() {
        let error = serde_json::from_str::<MachineParameters>(r#"{"radius": 1.0}"#).unwrap_err();
        assert!(error.to_string().contains("radius"), "{error}");
    }

    #[test]
    fn every_key_refuses_nan_infinity_and_minus_one_by_name() {
        type Edit = fn(&mut MachineParameters, f64);
        let edits: [(&str, Edit); 8] = [
            ("l_m", |p, v| p.l_m = v),
            ("r_m", |p, v| p.r_m = v),
            ("e_pa", |p, v| p.e_pa = v),
            ("d_outer_m", |p, v| p.d_outer_m = v),
            ("d_inner_m", |p, v| p.d_inner_m = v),
            ("l_d_m", |p, v| p.l_d_m = v),
            ("l_c_m", |p, v| p.l_c_m = v),
            ("phi_rad", |p, v| p.phi_rad = v),
        ];
        for (name, edit) in edits {
            for bad in [f64::NAN, f64::INFINITY, -1.0] {
                let mut parameters = MachineParameters::default();
                edit(&mut parameters, bad);
                let error = parameters.check().unwrap_err().to_string();
                assert!(error.contains(name) && error.contains(&bad.to_string()), "{name} = {bad}: {error}");
            }
        }
    }

    #[test]
    fn a_solid_wall_and_a_radius_that_folds_the_snake_are_contradictions() {
        let thick = MachineParameters { d_inner_m: 0.66e-3, ..MachineParameters::default() };
        assert!(matches!(thick.check(), Err(ParameterError::Contradiction { key: "d_inner_m", .. })));
        let wide = MachineParameters { r_m: 0.0083, ..MachineParameters::default() };
        assert!(matches!(wide.check(), Err(ParameterError::Contradiction { key: "r_m", .. })));
    }
}
