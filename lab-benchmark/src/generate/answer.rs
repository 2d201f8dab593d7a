//! The sealed answer of generated data, and the data as CSV.

use super::{Generated, Kind, Recipe};
use krait_lab::Quantity;
use krait_sim::Truth;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What is hidden in a file, for whoever scores the lab and nobody else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The data's file name.
    pub file: String,
    /// Names of the plant's kinds joined by `+`; `none` for nothing.
    pub kind: String,
    /// For each hidden effect the names of effects that count as right; `none` or `unknown` where no effect does.
    pub right: Vec<Vec<String>>,
    /// The plant's parameters that differ from its neutral ones, by key of a truth file; of segments the amplitude of each kind.
    pub params: BTreeMap<String, serde_json::Value>,
    /// Parameters that an effect of the catalogue must come to: effect, then parameter, in the units of a model file.
    pub known: BTreeMap<String, BTreeMap<String, f64>>,
    /// The motion.
    pub traj: String,
    /// The noise.
    pub noise: String,
    /// Standard deviation of the noise in each component, degrees.
    pub sigma_deg: f64,
    /// Standard deviation of the load cells' noise, N, where loads were recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_sigma_n: Option<f64>,
    /// Size of each hidden effect in units of the noise's length, as asked for.
    pub size: Vec<f64>,
    /// Error of the base model, degrees.
    pub base_rms_deg: f64,
    /// Its part without noise.
    pub effect_rms_deg: f64,
    /// The noise that was added, root mean square of its length, degrees.
    pub noise_rms_deg: f64,
    /// Rows.
    pub rows: usize,
    /// Everything else follows from it.
    pub seed: u64,
    /// How far the plant's dimensions may be off, 1.
    pub perturbation: f64,
}

impl Answer {
    pub(super) fn new(recipe: &Recipe, truth: &Truth, [base, effect, noise]: [f64; 3], rows: usize) -> Self {
        let kinds: Vec<&Kind> = recipe.hidden.iter().map(|&(kind, _)| kind).collect();
        let (kind, right) = crate::truth::names(kinds.iter().map(|kind| (kind.name, kind.right.iter().copied())));
        // With dimensions that are off, no parameter of the catalogue has to come to the plant's.
        let is_exact = recipe.perturbation == 0.0;
        let known = kinds.iter().filter(|kind| is_exact && kind.is_known()).map(|kind| {
            let values = kind.known_parameters(truth);
            (kind.right[0].to_owned(), values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
        });
        Self {
            file: String::new(),
            kind,
            right,
            params: differences(truth),
            known: known.filter(|(_, values): &(_, BTreeMap<_, _>)| !values.is_empty()).collect(),
            traj: recipe.motion.name().to_owned(),
            noise: recipe.noise.name(),
            sigma_deg: recipe.sigma_rad.to_degrees(),
            load_sigma_n: recipe.load_sigma_n,
            size: recipe.hidden.iter().map(|&(_, size)| size).collect(),
            base_rms_deg: base.to_degrees(),
            effect_rms_deg: effect.to_degrees(),
            noise_rms_deg: noise.to_degrees(),
            rows,
            seed: recipe.seed,
            perturbation: recipe.perturbation,
        }
    }
}

impl<T> Generated<T> {
    /// The data as CSV, in the columns that the lab reads.
    pub fn csv(&self) -> String {
        let data = &self.measurements;
        let loads = data.loads_n.as_deref();
        let mut text = String::from("time_s");
        if data.quantity == Quantity::Snake {
            text += ",q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad";
        } else {
            (1..=data.n_inputs).for_each(|k| text += &format!(",u{k}_m"));
            (1..=data.n_outputs).for_each(|k| text += &format!(",y{k}_rad"));
        }
        let n = data.n_inputs;
        (1..=n).filter(|_| loads.is_some()).for_each(|k| text += &format!(",tau{k}_n"));
        text.push('\n');
        for row in 0..data.n_rows() {
            let time_s = data.time_s.get(row).copied().unwrap_or_default();
            text += &((time_s * 1e9).round() / 1e9).to_string();
            let loads = loads.and_then(|loads| loads.get(row * n..(row + 1) * n)).unwrap_or_default();
            for value in data.input(row).iter().chain(data.output(row)).chain(loads) {
                text.push(',');
                // A row that the camera did not see stays empty.
                if value.is_finite() {
                    text += &significant(*value).to_string();
                }
            }
            text.push('\n');
        }
        text
    }
}

/// Seven digits, as short as they go.
fn significant(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

/// Every value of a truth that differs from the plant without effects.
fn differences(truth: &Truth) -> BTreeMap<String, serde_json::Value> {
    let neutral = Truth { effects: krait_sim::EffectsTruth::none(), ..Truth::default() };
    let values = |truth: &Truth| serde_json::to_value(truth).unwrap_or_default();
    let (found, neutral) = (values(truth), values(&neutral));
    let mut different = BTreeMap::new();
    for (table, keys) in found.as_object().into_iter().flatten() {
        for (key, value) in keys.as_object().into_iter().flatten() {
            if neutral.get(table).and_then(|keys| keys.get(key)) != Some(value) {
                different.insert(format!("{table}.{key}"), value.clone());
            }
        }
    }
    different
}
