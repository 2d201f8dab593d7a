//! Effects on the moment that bends the snake: load scale, softening of the backbones, friction of bending, forces on the tip.
//!
//! They act on the moment m = d E / d bend, N m per rad of bend vector, before it is divided among the lines.

use super::EffectKind;
use super::arc;
use super::definition::{Class, Definition, Hook, effect, parameter};
use super::operators::{planar_play, play};
use super::prepared::{Constants, Now, Prepared};
use super::real::{Real, Scalar};

pub(super) static STIFFNESS_SCALE: Definition = Definition {
    also: &["gain", "scale", "stiffness", "load-scale"],
    parameters: &[parameter("eta", "1", [0.1, 10.0], 1.22, "load scale of Eq. (18); Eq. (22) estimates 1.220")],
    ..effect("stiffness-scale", Hook::Tau, Class::Proportional, "m <- eta m")
};

pub(super) static SUPERELASTIC_SOFTENING: Definition = Definition {
    also: &["softening", "plasticity"],
    n_states: 1,
    parameters: &[
        parameter("strain", "1", [0.002, 0.05], 0.01, "outer strain eps_t at which austenite ends; 0.5 to 1 %"),
        parameter("a", "1", [0.0, 1.5], 1.25, "fit of the bent tube's integral, within 2 % up to 180 deg"),
        parameter("flag", "1", [0.0, 0.3], 0.0, "relative growth of a while the bend decreases (lower plateau)"),
        parameter("turn_rad", "rad", [1e-4, 0.2], 0.02, "change of bend over which the branch changes")
            .fixed("a threshold"),
    ],
    ..effect(
        "superelastic-softening",
        Hook::Tau,
        Class::Cubic,
        "m <- m (1 - a u^2), u = max(0, 1 - b_t/b), b_t = eps_t 2 L / d_outer; the moment stays level beyond its maximum",
    )
};

pub(super) static BEND_FRICTION: Definition = Definition {
    also: &["internal-friction"],
    n_states: 2,
    parameters: &[
        parameter("moment_nm", "N m", [0.0, 0.05], 5e-4, "Coulomb moment without load; a start value"),
        parameter(
            "per_load_m",
            "m",
            [0.0, 0.01],
            0.0,
            "growth with the sum of the lines' loads, N m per N; a start value",
        ),
    ],
    ..effect(
        "bend-friction",
        Hook::Tau,
        Class::BendHysteresis,
        "m <- m + k (b - b_p), k = 20 (4 E I/L), |b - b_p| <= (moment + per_load sum|tau_i|)/k: a stop in the plane, all but rigid",
    )
};

pub(super) static AXIAL_TIP_FORCE: Definition = Definition {
    also: &["follower-force"],
    parameters: &[parameter(
        "force_n",
        "N",
        [-5.0, 5.0],
        0.5,
        "force on the end disk along the base's z; a start value",
    )],
    ..effect("axial-tip-force", Hook::Tau, Class::Cubic, "m <- m - J_x^T w, w = (0, 0, force)")
};

pub(super) static LATERAL_TIP_FORCE: Definition = Definition {
    also: &["weight", "gravity", "tip-load"],
    parameters: &[
        parameter("force_x_n", "N", [-5.0, 5.0], 0.1, "force on the end disk along the base's x; a start value"),
        parameter("force_y_n", "N", [-5.0, 5.0], 0.0, "force on the end disk along the base's y; a start value"),
    ],
    ..effect("lateral-tip-force", Hook::Tau, Class::FirstHarmonic, "m <- m - J_x^T w, w = (force_x, force_y, 0)")
};

/// The moment after an effect; `loads` gives the lines' loads for a moment.
#[inline(always)]
pub(crate) fn apply<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    machine: &Constants,
    b: [S; 2],
    now: &Now,
    m: [S; 2],
    loads: impl Fn([S; 2]) -> [S; 3],
) -> [S; 2] {
    match e.kind {
        EffectKind::StiffnessScale => [m[0] * e.c[0], m[1] * e.c[0]],
        EffectKind::SuperelasticSoftening => soften(e, state, b, now, m),
        EffectKind::BendFriction => rub(e, state, machine, b, now, m, loads(m)),
        EffectKind::AxialTipForce => push_along(e, machine, b, m),
        EffectKind::LateralTipForce => push_aside(e, machine, b, m),
        _ => m,
    }
}

#[inline(never)]
fn soften<P: Real, S: Scalar<P>>(e: &Prepared<P>, state: &mut [P], b: [S; 2], now: &Now, m: [S; 2]) -> [S; 2] {
    let [b_t, a, flag, turn] = [e.c[0], e.c[1], e.c[2], e.c[3]];
    let bend = (b[0] * b[0] + b[1] * b[1]).sqrt();
    let half = turn * P::constant(0.5);
    let p = play(state[e.state], bend, half, now.fresh);
    if now.commit {
        state[e.state] = p.settle();
    }
    if bend.value() <= b_t.value() {
        return m;
    }
    let one = S::constant(1.0);
    // +1 while the bend grows, -1 while it falls: half (1 - sigma) of the flag is added.
    let sigma = (bend - p) * (P::constant(1.0) / half);
    let a = ((one - sigma) * (flag * P::constant(0.5)) + P::constant(1.0)) * a;
    let u = one - S::lift(b_t) / bend;
    m.map(|m| m * softened(a, u))
}

/// 1 - a u^2 up to where b (1 - a u^2) has its maximum, a u (2 - u) = 1; beyond it the moment stays level.
fn softened<S: Real>(a: S, u: S) -> S {
    let one = S::constant(1.0);
    if a.value() * u.value() * (2.0 - u.value()) <= 1.0 {
        return one - a * u * u;
    }
    let top = one - (one - one / a).sqrt();
    (one - a * top * top) * (one - u) / (one - top)
}

/// A Coulomb moment holds the bend until it is exceeded; before that the bend gives way elastically, this many times as stiff as
/// the snake itself: all but rigid, and a moment that is a function of the bend for the inverse.
const PRESLIDING: f64 = 20.0;

#[inline(never)]
fn rub<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    machine: &Constants,
    b: [S; 2],
    now: &Now,
    m: [S; 2],
    loads: [S; 3],
) -> [S; 2] {
    let stiffness = P::constant(PRESLIDING * 4.0 * machine.bending_stiffness_nm2 / machine.l_m);
    let sum = loads[0].abs() + loads[1].abs() + loads[2].abs();
    let radius = (sum * e.c[1] + e.c[0]) * (P::constant(1.0) / stiffness);
    let p = planar_play([state[e.state], state[e.state + 1]], b, radius, now.fresh);
    if now.commit {
        state[e.state] = p[0].settle();
        state[e.state + 1] = p[1].settle();
    }
    [m[0] + (b[0] - p[0]) * stiffness, m[1] + (b[1] - p[1]) * stiffness]
}

#[inline(never)]
fn push_along<P: Real, S: Scalar<P>>(e: &Prepared<P>, machine: &Constants, b: [S; 2], m: [S; 2]) -> [S; 2] {
    let slope = arc::sinc_slope(b[0] * b[0] + b[1] * b[1]) * (e.c[0] * P::constant(machine.l_m));
    [m[0] - b[0] * slope, m[1] - b[1] * slope]
}

/// The tip lies at L cosc(b) (b_x, -b_y) beside the axis.
#[inline(never)]
fn push_aside<P: Real, S: Scalar<P>>(e: &Prepared<P>, machine: &Constants, b: [S; 2], m: [S; 2]) -> [S; 2] {
    let [f_x, f_y] = [e.c[0] * P::constant(machine.l_m), e.c[1] * P::constant(machine.l_m)];
    let square = b[0] * b[0] + b[1] * b[1];
    let (cosc, slope) = (arc::cosc(square), arc::cosc_slope(square));
    let along = (b[0] * f_x - b[1] * f_y) * slope;
    [m[0] - cosc * f_x - along * b[0], m[1] + cosc * f_y - along * b[1]]
}
