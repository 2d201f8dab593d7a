//! Effects on the displacement of each line for a shape: radius, unequal lines, clearance in the disks' holes.
//!
//! Radius and angles are constants of a chain: they replace J_q and, by virtual work, the division of the moment among the
//! lines. Clearance depends on the load and is added afterwards.

use super::EffectKind;
use super::definition::{Class, Definition, Hook, effect, parameter};
use super::operators::play;
use super::prepared::{Now, Prepared};
use super::real::{Real, Scalar};
use core::f64::consts::PI;

pub(super) static RADIUS_ERROR: Definition = Definition {
    also: &["pitch-radius", "radius"],
    parameters: &[parameter(
        "relative",
        "1",
        [-0.2, 0.2],
        0.0,
        "relative error of the pitch radius; 1 to 3 %, engineering",
    )],
    ..effect("radius-error", Hook::Geo, Class::Proportional, "q <- (1 + relative) q, and tau by virtual work")
};

pub(super) static UNEQUAL_LINES: Definition = Definition {
    parameters: &[
        parameter("angle2_rad", "rad", [-0.2, 0.2], 0.0, "error of line 2's angle; 1 to 3 deg, engineering"),
        parameter("angle3_rad", "rad", [-0.2, 0.2], 0.0, "error of line 3's angle; line 1 is the reference"),
        parameter("radius2", "1", [-0.2, 0.2], 0.0, "relative error of line 2's radius; 1 to 3 %, engineering"),
        parameter("radius3", "1", [-0.2, 0.2], 0.0, "relative error of line 3's radius"),
        parameter("compliance2", "1", [-0.5, 0.5], 0.0, "relative difference of line 2's compliance; 1 to 3 %"),
        parameter("compliance3", "1", [-0.5, 0.5], 0.0, "relative difference of line 3's compliance"),
    ],
    ..effect(
        "unequal-lines",
        Hook::Geo,
        Class::SecondHarmonic,
        "q_i = -r (1 + radius_i) b cos(delta_i + angle_i), compliance times (1 + compliance_i)",
    )
};

pub(super) static HOLE_CLEARANCE: Definition = Definition {
    also: &["clearance", "hole-play"],
    n_states: 3,
    parameters: &[
        parameter("clearance_m", "m", [0.0, 2e-4], 2e-5, "diametral clearance; 0.02 to 0.06 mm, engineering"),
        parameter(
            "load_n",
            "N",
            [0.01, 50.0],
            1.0,
            "change of load that carries a line across its hole; a start value",
        ),
    ],
    ..effect(
        "hole-clearance",
        Hook::Geo,
        Class::LoadHysteresis,
        "q_i <- q_i (1 + clearance/(2 r) sigma_i), sigma_i from -1 (|tau_i| falling) to 1 (rising) over a change of `load`",
    )
};

/// Multiplies the Jacobian J_q (rows: lines) and the lines' compliance factors by a geometric effect.
pub(crate) fn shape_jacobian<P: Real>(kind: EffectKind, c: &[P], j: &mut [[P; 2]; 3], compliance: &mut [P; 3]) {
    let one = P::constant(1.0);
    match kind {
        EffectKind::RadiusError => j.iter_mut().flatten().for_each(|entry| *entry = *entry * (one + c[0])),
        EffectKind::UnequalLines => {
            for (i, (angle, radius, softness)) in [(1, (c[0], c[2], c[4])), (2, (c[1], c[3], c[5]))] {
                let g = P::constant([0.0, 2.0, 4.0][i] * PI / 3.0);
                let row_norm = (j[0][0] * j[0][0] + j[0][1] * j[0][1]).sqrt() * (one + radius);
                j[i] = [-(row_norm * (g + angle).cos()), row_norm * (g + angle).sin()];
                compliance[i] = compliance[i] * (one + softness);
            }
        }
        _ => {}
    }
}

/// Adds clearance to the displacements, m.
#[inline]
pub(crate) fn apply<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    r_m: f64,
    tau: [S; 3],
    now: &Now,
    q: &mut [S; 3],
) {
    if e.kind != EffectKind::HoleClearance {
        return;
    }
    let half = e.c[1] * P::constant(0.5);
    for i in 0..3 {
        let load = tau[i].abs();
        let p = play(state[e.state + i], load, half, now.fresh);
        if now.commit {
            state[e.state + i] = p.settle();
        }
        let sigma = (load - p) * (P::constant(1.0) / half);
        q[i] += q[i] * sigma * (e.c[0] * P::constant(0.5 / r_m));
    }
}
