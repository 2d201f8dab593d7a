//! The model that a chain runs with: one text, read once, handed to every process as it is.

use anyhow::{Context, bail};
use clap::ValueEnum;
use krait_bridge::{JointModel, LiveModel};
use krait_ipc::input;
use krait_model::model_file::{Machine, ModelFile, built_in};
use krait_model::segments::SegmentsParameters;
use krait_model::{Chain, ModelHash};
use krait_record::DrawnMachine;
use krait_report::Lanes;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A model that is built into the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Compensation {
    /// q~ = q.
    Off,
    /// Eqs. (15)-(17): elastic lines with the loading branch of friction always.
    Naive,
    /// Load scale, friction and play with the signs of motion; load scale and play are learnt.
    #[default]
    Estimated,
}

impl Compensation {
    /// Every built-in model, from the least compensation to the most.
    pub const ALL: [Self; 3] = [Self::Off, Self::Naive, Self::Estimated];

    /// The word used in configuration, tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Naive => "naive",
            Self::Estimated => "estimated",
        }
    }

    /// The text of its model file.
    pub fn text(self) -> &'static str {
        // Each name is one of the built-in files; a test holds them together.
        built_in(self.name()).unwrap_or_default()
    }
}

/// What a model of the user's own is called in tables and JSON.
pub const OWN_MODEL: &str = "model";

/// A model that a chain can run with.
#[derive(Clone, Debug)]
pub struct ModelInForce {
    /// off, naive, estimated, or model for a file of the user's own.
    pub label: &'static str,
    /// The text of the file.
    pub text: String,
    /// What it says.
    pub machine: LiveModel,
}

impl ModelInForce {
    /// Reads a model file, or takes the built-in one where none is named.
    ///
    /// # Errors
    /// One sentence with file, line and key; also for joints that no chain drives, for an effect that needs a column that a running
    /// chain does not have, and for one that no command undoes.
    pub fn load(path: Option<&Path>, otherwise: Compensation) -> anyhow::Result<Self> {
        let Some(path) = path else {
            let named = || format!("the built-in model {}", otherwise.name());
            return Self::parse(otherwise.text()).with_context(named);
        };
        let text = input::text(path, input::CONFIG_BYTES)
            .with_context(|| format!("the model file {} could not be read", path.display()))?;
        Self::parse(&text).with_context(|| format!("model file {}", path.display()))
    }

    /// The chain of a snake.
    ///
    /// # Errors
    /// One sentence: `what` is for snakes, and the model is of joints or segments.
    pub fn snake(&self, what: &str) -> anyhow::Result<&Chain> {
        self.machine.snake().with_context(|| {
            let found = if self.machine.segments().is_some() { "segments" } else { "joints" };
            format!("{what} is for snakes, and the model is of {found}")
        })
    }

    /// The same segments without effects: with lines taken for rigid (off), or elastic ones alone (naive); or as they are (estimated).
    ///
    /// # Errors
    /// One sentence for a model of another kind, whose compensation is its own.
    pub fn segments_with(&self, own: Compensation) -> anyhow::Result<Self> {
        let file = ModelFile::parse(&self.text)?;
        let Machine::Segments(segments) = file.machine() else {
            bail!(
                "--compensation beside --model takes effects off a model of kind segments, and this one is of kind {}; leave one of the two out",
                file.machine().kind()
            );
        };
        let rigid_lines = match own {
            Compensation::Off => true,
            Compensation::Naive => false,
            Compensation::Estimated => return Ok(self.clone()),
        };
        let bare = Machine::Segments(SegmentsParameters { rigid_lines, ..segments.clone() });
        Self::parse(&ModelFile::new(bare, Vec::new(), Vec::new())?.to_toml())
    }

    /// Checks a model file's text.
    ///
    /// # Errors
    /// As [`ModelInForce::load`].
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let file = ModelFile::parse(text)?;
        let machine = LiveModel::of(&file)?;
        let label = match file.machine() {
            Machine::Segments(segments) if file.effects().is_empty() => {
                let bare = if segments.rigid_lines { Compensation::Off } else { Compensation::Naive };
                bare.name()
            }
            _ => label_of(machine.hash()),
        };
        Ok(Self { label, text: text.to_owned(), machine })
    }
}

/// What stands in a message's places for joints; `None` for a snake, which uses none of them.
pub fn lanes_of(model: &LiveModel) -> Option<Lanes> {
    match model {
        LiveModel::Snake(_) => None,
        LiveModel::Joints(joints) => Some(Lanes::of_joints(JointModel::slides(joints))),
        LiveModel::Segments(_) => Some(Lanes::Segments),
    }
}

/// What viewers draw of a machine; joints have no shape that a model knows.
pub fn drawn_of(model: &LiveModel) -> Option<DrawnMachine> {
    match model {
        LiveModel::Snake(chain) => Some(DrawnMachine::Snake(*chain.machine())),
        LiveModel::Joints(_) => None,
        LiveModel::Segments(segments) => Some(DrawnMachine::Segments(segments.parameters().clone())),
    }
}

/// The name of a built-in model, or [`OWN_MODEL`].
pub fn label_of(hash: ModelHash) -> &'static str {
    let is_it = |own: &Compensation| ModelFile::parse(own.text()).is_ok_and(|file| file.hash() == hash);
    Compensation::ALL.into_iter().find(is_it).map_or(OWN_MODEL, Compensation::name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_model_runs_and_goes_by_its_name() {
        for own in Compensation::ALL {
            assert_eq!(ModelInForce::load(None, own).expect("a built-in model").label, own.name());
        }
    }

    #[test]
    fn segments_can_be_had_without_their_effects_and_other_models_cannot() {
        let two = ModelInForce::parse(include_str!("../../docs/segments/two.toml")).expect("segments");
        let label = |own| two.segments_with(own).expect("segments").label;
        assert_eq!(Compensation::ALL.map(label), ["off", "naive", OWN_MODEL]);
        let off = two.segments_with(Compensation::Off).expect("segments");
        assert_eq!(off.segments_with(Compensation::Off).expect("segments").machine.hash(), off.machine.hash());
        let snake = ModelInForce::load(None, Compensation::Estimated).expect("a built-in model");
        let refused = snake.segments_with(Compensation::Off).expect_err("a snake").to_string();
        assert!(refused.contains("this one is of kind snake"), "{refused}");
    }

    #[test]
    fn what_no_command_undoes_and_what_needs_a_column_is_refused_in_one_sentence() {
        let refused = |effect: &str| {
            let text = format!("format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"{effect}\"\n");
            format!("{:#}", ModelInForce::parse(&text).expect_err(effect))
        };
        assert!(refused("saturation").contains("cannot be compensated"), "{}", refused("saturation"));
        assert!(refused("stem-coupling").contains("needs the column stem_angle_rad"), "{}", refused("stem-coupling"));
    }
}
