//! Which parameters of a chain are learnt while the machine moves, from what start, how far and how fast.

use super::settings::{ChainError, EffectSetting};

/// The most parameters that are learnt at once, of all effects of a chain together.
pub const MAX_LEARNT: usize = 8;
/// No learnt value leaves its start value by more than this, standard deviations.
const REACH_SDS: f64 = 5.0;

/// How a parameter is learnt: its prior, and how it may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learn {
    /// Standard deviation of the start value, in the parameter's unit; above zero. No learnt value goes further than five of
    /// them from where it began.
    pub sd: f64,
    /// The value drifts as a random walk that goes one `sd` in this time, s, 1 to 1e9.
    pub memory_s: f64,
}

/// What is wrong with an entry: key, value, and what was expected.
pub(super) fn refused(learn: &Learn) -> Option<(&'static str, f64, &'static str)> {
    if !(learn.sd.is_finite() && learn.sd > 0.0) {
        return Some(("sd", learn.sd, "a standard deviation above zero"));
    }
    if !(1.0..=1e9).contains(&learn.memory_s) {
        return Some(("memory_s", learn.memory_s, "1 to 1e9 s"));
    }
    None
}

/// One parameter that a chain learns.
#[derive(Clone, Debug, PartialEq)]
pub struct LearntParameter {
    /// Place of the effect in the chain, from 0.
    pub effect: usize,
    /// Place of the parameter in the effect, from 0.
    pub parameter: usize,
    /// Name as `effect.parameter`.
    pub name: String,
    /// Unit; `1` for none.
    pub unit: String,
    /// Value in the model file.
    pub start: f64,
    /// Smallest value that is taken.
    pub low: f64,
    /// Largest value that is taken.
    pub high: f64,
    /// Its prior, and how it may change.
    pub learn: Learn,
}

/// The learnt parameters of a list of effects, in the order of the list.
pub(crate) fn learnt(effects: &[EffectSetting]) -> Result<Vec<LearntParameter>, ChainError> {
    let mut found = Vec::new();
    for (k, effect) in effects.iter().enumerate() {
        for (j, name) in effect.parameter_names().enumerate() {
            let Some(learn) = effect.learns()[j] else { continue };
            let (low, high) = effect.bounds(j);
            let start = effect.values()[j];
            found.push(LearntParameter {
                effect: k,
                parameter: j,
                name: format!("{}.{name}", effect.label()),
                unit: effect.unit(j).to_owned(),
                start,
                low: low.max(start - REACH_SDS * learn.sd),
                high: high.min(start + REACH_SDS * learn.sd),
                learn,
            });
        }
    }
    if found.len() > MAX_LEARNT {
        return Err(ChainError::TooManyLearnt { found: found.len(), limit: MAX_LEARNT });
    }
    Ok(found)
}
