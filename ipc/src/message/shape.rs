//! What a camera saw of the snake: published by whoever measures it, read by `resolve`, `estimate`, `record`.

use super::message;
use iceoryx2::prelude::ZeroCopySend;

/// A measured shape.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.Shape")]
pub struct Shape {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of exposure, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// When the shape was published, CLOCK_MONOTONIC, nanoseconds.
    pub available_ns: i64,
    /// Measured bend vector b (cos delta, sin delta), rad; NaN where the view was lost.
    pub bend_rad: [f64; 2],
    /// Tangent angle of the end disk in the snake plane, rad; pi/2 is straight.
    pub theta_l_rad: f64,
    /// delta as in the paper, rad, in (-pi, pi]; arbitrary at the straight pose.
    pub delta_rad: f64,
    /// Standard deviation of each component of `bend_rad`, rad, as its maker states it.
    pub sigma_bend_rad: f64,
    /// Actuator positions q~ at the instant of exposure, m; NaN where the maker does not know them.
    pub q_tilde_m: [f64; 3],
}

message!(Shape, "shape", 1);
