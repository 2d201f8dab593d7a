//! Effects that know the time: creep, latency, lags of first and second order, rate limit, drifts.

use super::{JOINT, JointEffect, N_STATES, Now};
use crate::effects::{Class, Definition, Hook, Inverse, Needs, effect, parameter, relax};

const SHARE: [f64; 2] = [-1.0, 1.0];
const SLOW_S: [f64; 2] = [0.1, 1e5];

pub(super) static CREEP: Definition = Definition {
    also: &["relaxation", "viscoelasticity"],
    repeatable: true,
    needs: Needs::Time,
    n_states: 2,
    parameters: &[
        JOINT,
        parameter("a1", "1", SHARE, 0.0, "share that is given back over t1_s; 0: none"),
        parameter("t1_s", "s", SLOW_S, 10.0, "polymer liners: 1 to 300 s, unverified"),
        parameter("a2", "1", SHARE, 0.0, "share that is given back over t2_s; 0: none"),
        parameter("t2_s", "s", SLOW_S, 100.0, "as t1_s"),
    ],
    ..effect("creep", Hook::Cmd, Class::Rest, "x <- x - sum_k c_k, dc_k/dt = (a_k x - c_k) / t_k")
};

pub(super) static LATENCY: Definition = Definition {
    also: &["delay", "dead-time", "time-delay"],
    repeatable: true,
    needs: Needs::Time,
    inverse: Inverse::None("a command in the past"),
    parameters: &[JOINT, parameter("delay_s", "s", [0.0, 2.0], 0.0, "of drive or sensor; 0: none")],
    ..effect("latency", Hook::Cmd, Class::Rate, "x(t) <- x(t - delay)")
};

pub(super) static FIRST_ORDER_LAG: Definition = Definition {
    also: &["lag", "low-pass"],
    repeatable: true,
    needs: Needs::Time,
    inverse: Inverse::None("the rate of the command would be needed"),
    n_states: 2,
    parameters: &[JOINT, parameter("time_s", "s", [0.0, 100.0], 0.0, "of the drive or its filter; 0: none")],
    ..effect("first-order-lag", Hook::Cmd, Class::Rate, "x <- l, dl/dt = (x - l) / time")
};

pub(super) static DRIFT: Definition = Definition {
    also: &["temperature", "thermal-drift"],
    repeatable: true,
    needs: Needs::Time,
    parameters: &[
        JOINT,
        parameter("size", "y", [-1e6, 1e6], 0.0, "where it ends; 0: none"),
        parameter("rise_time_s", "s", [1.0, 1e6], 600.0, "warming up: minutes"),
    ],
    ..effect("drift", Hook::Meas, Class::Drift, "y <- y + size (1 - e^(-t / rise_time)), t since the trial began")
};

pub(super) static SECOND_ORDER: Definition = Definition {
    also: &["resonance", "oscillation"],
    repeatable: true,
    needs: Needs::Time,
    inverse: Inverse::None("the acceleration of the command would be needed"),
    n_states: 3,
    parameters: &[
        JOINT,
        parameter("frequency_rad_per_s", "rad/s", [0.0, 1e5], 0.0, "natural frequency of the drive's loop; 0: none"),
        parameter("damping", "1", [0.01, 100.0], 1.0, "damping ratio; 1: no overshoot"),
    ],
    ..effect(
        "second-order",
        Hook::Cmd,
        Class::Rate,
        "x <- l, d2l/dt2 = frequency^2 (x - l) - 2 damping frequency dl/dt",
    )
};

pub(super) static RATE_LIMIT: Definition = Definition {
    also: &["speed-limit"],
    repeatable: true,
    needs: Needs::Time,
    inverse: Inverse::None("no command moves a drive faster than it can"),
    n_states: 1,
    parameters: &[JOINT, parameter("rate", "u/s", [0.0, NO_LIMIT], NO_LIMIT, "largest speed; 1e9: none")],
    ..effect("rate-limit", Hook::Cmd, Class::Rate, "x <- l, l goes towards x by at most rate dt")
};

/// A speed beyond every command's.
const NO_LIMIT: f64 = 1e9;

pub(super) static LINEAR_DRIFT: Definition = Definition {
    also: &["slip"],
    repeatable: true,
    needs: Needs::Time,
    parameters: &[JOINT, parameter("rate", "y/s", [-1e6, 1e6], 0.0, "0: none")],
    ..effect("linear-drift", Hook::Meas, Class::Drift, "y <- y + rate t, t since the trial began")
};

/// A first-order lag behind an input that goes straight from `from` to `to` in `dt_s`: exact, so that a slow sampling does not
/// change the time. `decay` is e^(-dt / time).
#[inline]
pub fn lag_step(l: f64, from: f64, to: f64, time_s: f64, dt_s: f64, decay: f64) -> f64 {
    if dt_s <= 0.0 {
        return l;
    }
    let behind = (to - from) / dt_s * time_s;
    to - behind + (l - from + behind) * decay
}

/// A second-order system's position and speed behind an input that goes straight from `from` to `to` in `dt_s`; `matrix` is
/// that of [`second_order_step`].
#[inline]
pub fn second_order_ramp(
    [position, speed]: [f64; 2],
    [from, to]: [f64; 2],
    [frequency, damping]: [f64; 2],
    dt_s: f64,
    [a, b, c, d]: [f64; 4],
) -> [f64; 2] {
    if dt_s <= 0.0 {
        return [position, speed];
    }
    let slope = (to - from) / dt_s;
    let behind = 2.0 * damping / frequency * slope;
    let (off, faster) = (position - from + behind, speed - slope);
    [to - behind + a * off + b * faster, slope + c * off + d * faster]
}

/// How a second-order system goes from (l - x, dl/dt) over a step in which x is held: a matrix, row after row.
pub fn second_order_step(frequency: f64, damping: f64, dt_s: f64) -> [f64; 4] {
    let (w, z) = (frequency, damping);
    let decay = (-z * w * dt_s).exp();
    let discriminant = z * z - 1.0;
    // cosine and sine(t)/rate of the damped motion, or what they become without oscillation.
    let (c, s) = if discriminant.abs() < 1e-8 {
        (1.0, dt_s)
    } else if discriminant < 0.0 {
        let rate = w * (-discriminant).sqrt();
        ((rate * dt_s).cos(), (rate * dt_s).sin() / rate)
    } else {
        let rate = w * discriminant.sqrt();
        // cosh and sinh overflow where the decay has long vanished.
        let (up, down) = (((rate - z * w) * dt_s).exp(), ((-rate - z * w) * dt_s).exp());
        let (c, s) = (0.5 * (up + down), 0.5 * (up - down) / rate);
        return [c + z * w * s, s, -w * w * s, c - z * w * s];
    };
    [decay * (c + z * w * s), decay * s, -decay * w * w * s, decay * (c - z * w * s)]
}

/// The position behind the effect, and its memory of this step. Latency is the chain's, which keeps the past.
pub(super) fn change(kind: JointEffect, c: &[f64], x: f64, state: &mut [f64; N_STATES], now: &Now) -> f64 {
    match (kind, c) {
        (JointEffect::Creep, [a1, t1, a2, t2, ..]) => {
            state[0] = relax(state[0], a1 * x, *t1, now.dt_s, now.fresh);
            state[1] = relax(state[1], a2 * x, *t2, now.dt_s, now.fresh);
            x - state[0] - state[1]
        }
        (JointEffect::FirstOrderLag, [time, ..]) => {
            let straight = *time > 0.0 && !now.fresh;
            let decay = (-now.dt_s / time).exp();
            state[0] = if straight { lag_step(state[0], state[1], x, *time, now.dt_s, decay) } else { x };
            state[1] = x;
            state[0]
        }
        (JointEffect::SecondOrder, [frequency, damping, ..]) => {
            if now.fresh || *frequency <= 0.0 {
                (state[0], state[1]) = (x, 0.0);
            } else {
                let matrix = second_order_step(*frequency, *damping, now.dt_s);
                let [here, ramp, own] = [[state[0], state[1]], [state[2], x], [*frequency, *damping]];
                [state[0], state[1]] = second_order_ramp(here, ramp, own, now.dt_s, matrix);
            }
            state[2] = x;
            state[0]
        }
        (JointEffect::RateLimit, [rate, ..]) => {
            let most = rate * now.dt_s;
            state[0] = if now.fresh { x } else { state[0] + (x - state[0]).clamp(-most, most) };
            state[0]
        }
        (JointEffect::LinearDrift, [rate, ..]) => x + rate * now.elapsed_s,
        (JointEffect::Drift, [size, rise, ..]) => x + size * (1.0 - (-now.elapsed_s / rise).exp()),
        _ => x,
    }
}
