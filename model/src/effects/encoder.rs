//! Effects between an actuator's true position and the encoder's reading, and on the command.

use super::EffectKind;
use super::definition::{Class, Definition, Hook, Inverse, effect, parameter};
use super::prepared::Prepared;
use super::real::{Real, Scalar};
use core::f64::consts::PI;

pub(super) static BACKLASH: Definition = Definition {
    also: &["play", "slack", "lost-motion", "deadband", "dead-band", "dead-zone", "clearance", "hysteresis"],
    inverse: Inverse::Smoothed,
    n_states: 3,
    parameters: &[parameter(
        "half_width_m",
        "m",
        [0.0, 2e-3],
        8.9e-5,
        "half of 0.178 mm, Eq. (22); the paper measured 0.15 to 0.20 mm in all",
    )],
    ..effect(
        "backlash",
        Hook::Eps,
        Class::ConstantHysteresis,
        "p <- clamp(p, q~ - half_width, q~ + half_width) moves the line; inverse q~ = p + half_width s",
    )
};

pub(super) static ENCODER_ZERO: Definition = Definition {
    also: &["zero", "zero-offset", "slip", "offset", "bias"],
    parameters: &[
        parameter("zero1_m", "m", [-2e-3, 2e-3], 0.0, "reading of encoder 1 at zero; 0.02 to 0.1 mm from homing"),
        parameter("zero2_m", "m", [-2e-3, 2e-3], 0.0, "reading of encoder 2 at zero"),
        parameter("zero3_m", "m", [-2e-3, 2e-3], 0.0, "reading of encoder 3 at zero"),
    ],
    ..effect("encoder-zero", Hook::Enc, Class::FirstHarmonic, "reading_i = q~_i + zero_i")
};

pub(super) static ENCODER_SCALE: Definition = Definition {
    also: &["gear-ratio", "lead", "scale", "gain"],
    parameters: &[
        parameter("scale1", "1", [-0.1, 0.1], 0.0, "relative error of encoder 1; 0.1 to 1 %, engineering"),
        parameter("scale2", "1", [-0.1, 0.1], 0.0, "relative error of encoder 2"),
        parameter("scale3", "1", [-0.1, 0.1], 0.0, "relative error of encoder 3"),
    ],
    ..effect("encoder-scale", Hook::Enc, Class::SecondHarmonic, "reading_i = (1 + scale_i) q~_i")
};

pub(super) static LEAD_SCREW_ERROR: Definition = Definition {
    also: &["screw-error", "periodic", "ripple"],
    repeatable: true,
    parameters: &[
        parameter("amplitude_m", "m", [0.0, 5e-5], 1e-5, "2 to 20 um, unverified; the reading stays monotone"),
        parameter("pitch_m", "m", [5e-4, 0.01], 1e-3, "0.5 to 2 mm, unverified").fixed("a period"),
        parameter("phase1_rad", "rad", [-3.15, 3.15], 0.0, "phase of screw 1"),
        parameter("phase2_rad", "rad", [-3.15, 3.15], 0.0, "phase of screw 2"),
        parameter("phase3_rad", "rad", [-3.15, 3.15], 0.0, "phase of screw 3"),
    ],
    ..effect(
        "lead-screw-error",
        Hook::Enc,
        Class::Periodic,
        "reading_i = q~_i + amplitude sin(2 pi q~_i/pitch + phase_i)",
    )
};

pub(super) static SATURATION: Definition = Definition {
    also: &["limit", "clipping"],
    inverse: Inverse::None("an actuator at its force limit follows no command; limit the workspace instead"),
    parameters: &[parameter("limit_n", "N", [0.1, 1000.0], 25.0, "force at which an actuator stalls; a start value")
        .fixed("a threshold")],
    ..effect("saturation", Hook::Cmd, Class::Clipped, "the actuator stays behind where |tau~| would exceed limit")
};

pub(super) static PRELOAD: Definition = Definition {
    also: &["pretension"],
    parameters: &[parameter("load_n", "N", [-50.0, 50.0], 2.0, "load of every line at encoder zero; a start value")],
    ..effect(
        "preload",
        Hook::Cmd,
        Class::Preload,
        "q~ is (1/K_d + 1/K_c + 3 L/(E A)) load more than commanded; the inverse plans with this load in all lines",
    )
};

/// The reading of line i's encoder at a true position, m.
#[inline]
pub(crate) fn reading<P: Real, S: Scalar<P>>(e: &Prepared<P>, i: usize, q_tilde: S) -> S {
    match e.kind {
        EffectKind::EncoderZero => q_tilde + e.c[i],
        EffectKind::EncoderScale => q_tilde + q_tilde * e.c[i],
        EffectKind::LeadScrewError => {
            let phase = q_tilde * (P::constant(2.0 * PI) / e.c[1]) + e.c[2 + i];
            q_tilde + phase.sin() * e.c[0]
        }
        _ => q_tilde,
    }
}
