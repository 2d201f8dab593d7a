//! The errors of the paper, each with the numbers that show it, computed here and now.

mod friction;
mod kinematics;
mod recursion;

use crate::table2::Table2;
use crate::table3::Table3;
use krait_model::Snake;
use krait_sim::Truth;
use serde::Serialize;

/// One error.
#[derive(Clone, Debug, Serialize)]
pub struct PaperError {
    /// Where in the paper.
    pub place: &'static str,
    /// What stands there.
    pub printed: &'static str,
    /// What is so instead.
    pub correct: &'static str,
    /// The numbers that show it.
    pub numbers: Vec<Number>,
}

/// One number.
#[derive(Clone, Debug, Serialize)]
pub struct Number {
    /// What it is.
    pub what: &'static str,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

/// Every error, in the order of the equations.
pub fn all(snake: &Snake, truth: &Truth, table_2: &Table2, table_3: &Table3) -> anyhow::Result<Vec<PaperError>> {
    Ok(vec![
        kinematics::division_by_one_cosine(snake),
        kinematics::second_row_of_eq_7(snake)?,
        kinematics::radius(snake),
        friction::sign_of_the_wrench(snake, truth)?,
        friction::gravity(table_2),
        friction::error_of_f_s(table_2),
        friction::error_of_mu(table_2),
        friction::loading_branch(snake, truth)?,
        friction::uniform_lambda(snake, truth)?,
        friction::uniform_f_s(snake),
        recursion::stacked_rows_of_eq_20(table_3),
        recursion::units_of_eq_20(snake, table_3),
        recursion::plus_minus_of_eq_22(table_3),
        recursion::lambda_of_one_line(table_3),
        kinematics::two_lines_of_eq_26(snake)?,
    ])
}

fn number(what: &'static str, value: f64, unit: &'static str) -> Number {
    Number { what, value, unit }
}
