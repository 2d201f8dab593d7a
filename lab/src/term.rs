//! One effect of a model as the lab sees it: a name and numbers, whatever the machine.

use krait_model::effects::{FormulaText, Varying};

/// An effect with the values of its parameters, in the order of its definition.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The effect's name in model files; `formula` for the user's own.
    pub name: String,
    /// Values of its parameters, each in its own unit.
    pub values: Vec<f64>,
    /// The user's own equation.
    pub formula: Option<FormulaText>,
    /// The parameter that depends on a column of the data; its slope is then the last of the values.
    pub varying: Option<Varying>,
}

impl Term {
    /// An effect of the library with these values.
    pub fn new(name: &str, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), values, formula: None, varying: None }
    }

    /// The name for tables: the formula's own, if it is one.
    pub fn label(&self) -> &str {
        self.formula.as_ref().map_or(self.name.as_str(), |formula| formula.name.as_str())
    }
}

/// A parameter as the lab sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Key in the model file.
    pub name: String,
    /// Unit, `1` for none.
    pub unit: String,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Value where a file leaves it out.
    pub default: f64,
}
