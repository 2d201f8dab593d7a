//! A formula of joints by itself, for whoever has commands and positions and no chain: the lab tries it beside others.

use crate::Circumstances;
use crate::effects::formula::Formula;
use crate::effects::formula_variables::joint_values;
use crate::effects::{FormulaError, FormulaText, Hook, MAX_PARAMETERS};

/// A formula at hook `joint`.
#[derive(Clone, Debug)]
pub struct JointFormula {
    formula: Formula,
}

/// What a formula of joints sees of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtJoint {
    /// Its command, in units of u.
    pub u: f64,
    /// Its position without the formula, in units of y.
    pub y: f64,
    /// Sign of the last change of the command, 0 before the first.
    pub motion: f64,
    /// Its number, from 0.
    pub joint: usize,
}

impl JointFormula {
    /// Parses and checks it; its columns are then those of [`Circumstances`] in the formula's own order.
    ///
    /// # Errors
    /// [`FormulaError`], also where its hook is none of joints.
    pub fn new(text: &FormulaText) -> Result<Self, FormulaError> {
        if text.hook != Hook::Joint {
            return Err(FormulaError::Hook { formula: text.name.clone(), hook: text.hook.word() });
        }
        Ok(Self { formula: Formula::of_any_machine(text)? })
    }

    /// Its value, in units of y; `None` where it is not finite. Parameters are in the formula's own order.
    pub fn value(&self, here: AtJoint, at: &Circumstances, parameters: &[f64; MAX_PARAMETERS]) -> Option<f64> {
        let values = joint_values(here.u, here.y, here.motion, here.joint, at, &at.columns);
        self.formula.evaluate(&values, parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::FormulaParameter;

    #[test]
    fn a_formula_by_itself_sees_what_it_sees_in_a_chain() {
        let parameter = FormulaParameter { name: "k".to_owned(), value: 0.0, unit: "1".to_owned() };
        let text = |hook| FormulaText {
            name: "own".to_owned(),
            hook,
            text: "k * (u_i + 10 * y_i + 100 * motion_i + 1000 * joint + time_s)".to_owned(),
            parameters: vec![parameter.clone()],
            columns: Vec::new(),
        };
        let mut parameters = [0.0; MAX_PARAMETERS];
        parameters[0] = 2.0;
        let here = AtJoint { u: 1.0, y: 2.0, motion: -1.0, joint: 2 };
        let value =
            JointFormula::new(&text(Hook::Joint)).map(|own| own.value(here, &Circumstances::at(0.5), &parameters));
        assert_eq!(value, Ok(Some(2.0 * (1.0 + 20.0 - 100.0 + 3000.0 + 0.5))));
        assert!(JointFormula::new(&text(Hook::Eps)).is_err());
    }
}
