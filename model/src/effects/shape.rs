//! Effects between the shape of an ideal arc and the shape as it is observed.
//!
//! Twist, plane offset and non-constant curvature are in the snake: the end disk really is elsewhere, and the inverse bends so
//! that it comes to where it is wanted. Camera scale, camera offset and latency are in the sensor: the command must not follow
//! them, or the snake would be bent to please the camera.

use super::EffectKind;
use super::definition::{Class, Definition, Hook, Inverse, Needs, effect, parameter};
use super::prepared::Prepared;
use super::real::{Real, Scalar};

pub(super) const SENSOR: Inverse = Inverse::NotNeeded("it is in the camera only, and the snake is where it should be");

pub(super) static CAMERA_SCALE: Definition = Definition {
    also: &["magnification", "camera-gain", "scale", "gain"],
    inverse: SENSOR,
    parameters: &[parameter("relative", "1", [-0.2, 0.2], 0.0, "0.5 to 2 %, engineering")],
    ..effect("camera-scale", Hook::Meas, Class::Proportional, "b_m = (1 + relative) b")
};

pub(super) static CAMERA_OFFSET: Definition = Definition {
    also: &["offset", "bias"],
    inverse: SENSOR,
    parameters: &[
        parameter("offset_x_rad", "rad", [-0.5, 0.5], 0.0, "tilt of the view; 0.2 to 1 deg, engineering"),
        parameter("offset_y_rad", "rad", [-0.5, 0.5], 0.0, "tilt of the view in the other axis"),
    ],
    ..effect("camera-offset", Hook::Meas, Class::FirstHarmonic, "b_m = b + (offset_x, offset_y)")
};

pub(super) static LATENCY: Definition = Definition {
    also: &["delay", "dead-time", "time-delay", "lag"],
    inverse: SENSOR,
    needs: Needs::Time,
    parameters: &[parameter("delay_s", "s", [0.0, 1.0], 0.05, "30 to 100 ms, engineering")],
    ..effect("latency", Hook::Meas, Class::Rate, "b_m(t) = b(t - delay)")
};

pub(super) static PLANE_OFFSET: Definition = Definition {
    also: &["roll", "rotation"],
    parameters: &[parameter("angle_rad", "rad", [-0.5, 0.5], 0.0, "roll of the assembly; 1 to 5 deg, engineering")],
    ..effect("plane-offset", Hook::Meas, Class::Plane, "delta_m = delta + angle")
};

pub(super) static TWIST: Definition = Definition {
    also: &["torsion"],
    parameters: &[parameter("rad_per_rad", "rad/rad", [-0.5, 0.5], 0.0873, "0 to 10 deg per rad; 5, a start value")],
    ..effect("twist", Hook::Meas, Class::Plane, "delta_m = delta + rad_per_rad b")
};

pub(super) static NON_CONSTANT_CURVATURE: Definition = Definition {
    parameters: &[parameter(
        "cubic_per_rad2",
        "1/rad2",
        [-0.1, 0.033],
        0.03,
        "a1/3 of the curvature's slope at 1 rad; 3 %/rad2, a start value; larger ones are not monotone up to pi",
    )],
    ..effect(
        "non-constant-curvature",
        Hook::Meas,
        Class::Cubic,
        "b_m = b (1 - cubic b^2), the angle that the tip's position shows",
    )
};

/// Whether the effect is in the snake and so part of the inverse.
pub(crate) fn is_in_snake(kind: EffectKind) -> bool {
    matches!(kind, EffectKind::PlaneOffset | EffectKind::Twist | EffectKind::NonConstantCurvature)
}

/// The observed bend vector, rad, of a shape.
#[inline]
pub(crate) fn observe<P: Real, S: Scalar<P>>(e: &Prepared<P>, b: [S; 2]) -> [S; 2] {
    match e.kind {
        EffectKind::CameraScale => b.map(|b| b + b * e.c[0]),
        EffectKind::CameraOffset => [b[0] + e.c[0], b[1] + e.c[1]],
        EffectKind::PlaneOffset => turn(b, S::lift(e.c[0])),
        EffectKind::Twist => turn(b, bend(b) * e.c[0]),
        EffectKind::NonConstantCurvature => {
            let factor = S::constant(1.0) - (b[0] * b[0] + b[1] * b[1]) * e.c[0];
            b.map(|b| b * factor)
        }
        _ => b,
    }
}

/// The shape that is observed as `b_m`, for effects in the snake.
#[inline]
pub(crate) fn unobserve<P: Real, S: Scalar<P>>(e: &Prepared<P>, b_m: [S; 2]) -> [S; 2] {
    match e.kind {
        EffectKind::PlaneOffset => turn(b_m, -S::lift(e.c[0])),
        EffectKind::Twist => turn(b_m, -(bend(b_m) * e.c[0])),
        EffectKind::NonConstantCurvature => straighten(e, b_m),
        _ => b_m,
    }
}

/// Solves f (1 - cubic (f b_m)^2) = 1 for the factor f = b / b_m by Newton's method; monotone within the parameter's bounds.
fn straighten<P: Real, S: Scalar<P>>(e: &Prepared<P>, b_m: [S; 2]) -> [S; 2] {
    let k = (b_m[0] * b_m[0] + b_m[1] * b_m[1]) * e.c[0];
    let mut f = S::constant(1.0);
    for _ in 0..STRAIGHTEN_STEPS {
        let square = f * f * k;
        let residual = f - f * square - S::constant(1.0);
        f = f - residual / (S::constant(1.0) - square * S::constant(3.0));
    }
    b_m.map(|b| b * f)
}

/// Quadratic convergence from f = 1 reaches rounding in 5 steps at bends up to 90 degrees, in 7 up to pi.
const STRAIGHTEN_STEPS: u32 = 8;

fn turn<S: Real>(b: [S; 2], angle: S) -> [S; 2] {
    let (sin, cos) = (angle.sin(), angle.cos());
    [b[0] * cos - b[1] * sin, b[0] * sin + b[1] * cos]
}

/// |b|; its tangent at the straight pose is zero, as is that of everything it multiplies.
fn bend<S: Real>(b: [S; 2]) -> S {
    (b[0] * b[0] + b[1] * b[1]).sqrt()
}
