//! The configuration file: one table per process, every key optional, unknown keys and values out of range refused.

use crate::budget::Budget;
use crate::in_force::{Compensation, ModelInForce};
use crate::print::wrapped;
use crate::real_drives;
use anyhow::{Context, bail};
use krait_bridge::{
    CompensateConfig, EstimateConfig, GripperConfig, JointMachine, JointsConfig, LiveModel, ResolveConfig,
};
use krait_ipc::setting::Setting;
use krait_ipc::{Realtime, input};
use krait_master::{MasterConfig, PoseConfig};
use krait_model::Snake;
use krait_model::gripper::Gripper;
use krait_model::segments::SegmentParameters;
use krait_record::RecordConfig;
use krait_shape::GateConfig;
use krait_slave::{ActuatorConfig, DriveConfig, DriveKind, Limits, SlaveConfig};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What stands for the standard input in place of a configuration's path.
pub const STANDARD_INPUT: &str = "-";

/// Everything that can be set about a chain.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The built-in model that the chain runs with, where no file is named: off, naive or estimated.
    pub compensation: Compensation,
    /// The model file that the chain runs with: the machine, its effects, and what is learnt.
    pub model: Option<PathBuf>,
    /// The text of the model, where a supervisor hands it over; then no file is read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_text: Option<String>,
    /// The operator's device.
    pub master: MasterConfig,
    /// The operator's motion to the setpoint.
    pub resolve: ResolveConfig,
    /// The setpoint to the actuators.
    pub compensate: CompensateConfig,
    /// How the operator moves joints, where the model is of joints.
    pub joints: JointsConfig,
    /// How the operator moves the jaw, where the model has a gripper.
    pub gripper: GripperConfig,
    /// Learning the model.
    pub estimate: EstimateConfig,
    /// The drives.
    pub slave: SlaveConfig,
    /// Shapes of another program.
    pub shape: GateConfig,
    /// The recording.
    pub record: RecordConfig,
    /// What a sample may take.
    pub budget: Budget,
    /// What the processes between the hand and the drives ask of the kernel.
    pub realtime: Realtime,
}

impl Config {
    /// Reads a configuration, `-` from standard input, or gives the defaults where no file is named.
    ///
    /// # Errors
    /// One sentence with file, line and key.
    pub fn load(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else { return Ok(Self::default()) };
        Self::read(&Self::text(path)?, path)
    }

    /// The text of a configuration, `-` from standard input.
    ///
    /// # Errors
    /// One sentence with the file.
    pub fn text(path: &Path) -> anyhow::Result<String> {
        let text = if path == Path::new(STANDARD_INPUT) {
            input::text_from(&mut std::io::stdin(), input::CONFIG_BYTES)
        } else {
            input::text(path, input::CONFIG_BYTES)
        };
        text.with_context(|| format!("the configuration {} could not be read", path.display()))
    }

    /// Reads and checks the text of a configuration, which is from `path`.
    ///
    /// # Errors
    /// One sentence with file, line and key.
    pub fn read(text: &str, path: &Path) -> anyhow::Result<Self> {
        let config = Self::parse(text).with_context(|| format!("configuration {}", path.display()))?;
        config.check().with_context(|| format!("configuration {}", path.display()))?;
        Ok(config)
    }

    /// The configuration as TOML with every key.
    ///
    /// # Errors
    /// A value that TOML cannot hold.
    pub fn to_toml(&self) -> anyhow::Result<String> {
        toml::to_string(self).context("the configuration could not be written as TOML")
    }

    /// The same with what each key is and what it may be, in comments.
    ///
    /// # Errors
    /// As [`Config::to_toml`].
    pub fn explained(&self) -> anyhow::Result<String> {
        let (mut text, mut table) = (String::new(), String::new());
        for line in self.to_toml()?.lines() {
            if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                // A table that there may be several of stands in two brackets.
                name.trim_matches(['[', ']']).clone_into(&mut table);
            }
            let key = line.split(" = ").next().filter(|_| line.contains(" = "));
            if let Some(setting) = key.and_then(|key| settings_of(&table).iter().find(|setting| setting.key == key)) {
                for line in wrapped(&setting.sentence(), WIDTH) {
                    text += &format!("# {line}\n");
                }
            }
            text += &format!("{line}\n");
        }
        Ok(text)
    }

    /// Reads a configuration from its text; ranges are not checked yet.
    ///
    /// # Errors
    /// One sentence with line and key.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(0, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            anyhow::anyhow!("line {line}: {}{}", error.message(), nearest(error.message()))
        })
    }

    /// The model that the chain runs with.
    ///
    /// # Errors
    /// One sentence with file, line and key.
    pub fn model(&self) -> anyhow::Result<ModelInForce> {
        match &self.model_text {
            Some(text) => ModelInForce::parse(text).context("the model that was handed over"),
            None => ModelInForce::load(self.model.as_deref(), self.compensation),
        }
    }

    /// The same with the model's text in it, read once: no process can come to another one, whatever happens to the file.
    ///
    /// # Errors
    /// As [`Config::model`].
    pub fn with_model_text(&self) -> anyhow::Result<Self> {
        Ok(Self { model_text: Some(self.model()?.text), ..self.clone() })
    }

    /// The same with a compensation: the built-in model of that name, or the model that is named already with what the name takes off
    /// (`keeps_model`), which only segments can be had with.
    ///
    /// # Errors
    /// One sentence where the model cannot be read or is of another kind.
    pub fn with_compensation(&self, compensation: Compensation, keeps_model: bool) -> anyhow::Result<Self> {
        if !keeps_model {
            return Ok(Self { compensation, model: None, ..self.clone() });
        }
        let model_text = Some(self.model()?.segments_with(compensation)?.text);
        Ok(Self { compensation, model_text, ..self.clone() })
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first value that is out of range, with table, key, range and reason.
    pub fn check(&self) -> anyhow::Result<()> {
        self.master.check()?;
        self.resolve.check()?;
        self.compensate.check()?;
        self.estimate.check()?;
        self.slave.check()?;
        self.shape.check()?;
        self.record.check()?;
        self.realtime.check()?;
        self.budget.check()?;
        self.joints.check()?;
        self.gripper.check()?;
        const REFUSED: &str = "the model must not steer a machine";
        match self.model()?.machine {
            LiveModel::Snake(chain) => {
                self.check_strain(Snake::new(chain.machine())?.axial_stiffness_n())?;
                chain.gripper().map_or(Ok(()), |gripper| self.check_gripper(gripper))?;
                chain.plausible(self.resolve.max_bend_rad)?.context(REFUSED)
            }
            LiveModel::Joints(joints) => JointMachine::new(&joints, &self.joints)?.plausible()?.context(REFUSED),
            LiveModel::Segments(segments) => {
                let stiffnesses_n = segments.parameters().segments.iter().map(SegmentParameters::axial_stiffness_n);
                stiffnesses_n.into_iter().try_for_each(|stiffness_n| self.check_strain(stiffness_n))
            }
        }
    }

    /// Real drives must be those of the model's machine; to be asked when it is clear which model that is.
    ///
    /// # Errors
    /// As [`real_drives::check`].
    pub fn check_drives(&self) -> anyhow::Result<()> {
        match self.slave.drive.kind {
            DriveKind::Sim => Ok(()),
            DriveKind::Sts3215 | DriveKind::Xl330 | DriveKind::Cia402 => {
                real_drives::check(&self.slave.drive, &self.model()?.machine)
            }
        }
    }

    /// The model of a gripper may steer a jaw, and the wire's way is within what a command may be.
    fn check_gripper(&self, gripper: &Gripper) -> anyhow::Result<()> {
        let (found_m, stroke_m) = (gripper.travel_m(), self.compensate.max_stroke_m);
        if found_m > stroke_m {
            bail!(
                "[gripper] of the model: its wire goes {:.2} mm from its zero, expected at most [compensate] max_stroke_m = {:.2} mm; \
                 make range_deg or wire_m_per_rad smaller, or max_stroke_m larger",
                found_m * 1e3,
                stroke_m * 1e3
            );
        }
        gripper.plausible()?.context("[gripper] of the model must not steer a jaw")
    }

    /// The pull that is allowed strains no line beyond what is allowed. `stiffness_n`: E A of a line, N.
    fn check_strain(&self, stiffness_n: f64) -> anyhow::Result<()> {
        let Limits { pull_n, strain, .. } = self.slave.limits;
        // Where loads are not measured, the drives' own torque limit bounds them.
        if pull_n.is_finite() && pull_n > strain * stiffness_n {
            bail!(
                "[slave.limits] pull_n = {pull_n}: it strains a line of this model by {:.2} %, expected at most strain = {:.2} %, \
                 which is {:.0} N; lower pull_n, or raise strain where the lines' material allows it",
                100.0 * pull_n / stiffness_n,
                100.0 * strain,
                strain * stiffness_n
            );
        }
        Ok(())
    }
}

/// Width of a comment line in [`Config::explained`].
const WIDTH: usize = 98;

/// What is known about the settings of a table.
fn settings_of(table: &str) -> &'static [Setting] {
    match table {
        MasterConfig::TABLE => MasterConfig::SETTINGS,
        PoseConfig::TABLE => PoseConfig::SETTINGS,
        ResolveConfig::TABLE => ResolveConfig::SETTINGS,
        CompensateConfig::TABLE => CompensateConfig::SETTINGS,
        JointsConfig::TABLE => JointsConfig::SETTINGS,
        GripperConfig::TABLE => GripperConfig::SETTINGS,
        EstimateConfig::TABLE => EstimateConfig::SETTINGS,
        SlaveConfig::TABLE => SlaveConfig::SETTINGS,
        Limits::TABLE => Limits::SETTINGS,
        DriveConfig::TABLE => DriveConfig::SETTINGS,
        ActuatorConfig::TABLE => ActuatorConfig::SETTINGS,
        GateConfig::TABLE => GateConfig::SETTINGS,
        RecordConfig::TABLE => RecordConfig::SETTINGS,
        Realtime::TABLE => Realtime::SETTINGS,
        _ => &[],
    }
}

/// For an unknown key: the known one that looks most like it.
fn nearest(message: &str) -> String {
    let mut words = message.split('`').skip(1).step_by(2);
    let Some(unknown) = words.next().filter(|_| message.starts_with("unknown")) else { return String::new() };
    krait_model::nearest_name(unknown, words).map_or_else(String::new, |known| format!("; did you mean `{known}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::Priority;

    #[test]
    fn the_defaults_are_in_range_and_survive_a_round_trip_through_toml() {
        let config = Config::default();
        config.check().expect("in range");
        let text = config.to_toml().expect("toml");
        assert_eq!(Config::parse(&text).expect("parses"), config);
    }

    #[test]
    fn every_number_is_explained_and_the_explained_configuration_is_the_same() {
        let config = Config::default();
        let text = config.explained().expect("toml");
        assert_eq!(Config::parse(&text).expect("parses"), config);
        let lines: Vec<&str> = text.lines().collect();
        let is_value = |line: &str| line.contains(" = ") && !line.starts_with('#');
        let bare = lines.windows(2).filter(|pair| is_value(pair[1]) && !pair[0].starts_with("# "));
        let bare: Vec<&str> =
            bare.map(|pair| pair[1]).filter(|line| !line.contains("floors") && !line.contains("_us = ")).collect();
        // Budgets are explained in their guide; the axes under `axis_map`.
        assert_eq!(bare, ["view_x = \"+x\"", "view_y = \"+z\"", "view_z = \"-y\""]);
        assert!(text.contains("Range: 0.01 to 10.\nmax_bend_vel_rad_per_s = 2.0"), "{text}");
    }

    #[test]
    fn a_priority_is_a_number_or_the_kernels_to_give() {
        let read = |value: &str| Config::parse(&format!("[realtime]\npriority = {value}\n"));
        for (value, priority) in [("\"auto\"", Priority::Auto), ("0", Priority::NONE), ("60", Priority::Fixed(60))] {
            assert_eq!(read(value).expect("a priority").realtime.priority, priority);
        }
        for wrong in ["\"high\"", "-1", "1.5", "true"] {
            let told = read(wrong).expect_err("no priority").to_string();
            assert!(told.contains("expected \"auto\" or a whole number of 0 to 99"), "{wrong}: {told}");
        }
        let told = read("100").expect("a number").check().expect_err("too high").to_string();
        assert!(told.contains("[realtime] priority = 100: expected 0 to 99"), "{told}");
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line_and_the_nearest_known_one() {
        let error = Config::parse("[resolve]\n\nmax_bent_rad = 1.0\n").expect_err("unknown").to_string();
        assert!(error.starts_with("line 3: unknown field `max_bent_rad`"), "{error}");
        assert!(error.ends_with("did you mean `max_bend_rad`?"), "{error}");
    }

    #[test]
    fn a_pull_that_strains_a_line_too_far_is_refused_and_one_that_is_not_measured_passes() {
        let refused = |text: &str| Config::parse(text).expect("parses").check().err().map(|error| error.to_string());
        let found = refused("[slave.limits]\npull_n = 90.0\n").expect("too far");
        assert!(found.contains("by 1.14 %") && found.contains("expected at most strain = 1.00 %"), "{found}");
        let allowed =
            ["[slave.limits]\npull_n = 90.0\nstrain = 0.02\n", "[slave.limits]\npull_n = inf\npush_n = inf\n"];
        assert_eq!(allowed.map(refused), [None, None]);
    }

    #[test]
    fn a_value_of_the_wrong_kind_is_named_with_its_line() {
        let error = Config::parse("[resolve]\nmax_bend_rad = \"far\"\n").expect_err("a word").to_string();
        assert!(error.starts_with("line 2: invalid type"), "{error}");
    }
}
