//! The machine-readable answer of a diagnosis: its names and nesting are a contract with other programs.

use super::variation::ParameterVariation;
use super::{Calibration, Diagnosis, FoundEffect, LoadCell, LockedError};
use crate::CameraOffset;
use crate::experiment::{Experiment, Separation};
use krait_model::effects::explanation;
use serde_json::{Map, Value, json};

impl Diagnosis {
    /// The answer as JSON. Every error stands under a name without a unit, beside `unit`; where that is degrees, also under the
    /// name with `_deg`, which holds null in another unit.
    pub fn to_json(&self) -> Value {
        let deg = |value: Option<f64>| value.filter(|_| self.unit == "deg");
        let mut all = json!({
            "format": 2,
            "verdict": self.verdict.word(),
            "sentence": self.sentence,
            "needed_s": self.needed_s,
            "cautions": self.cautions,
            "unit": self.unit,
            "noise_floor": self.noise_floor,
            "noise_floor_deg": deg(self.noise_floor),
            "noise_floor_source": self.floor_source,
            "noise_floor_relative_se": self.noise_floor.map(|_| self.floor_relative_error),
            "as_given_rms": self.as_given_rms,
            "as_given_rms_deg": deg(Some(self.as_given_rms)),
            "base_heldout_rms": self.base_heldout_rms,
            "base_heldout_rms_deg": deg(Some(self.base_heldout_rms)),
            "final_heldout_rms": self.final_heldout_rms,
            "final_heldout_rms_deg": deg(Some(self.final_heldout_rms)),
            "final_error_is": "used in selection",
            "locked": self.locked.as_ref().map(|own| own.to_json(&self.unit)),
            "explained_share": self.explained_share,
            "model_free_rms": self.model_free_rms,
            "model_free_rms_deg": deg(self.model_free_rms),
            "calibration": self.calibration.iter().map(Calibration::to_json).collect::<Vec<_>>(),
            "clocks": self.clocks.iter().map(|own| json!({ "shift_s": own.shift_s, "rate_ppm": 1e6 * own.rate })).collect::<Vec<_>>(),
            "camera_offsets": self.cameras.iter().map(CameraOffset::to_json).collect::<Vec<_>>(),
            "effects": self.effects.iter().map(|own| effect(own, &self.unit)).collect::<Vec<_>>(),
            "chain_order": self.chain_order(),
            "partial": self.partial.iter().map(|own| effect(own, &self.unit)).collect::<Vec<_>>(),
            "candidates": self.candidates.iter().map(|candidate| json!({
                "effect": candidate.name,
                "looks": candidate.class,
                "heldout_rms": candidate.heldout_rms,
                "heldout_rms_deg": deg(candidate.heldout_rms),
                "probability": candidate.probability,
                "p_value": candidate.p_value,
                "state": candidate.state,
            })).collect::<Vec<_>>(),
            "remaining": {
                "structured": self.remaining.structured,
                "p_value": self.remaining.p_value,
                "looks_like": self.remaining.looks_like,
                "unexplained_share": self.remaining.unexplained,
                "groups": self.remaining.structure.groups.iter().map(|group| json!({
                    "depends_on": group.name, "share": group.share, "p_value": group.p_value,
                })).collect::<Vec<_>>(),
            },
            "proposals": self.proposals.iter().map(|own| json!({
                "joint": own.joint, "term": own.term, "gain": own.gain, "se": own.se, "unit": own.unit, "share": own.share,
                "column": own.column.as_ref().map(|(name, column)| json!({ "name": name, "column": column })),
            })).collect::<Vec<_>>(),
            "variations": self.variations.iter().map(ParameterVariation::to_json).collect::<Vec<_>>(),
            "next_experiment": self.next_experiment.as_ref().map(|next| json!({
                "separates": next.separates, "do": next.instruction,
                "moves": next.motion.as_ref().map(|motion| motion.moves.clone()),
                "seconds": next.motion.as_ref().map(|motion| motion.seconds),
                "expected_separation": next.motion.as_ref().and_then(separation),
            })),
            "rows": self.rows[0],
            "scored_rows": self.rows[1],
            "outliers": self.rows[2],
            "blocks": self.rows[3],
            "seed": self.seed,
        });
        if let (Some(loads), Value::Object(keys)) = (&self.loads, &mut all) {
            keys.insert("loads".to_owned(), loads.iter().map(LoadCell::to_json).collect());
        }
        all
    }
}

impl LockedError {
    fn to_json(&self, unit: &str) -> Value {
        let deg = |value: f64| (unit == "deg").then_some(value);
        json!({
            "part": self.part.word(),
            "rows": self.n_rows,
            "rms": self.rms,
            "rms_deg": deg(self.rms),
            "base_rms": self.base_rms,
            "base_rms_deg": deg(self.base_rms),
            "verdict": self.verdict.word(),
            "effects": self.effects,
        })
    }
}

impl LoadCell {
    /// The cell as JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "line": self.line, "gain": self.gain, "offset_n": self.offset_n, "noise_n": self.noise_n,
            "rms_n": { "before": self.before_n, "after": self.after_n },
        })
    }
}

impl Calibration {
    /// The number as JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "name": self.name,
            "joint": self.joint,
            "recording": self.recording,
            "value": self.value,
            "se": self.se,
            "unit": self.unit,
            "held": self.is_held,
            "prior": self.prior.map(|(value, se)| json!({
                "value": value, "se": se, "pull_in_se": (self.value - value) / se,
            })),
        })
    }
}

fn effect(found: &FoundEffect, unit: &str) -> Value {
    let parameters: Map<String, Value> = found
        .parameters
        .iter()
        .map(|own| {
            let value = json!({
                "value": own.value, "se": own.se, "se_if_independent": own.se_naive, "unit": own.unit, "free": own.is_free,
                "on_bound": own.on_bound,
            });
            (own.name.clone(), value)
        })
        .collect();
    let errors = json!({ "before": found.before, "after": found.after });
    json!({
        "effect": found.name,
        "joint": found.joint,
        "class": found.class,
        "heldout_rms": errors,
        "heldout_rms_deg": (unit == "deg").then_some(&errors),
        "unit": unit,
        "probability": found.probability,
        "params": parameters,
        "title": found.title(),
        "explanation": explanation(&found.name),
        "sketch": found.sketch.as_ref().map(|own| json!({
            "position": own.position.iter().map(short).collect::<Vec<_>>(),
            "change": own.change.iter().map(short).collect::<Vec<_>>(),
            "unit": own.unit,
            "is_across": own.is_across,
        })),
    })
}

/// A number of a picture: five digits are more than a screen shows.
fn short(value: &f64) -> f64 {
    if *value == 0.0 {
        return 0.0;
    }
    let step = 10_f64.powf(value.abs().log10().floor() - 4.0);
    (value / step).round() * step
}

fn separation(motion: &Experiment) -> Option<Value> {
    let own = motion.separation.as_ref()?;
    let pairs = own.pairs.iter().map(|pair| {
        json!({
            "truth": pair.truth, "other": pair.other, "lambda_now": pair.lambda_now, "lambda_after": pair.lambda_then,
            "part_of_noise_after": pair.part_then, "told": pair.is_told(),
        })
    });
    Some(json!({ "seconds": own.seconds, "enough": Separation::ENOUGH, "pairs": pairs.collect::<Vec<_>>() }))
}
