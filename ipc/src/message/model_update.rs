//! What the estimator has learnt: published by `estimate`, taken by `compensate` smoothly and within bounds.

use super::message;
use iceoryx2::prelude::ZeroCopySend;

/// Proposed parameters with their uncertainty.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.ModelUpdate")]
pub struct ModelUpdate {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Exposure of the newest shape that it rests on, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// Sequence number of that shape.
    pub shape_sequence: u64,
    /// Load scale eta, 1.
    pub eta: f64,
    /// Backlash lambda: half-width with the sign of each line's motion, m.
    pub lambda_m: f64,
    /// Standard deviation of eta, 1.
    pub eta_sd: f64,
    /// Standard deviation of lambda, m.
    pub lambda_sd_m: f64,
    /// Root mean square of the newest innovations, m.
    pub innovation_rms_m: f64,
    /// Measurements used since start.
    pub n_used: u64,
    /// Measurements left out since start (rest, no direction, outlier).
    pub n_left_out: u64,
    /// Changes of the machine seen since start: the model no longer explained the camera.
    pub n_changes: u64,
    /// Exposure of the shape that showed the newest of them, CLOCK_MONOTONIC, nanoseconds; 0 before the first.
    pub changed_ns: i64,
    /// What it looks like: 1 along x, 2 along y, 3 in the bending plane, 4 out of it, 5 with the motion, 6 scatter; 0 before the first.
    pub change_kind: u32,
    /// 1 while the watch for changes has learnt what is normal, else 0.
    pub is_watching: u32,
}

message!(ModelUpdate, "model_update", 2);
