//! What the lab refuses, each in one sentence.

use krait_model::ChainError;

/// Work that the lab cannot do with what it was given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LabError {
    /// A model cannot be built.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// An effect's name is not known for this kind of machine.
    #[error("effect {name:?} is not one that a machine of kind {machine} can have; did you mean {nearest}?")]
    UnknownEffect {
        /// What was given.
        name: String,
        /// The machine's kind.
        machine: &'static str,
        /// The nearest name.
        nearest: String,
    },
    /// A parameter shall be freed of an effect that the model does not have.
    #[error(
        "effect {name} is not in the model, which has {has}; free a parameter of those, or add it with `krait lab add`"
    )]
    NotInModel {
        /// What was given.
        name: String,
        /// The effects that there are.
        has: String,
    },
    /// A parameter's name is not known.
    #[error("effect {effect} has no parameter {name:?}; did you mean {nearest}?")]
    UnknownParameter {
        /// The effect.
        effect: String,
        /// What was given.
        name: String,
        /// The nearest name.
        nearest: String,
    },
    /// The data cannot show an effect.
    #[error("effect {effect} cannot be fitted to these data: it {reason}; choose another effect or other data")]
    CannotShow {
        /// The effect.
        effect: String,
        /// Why, a verb first.
        reason: String,
    },
    /// A gain that no fit can find, since its joint stands still.
    #[error(
        "{data}: {joint} does not move, so that its gain cannot be seen, expected motion of every joint whose gain the model leaves open; record \
         it in motion, or give its gain as a number in the model file"
    )]
    StillGain {
        /// The data's file.
        data: String,
        /// The joint as its columns name it.
        joint: String,
    },
    /// Positions of a tip that make no bends.
    #[error("{data}: the tip's positions: {why}")]
    Tip {
        /// The data's file.
        data: String,
        /// What was found and expected, and what to do.
        why: String,
    },
    /// Model and data are of different machines.
    #[error(
        "{data}: the data are of a machine of kind {found}, the model is of kind {expected}; use a model of that kind"
    )]
    OtherMachine {
        /// The data's file.
        data: String,
        /// The model's kind.
        expected: &'static str,
        /// The data's kind.
        found: &'static str,
    },
}
