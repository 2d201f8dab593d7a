//! Fits: the parameters of effects that bring predictions closest to measurements, and how well the data know them.

mod levenberg_marquardt;
mod uncertainty;
mod variable;

pub use levenberg_marquardt::{Fit, fit};
pub(crate) use levenberg_marquardt::{dot, fit_to_end, normal_equations};
pub use uncertainty::{Uncertainty, held_out_block_squares, uncertainty};
pub(crate) use uncertainty::{held_out_output_squares, held_out_parts, inverse, standard_errors};
pub use variable::Variable;
