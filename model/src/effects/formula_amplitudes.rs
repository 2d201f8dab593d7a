//! Which parameters of a formula only scale it: at zero it does nothing, twice as large it does twice as much.
//!
//! Tested, not derived: the formula is evaluated all over the workspace with these parameters at zero, one at a time, all, and doubled.

use super::formula::{Formula, FormulaText, workspace};
use super::formula_error::FormulaError;
use super::formula_variables::of_part;
use super::prepared::MAX_PARAMETERS;
use crate::joints::MAX_JOINTS;

/// Relative deviation from linear that rounding makes.
const ROUNDING: f64 = 1e-9;

/// Places of the parameters that scale a formula, all together; empty where none does.
///
/// # Errors
/// [`FormulaError`] for a formula that no machine can have.
pub fn amplitudes(text: &FormulaText) -> Result<Vec<usize>, FormulaError> {
    let probe = Probe::new(text)?;
    let mut scaling: Vec<usize> = (0..text.parameters.len()).filter(|k| probe.is_linear(&[*k])).collect();
    // a (x + b y) is linear in each of them, and not in both: the first ones count.
    while !scaling.is_empty() && !probe.scales(&scaling) {
        scaling.pop();
    }
    Ok(scaling)
}

/// A formula with values of its parameters that are not zero.
struct Probe {
    formula: Formula,
    values: [f64; MAX_PARAMETERS],
}

impl Probe {
    fn new(text: &FormulaText) -> Result<Self, FormulaError> {
        let mut values = [0.0; MAX_PARAMETERS];
        for (k, (own, given)) in values.iter_mut().zip(&text.parameters).enumerate() {
            *own = if given.value == 0.0 { 0.37 + 0.11 * k as f64 } else { given.value };
        }
        Ok(Self { formula: Formula::of_any_machine(text)?, values })
    }

    /// The formula all over the workspace, with some parameters multiplied; NaN where it is not finite.
    fn with(&self, factor: impl Fn(usize) -> f64) -> Vec<f64> {
        let parameters: [f64; MAX_PARAMETERS] = core::array::from_fn(|k| factor(k) * self.values[k]);
        let all = workspace().flat_map(|(values, ..)| {
            (1..=MAX_JOINTS).map(move |joint| of_part(values, joint as f64, (joint % 2) as f64))
        });
        all.map(|values| self.formula.evaluate(&values, &parameters).unwrap_or(f64::NAN)).collect()
    }

    /// Whether the step from none of these parameters to all of them is that from all to twice as much.
    fn is_linear(&self, own: &[usize]) -> bool {
        let at = |size: f64| self.with(|k| if own.contains(&k) { size } else { 1.0 });
        let (zero, one, two) = (at(0.0), at(1.0), at(2.0));
        let size = one.iter().chain(&two).fold(0.0, |most: f64, x| most.max(x.abs()));
        size > 0.0
            && zero.iter().zip(&one).zip(&two).all(|((zero, one), two)| {
                let bend = two - 2.0 * one + zero;
                bend.abs() <= ROUNDING * size
            })
    }

    /// Whether the formula is a sum of terms, each with one of these parameters as its factor.
    fn scales(&self, own: &[usize]) -> bool {
        let only = |size: &dyn Fn(usize) -> f64| self.with(|k| if own.contains(&k) { size(k) } else { 1.0 });
        let (none, all) = (only(&|_| 0.0), only(&|_| 1.0));
        let mut sum = vec![0.0; all.len()];
        for one in own {
            let alone = only(&|k| if k == *one { 1.0 } else { 0.0 });
            sum.iter_mut().zip(alone).for_each(|(sum, x)| *sum += x);
        }
        let size = all.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let is_small = |x: f64| x.abs() <= ROUNDING * size;
        self.is_linear(own) && none.iter().all(|x| is_small(*x)) && sum.iter().zip(&all).all(|(a, b)| is_small(a - b))
    }
}

#[cfg(test)]
mod tests {
    use super::super::definition::Hook;
    use super::super::formula::FormulaParameter;
    use super::*;

    fn scaling(hook: Hook, text: &str, parameters: &[(&str, f64)]) -> Vec<usize> {
        let parameter = |(name, value): &(&str, f64)| FormulaParameter {
            name: (*name).to_owned(),
            value: *value,
            unit: "1".to_owned(),
        };
        let parameters = parameters.iter().map(parameter).collect();
        let text = FormulaText { name: "own".to_owned(), hook, text: text.to_owned(), parameters, columns: Vec::new() };
        amplitudes(&text).expect("a formula")
    }

    #[test]
    fn what_scales_a_formula_is_found() {
        let shelf = &[("a", 0.0), ("b", 0.2), ("d0", 0.0)];
        assert_eq!(scaling(Hook::Eps, "a * tanh(bend / b) * cos(delta - d0)", shelf), [0]);
        assert_eq!(scaling(Hook::Joint, "a * sin(u_i) + b * u_i^2", &[("a", 1.0), ("b", 0.0)]), [0, 1]);
        // Each alone is a factor, both together are not.
        assert_eq!(scaling(Hook::Joint, "a * b * u_i", &[("a", 1.0), ("b", 2.0)]), [0]);
        assert_eq!(scaling(Hook::Joint, "a * (u_i + b * u_i^2)", &[("a", 1.0), ("b", 2.0)]), [0]);
        // Nothing makes these nothing.
        assert_eq!(scaling(Hook::Joint, "sin(k * u_i)", &[("k", 1.0)]), [0; 0]);
        assert_eq!(scaling(Hook::Joint, "a + u_i", &[("a", 1.0)]), [0; 0]);
    }
}
