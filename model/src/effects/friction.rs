//! Effects on the load of each line on its way from the snake to the actuator.
//!
//! While a line sticks, its load at the actuator may be anything between two limits: that of a line that is just about to be
//! drawn back and that of one that is about to be pushed. Each friction widens this interval; (low, high) travel together.

use super::EffectKind;
use super::definition::{Class, Definition, Hook, Inverse, Needs, effect, parameter};
use super::prepared::{Now, Prepared};
use super::real::{Real, Scalar};
use core::ops::Mul;

/// Limits of a line's load, N, push positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits<S> {
    /// Drawn back.
    pub low: S,
    /// Pushed.
    pub high: S,
}

pub(super) static DISK_FRICTION: Definition = Definition {
    also: &["hole-friction"],
    inverse: Inverse::Smoothed,
    parameters: &[parameter("mu", "1", [0.0, 1.0], 0.1, "friction at the spacer disks; 0.05 to 0.2, unverified")],
    ..effect(
        "disk-friction",
        Hook::Tau,
        Class::LoadHysteresis,
        "tau <- tau e^(+-mu b), + while the line moves against its load",
    )
};

pub(super) static CONE_FRICTION: Definition = Definition {
    also: &[
        "capstan",
        "capstan-friction",
        "eytelwein",
        "slip",
        "friction",
        "coulomb-friction",
        "coulomb",
        "dry-friction",
    ],
    inverse: Inverse::Smoothed,
    parameters: &[parameter("mu", "1", [0.0, 1.0], 0.1727, "Eq. (13), Table II")],
    ..effect(
        "cone-friction",
        Hook::Tau,
        Class::LoadHysteresis,
        "tau~ <- tau~ e^(+-2 mu phi), + while the line moves against its load",
    )
};

pub(super) static DISTRIBUTED_CAPSTAN: Definition = Definition {
    also: &["capstan", "capstan-friction"],
    inverse: Inverse::Smoothed,
    parameters: &[
        parameter("mu", "1", [0.0, 1.0], 0.1727, "Eq. (13), Table II"),
        parameter(
            "arc_share",
            "1",
            [0.0, 1.0],
            0.4935,
            "share of L_c that lies in the cone's two bends, 2 R phi/L_c; R = 20 mm",
        )
        .fixed("a dimension"),
    ],
    ..effect(
        "distributed-capstan",
        Hook::Tau,
        Class::LoadHysteresis,
        "tau~ <- tau e^(+-2 mu phi), and the cone gives m_+- tau/K_c, m the mean of e^(+-mu theta) along it",
    )
};

/// The mean load along the cone over the load at its end at the snake, where each of its two bends multiplies the load by e^u and
/// `arc_share` of its length lies in them.
pub(super) fn mean_along_cone<P: Real>(u: P, arc_share: P) -> P {
    let bend = u.exp();
    // (e^u - 1)/u, the mean over one bend.
    let x = u.value();
    let mean = if x.abs() < 1e-4 {
        u.chain(1.0 + x / 2.0 + x * x / 6.0, 0.5 + x / 3.0 + x * x / 8.0)
    } else {
        let mean = x.exp_m1() / x;
        u.chain(mean, (bend.value() - mean) / x)
    };
    let one = P::constant(1.0);
    mean * (one + bend) * arc_share * P::constant(0.5) + bend * (one - arc_share)
}

pub(super) static STATIC_FRICTION: Definition = Definition {
    also: &["coulomb-friction", "friction", "coulomb", "stiction", "dry-friction"],
    inverse: Inverse::Smoothed,
    parameters: &[parameter(
        "f_s_n",
        "N",
        [0.0, 100.0],
        1.959,
        "Eq. (13), Table II with g = 10 m/s2 (1.921 with 9.80665)",
    )],
    ..effect("static-friction", Hook::Tau, Class::ConstantHysteresis, "tau~ <- tau~ + f_s s, s the sign of motion")
};

pub(super) static STEM_COUPLING: Definition = Definition {
    inverse: Inverse::Smoothed,
    needs: Needs::StemAngle,
    parameters: &[
        parameter("mu", "1", [0.0, 1.0], 0.1727, "friction in the stem; the cone's, Table II"),
        parameter("radius_m", "m", [0.0, 0.02], 1.684e-3, "pitch radius of the lines in the stem; the snake's"),
        parameter("azimuth_rad", "rad", [-3.15, 3.15], 0.0, "plane in which the stem is bent; a start value"),
    ],
    ..effect(
        "stem-coupling",
        Hook::Tau,
        Class::Stem,
        "tau~ <- tau~ e^(+-mu |phi_s|); eps_i += radius phi_s cos(azimuth + (i-1) 120 deg)",
    )
};

pub(super) static VISCOUS_FRICTION: Definition = Definition {
    also: &["damping", "viscous", "drag"],
    needs: Needs::Time,
    n_states: 3,
    parameters: &[parameter(
        "coefficient_n_s_per_m",
        "N s/m",
        [0.0, 1e5],
        280.0,
        "0.02 mm of extension per mm/s through the compliance of a line; a start value",
    )],
    ..effect("viscous-friction", Hook::Tau, Class::Rate, "tau <- tau + coefficient dq/dt")
};

pub(super) static STRIBECK_FRICTION: Definition = Definition {
    also: &["stick-slip", "stribeck", "breakaway", "stiction"],
    needs: Needs::Time,
    n_states: 6,
    parameters: &[
        parameter("f_c_n", "N", [0.0, 20.0], 1.0, "sliding friction; 0.5 to 2 N, unverified"),
        parameter("breakaway", "1", [1.0, 2.0], 1.3, "F_s/F_c at rest; 1.1 to 1.5, unverified"),
        parameter("presliding_m", "m", [1e-6, 1e-3], 3e-5, "F_c / s0; 10 to 50 um, unverified").fixed("a threshold"),
        parameter("v_s_m_per_s", "m/s", [1e-5, 0.1], 3e-4, "Stribeck speed; 0.1 to 1 mm/s, unverified")
            .fixed("a threshold"),
    ],
    ..effect(
        "stribeck-friction",
        Hook::Tau,
        Class::ConstantHysteresisAndRate,
        "tau <- tau + F_c z, z <- z_s + (z - z_s) e^(-|dq|/(presliding G)), z_s = G sgn dq, G = 1 + (breakaway - 1) e^(-(v/v_s)^2)",
    )
};

/// Limits after an effect that acts in or before the holder; `q` is the displacement of the line at the snake.
#[inline]
pub(crate) fn apply_at_snake<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    b: [S; 2],
    q: [S; 3],
    now: &Now,
    limits: &mut [Limits<S>; 3],
) {
    match e.kind {
        EffectKind::DiskFriction => {
            let g = ((b[0] * b[0] + b[1] * b[1]).sqrt() * e.c[0]).exp();
            let inverse = S::constant(1.0) / g;
            limits.iter_mut().for_each(|line| widen(line, g, inverse));
        }
        EffectKind::ViscousFriction => {
            for i in 0..3 {
                let v = if now.dt_s > 0.0 {
                    (q[i] - state[e.state + i]) * P::constant(1.0 / now.dt_s)
                } else {
                    S::constant(0.0)
                };
                let v = if now.fresh { S::constant(0.0) } else { v };
                add(&mut limits[i], v * e.c[0]);
                if now.commit {
                    state[e.state + i] = q[i].settle();
                }
            }
        }
        EffectKind::StribeckFriction => (0..3).for_each(|i| {
            let z = bristle(e, [state[e.state + i], state[e.state + 3 + i]], q[i], now);
            add(&mut limits[i], z * e.c[0]);
            if now.commit {
                state[e.state + i] = z.settle();
                state[e.state + 3 + i] = q[i].settle();
            }
        }),
        _ => {}
    }
}

/// A capstan: what moves against its load needs more, what moves with it keeps less.
#[inline(always)]
fn widen<S: Real + Mul<F, Output = S>, F: Copy>(line: &mut Limits<S>, more: F, less: F) {
    line.high = line.high * if line.high.value() >= 0.0 { more } else { less };
    line.low = line.low * if line.low.value() <= 0.0 { more } else { less };
}

pub(crate) fn add<S: Real>(line: &mut Limits<S>, load: S) {
    line.low += load;
    line.high += load;
}

/// LuGre's bristle in units of its sliding force, over one step, exactly for a constant speed.
fn bristle<P: Real, S: Scalar<P>>(e: &Prepared<P>, [z, q_before]: [P; 2], q: S, now: &Now) -> S {
    if now.fresh {
        return S::constant(0.0);
    }
    let dq = q - q_before;
    let slow = if now.dt_s > 0.0 {
        let ratio = dq * (P::constant(1.0 / now.dt_s) / e.c[3]);
        (-(ratio * ratio)).exp()
    } else {
        S::constant(1.0)
    };
    let g = slow * (e.c[1] - P::constant(1.0)) + P::constant(1.0);
    let sign = if dq.value() < 0.0 { -1.0 } else { 1.0 };
    let settled = g * P::constant(sign);
    let travel = dq * P::constant(sign) * (P::constant(1.0) / e.c[2]);
    let decay = (-(travel / g)).exp();
    settled + (S::lift(z) - settled) * decay
}
