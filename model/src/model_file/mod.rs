//! Model files: a machine, its effects in order, and how they came to be; text in, checked model out, and back.
//!
//! TOML, described in `docs/physics/effects.md`. Everything in a file is untrusted: an unknown key, a value out of bounds, a formula
//! that is not finite is refused with its line. Reading and writing the file itself is the caller's.
//!
//! ```
//! use krait_model::model_file::ModelFile;
//! let file = ModelFile::parse("format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"backlash\"\n")?;
//! assert_eq!(file.effects()[0].setting().value("half_width_m"), Some(8.9e-5));
//! assert_eq!(ModelFile::parse(&file.to_toml())?, file);
//! # Ok::<(), krait_model::model_file::ModelFileError>(())
//! ```

mod assumed;
mod built_in;
mod error;
mod gripper;
mod history;
mod machine;
mod read;
mod read_effect;
mod read_segments;
mod segment_keys;
mod write;
mod write_segments;

pub use assumed::{Assumed, assumed};
pub use built_in::{BUILT_IN, built_in};
pub use error::ModelFileError;
pub use history::{HeldOutRms, HistoryEntry};
pub use machine::{ForceMachine, ForceUnit, GeometryKey, Joints, Known, Machine, SnakeMachine};
pub use write::documented_defaults;

use crate::hash::{self, ModelHash};
use crate::joints::JointChain;
use crate::segments::SegmentChain;
use crate::{Chain, ChainError, EffectSetting, KnownColumns, Snake};

/// The only format there is.
pub const MODEL_FILE_FORMAT: i64 = 1;

/// A checked model file.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    machine: Machine,
    effects: Vec<FileEffect>,
    history: Vec<HistoryEntry>,
}

/// One effect and where its values come from.
#[derive(Clone, Debug, PartialEq)]
pub struct FileEffect {
    setting: EffectSetting,
    origins: Vec<Origin>,
    free: Vec<&'static str>,
}

/// Where a fitted value comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// The parameter.
    pub parameter: String,
    /// Standard error, in the parameter's unit.
    pub se: Option<f64>,
    /// The data it was fitted to.
    pub from: Option<String>,
    /// The day of the fit, YYYY-MM-DD.
    pub date: Option<String>,
}

impl FileEffect {
    /// An effect whose values nobody fitted.
    pub fn new(setting: EffectSetting) -> Self {
        Self { setting, origins: Vec::new(), free: Vec::new() }
    }

    /// The same effect with a parameter that the file leaves to every fit; until then it has its default.
    ///
    /// # Errors
    /// [`ChainError::UnknownParameter`] where the catalogue's effect has no such parameter; a formula has none.
    pub fn with_free(mut self, parameter: &str) -> Result<Self, ChainError> {
        let known = self.setting.kind().definition().parameters.iter().find(|own| own.name == parameter);
        let own = known.ok_or_else(|| self.setting.unknown(parameter))?;
        self.setting = self.setting.with(own.name, own.default)?;
        self.origins.retain(|origin| origin.parameter != own.name);
        self.free.retain(|name| *name != own.name);
        self.free.push(own.name);
        Ok(self)
    }

    /// Whether the file leaves a parameter to every fit.
    pub fn is_free(&self, parameter: &str) -> bool {
        self.free.contains(&parameter)
    }

    /// The same effect with the origin of one value, which replaces an older one.
    ///
    /// # Errors
    /// [`ChainError::UnknownParameter`]; [`ChainError::NotFinite`] for a standard error that is not finite or negative.
    pub fn with_origin(mut self, origin: Origin) -> Result<Self, ChainError> {
        if self.setting.index(&origin.parameter).is_none() {
            return Err(self.setting.unknown(&origin.parameter));
        }
        if let Some(found) = origin.se.filter(|se| !(se.is_finite() && *se >= 0.0)) {
            let (name, key) = (self.setting.label().to_owned(), format!("{} (standard error)", origin.parameter));
            return Err(ChainError::NotFinite { name, key, found });
        }
        self.origins.retain(|own| own.parameter != origin.parameter);
        self.origins.push(origin);
        Ok(self)
    }

    /// The effect with its values.
    pub fn setting(&self) -> &EffectSetting {
        &self.setting
    }

    /// Where a parameter's value comes from, if it was fitted.
    pub fn origin(&self, parameter: &str) -> Option<&Origin> {
        self.origins.iter().find(|origin| origin.parameter == parameter)
    }
}

impl ModelFile {
    /// A model from its parts.
    ///
    /// # Errors
    /// [`ChainError`] for anything that a file would be refused for.
    pub fn new(machine: Machine, effects: Vec<FileEffect>, history: Vec<HistoryEntry>) -> Result<Self, ChainError> {
        let machine = match machine {
            Machine::Segments(segments) => Machine::Segments(segment_keys::sayable(segments)),
            other => other,
        };
        let file = Self { machine, effects, history };
        file.check()?;
        Ok(file)
    }

    /// Reads and checks a file's text.
    ///
    /// # Errors
    /// [`ModelFileError`], one sentence with line and key.
    pub fn parse(text: &str) -> Result<Self, ModelFileError> {
        read::parse(text)
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The first number that the file leaves to the fits, and what it is of, `[machine]` or an effect: such a model is not calibrated.
    /// `None`: every number is known.
    pub fn first_open(&self) -> Option<(&'static str, &str)> {
        let of_machine = match &self.machine {
            Machine::Snake(snake) => snake.first_open(),
            Machine::Joints(joints) => {
                let is_open = |known: &[Known]| known.iter().any(Known::is_open);
                let keys = [("gain", is_open(&joints.gain_known)), ("offset", is_open(&joints.offset_known))];
                keys.into_iter().find(|(_, open)| *open).map(|(key, _)| key)
            }
            Machine::Segments(_) | Machine::Force(_) => None,
        };
        let mut of_effects = self.effects.iter().filter_map(|own| Some((*own.free.first()?, own.setting.label())));
        of_machine.map(|key| (key, "[machine]")).or_else(|| of_effects.next())
    }

    /// The effects, in the order of the chain.
    pub fn effects(&self) -> &[FileEffect] {
        &self.effects
    }

    /// How the model came to be.
    pub fn history(&self) -> &[HistoryEntry] {
        &self.history
    }

    /// The chain of a snake's model; `None` for other machines.
    ///
    /// # Errors
    /// [`ChainError::MissingColumn`] where an effect needs a column that is not there.
    pub fn chain(&self, columns: KnownColumns) -> Result<Option<Chain>, ChainError> {
        let Machine::Snake(snake) = &self.machine else { return Ok(None) };
        let chain = Chain::new(&snake.parameters, snake.settings, &self.settings(), columns)?;
        Ok(Some(chain.with_floor(self.floor_rad()).with_gripper(snake.gripper().cloned())))
    }

    /// What of its error is the measurement's own, rad, as the newest entry of the history says that knows it.
    fn floor_rad(&self) -> Option<f64> {
        let of_angle = self.history.iter().rev().filter(|entry| entry.unit == "deg");
        of_angle.filter_map(|entry| entry.heldout_rms.noise_floor).next().map(f64::to_radians)
    }

    /// The chain of joints; `None` for a snake and for segments.
    ///
    /// # Errors
    /// [`ChainError::MissingColumn`] where a formula needs a column that is not there; [`ChainError::NothingToDrive`] for a model
    /// of kind force.
    pub fn joint_chain(&self, columns: KnownColumns) -> Result<Option<JointChain>, ChainError> {
        let joints = match &self.machine {
            Machine::Joints(joints) => joints,
            Machine::Snake(_) | Machine::Segments(_) => return Ok(None),
            Machine::Force(_) => return Err(ChainError::NothingToDrive),
        };
        JointChain::new(joints, &self.settings(), columns).map(Some)
    }

    /// The chain of segments; `None` for other machines.
    ///
    /// # Errors
    /// [`ChainError`] as [`SegmentChain::new`].
    pub fn segment_chain(&self) -> Result<Option<SegmentChain>, ChainError> {
        let Machine::Segments(segments) = &self.machine else { return Ok(None) };
        SegmentChain::new(segments, &self.settings()).map(Some)
    }

    fn settings(&self) -> Vec<EffectSetting> {
        self.effects.iter().map(|effect| effect.setting.clone()).collect()
    }

    /// Which model it is: a hash of the machine, the effects with their values, and what is learnt; not of the history.
    pub fn hash(&self) -> ModelHash {
        let effects = self.settings();
        match &self.machine {
            Machine::Snake(snake) => hash::of_snake(&snake.parameters, snake.settings, &effects, snake.gripper()),
            Machine::Segments(segments) => hash::of_segments(segments, &effects),
            Machine::Joints(joints) => hash::of_joints(joints, &effects),
            Machine::Force(force) => hash::of_force(force, &effects),
        }
    }

    /// The same model, of which nothing is learnt.
    pub fn without_learning(&self) -> Self {
        let still = |effect: &FileEffect| FileEffect { setting: effect.setting.without_learning(), ..effect.clone() };
        Self { effects: self.effects.iter().map(still).collect(), ..self.clone() }
    }

    /// The file's text, with every value of every effect.
    pub fn to_toml(&self) -> String {
        write::to_toml(self, false)
    }

    /// The same with what each key means, its unit, bounds, default and source beside it.
    pub fn to_documented_toml(&self) -> String {
        write::to_toml(self, true)
    }

    fn check(&self) -> Result<(), ChainError> {
        match &self.machine {
            Machine::Snake(snake) => {
                Snake::new(&snake.parameters)?;
                self.chain(EVERY_COLUMN).map(|_| ())
            }
            Machine::Segments(_) => self.segment_chain().map(|_| ()),
            Machine::Joints(_) => {
                self.joint_chain(EVERY_COLUMN)?;
                machine::check_names(self.effects.iter().map(FileEffect::setting))
            }
            Machine::Force(force) => force.check_all(self.effects.iter().map(FileEffect::setting)),
        }
    }
}

/// A file may need any column; whoever uses it says which ones there are.
const EVERY_COLUMN: KnownColumns = KnownColumns { time: true, stem_angle: true, temperature: true, named: true };
