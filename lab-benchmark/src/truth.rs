//! What was hidden in a cell's data, for scoring: one form for every machine, with its unit.

use crate::generate::Answer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The truth of one cell. Errors are in `unit`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HiddenTruth {
    /// Names of the plant's kinds joined by `+`; `none` for nothing.
    pub kind: String,
    /// For each hidden effect the names of effects that count as right; `none` or `unknown` where no effect does.
    pub right: Vec<Vec<String>>,
    /// Parameters that an effect of the catalogue must come to: effect, then parameter, in the units of a model file.
    pub known: BTreeMap<String, BTreeMap<String, f64>>,
    /// The motion.
    pub motion: String,
    /// The noise.
    pub noise: String,
    /// Size of each hidden effect in noise lengths, as asked for.
    pub size: Vec<f64>,
    /// Unit of the errors.
    pub unit: String,
    /// What sizes are counted in.
    pub noise_length: f64,
    /// Error of the base model.
    pub base_rms: f64,
    /// Its part without noise.
    pub effect_rms: f64,
    /// The noise that was added, where the lab looks: root mean square of its length.
    pub noise_rms: f64,
    /// Everything else follows from it.
    pub seed: u64,
}

impl HiddenTruth {
    /// That of generated data in degrees; a noise length is so many standard deviations of one component.
    pub(crate) fn of_answer(answer: Answer, deviations: f64) -> Self {
        Self {
            kind: answer.kind,
            right: answer.right,
            known: answer.known,
            motion: answer.traj,
            noise: answer.noise,
            size: answer.size,
            unit: "deg".to_owned(),
            noise_length: deviations * answer.sigma_deg,
            base_rms: answer.base_rms_deg,
            effect_rms: answer.effect_rms_deg,
            noise_rms: answer.noise_rms_deg,
            seed: answer.seed,
        }
    }
}

/// Names of what is hidden joined by `+`, and for each the names that count as right; `none` for nothing.
pub(crate) fn names<N, R>(hidden: impl Iterator<Item = (N, R)>) -> (String, Vec<Vec<String>>)
where
    N: Into<String>,
    R: IntoIterator<Item: Into<String>>,
{
    let owned = |names: R| names.into_iter().map(Into::into).collect();
    let (kinds, right): (Vec<String>, Vec<Vec<String>>) =
        hidden.map(|(kind, right)| (kind.into(), owned(right))).unzip();
    if kinds.is_empty() { ("none".to_owned(), vec![vec!["none".to_owned()]]) } else { (kinds.join("+"), right) }
}
