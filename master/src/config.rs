//! The master's settings: one documented struct, checked once at load, so that no step meets a value out of range.

use crate::{
    AxisMap, BesideConfig, DeviceChoice, Engage, HoldButton, LineLoadLimits, LiveMotion, MAX_DEVICES, MasterError,
    PoseConfig, Presence, PressButton,
};
use krait_ipc::settings;
use std::path::PathBuf;

settings! {
    /// Settings of the master; every one has a default, an unknown key is refused.
    #[derive(Clone, Debug, PartialEq)]
    pub struct MasterConfig in "master" {
        /// Inputs published per second while no report arrives, Hz. 1000: as fast as the drives are written.
        rate_hz: u32 = 1000, 100..=8000;
        /// Which device axis drives which axis of the view; three different ones.
        axis_map: AxisMap = AxisMap::default();
        /// Deflection, as a part of the full one, below which the hand counts as still. 0.03: a resting hand's weight.
        dead_zone_ratio: f64 = 0.03, 0.0..=0.5;
        /// Exponent of the response curve. 1.5: fine motion near the centre, full speed at the stop.
        response_exponent: f64 = 1.5, 1.0..=4.0;
        /// Speed of the tip at full deflection, m/s. 0.025: the default snake bends 60 deg in about half a second.
        full_speed_m_per_s: f64 = 0.025, 0.001..=0.1;
        /// Speed of turning at full deflection, rad/s, for joints; a snake of three lines cannot turn its tip. 0.5: half of what
        /// joints 4 to 6 do by default.
        full_turn_rad_per_s: f64 = 0.5, 0.01..=5.0;
        /// What counts as the operator's presence: `hold:<button>` or `toggle:<button>`.
        presence: Presence = Presence::Toggle(0);
        /// What counts as the clutch: `none` or `hold:<button>`.
        clutch: HoldButton = HoldButton::Hold(1);
        /// What opens the jaw of a gripper while it is held: `none` or `hold:<button>`.
        jaw_open: HoldButton = HoldButton::None;
        /// What closes it; while both are held it stays.
        jaw_close: HoldButton = HoldButton::None;
        /// What sets a mark in the recording: `none` or `press:<button>`. `press:2`: the first button that steers nothing.
        mark: PressButton = PressButton::Press(2);
        /// What turns fine motion on and off while it moves: `none` or `press:<button>`.
        fine: PressButton = PressButton::None;
        /// Part of the configured speed at which the hand moves the tip in fine motion.
        fine_scale: f64 = 0.25, 0.01..=1.0;
        /// What locks translation and frees it again: `none` or `press:<button>`.
        lock_translation: PressButton = PressButton::None;
        /// The same for rotation.
        lock_rotation: PressButton = PressButton::None;
        /// Silence after which a deflected device is lost, s. 0.1: six missed reports of the slowest device.
        silence_limit_s: f64 = 0.1, 0.02..=1.0;
        /// Which live device to read: `any`, `vid:pid` or `vid:pid:serial`.
        device: DeviceChoice = DeviceChoice::default();
        /// Profile (TOML, docs/hands.md) of a device of the kernel's input system, which is then read instead of `device`; none
        /// by default.
        profile: Option<PathBuf> = None;
        /// Node of the kernel's input system that is the profile's device, as in `/dev/input/by-id/...-event-mouse`; none by default:
        /// the one that the profile names.
        node: Option<PathBuf> = None;
        /// Devices beside that one whose buttons and axes join its, as pedals are (docs/hands.md): `[[master.beside]]` with `profile` and `node` as
        /// here, at most three; none by default.
        beside: Vec<BesideConfig> = Vec::new();
        /// Socket of spacenavd, as in "/run/spnav.sock" (docs/hands.md), through which the device is then read; none by default.
        spacenavd: Option<PathBuf> = None;
        /// The hand that a pose sender follows (`--master pose`).
        pose: PoseConfig = PoseConfig::default();
        /// Whether a recording or a script begins only when the slave is enabled and homed.
        start_when_ready: bool = true;
        /// File to record the raw reports into; none by default.
        record_reports: Option<PathBuf> = None;
        /// Whether presence counts. Given by the program from its source and its command line, not by this table.
        #[serde(skip)]
        engage: Engage = Engage::Never;
        /// Live scale and locks to begin with. Given by the program, not by this table.
        #[serde(skip)]
        begin: LiveMotion = LiveMotion::default();
        /// Largest loads of a line, against which the hand is told of them. Given by the program from `[slave.limits]`, not by this table.
        #[serde(skip)]
        load_limits: LineLoadLimits = LineLoadLimits::default();
    }
}

impl MasterConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`MasterError::Setting`] or [`MasterError::Config`] for the first setting that is out of its range or does not fit.
    pub fn check(&self) -> Result<(), MasterError> {
        self.check_ranges()?;
        self.pose.check()?;
        if !self.axis_map.is_one_to_one() {
            let axes = self.axis_map.axes().map(String::from);
            return Err(refusal("axis_map", axes.join(", "), "three different device axes for view_x, view_y, view_z"));
        }
        if let (Some(node), None) = (&self.node, &self.profile) {
            return Err(refusal("node", node.display(), "a `profile` that says what is what on it"));
        }
        if let (Some(socket), Some(_)) = (&self.spacenavd, &self.profile) {
            return Err(refusal(
                "spacenavd",
                socket.display(),
                "no `profile` beside it: the daemon says itself what is what",
            ));
        }
        if self.beside.len() >= MAX_DEVICES {
            return Err(refusal("beside", self.beside.len(), "at most three devices beside the hand controller"));
        }
        self.check_buttons()
    }

    /// One press shall do one thing.
    fn check_buttons(&self) -> Result<(), MasterError> {
        let (Presence::Hold(presence) | Presence::Toggle(presence)) = self.presence;
        let clutch = self.clutch.button();
        let others = [
            ("mark", self.mark.button(), String::from(self.mark)),
            ("fine", self.fine.button(), self.fine.into()),
            ("lock_translation", self.lock_translation.button(), self.lock_translation.into()),
            ("lock_rotation", self.lock_rotation.button(), self.lock_rotation.into()),
            ("jaw_open", self.jaw_open.button(), self.jaw_open.into()),
            ("jaw_close", self.jaw_close.button(), self.jaw_close.into()),
        ];
        if clutch == Some(presence) {
            return Err(refusal("clutch", String::from(self.clutch), "another button than the one for presence"));
        }
        for (idx, (field, button, text)) in others.iter().enumerate() {
            let steers = button.is_some_and(|button| button == presence || Some(button) == clutch);
            let again = button.is_some() && others[..idx].iter().any(|(_, other, _)| other == button);
            if steers || again {
                return Err(refusal(field, text, "another button than those that do something else"));
            }
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
        assert!(refused(|c| c.rate_hz = 99).contains("[master] rate_hz = 99: expected 100 to 8000"));
        assert!(refused(|c| c.dead_zone_ratio = f64::NAN).contains("dead_zone_ratio = NaN"));
        assert!(refused(|c| c.full_speed_m_per_s = 1.0).contains("full_speed_m_per_s = 1: expected"));
        assert!(refused(|c| c.axis_map.view_x = c.axis_map.view_y).contains("axis_map = +z, +z, -y"));
        assert!(
            refused(|c| c.node = Some("/dev/input/event3".into()))
                .contains("node = /dev/input/event3: expected a `prof")
        );
        let both =
            |c: &mut MasterConfig| (c.spacenavd, c.profile) = (Some("/run/spnav.sock".into()), Some("mouse".into()));
        assert!(refused(both).contains("spacenavd = /run/spnav.sock: expected no `profile`"));
        assert!(refused(|c| c.clutch = HoldButton::Hold(0)).contains("another button"));
    }

    #[test]
    fn one_button_does_one_thing() {
        for change in [
            (|c: &mut MasterConfig| c.mark = PressButton::Press(0)) as fn(&mut MasterConfig),
            |c| c.fine = PressButton::Press(1),
            |c| c.lock_rotation = PressButton::Press(2),
            |c| (c.lock_translation, c.lock_rotation) = (PressButton::Press(7), PressButton::Press(7)),
            |c| c.jaw_open = HoldButton::Hold(2),
            |c| (c.jaw_open, c.jaw_close) = (HoldButton::Hold(4), HoldButton::Hold(4)),
        ] {
            assert!(refused(change).contains("another button than those that do something else"));
        }
        assert!(refused(|c| c.fine_scale = 0.0).contains("[master] fine_scale = 0: expected 0.01 to 1"));
    }

    #[test]
    fn an_unknown_key_and_a_wrong_word_are_refused_by_name() {
        for (text, named) in [
            ("rate_khz = 1", "rate_khz"),
            ("presence = \"maybe\"", "toggle:<0..31>"),
            ("presence = \"hold:32\"", "hold:<0..31>"),
            ("clutch = \"toggle:1\"", "is no button to hold"),
            ("axis_map = { view_x = \"+q\" }", "is no device axis"),
            ("device = \"046d\"", "vid:pid"),
        ] {
            let error = toml::from_str::<MasterConfig>(text).expect_err("refused").to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
