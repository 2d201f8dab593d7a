//! What is known about an effect without running it: name, hook, class, parameters, memory, and whether it can be inverted.

/// Where an effect enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hook {
    /// The extension of a line: q~ = q + eps.
    Eps,
    /// The load of a line, or the moment that bends the snake, before the compliances.
    Tau,
    /// The displacement of a line for a shape: q(bend).
    Geo,
    /// The shape as it is observed.
    Meas,
    /// The encoder's reading of an actuator.
    Enc,
    /// The command on its way to the actuator.
    Cmd,
    /// The measured position of a joint.
    Joint,
    /// The torque or current of a joint.
    Force,
}

impl Hook {
    /// The word that model files use.
    pub fn word(self) -> &'static str {
        match self {
            Self::Eps => "eps",
            Self::Tau => "tau",
            Self::Geo => "geo",
            Self::Meas => "meas",
            Self::Enc => "enc",
            Self::Cmd => "cmd",
            Self::Joint => "joint",
            Self::Force => "force",
        }
    }

    /// The hook of a word.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Eps, Self::Tau, Self::Geo, Self::Meas, Self::Enc, Self::Cmd, Self::Joint, Self::Force]
            .into_iter()
            .find(|hook| hook.word() == word)
    }
}

/// Effects of one class look alike in the shape alone; an experiment has to separate them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// K1: the error is proportional to the bend.
    Proportional,
    /// K2: a constant times the sign of motion.
    ConstantHysteresis,
    /// K3: the load times the sign of motion.
    LoadHysteresis,
    /// K4: cubic in the bend.
    Cubic,
    /// K5: pushed and drawn lines differ.
    Asymmetry,
    /// K6: grows with speed.
    Rate,
    /// K2 and K6 together.
    ConstantHysteresisAndRate,
    /// K7: turns the plane of bending.
    Plane,
    /// K8: constant in the base frame, first harmonic of the plane.
    FirstHarmonic,
    /// Second harmonic of the plane.
    SecondHarmonic,
    /// A moment against any change of the bend vector, near K2.
    BendHysteresis,
    /// Periodic in the actuator's position.
    Periodic,
    /// Changes while the machine rests.
    Rest,
    /// Changes over minutes.
    Drift,
    /// Needs the angle of the flexible stem.
    Stem,
    /// Clipped.
    Clipped,
    /// No bend by itself.
    Preload,
    /// Moves what should rest.
    Coupling,
    /// The same everywhere.
    Constant,
    /// Nothing moves near zero.
    DeadZone,
    /// Whatever the user wrote.
    User,
}

impl Class {
    /// Short label: K1 to K8 where effects.md numbers the class.
    pub fn label(self) -> &'static str {
        match self {
            Self::Proportional => "K1 proportional",
            Self::ConstantHysteresis => "K2 constant hysteresis",
            Self::LoadHysteresis => "K3 load hysteresis",
            Self::Cubic => "K4 cubic",
            Self::Asymmetry => "K5 asymmetry",
            Self::Rate => "K6 rate",
            Self::ConstantHysteresisAndRate => "K2 and K6",
            Self::Plane => "K7 plane",
            Self::FirstHarmonic => "K8 first harmonic",
            Self::SecondHarmonic => "second harmonic",
            Self::BendHysteresis => "bend hysteresis, near K2",
            Self::Periodic => "periodic",
            Self::Rest => "time at rest",
            Self::Drift => "drift",
            Self::Stem => "needs the stem angle",
            Self::Clipped => "clipped",
            Self::Preload => "no bend by itself",
            Self::Coupling => "coupling",
            Self::Constant => "constant",
            Self::DeadZone => "dead zone",
            Self::User => "the user's own",
        }
    }
}

/// Whether a compensator can undo an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inverse {
    /// Exactly, step by step.
    Exact,
    /// Exactly once a line has travelled the transition length in its new direction; continuously in between.
    Smoothed,
    /// The effect is in the sensor only: the command must not follow it. The reason.
    NotNeeded(&'static str),
    /// No command undoes it. The reason.
    None(&'static str),
}

impl Inverse {
    /// One or two words for a table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Smoothed => "smoothed at reversals",
            Self::NotNeeded(_) => "not needed",
            Self::None(_) => "none",
        }
    }
}

/// What an effect needs besides the encoders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// Time stamps.
    Time,
    /// The angle of the flexible stem.
    StemAngle,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterSpec {
    /// Key in the model file; ends with the unit where there is one.
    pub name: &'static str,
    /// Unit; `1` for none.
    pub unit: &'static str,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Value where the key is missing, and where a fit starts.
    pub default: f64,
    /// What it is and where the default comes from.
    pub source: &'static str,
    /// Why it cannot be learnt while the machine moves, if it cannot.
    pub not_learnt: Option<&'static str>,
}

impl ParameterSpec {
    /// The same, which cannot be learnt while the machine moves, and why.
    pub(crate) const fn fixed(self, reason: &'static str) -> Self {
        Self { not_learnt: Some(reason), ..self }
    }
}

/// One effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// Name in model files, commands and reports.
    pub name: &'static str,
    /// What people call it besides, in lower case with hyphens, the word that means it most first: of several effects that a
    /// word may mean, the one that has it further in front is meant.
    pub also: &'static [&'static str],
    /// Where it enters.
    pub hook: Hook,
    /// What it looks like.
    pub class: Class,
    /// Whether it can be undone.
    pub inverse: Inverse,
    /// What it needs besides the encoders.
    pub needs: Needs,
    /// Whether a chain may hold it more than once.
    pub repeatable: bool,
    /// Numbers that it remembers, all lines together.
    pub n_states: usize,
    /// Its equation.
    pub equation: &'static str,
    /// Its parameters, in the order in which the equation's code takes them.
    pub parameters: &'static [ParameterSpec],
}

pub(crate) const fn parameter(
    name: &'static str,
    unit: &'static str,
    bounds: [f64; 2],
    default: f64,
    source: &'static str,
) -> ParameterSpec {
    ParameterSpec { name, unit, low: bounds[0], high: bounds[1], default, source, not_learnt: None }
}

pub(crate) const fn effect(name: &'static str, hook: Hook, class: Class, equation: &'static str) -> Definition {
    Definition {
        name,
        also: &[],
        hook,
        class,
        inverse: Inverse::Exact,
        needs: Needs::Nothing,
        repeatable: false,
        n_states: 0,
        equation,
        parameters: &[],
    }
}
