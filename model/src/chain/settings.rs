//! What a chain is made of, checked: effects with parameter values, settings, columns; and what can be wrong with it.

use super::learn::{Learn, refused};
use crate::effects::{EffectKind, FormulaError, FormulaText, Hook, Inverse, MAX_PARAMETERS, SLOPE, Varying};
use crate::joints::JointEffect;
use crate::segments::SegmentsError;
use crate::{ParameterError, nearest_name};

/// One effect with its parameter values.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectSetting {
    kind: EffectKind,
    values: [f64; MAX_PARAMETERS],
    learn: [Option<Learn>; MAX_PARAMETERS],
    formula: Option<FormulaText>,
    varying: Option<Varying>,
}

impl EffectSetting {
    /// An effect with the default of every parameter. A formula is made with [`EffectSetting::formula`].
    pub fn new(kind: EffectKind) -> Self {
        let mut values = [0.0; MAX_PARAMETERS];
        for (value, parameter) in values.iter_mut().zip(kind.definition().parameters) {
            *value = parameter.default;
        }
        Self { kind, values, learn: [None; MAX_PARAMETERS], formula: None, varying: None }
    }

    /// The user's own effect.
    pub fn formula(formula: FormulaText) -> Self {
        let mut values = [0.0; MAX_PARAMETERS];
        for (value, parameter) in values.iter_mut().zip(&formula.parameters) {
            *value = parameter.value;
        }
        let learn = [None; MAX_PARAMETERS];
        Self { kind: EffectKind::Formula, values, learn, formula: Some(formula), varying: None }
    }

    /// The same effect of joints with one parameter that depends on a column, by the parameter `slope`, 0 until it is set.
    ///
    /// # Errors
    /// [`ChainError::Varying`] for an effect or a parameter that cannot depend on a column.
    pub fn with_column(mut self, parameter: &str, column: &str, at: f64) -> Result<Self, ChainError> {
        let refuse = |reason| ChainError::Varying {
            effect: self.kind.name(),
            key: parameter.into(),
            column: column.into(),
            reason,
        };
        let is_of_joints = matches!(self.kind, EffectKind::Joint(kind) if kind != JointEffect::Latency);
        if !is_of_joints {
            return Err(refuse("only parameters of effects of joints, but for latency, depend on columns"));
        }
        let specs = self.kind.definition().parameters;
        let spec = specs.iter().find(|own| own.name == parameter && !["joint", "from"].contains(&own.name));
        let Some(spec) = spec else { return Err(refuse("it has no such number")) };
        if specs.len() >= MAX_PARAMETERS {
            return Err(refuse("it has too many numbers already"));
        }
        if column.trim().is_empty() || !at.is_finite() {
            return Err(refuse("a column has a name, and `at` is a finite number"));
        }
        self.varying = Some(Varying { parameter: spec.name, column: column.to_owned(), at });
        Ok(self)
    }

    /// The parameter that depends on a column, if one does.
    pub fn varying(&self) -> Option<&Varying> {
        self.varying.as_ref()
    }

    /// Names of the columns that it needs.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let own = self.varying.iter().map(|own| own.column.as_str());
        own.chain(self.formula.iter().flat_map(|formula| formula.columns.iter().map(|own| own.column.as_str())))
    }

    /// The same effect with another value of one parameter.
    ///
    /// # Errors
    /// [`ChainError::UnknownParameter`] and [`ChainError::OutOfBounds`].
    pub fn with(mut self, name: &str, value: f64) -> Result<Self, ChainError> {
        let index = self.index(name).ok_or_else(|| self.unknown(name))?;
        if let Some(parameter) = self.kind.definition().parameters.get(index) {
            if !(parameter.low..=parameter.high).contains(&value) {
                return Err(ChainError::OutOfBounds {
                    effect: self.kind.name(),
                    key: parameter.name,
                    found: value,
                    low: parameter.low,
                    high: parameter.high,
                    unit: parameter.unit,
                });
            }
        } else if !value.is_finite() {
            return Err(ChainError::NotFinite { name: self.label().to_owned(), key: name.to_owned(), found: value });
        }
        self.values[index] = value;
        // The formula as it is written says the same: model files print it.
        if let Some(own) = self.formula.as_mut().and_then(|formula| formula.parameters.get_mut(index)) {
            own.value = value;
        }
        Ok(self)
    }

    /// The same effect with one parameter to be learnt while the machine moves.
    ///
    /// # Errors
    /// [`ChainError::UnknownParameter`], [`ChainError::NotLearnt`] for a parameter that cannot be learnt, and
    /// [`ChainError::Learn`] for a standard deviation or a memory that is none.
    pub fn with_learn(mut self, name: &str, learn: Learn) -> Result<Self, ChainError> {
        let index = self.index(name).ok_or_else(|| self.unknown(name))?;
        let spec = self.kind.definition().parameters.get(index);
        let by_column = self.varying.is_some().then_some("part of what depends on a column");
        if let Some(reason) = spec.and_then(|spec| spec.not_learnt).or(by_column) {
            let (effect, key) = (self.label().to_owned(), name.to_owned());
            return Err(ChainError::NotLearnt { effect, key, reason });
        }
        if let Some((what, found, expected)) = refused(&learn) {
            let (effect, key) = (self.label().to_owned(), name.to_owned());
            return Err(ChainError::Learn { effect, key, what, found, expected });
        }
        self.learn[index] = Some(learn);
        Ok(self)
    }

    /// The same effect, of which nothing is learnt.
    pub fn without_learning(&self) -> Self {
        Self { learn: [None; MAX_PARAMETERS], ..self.clone() }
    }

    /// How a parameter is learnt while the machine moves, if it is.
    pub fn learn(&self, name: &str) -> Option<Learn> {
        *self.learn.get(self.index(name)?)?
    }

    /// How each parameter is learnt, in the order of the parameters.
    pub(crate) fn learns(&self) -> &[Option<Learn>; MAX_PARAMETERS] {
        &self.learn
    }

    /// Bounds of a parameter by its place: the definition's; a formula's have none.
    pub(crate) fn bounds(&self, index: usize) -> (f64, f64) {
        self.kind.definition().parameters.get(index).map_or((f64::MIN, f64::MAX), |spec| (spec.low, spec.high))
    }

    /// Unit of a parameter by its place; `1` for none.
    pub(crate) fn unit(&self, index: usize) -> &str {
        let own = || Some(self.formula.as_ref()?.parameters.get(index)?.unit.as_str());
        self.kind.definition().parameters.get(index).map(|spec| spec.unit).or_else(own).unwrap_or("1")
    }

    /// Which effect it is.
    pub fn kind(&self) -> EffectKind {
        self.kind
    }

    /// Its name, or the formula's.
    pub fn label(&self) -> &str {
        self.formula.as_ref().map_or(self.kind.name(), |formula| formula.name.as_str())
    }

    /// The formula, if it is one.
    pub fn formula_text(&self) -> Option<&FormulaText> {
        self.formula.as_ref()
    }

    /// Names of its parameters, in order.
    pub fn parameter_names(&self) -> impl Iterator<Item = &str> {
        let own = self.formula.iter().flat_map(|formula| formula.parameters.iter().map(|p| p.name.as_str()));
        let slope = self.varying.iter().map(|_| SLOPE);
        self.kind.definition().parameters.iter().map(|p| p.name).chain(own).chain(slope)
    }

    /// Whether a compensator can undo it. A formula at hook meas counts as the sensor's.
    pub fn inverse(&self) -> Inverse {
        match &self.formula {
            Some(formula) if formula.hook == Hook::Meas => Inverse::NotNeeded("a formula at hook meas is the sensor's"),
            _ => self.kind.definition().inverse,
        }
    }

    /// The value of a parameter.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.get(self.index(name)?).copied()
    }

    /// All values, in the order of the parameters.
    pub(crate) fn values(&self) -> &[f64; MAX_PARAMETERS] {
        &self.values
    }

    /// Place of a parameter.
    pub(crate) fn index(&self, name: &str) -> Option<usize> {
        self.parameter_names().position(|own| own == name)
    }

    pub(crate) fn unknown(&self, name: &str) -> ChainError {
        let nearest = nearest_name(name, self.parameter_names()).unwrap_or("no parameter at all");
        ChainError::UnknownParameter {
            effect: self.label().to_owned(),
            name: name.to_owned(),
            nearest: nearest.to_owned(),
        }
    }
}

/// Settings of a chain that are no physics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainSettings {
    /// Largest strain of a backbone's outer fibre, 1, 0.001 to 0.08; default 0.04. Bends beyond it are limited, with a status.
    ///
    /// Superelastic NiTi recovers 6 to 8 %; half of that is kept in reserve. The strain of an arc is (d_outer/2) b / L.
    pub strain_limit: f64,
    /// Travel of a line's displacement over which its sign of motion turns in the inverse, m, 1e-9 to 0.001; default 20 um.
    pub transition_m: f64,
}

impl Default for ChainSettings {
    fn default() -> Self {
        Self { strain_limit: 0.04, transition_m: 20e-6 }
    }
}

/// Which columns, besides the encoders, whoever uses a chain can give at every step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KnownColumns {
    /// Time stamps.
    pub time: bool,
    /// Angle of the flexible stem.
    pub stem_angle: bool,
    /// Temperature.
    pub temperature: bool,
    /// Columns with names of their own, as many as a model names.
    pub named: bool,
}

impl Default for KnownColumns {
    fn default() -> Self {
        Self { time: true, stem_angle: false, temperature: false, named: false }
    }
}

/// A chain cannot be built, or not be used for this.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChainError {
    /// The machine.
    #[error(transparent)]
    Machine(#[from] ParameterError),
    /// The machine, of segments.
    #[error(transparent)]
    Segments(#[from] SegmentsError),
    /// A formula.
    #[error(transparent)]
    Formula(#[from] FormulaError),
    /// A parameter lies outside its bounds or is not a number.
    #[error("effect {effect}: {key} is {found}, expected {low} to {high} {unit}; correct it")]
    OutOfBounds {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        key: &'static str,
        /// What was given.
        found: f64,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Unit of the three numbers.
        unit: &'static str,
    },
    /// A formula's parameter is not a number.
    #[error("formula {name:?}: parameter {key} is {found}, expected a finite number; correct it")]
    NotFinite {
        /// The formula.
        name: String,
        /// The parameter.
        key: String,
        /// What was given.
        found: f64,
    },
    /// A parameter that shall be learnt and cannot be.
    #[error("effect {effect}: {key} is {reason}, which cannot be learnt while the machine moves; remove its `learn`")]
    NotLearnt {
        /// The effect.
        effect: String,
        /// The parameter.
        key: String,
        /// Why not.
        reason: &'static str,
    },
    /// How a parameter shall be learnt makes no sense.
    #[error("effect {effect}: {key} shall be learnt with {what} = {found}, expected {expected}; correct it")]
    Learn {
        /// The effect.
        effect: String,
        /// The parameter.
        key: String,
        /// `sd` or `memory_s`.
        what: &'static str,
        /// What was given.
        found: f64,
        /// What makes sense.
        expected: &'static str,
    },
    /// More parameters than can be learnt at once.
    #[error("{found} parameters shall be learnt, expected at most {limit}; remove the `learn` of some")]
    TooManyLearnt {
        /// How many.
        found: usize,
        /// How many are possible.
        limit: usize,
    },
    /// An effect has no such parameter.
    #[error("effect {effect} has no parameter {name:?}; did you mean {nearest}?")]
    UnknownParameter {
        /// The effect.
        effect: String,
        /// What was given.
        name: String,
        /// The parameter that looks most like it.
        nearest: String,
    },
    /// An effect stands in the chain twice.
    #[error(
        "effect {name} stands in the chain twice, at places {first} and {second}; it adds nothing to itself, remove one"
    )]
    Twice {
        /// The effect or the formula.
        name: String,
        /// Its first place, counted from 1.
        first: usize,
        /// Its second place.
        second: usize,
    },
    /// Two laws of one thing.
    #[error(
        "effects {first_name} and {second_name}, at places {first} and {second}, are two laws of one friction; keep one, remove the other"
    )]
    TwoLaws {
        /// The effect that comes first.
        first_name: &'static str,
        /// The other one.
        second_name: &'static str,
        /// Place of the first, counted from 1.
        first: usize,
        /// Place of the other.
        second: usize,
    },
    /// More effects than a chain has places for.
    #[error("the chain has {found} effects, expected at most {limit}; remove some")]
    TooMany {
        /// How many.
        found: usize,
        /// How many are possible.
        limit: usize,
    },
    /// An effect needs a column that is not there.
    #[error("effect {name} needs the column {column}, which is not given; provide it or remove the effect")]
    MissingColumn {
        /// The effect or the formula.
        name: String,
        /// The column.
        column: String,
    },
    /// More columns than a model can name.
    #[error("the effects name {found} different columns, expected at most {limit}; remove some")]
    TooManyColumns {
        /// How many.
        found: usize,
        /// How many are possible.
        limit: usize,
    },
    /// A parameter that cannot depend on a column.
    #[error("effect {effect}: {key} cannot depend on the column {column:?}: {reason}; remove its `by`")]
    Varying {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        key: Box<str>,
        /// The column.
        column: Box<str>,
        /// Why not.
        reason: &'static str,
    },
    /// An effect of another kind of machine.
    #[error("effect {name} makes no sense for a machine of kind {expected}; remove it")]
    OtherMachine {
        /// The effect.
        name: &'static str,
        /// The machine's kind.
        expected: &'static str,
    },
    /// An effect of a segment that the machine does not have.
    #[error("effect {name} is of segment {segment}, and the machine has {n}; remove it, or name another segment")]
    OfNoSegment {
        /// The effect.
        name: &'static str,
        /// Which, from 1.
        segment: usize,
        /// How many there are.
        n: usize,
    },
    /// A compensator cannot undo an effect.
    #[error("effect {name} cannot be compensated: {reason}; remove it from the model that the compensator uses")]
    NoInverse {
        /// The effect.
        name: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// A model of forces says nothing about positions.
    #[error(
        "the model is of kind force: it says which torque a motion needs, and drives nothing; give a model of a snake or of joints"
    )]
    NothingToDrive,
    /// A fitted gain of a joint that cannot be told from zero.
    #[error(
        "the gain of joint {joint} is {gain:.3e} with a standard error of {se:.1e}: it cannot be told from zero, so no commands follow from \
         wanted positions; look at that joint's measurements and fit it again"
    )]
    NoGain {
        /// The joint, from 1.
        joint: usize,
        /// Its gain.
        gain: f64,
        /// Its standard error.
        se: f64,
    },
    /// The joints' matrix G determines no commands.
    #[error(
        "the matrix `gain` of the joints has no inverse, or nearly none, so no commands follow from wanted positions; correct it"
    )]
    Gain,
    /// Two effects together leave no lines to bend the snake with.
    #[error("the lines' displacements do not determine the bend with these geometric effects; correct unequal-lines")]
    Geometry,
}
