//! What a guide follows: places of the tip, leg by leg, each to a stop at which a pose may be measured. Written by
//! `krait experiment`, read by the master of that chain.

use crate::MasterError;
use crate::recording::read_bounded;
use serde::{Deserialize, Serialize};
use std::path::Path;

const MAX_BYTES: u64 = 16 * 1024 * 1024;

/// Legs in their order, and how they are followed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GuidePlan {
    /// Roll of the camera's view about the snake's straight axis, rad, as `resolve` has it.
    pub view_roll_rad: f64,
    /// Fastest tip, m/s.
    pub speed_m_per_s: f64,
    /// Actuators that stay within so much, m, count as at rest.
    pub rest_m: f64,
    /// So long they must, s, before a pose is measured.
    pub settle_s: f64,
    /// So long a pose is measured, s.
    pub measure_s: f64,
    /// So long is waited for anything, s: for the operator's engagement, for arrival beyond a leg's own time, for rest.
    pub patience_s: f64,
    /// Whether more legs come while it runs ([`crate::GuideOrder`]); without, it ends after its last.
    #[serde(default)]
    pub awaits_orders: bool,
    /// The legs.
    #[serde(default)]
    pub leg: Vec<GuideLeg>,
}

/// One way from the stop before to the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GuideLeg {
    /// Number of the pose that is measured at its end, from 1; 0: none is.
    pub pose: u32,
    /// Where the end disk's centre goes, base frame, m, in straight lines from one to the next.
    pub tip_pos_in_base_m: Vec<[f64; 3]>,
}

impl GuidePlan {
    /// Reads a plan.
    ///
    /// # Errors
    /// [`MasterError`] for a file that cannot be read, is no plan, or asks for what cannot be.
    pub fn load(path: &Path) -> Result<Self, MasterError> {
        let file = path.display().to_string();
        let bytes = read_bounded(path, MAX_BYTES)?;
        let text = String::from_utf8_lossy(&bytes);
        let refuse = |expected: &str, found: String| MasterError::Plan {
            file: file.clone(),
            expected: expected.to_owned(),
            found,
        };
        let plan: Self = toml::from_str(&text)
            .map_err(|error| refuse("a plan as `krait experiment` writes it", error.message().to_owned()))?;
        plan.check().map_err(|(expected, found)| refuse(expected, found))?;
        Ok(plan)
    }

    /// What is expected and what was found, of the first thing that cannot be.
    fn check(&self) -> Result<(), (&'static str, String)> {
        let ranges = [
            (self.view_roll_rad, -3.2..=3.2, "view_roll_rad from -3.2 to 3.2"),
            (self.speed_m_per_s, 1e-4..=0.05, "speed_m_per_s from 0.0001 to 0.05"),
            (self.rest_m, 1e-7..=1e-3, "rest_m from 1e-7 to 1e-3"),
            (self.settle_s, 0.0..=60.0, "settle_s from 0 to 60"),
            (self.measure_s, 0.01..=600.0, "measure_s from 0.01 to 600"),
            (self.patience_s, 0.1..=600.0, "patience_s from 0.1 to 600"),
        ];
        for (value, range, expected) in ranges {
            if !range.contains(&value) {
                return Err((expected, value.to_string()));
            }
        }
        for (k, leg) in self.leg.iter().enumerate() {
            // Farther from the base than any snake is long.
            let is_place = |place: &[f64; 3]| place.iter().all(|x| x.abs() <= 0.5);
            if leg.tip_pos_in_base_m.is_empty() || !leg.tip_pos_in_base_m.iter().all(is_place) {
                return Err(("legs with places within 0.5 m", format!("leg {} without", k + 1)));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_comes_back_from_its_text_and_one_that_cannot_be_is_refused() {
        let plan = GuidePlan {
            view_roll_rad: 0.0,
            speed_m_per_s: 0.01,
            rest_m: 5e-6,
            settle_s: 0.2,
            measure_s: 0.4,
            patience_s: 10.0,
            awaits_orders: false,
            leg: vec![GuideLeg { pose: 1, tip_pos_in_base_m: vec![[0.0, 0.0, 0.026]] }],
        };
        let text = toml::to_string(&plan).expect("TOML");
        assert_eq!(toml::from_str::<GuidePlan>(&text).expect("a plan"), plan);
        assert_eq!(plan.check(), Ok(()));
        let far = GuideLeg { pose: 1, tip_pos_in_base_m: vec![[f64::NAN, 0.0, 0.026]] };
        let empty = GuidePlan { awaits_orders: true, leg: Vec::new(), ..plan.clone() };
        let text = toml::to_string(&empty).expect("TOML");
        assert_eq!(toml::from_str::<GuidePlan>(&text).expect("a plan that awaits its legs"), empty);
        for refused in [
            GuidePlan { speed_m_per_s: f64::NAN, ..plan.clone() },
            GuidePlan { measure_s: 0.0, ..plan.clone() },
            GuidePlan { leg: vec![far], ..plan.clone() },
        ] {
            assert!(refused.check().is_err(), "{refused:?}");
        }
    }
}
