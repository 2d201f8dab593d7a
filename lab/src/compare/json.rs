//! The machine-readable answer of a comparison: its names and nesting are a contract with other programs.

use super::{Bin, Comparison};
use crate::TipFrame;
use crate::diagnose::LoadCell;
use serde_json::{Value, json};

impl Comparison {
    /// The answer as JSON. Names in degrees hold null where errors are in another unit, which `unit` names.
    pub fn to_json(&self) -> Value {
        let is_deg = self.unit == "deg";
        let deg = |value: f64| is_deg.then_some(value);
        let bends = self.parts.as_ref();
        let mut all = json!({
            "format": 2,
            "rows": self.n_rows,
            "scored_rows": self.n_scored,
            "error_deg": is_deg.then(|| json!({
                "rms": self.error.rms,
                "p95": self.error.p95,
                "max": self.error.max,
                "bend_rms": bends.map(|p| p.bend.rms),
                "plane_rms": bends.map(|p| p.plane.rms),
                "bend_p95": bends.map(|p| p.bend.p95),
                "bend_max": bends.map(|p| p.bend.max),
                "bend_mean": bends.map(|p| p.bend_mean),
                "plane_p95": bends.map(|p| p.plane.p95),
                "plane_max": bends.map(|p| p.plane.max),
                "plane_mean": bends.map(|p| p.plane_mean),
                "azimuth_rms": bends.map(|p| p.azimuth_rms),
            })),
            "as_given_rms": self.as_given_rms,
            "as_given_rms_deg": deg(self.as_given_rms),
            "calibration": self.calibration,
            "still_joints": self.still_joints,
            "error_m": {"rms": self.position_rms_m},
            "noise_floor_deg": self.noise_floor.and_then(deg),
            "noise_floor_source": self.noise_source,
            "where": self.bins.iter().map(|bin| one(bin, &deg)).collect::<Vec<_>>(),
            "worst": self.worst,
            "error": {
                "unit": self.unit, "noise_floor": self.noise_floor, "rms": self.error.rms, "p95": self.error.p95, "max": self.error.max,
                "output_rms": self.output_rms,
            },
            "noise": self.noise,
            "common_mode": self.common_mode.map(|common| json!({
                "encoder_rms_m": common.encoder_rms_m,
                "encoder_max_m": common.encoder_max_m,
                "load_rms_n": common.load_rms_n,
                "load_max_n": common.load_max_n,
            })),
            "data": self.source,
            "data_sha256": self.sha256,
        });
        if let (false, Value::Object(keys)) = (self.tip_frames.is_empty(), &mut all) {
            keys.insert("tip_frames".to_owned(), self.tip_frames.iter().map(TipFrame::to_json).collect());
        }
        if let (Some(loads), Value::Object(keys)) = (&self.loads, &mut all) {
            let cell = |own: &LoadCell| {
                json!({
                    "line": own.line, "gain": own.gain, "offset_n": own.offset_n, "noise_n": own.noise_n, "rms_n": own.after_n,
                })
            };
            keys.insert("loads".to_owned(), loads.iter().map(cell).collect());
        }
        all
    }
}

fn one(bin: &Bin, deg: &impl Fn(f64) -> Option<f64>) -> Value {
    json!({
        "by": bin.by,
        "bin": bin.bin,
        "rms_deg": deg(bin.rms),
        "rows": bin.n_rows,
        "rms": bin.rms,
        "mean": bin.mean,
        "plane_mean": bin.plane_mean,
    })
}
