//! A formula of a machine of kind force: a part of a joint's torque or current, from its motion and its load.

use super::formula::Formula;
use super::formula_variables::force_values;
use super::{FormulaError, FormulaText, Hook, MAX_PARAMETERS};

/// A formula at hook `force`.
#[derive(Clone, Debug)]
pub struct ForceFormula(Formula);

/// What a formula of force sees of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtForce {
    /// Its angle, rad.
    pub angle_rad: f64,
    /// Its speed, rad/s.
    pub speed_rad_per_s: f64,
    /// Its acceleration, rad/s^2.
    pub acceleration_rad_per_s2: f64,
    /// Sign of its speed.
    pub motion: f64,
    /// The load of its gear, in the force's unit.
    pub load: f64,
    /// Its number, from 0.
    pub joint: usize,
    /// Time, s.
    pub time_s: f64,
}

impl ForceFormula {
    /// Parses and checks it.
    ///
    /// # Errors
    /// [`FormulaError`], also where its hook is another one and where a name stands for a column.
    pub fn new(text: &FormulaText) -> Result<Self, FormulaError> {
        match text.columns.first() {
            _ if text.hook != Hook::Force => {
                Err(FormulaError::Hook { formula: text.name.clone(), hook: text.hook.word() })
            }
            Some(own) => Err(FormulaError::Column { formula: text.name.clone(), name: own.name.clone() }),
            None => Formula::of_any_machine(text).map(Self),
        }
    }

    /// Its value, in the force's unit; `None` where it is not finite. Parameters are in the formula's own order.
    pub fn value(&self, here: &AtForce, parameters: &[f64; MAX_PARAMETERS]) -> Option<f64> {
        self.0.evaluate(&force_values(here), parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::super::FormulaParameter;
    use super::*;

    #[test]
    fn a_formula_of_force_sees_motion_load_joint_and_time() {
        let parameter = FormulaParameter { name: "k".to_owned(), value: 0.0, unit: "1".to_owned() };
        let text = |hook, text: &str| FormulaText {
            name: "own".to_owned(),
            hook,
            text: text.to_owned(),
            parameters: vec![parameter.clone()],
            columns: Vec::new(),
        };
        let all = "k * (angle_i + 10 * speed_i + 100 * acceleration_i + 1000 * motion_i + 1e4 * load_i + 1e5 * joint + time_s)";
        let here = AtForce {
            angle_rad: 1.0,
            speed_rad_per_s: 2.0,
            acceleration_rad_per_s2: 3.0,
            motion: -1.0,
            load: 4.0,
            joint: 1,
            time_s: 0.5,
        };
        let mut parameters = [0.0; MAX_PARAMETERS];
        parameters[0] = 2.0;
        let value = ForceFormula::new(&text(Hook::Force, all)).map(|own| own.value(&here, &parameters));
        assert_eq!(value, Ok(Some(2.0 * (1.0 + 20.0 + 300.0 - 1000.0 + 4e4 + 2e5 + 0.5))));
        assert!(ForceFormula::new(&text(Hook::Joint, "k * u_i")).is_err());
        assert!(ForceFormula::new(&text(Hook::Force, "k * u_i")).is_err());
    }
}
