//! What can be wrong with a formula, each as one sentence.

use super::formula::FormulaText;
use super::formula_operators::FORMULA_FUNCTIONS;
use super::formula_variables::FORMULA_VARIABLES;
use crate::nearest_name;

/// A formula cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormulaError {
    /// The text does not parse.
    #[error("formula {formula:?} cannot be read: {reason}; write it with + - * / ^ and functions as min(a, b)")]
    Syntax {
        /// Its name.
        formula: String,
        /// What the parser says.
        reason: String,
    },
    /// A name is neither a parameter nor a variable.
    #[error(
        "formula {formula:?} uses {name:?}, which is neither a variable nor one of its parameters; did you mean {nearest:?}?"
    )]
    UnknownName {
        /// Its name.
        formula: String,
        /// The name.
        name: String,
        /// The known name that looks most like it.
        nearest: String,
    },
    /// A parameter's name is no word, or that of a variable or function.
    #[error(
        "formula {formula:?} has a parameter {name:?}, expected a word of letters, digits and _ that is no variable or function; rename it"
    )]
    ParameterName {
        /// Its name.
        formula: String,
        /// The parameter.
        name: String,
    },
    /// A variable has no value at this hook.
    #[error("formula {formula:?} uses {name:?}, which is not known at hook {hook}; use another hook or variable")]
    NotAtHook {
        /// Its name.
        formula: String,
        /// The variable.
        name: String,
        /// The hook.
        hook: &'static str,
    },
    /// A formula cannot be added at this hook.
    #[error(
        "formula {formula:?} has hook {hook}, which this machine does not have, expected eps, tau, geo, meas or enc of a snake, meas of segments, joint of joints, force of a machine of kind force; choose one of these"
    )]
    Hook {
        /// Its name.
        formula: String,
        /// The hook.
        hook: &'static str,
    },
    /// More numbers and names than can be evaluated without the heap.
    #[error("formula {formula:?} has {found} numbers and names, expected at most {limit}; shorten it")]
    TooLong {
        /// Its name.
        formula: String,
        /// How many.
        found: usize,
        /// How many are possible.
        limit: usize,
    },
    /// More different names than there are tangents.
    #[error("formula {formula:?} uses {found} different names, expected at most {limit}; shorten it")]
    TooManyNames {
        /// Its name.
        formula: String,
        /// How many.
        found: usize,
        /// How many are possible.
        limit: usize,
    },
    /// More parameters than an effect can have.
    #[error("formula {formula:?} has {found} parameters, expected at most {limit}; remove some")]
    TooManyParameters {
        /// Its name.
        formula: String,
        /// How many.
        found: usize,
        /// How many are possible.
        limit: usize,
    },
    /// A column in a formula of another machine than joints.
    #[error("formula {formula:?}: {name} stands for a column, which only formulas of joints can read; leave it out")]
    Column {
        /// Its name.
        formula: String,
        /// The name that stands for the column.
        name: String,
    },
    /// The value, or its slope, is not finite somewhere in the workspace.
    #[error(
        "formula {formula:?} = {text:?} or its slope is not finite at bend {bend_rad} rad, delta {delta_rad} rad; keep it finite everywhere"
    )]
    NotFinite {
        /// Its name.
        formula: String,
        /// The expression.
        text: String,
        /// Where.
        bend_rad: f64,
        /// Where.
        delta_rad: f64,
    },
}

impl FormulaError {
    pub(super) fn unknown_name(formula: &FormulaText, word: &str) -> Self {
        let known = FORMULA_VARIABLES
            .iter()
            .map(|v| v.name)
            .chain(FORMULA_FUNCTIONS)
            .chain(formula.parameters.iter().map(|p| p.name.as_str()))
            .chain(formula.columns.iter().map(|own| own.name.as_str()));
        let nearest = nearest_name(word, known).unwrap_or_default();
        Self::UnknownName { formula: formula.name.clone(), name: word.to_owned(), nearest: nearest.to_owned() }
    }
}
