//! What columns with names of their own do to a model: a parameter that depends on one, and a formula that reads one.
//!
//! Both are of joints. A column is a measurement beside the commands, for example the angle of a sheath or a measured torque: whoever
//! uses the model must give its value at every step ([`crate::Circumstances::columns`]), which a running chain does not.

use super::definition::ParameterSpec;

/// Different columns that the effects of one model can name.
pub const MAX_COLUMNS: usize = 4;

/// Name of the slope in model files.
pub const SLOPE: &str = "slope";

/// One parameter of an effect that depends on a column: parameter = value + slope (column - at), kept within the parameter's bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Varying {
    /// The parameter.
    pub parameter: &'static str,
    /// The column's name in the data.
    pub column: String,
    /// Where the column must stand for the parameter to have its value, in the column's unit.
    pub at: f64,
}

/// A name in a formula that stands for a column.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaColumn {
    /// Name in the expression.
    pub name: String,
    /// The column's name in the data.
    pub column: String,
}

/// How a parameter depends on a column, ready to run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VaryingStep {
    /// Place of the parameter among all of the effect.
    pub parameter: usize,
    /// Place of the slope among them.
    pub slope: usize,
    /// Place of the column.
    pub column: usize,
    pub at: f64,
    pub low: f64,
    pub high: f64,
}

impl VaryingStep {
    pub(crate) fn new(parameters: &[ParameterSpec], varying: &Varying, column: usize) -> Option<Self> {
        let parameter = parameters.iter().position(|own| own.name == varying.parameter)?;
        let ParameterSpec { low, high, .. } = parameters[parameter];
        Some(Self { parameter, slope: parameters.len(), column, at: varying.at, low, high })
    }

    /// The parameter's value now; as the file gives it, until the column has been measured once.
    pub(crate) fn value(&self, value: f64, slope: f64, columns: &[f64; MAX_COLUMNS]) -> f64 {
        let column = columns[self.column];
        let own = if column.is_finite() { value + slope * (column - self.at) } else { value };
        own.clamp(self.low, self.high)
    }
}
