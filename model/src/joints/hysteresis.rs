//! Effects that remember where the joint came from: backlash, Bouc-Wen, Prandtl-Ishlinskii, friction that grows with load.

use super::{JOINT, JointEffect, N_STATES, Now};
use crate::effects::{Class, Definition, Hook, Inverse, bouc_wen, effect, parameter};

const LENGTH: [f64; 2] = [0.0, 1e6];
const TRAVEL: [f64; 2] = [1e-9, 1e6];
const SHARE: [f64; 2] = [-10.0, 10.0];

pub(super) static BACKLASH: Definition = Definition {
    also: &["play", "slack", "lost-motion", "clearance"],
    repeatable: true,
    inverse: Inverse::Smoothed,
    n_states: 1,
    parameters: &[JOINT, parameter("half_width", "u", LENGTH, 0.0, "half of the free play; 0: none")],
    ..effect(
        "backlash",
        Hook::Cmd,
        Class::ConstantHysteresis,
        "x <- p, p = clamp(p_before, x - half_width, x + half_width)",
    )
};

pub(super) static BOUC_WEN: Definition = Definition {
    also: &["hysteresis"],
    repeatable: true,
    inverse: Inverse::Smoothed,
    n_states: 2,
    parameters: &[
        JOINT,
        parameter("amplitude", "u", LENGTH, 0.0, "lost motion far from reversals, each way; 0: none"),
        parameter("travel", "u", TRAVEL, 1.0, "travel over which it builds up after a reversal"),
        parameter("gamma", "1", [0.0, 0.5], 0.5, "shape of unloading: 0.5 straight, 0 curved"),
    ],
    ..effect(
        "bouc-wen",
        Hook::Cmd,
        Class::ConstantHysteresis,
        "x <- x - amplitude z, dz = (1 - (1 - gamma) |z| sgn(z dx) - gamma |z|) dx / travel",
    )
};

pub(super) static PRANDTL_ISHLINSKII: Definition = Definition {
    also: &["hysteresis"],
    repeatable: true,
    inverse: Inverse::Smoothed,
    n_states: N_STATES,
    parameters: &[
        JOINT,
        parameter("weight1", "1", SHARE, 0.0, "share of the first play; 0: none"),
        parameter("half_width1", "u", LENGTH, 0.0, "of the first play"),
        parameter("weight2", "1", SHARE, 0.0, "share of the second play; 0: none"),
        parameter("half_width2", "u", LENGTH, 0.0, "of the second play"),
        parameter("weight3", "1", SHARE, 0.0, "share of the third play; 0: none"),
        parameter("half_width3", "u", LENGTH, 0.0, "of the third play"),
    ],
    ..effect(
        "prandtl-ishlinskii",
        Hook::Cmd,
        Class::ConstantHysteresis,
        "x <- x - sum_k weight_k (x - p_k), p_k the play of half_width_k",
    )
};

pub(super) static CONE_FRICTION: Definition = Definition {
    also: &[
        "capstan",
        "capstan-friction",
        "friction",
        "coulomb-friction",
        "coulomb",
        "dry-friction",
        "stiction",
        "static-friction",
    ],
    repeatable: true,
    inverse: Inverse::Smoothed,
    n_states: 1,
    parameters: &[
        JOINT,
        parameter("friction", "1", [0.0, 2.0], 0.0, "mu times the angle of the cable's bends, rad; 0: none"),
    ],
    ..effect(
        "cone-friction",
        Hook::Cmd,
        Class::LoadHysteresis,
        "x <- p, p = clamp(p_before, between x e^-friction and x e^+friction): the load grows with x",
    )
};

pub(super) static LOAD_FRICTION: Definition = Definition {
    repeatable: true,
    inverse: Inverse::Smoothed,
    n_states: 1,
    parameters: &[
        JOINT,
        parameter("share", "1", [-10.0, 10.0], 0.0, "share of the motion that feels the friction; 0: none"),
        parameter("friction", "1", [0.0, 2.0], 0.1, "half-width of the play as a share of x"),
    ],
    ..effect(
        "load-friction",
        Hook::Cmd,
        Class::LoadHysteresis,
        "x <- x - share (x - p), p = clamp(p_before, x - friction |x|, x + friction |x|)",
    )
};

/// Ratios of the four half-widths of a generalised Prandtl-Ishlinskii model to its reach.
pub const REACHES: [f64; 4] = [0.1, 0.25, 0.5, 1.0];

pub(super) static GENERALISED_PRANDTL_ISHLINSKII: Definition = Definition {
    repeatable: true,
    inverse: Inverse::None("its loops are not symmetric; fit backlash or prandtl-ishlinskii for a live machine"),
    n_states: N_STATES,
    parameters: &[
        JOINT,
        parameter("reach", "u", TRAVEL, 1.0, "half-width of the widest play"),
        parameter("bend", "1/u", [-1e6, 1e6], 0.0, "how much wider the loops are on one side"),
        parameter("centre", "u", [-1e6, 1e6], 0.0, "where the loops are as wide as without a bend"),
        parameter("weight1", "1", SHARE, 0.0, "share of the play of 0.1 reach; 0: none"),
        parameter("weight2", "1", SHARE, 0.0, "share of the play of 0.25 reach; 0: none"),
        parameter("weight3", "1", SHARE, 0.0, "share of the play of 0.5 reach; 0: none"),
        parameter("weight4", "1", SHARE, 0.0, "share of the widest play; 0: none"),
    ],
    ..effect(
        "generalised-prandtl-ishlinskii",
        Hook::Cmd,
        Class::ConstantHysteresis,
        "x <- x - sum_k weight_k (w - p_k), w = x + bend (x - centre)^2, p_k the play of w of 0.1, 0.25, 0.5, 1 reach",
    )
};

/// A play's place after a step; before the first one, its memory says where it begins, from -1 to 1 of its half-width.
fn play(state: f64, x: f64, half_width: f64, fresh: bool) -> f64 {
    super::play(if fresh { x + state * half_width } else { state }, x, half_width)
}

/// The position behind the hysteresis, and its memory of this step; before the first step the memory says where plays and
/// Bouc-Wen's z begin, from -1 to 1.
pub(super) fn change(kind: JointEffect, c: &[f64], x: f64, state: &mut [f64; N_STATES], now: &Now) -> f64 {
    match (kind, c) {
        (JointEffect::Backlash, [half_width, ..]) => {
            state[0] = play(state[0], x, *half_width, now.fresh);
            state[0]
        }
        (JointEffect::BoucWen, [amplitude, travel, gamma, ..]) => {
            let z = if now.fresh { state[0] } else { bouc_wen(state[0], x - state[1], *travel, *gamma) };
            (state[0], state[1]) = (z, x);
            x - amplitude * z
        }
        (JointEffect::PrandtlIshlinskii, [w1, r1, w2, r2, w3, r3, ..]) => {
            let mut changed = x;
            for (p, (weight, half_width)) in state.iter_mut().zip([(w1, r1), (w2, r2), (w3, r3)]) {
                *p = play(*p, x, *half_width, now.fresh);
                changed -= weight * (x - *p);
            }
            changed
        }
        (JointEffect::ConeFriction, [friction, ..]) => {
            let (a, b) = (x * (-friction).exp(), x * friction.exp());
            state[0] = if now.fresh { x } else { state[0].clamp(a.min(b), a.max(b)) };
            state[0]
        }
        (JointEffect::LoadFriction, [share, friction, ..]) => {
            state[0] = if now.fresh { x } else { load_play(state[0], x, *friction) };
            x - share * (x - state[0])
        }
        (JointEffect::GeneralisedPrandtlIshlinskii, [reach, bend, centre, weights @ ..]) => {
            let warped = x + bend * (x - centre).powi(2);
            let mut changed = x;
            for ((p, ratio), weight) in state.iter_mut().zip(REACHES).zip(weights) {
                *p = play(*p, warped, ratio * reach, now.fresh);
                changed -= weight * (warped - *p);
            }
            changed
        }
        _ => x,
    }
}

/// Play whose half-width is a share of the position: the friction grows with the load, and the load with the position.
#[inline]
pub fn load_play(p: f64, x: f64, friction: f64) -> f64 {
    let half_width = friction * x.abs();
    p.clamp(x - half_width, x + half_width)
}
