//! The machine-readable answer of a diagnosis: its names and nesting are a contract with other programs.

use super::{Diagnosis, FoundEffect};
use crate::experiment::Separation;
use serde_json::{Map, Value, json};

impl Diagnosis {
    /// The answer as JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "verdict": self.verdict.word(),
            "sentence": self.sentence,
            "cautions": self.cautions,
            "noise_floor_deg": self.noise_floor,
            "noise_floor_source": self.floor_source,
            "base_heldout_rms_deg": self.base_heldout_rms,
            "final_heldout_rms_deg": self.final_heldout_rms,
            "effects": self.effects.iter().map(effect).collect::<Vec<_>>(),
            "partial": self.partial.iter().map(effect).collect::<Vec<_>>(),
            "candidates": self.candidates.iter().map(|candidate| json!({
                "effect": candidate.name,
                "looks": candidate.class,
                "heldout_rms_deg": candidate.heldout_rms,
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
            "next_experiment": self.next_experiment.as_ref().map(|next| json!({
                "separates": next.separates, "do": next.instruction,
                "expected_separation": next.expected_separation.as_ref().map(separation),
            })),
            "rows": self.rows[0],
            "scored_rows": self.rows[1],
            "outliers": self.rows[2],
            "blocks": self.rows[3],
            "seed": self.seed,
        })
    }
}

fn effect(found: &FoundEffect) -> Value {
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
    json!({
        "effect": found.name,
        "class": found.class,
        "heldout_rms_deg": { "before": found.before, "after": found.after },
        "probability": found.probability,
        "params": parameters,
    })
}

fn separation(own: &Separation) -> Value {
    let pairs = own.pairs.iter().map(|pair| {
        json!({
            "truth": pair.truth, "other": pair.other, "lambda_now": pair.lambda_now, "lambda_after": pair.lambda_then,
        })
    });
    json!({ "seconds": own.seconds, "enough": Separation::ENOUGH, "pairs": pairs.collect::<Vec<_>>() })
}
