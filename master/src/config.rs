//! The master's settings: one documented struct, checked once at load, so that no step meets a value out of range.

use crate::{AxisMap, Clutch, DeviceChoice, Engage, MarkButton, MasterError, Presence};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Settings of the master; every one has a default, an unknown key is refused.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct MasterConfig {
    /// Inputs published per second while no report arrives, 100..=8000, Hz. 1000: as fast as the drives are written.
    pub rate_hz: u32,
    /// Which device axis drives which axis of the view.
    pub axis_map: AxisMap,
    /// Deflection, as a part of the full one, below which the hand counts as still, 0..=0.5. 0.03: a resting hand's weight.
    pub dead_zone_ratio: f64,
    /// Exponent of the response curve, 1..=4. 1.5: fine motion near the centre, full speed at the stop.
    pub response_exponent: f64,
    /// Speed of the tip at full deflection, 0.001..=0.1, m/s. 0.025: the default snake bends 60 deg in about half a second.
    pub full_speed_m_per_s: f64,
    /// What counts as the operator's presence: `hold:<button>` or `toggle:<button>`.
    pub presence: Presence,
    /// What counts as the clutch: `none` or `hold:<button>`.
    pub clutch: Clutch,
    /// What sets a mark in the recording: `none` or `press:<button>`. `press:2`: the first button that steers nothing.
    pub mark: MarkButton,
    /// Silence after which a deflected device is lost, 0.02..=1, s. 0.1: six missed reports of the slowest device.
    pub silence_limit_s: f64,
    /// Which live device to read: `any`, `vid:pid` or `vid:pid:serial`.
    pub device: DeviceChoice,
    /// Whether a recording or a script begins only when the slave is enabled and homed.
    pub start_when_ready: bool,
    /// File to record the raw reports into; none by default.
    pub record_reports: Option<PathBuf>,
    /// Whether presence counts. Given by the program from its source and its command line, not by this table.
    #[serde(skip)]
    pub engage: Engage,
}

impl Default for MasterConfig {
    fn default() -> Self {
        Self {
            rate_hz: 1000,
            axis_map: AxisMap::default(),
            dead_zone_ratio: 0.03,
            response_exponent: 1.5,
            full_speed_m_per_s: 0.025,
            presence: Presence::Toggle(0),
            clutch: Clutch::Hold(1),
            mark: MarkButton::Press(2),
            silence_limit_s: 0.1,
            device: DeviceChoice::default(),
            start_when_ready: true,
            record_reports: None,
            engage: Engage::Never,
        }
    }
}

impl MasterConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`MasterError::Config`] for the first setting that is out of its range.
    pub fn check(&self) -> Result<(), MasterError> {
        if !(100..=8000).contains(&self.rate_hz) {
            return Err(refusal("rate_hz", self.rate_hz, "a whole number from 100 to 8000 Hz"));
        }
        if !self.axis_map.is_one_to_one() {
            let axes = self.axis_map.axes().map(String::from);
            return Err(refusal("axis_map", axes.join(", "), "three different device axes for view_x, view_y, view_z"));
        }
        within("dead_zone_ratio", self.dead_zone_ratio, 0.0..=0.5, "a number from 0 to 0.5")?;
        within("response_exponent", self.response_exponent, 1.0..=4.0, "a number from 1 to 4")?;
        within("full_speed_m_per_s", self.full_speed_m_per_s, 0.001..=0.1, "a number from 0.001 to 0.1 m/s")?;
        within("silence_limit_s", self.silence_limit_s, 0.02..=1.0, "a number from 0.02 to 1 s")?;
        match (self.presence, self.clutch) {
            (Presence::Hold(a) | Presence::Toggle(a), Clutch::Hold(b)) if a == b => {
                Err(refusal("clutch", String::from(self.clutch), "another button than the one for presence"))
            }
            _ => self.check_mark(),
        }
    }

    /// A press that steers shall not mark besides.
    fn check_mark(&self) -> Result<(), MasterError> {
        let MarkButton::Press(mark) = self.mark else { return Ok(()) };
        let steers = matches!(self.presence, Presence::Hold(button) | Presence::Toggle(button) if button == mark)
            || self.clutch == Clutch::Hold(mark);
        if steers {
            return Err(refusal("mark", String::from(self.mark), "another button than those for presence and clutch"));
        }
        Ok(())
    }

    /// Time between two ticks, ns. For a checked configuration.
    pub(crate) fn period_ns(&self) -> i64 {
        1_000_000_000 / i64::from(self.rate_hz.max(1))
    }

    /// The silence limit, ns. For a checked configuration.
    pub(crate) fn silence_limit_ns(&self) -> i64 {
        (self.silence_limit_s * 1e9) as i64
    }
}

fn within(
    field: &'static str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), MasterError> {
    if range.contains(&value) { Ok(()) } else { Err(refusal(field, value, expected)) }
}

fn refusal(field: &'static str, found: impl ToString, expected: &'static str) -> MasterError {
    MasterError::Config { field, found: found.to_string(), expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl FnOnce(&mut MasterConfig)) -> String {
        let mut config = MasterConfig::default();
        change(&mut config);
        config.check().expect_err("out of range").to_string()
    }

    #[test]
    fn the_default_passes_its_own_check_and_survives_a_round_trip() {
        let config = MasterConfig::default();
        config.check().expect("default");
        let text = toml::to_string(&config).expect("write");
        assert_eq!(toml::from_str::<MasterConfig>(&text).expect("read"), config);
    }

    #[test]
    fn a_value_out_of_range_or_not_a_number_is_named_with_its_range() {
        assert!(refused(|c| c.rate_hz = 99).contains("rate_hz is 99, expected a whole number from 100 to 8000 Hz"));
        assert!(refused(|c| c.dead_zone_ratio = f64::NAN).contains("dead_zone_ratio is NaN"));
        assert!(refused(|c| c.full_speed_m_per_s = 1.0).contains("full_speed_m_per_s is 1, expected"));
        assert!(refused(|c| c.axis_map.view_x = c.axis_map.view_y).contains("axis_map is +z, +z, -y"));
        assert!(refused(|c| c.clutch = Clutch::Hold(0)).contains("another button"));
    }

    #[test]
    fn an_unknown_key_and_a_wrong_word_are_refused_by_name() {
        for (text, named) in [
            ("rate_khz = 1", "rate_khz"),
            ("presence = \"maybe\"", "toggle:<0..31>"),
            ("presence = \"hold:32\"", "hold:<0..31>"),
            ("clutch = \"toggle:1\"", "is no clutch"),
            ("axis_map = { view_x = \"+q\" }", "is no device axis"),
            ("device = \"046d\"", "vid:pid"),
        ] {
            let error = toml::from_str::<MasterConfig>(text).expect_err("refused").to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
