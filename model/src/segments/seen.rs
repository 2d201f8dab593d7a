//! What a user's formulas add to the bends that the camera shows: to each segment's bend vector, from that bend vector.
//!
//! A formula sees the true bends of its segment, and what it adds passes the camera's scale and offset as they do. Several see the
//! same bends, so that their order does not matter. As of a snake it is the sensor's at this hook: no command follows it.

use super::{MAX_BENDS, MAX_SEGMENTS};
use crate::effects::formula::Formula;
use crate::effects::formula_variables::{set_axis, set_segment, shape_values};
use crate::effects::prepared::Now;
use crate::effects::{FormulaError, Hook, Scalar};
use crate::{ChainError, EffectSetting};
use std::sync::Arc;

/// The formulas of a model of segments.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen(Arc<Vec<Own>>);

#[derive(Debug)]
struct Own {
    setting: EffectSetting,
    formula: Formula,
}

impl Seen {
    /// # Errors
    /// [`ChainError`] for a formula at another hook, one that needs a column, and one of which a number shall be learnt.
    pub(super) fn new(effects: &[EffectSetting]) -> Result<Self, ChainError> {
        let mut all = Vec::new();
        for setting in effects {
            let Some(text) = setting.formula_text() else { continue };
            let name = || text.name.clone();
            if text.hook != Hook::Meas {
                return Err(FormulaError::Hook { formula: name(), hook: text.hook.word() }.into());
            }
            let formula = Formula::new(text)?;
            let missing = |column: &str| ChainError::MissingColumn { name: name(), column: column.to_owned() };
            if formula.uses_stem_angle() {
                return Err(missing("stem_angle_rad"));
            }
            if formula.uses_temperature() {
                return Err(missing("temperature_c"));
            }
            if let Some(key) = setting.parameter_names().find(|key| setting.learn(key).is_some()) {
                let (effect, key, reason) = (name(), key.to_owned(), "a number of a formula");
                return Err(ChainError::NotLearnt { effect, key, reason });
            }
            all.push(Own { setting: setting.clone(), formula });
        }
        Ok(Self(Arc::new(all)))
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// What the formulas make of the bends, rad, of the first `n` segments; a value that is not finite counts as zero.
    pub(super) fn add<S: Scalar<f64>>(&self, bends_rad: [S; MAX_BENDS], n: usize, time_s: f64) -> [S; MAX_BENDS] {
        let mut seen_rad = bends_rad;
        // The other columns are refused above.
        let now = Now {
            time_s,
            dt_s: 0.0,
            stem_column_rad: f64::NAN,
            temperature_column_c: f64::NAN,
            commit: true,
            fresh: false,
        };
        for own in self.0.iter() {
            for segment in 0..n.min(MAX_SEGMENTS) {
                let mut values = shape_values([bends_rad[2 * segment], bends_rad[2 * segment + 1]], &now);
                set_segment(&mut values, segment);
                for (axis, number) in [0.0, 1.0].into_iter().enumerate() {
                    set_axis(&mut values, number);
                    if let Some(value) = own.formula.evaluate(&values, own.setting.values()) {
                        seen_rad[2 * segment + axis] += value;
                    }
                }
            }
        }
        seen_rad
    }
}

/// Equal settings make equal formulas.
impl PartialEq for Seen {
    fn eq(&self, other: &Self) -> bool {
        self.0.iter().map(|own| &own.setting).eq(other.0.iter().map(|own| &own.setting))
    }
}
