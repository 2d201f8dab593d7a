//! A free parameter of one effect, and the scale on which a fit moves it.

use crate::machine::MachineUnderTest;
use crate::{LabError, Term};
use core::f64::consts::{PI, TAU};

/// A free parameter: which, its bounds, and whether it is stepped by ratio or by difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Place of the effect in the list.
    pub effect: usize,
    /// Place of the parameter in the effect.
    pub parameter: usize,
    /// Key in the model file.
    pub name: String,
    /// Unit, `1` for none.
    pub unit: String,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// What is known of it beside the data: a value and its standard error, which draw every fit.
    pub prior: Option<(f64, f64)>,
    /// Where a free number of the machine begins, with a wide error: what the data do not tell stays near, and what they tell does
    /// not feel it.
    pub(crate) anchor: Option<(f64, f64)>,
    /// Size of a unit step; `None`: the parameter is positive and its logarithm is stepped.
    pub(crate) scale: Option<f64>,
    /// Whether all angles are within its bounds: it has no bounds then.
    pub(crate) is_angle: bool,
}

impl Variable {
    /// The variable of one parameter; `size` is what counts as a large change where it is stepped by difference.
    ///
    /// # Errors
    /// [`LabError::UnknownEffect`] for an effect that the machine does not have.
    pub fn new(
        machine: &dyn MachineUnderTest,
        effects: &[Term],
        effect: usize,
        parameter: usize,
        size: f64,
    ) -> Result<Self, LabError> {
        let own = effects.get(effect).map(|term| machine.parameters(term)).transpose()?.unwrap_or_default();
        let Some(spec) = own.get(parameter) else {
            return Err(LabError::UnknownParameter {
                effect: effects.get(effect).map_or(String::new(), |term| term.label().to_owned()),
                name: format!("number {}", parameter + 1),
                nearest: own.last().map_or("none".to_owned(), |last| last.name.clone()),
            });
        };
        let by_ratio = spec.low > 0.0 && spec.high.is_finite();
        Ok(Self {
            effect,
            parameter,
            name: spec.name.clone(),
            unit: spec.unit.clone(),
            low: spec.low,
            high: spec.high,
            prior: None,
            anchor: None,
            scale: if by_ratio { None } else { Some(size.abs().max(1e-12)) },
            is_angle: spec.unit == "rad" && spec.low <= -PI && spec.high >= PI,
        })
    }

    /// Its value in a list of effects.
    pub fn value(&self, effects: &[Term]) -> f64 {
        effects[self.effect].values[self.parameter]
    }

    /// Moves it by `step` of its scale, within bounds.
    pub(crate) fn step(&self, effects: &mut [Term], step: f64) {
        let value = self.value(effects);
        let moved = match self.scale {
            Some(scale) => value + step * scale,
            None => value * step.clamp(-3.0, 3.0).exp(),
        };
        self.set(effects, moved);
    }

    /// Sets it, within bounds.
    pub(crate) fn set(&self, effects: &mut [Term], value: f64) {
        effects[self.effect].values[self.parameter] =
            if self.is_angle { turned(value) } else { value.clamp(self.low, self.high) };
    }

    /// d value / d step at the present value.
    pub(crate) fn unit_step(&self, effects: &[Term]) -> f64 {
        self.scale.unwrap_or_else(|| self.value(effects))
    }

    /// How far it lies from what was known of it before, in standard errors; zero where nothing was.
    pub(crate) fn pull(&self, effects: &[Term]) -> f64 {
        self.prior.or(self.anchor).map_or(0.0, |(value, se)| (self.value(effects) - value) / se)
    }

    /// d pull / d step at the present value; zero where nothing was known.
    pub(crate) fn pull_per_step(&self, effects: &[Term]) -> f64 {
        self.prior.or(self.anchor).map_or(0.0, |(_, se)| self.unit_step(effects) / se)
    }

    /// Whether it lies on a bound, and which.
    pub fn bound(&self, effects: &[Term]) -> Option<f64> {
        if self.is_angle {
            return None;
        }
        let value = self.value(effects);
        let ends = [self.low, self.high].into_iter().filter(|bound| bound.is_finite());
        ends.into_iter().find(|bound| (value - bound).abs() <= 1e-9 * bound.abs().max(1e-12))
    }
}

/// The same angle from -pi to pi, rad.
fn turned(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}
