//! Effects without memory: scale, offset, quadratic, cubic, dead zone, periodic error, cross-coupling, saturation.

use super::{JOINT, JointEffect};
use crate::effects::{Class, Definition, Hook, Inverse, effect, parameter};
use core::f64::consts::TAU;

/// A limit beyond every command.
const NO_LIMIT: f64 = 1e9;

const SIZE: [f64; 2] = [-1e6, 1e6];
const LENGTH: [f64; 2] = [0.0, 1e6];
const PERIOD: [f64; 2] = [1e-9, 1e6];

pub(super) static SCALE: Definition = Definition {
    also: &["gain", "gear-ratio", "stiffness"],
    repeatable: true,
    parameters: &[JOINT, parameter("scale", "1", [-10.0, 10.0], 0.0, "relative error of the gain; 0: none")],
    ..effect("scale", Hook::Cmd, Class::Proportional, "x <- (1 + scale) x")
};

pub(super) static OFFSET: Definition = Definition {
    also: &["zero", "bias", "zero-offset"],
    repeatable: true,
    inverse: Inverse::Exact,
    parameters: &[JOINT, parameter("offset", "y", SIZE, 0.0, "zero of the sensor or of homing; 0: none")],
    ..effect("offset", Hook::Meas, Class::Constant, "y <- y + offset")
};

pub(super) static CUBIC: Definition = Definition {
    repeatable: true,
    parameters: &[
        JOINT,
        parameter("cubic", "1/u^2", SIZE, 0.0, "relative change of the gain with the square of x; 0: none"),
        parameter("centre", "u", SIZE, 0.0, "where the curve has its turning point"),
    ],
    ..effect("cubic", Hook::Cmd, Class::Cubic, "x <- x + cubic (x - centre)^3")
};

pub(super) static QUADRATIC: Definition = Definition {
    repeatable: true,
    parameters: &[
        JOINT,
        parameter("quadratic", "1/u", SIZE, 0.0, "relative change of the gain with x; 0: none"),
        parameter("centre", "u", SIZE, 0.0, "where the curve touches a line"),
    ],
    ..effect("quadratic", Hook::Cmd, Class::Cubic, "x <- x + quadratic (x - centre)^2")
};

pub(super) static DEAD_ZONE: Definition = Definition {
    also: &["dead-band", "deadband"],
    repeatable: true,
    parameters: &[
        JOINT,
        parameter("half_width", "u", LENGTH, 0.0, "how far from the centre nothing moves; 0: none"),
        parameter("centre", "u", SIZE, 0.0, "where it is"),
    ],
    ..effect("dead-zone", Hook::Cmd, Class::DeadZone, "x <- x - clamp(x - centre, -half_width, half_width)")
};

pub(super) static PERIODIC_ERROR: Definition = Definition {
    also: &["periodic", "ripple", "eccentricity"],
    repeatable: true,
    parameters: &[
        JOINT,
        parameter("amplitude", "u", LENGTH, 0.0, "of a screw or a gear; 0: none"),
        parameter("period", "u", PERIOD, 1.0, "travel of one turn"),
        parameter("phase_rad", "rad", [-TAU, TAU], 0.0, "at x = 0"),
    ],
    ..effect("periodic-error", Hook::Cmd, Class::Periodic, "x <- x + amplitude sin(2 pi x / period + phase)")
};

pub(super) static CROSS_COUPLING: Definition = Definition {
    repeatable: true,
    parameters: &[
        JOINT,
        parameter("from", "1", [1.0, super::MAX_JOINTS as f64], 1.0, "the joint whose motion it feels, from 1"),
        parameter("k", "1", [-10.0, 10.0], 0.0, "share of that motion; dVRK wrists have 0.13 and 0.21; 0: none"),
    ],
    ..effect(
        "cross-coupling",
        Hook::Cmd,
        Class::Coupling,
        "x_joint <- x_joint + k x_from, all joints but `from` if joint is 0",
    )
};

pub(super) static SATURATION: Definition = Definition {
    also: &["limit", "clipping"],
    repeatable: true,
    inverse: Inverse::None("no command moves a joint beyond its stop"),
    parameters: &[
        JOINT,
        parameter("limit", "u", [0.0, NO_LIMIT], NO_LIMIT, "where motion ends, either way; 1e9: nowhere"),
    ],
    ..effect("saturation", Hook::Cmd, Class::Clipped, "x <- clamp(x, -limit, limit)")
};

/// The changed position of a joint; `own` and `all` are positions before.
pub(super) fn change(kind: JointEffect, c: &[f64], own: f64, all: &[f64], joint: usize) -> f64 {
    match (kind, c) {
        (JointEffect::Scale, [scale, ..]) => own + scale * own,
        (JointEffect::Offset, [offset, ..]) => own + offset,
        (JointEffect::Cubic, [cubic, centre, ..]) => own + cubic * (own - centre).powi(3),
        (JointEffect::Quadratic, [quadratic, centre, ..]) => own + quadratic * (own - centre).powi(2),
        (JointEffect::DeadZone, [half_width, centre, ..]) => own - (own - centre).clamp(-half_width, *half_width),
        (JointEffect::PeriodicError, [amplitude, period, phase, ..]) => {
            own + amplitude * (TAU * own / period + phase).sin()
        }
        (JointEffect::CrossCoupling, [from, k, ..]) => {
            let from = (from.round() as usize).saturating_sub(1);
            if from == joint { own } else { own + k * all.get(from).copied().unwrap_or(0.0) }
        }
        (JointEffect::Saturation, [limit, ..]) => own.clamp(-limit, *limit),
        _ => own,
    }
}
