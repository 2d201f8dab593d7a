//! Two simulated segments and where they go, for the tests of what is learnt and of what is watched.

#![allow(dead_code, reason = "each test uses its own part")]

use core::f64::consts::PI;
use krait_sim::{SegmentTruth, SegmentsTruth};

/// Samples of the loop; at every eighth there is a frame of the camera.
pub const TICK_NS: i64 = 2_000_000;
pub const CAMERA_HZ: f64 = 62.5;
pub const SIGMA_RAD: f64 = 0.3 * PI / 180.0;

/// The shipped segments, in front of a camera whose noise is drawn anew.
pub fn truth(seed: u64) -> SegmentsTruth {
    let segment = |degrees: [f64; 3]| SegmentTruth {
        azimuths_rad: degrees.map(f64::to_radians).to_vec(),
        ..SegmentTruth::default()
    };
    let segments = [[0.0, 120.0, 240.0], [60.0, 180.0, 300.0]].map(segment).to_vec();
    let mut truth = SegmentsTruth { segment: segments, ..SegmentsTruth::default() };
    (truth.camera.rate_hz, truth.camera.noise_rad, truth.camera.seed) = (CAMERA_HZ, SIGMA_RAD, seed);
    truth
}

/// Where both segments shall be: each to and fro in planes all round, with rests.
pub fn bends_rad(t_s: f64) -> [f64; 8] {
    let smooth = |x: f64| 0.5 - 0.5 * (PI * x.clamp(0.0, 1.0)).cos();
    let one = |period_s: f64, largest: f64, first: f64| {
        let (stroke, u) = ((t_s / period_s).floor(), (t_s / period_s).fract());
        let b = largest * (0.6 + 0.4 * (0.37 * stroke).fract()) * (smooth(u / 0.4) - smooth((u - 0.55) / 0.4));
        let side = if stroke % 2.0 == 0.0 { 0.9 } else { -0.9 };
        let delta = first + 2.4 * stroke + side * smooth((u - 0.3) / 0.4);
        [b * delta.cos(), b * delta.sin()]
    };
    let ([a, b], [c, d]) = (one(4.0, 0.6, 0.0), one(3.1, 0.7, 1.0));
    [a, b, c, d, 0.0, 0.0, 0.0, 0.0]
}
