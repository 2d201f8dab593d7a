//! Effects that know the time: creep, latency, first-order lag, drift.

use super::{JOINT, JointEffect, N_STATES, Now};
use crate::effects::{Class, Definition, Hook, Inverse, Needs, effect, parameter, relax};

const SHARE: [f64; 2] = [-1.0, 1.0];
const SLOW_S: [f64; 2] = [0.1, 1e5];

pub(super) static CREEP: Definition = Definition {
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
    repeatable: true,
    needs: Needs::Time,
    inverse: Inverse::None("a command in the past"),
    parameters: &[JOINT, parameter("delay_s", "s", [0.0, 2.0], 0.0, "of drive or sensor; 0: none")],
    ..effect("latency", Hook::Cmd, Class::Rate, "x(t) <- x(t - delay)")
};

pub(super) static FIRST_ORDER_LAG: Definition = Definition {
    repeatable: true,
    needs: Needs::Time,
    inverse: Inverse::None("the rate of the command would be needed"),
    n_states: 1,
    parameters: &[JOINT, parameter("time_s", "s", [0.0, 100.0], 0.0, "of the drive or its filter; 0: none")],
    ..effect("first-order-lag", Hook::Cmd, Class::Rate, "x <- l, dl/dt = (x - l) / time")
};

pub(super) static DRIFT: Definition = Definition {
    repeatable: true,
    needs: Needs::Time,
    parameters: &[
        JOINT,
        parameter("size", "y", [-1e6, 1e6], 0.0, "where it ends; 0: none"),
        parameter("rise_time_s", "s", [1.0, 1e6], 600.0, "warming up: minutes"),
    ],
    ..effect("drift", Hook::Meas, Class::Drift, "y <- y + size (1 - e^(-t / rise_time)), t since the trial began")
};

/// The position behind the effect, and its memory of this step. Latency is the chain's, which keeps the past.
pub(super) fn change(kind: JointEffect, c: &[f64], x: f64, state: &mut [f64; N_STATES], now: &Now) -> f64 {
    match (kind, c) {
        (JointEffect::Creep, [a1, t1, a2, t2, ..]) => {
            state[0] = relax(state[0], a1 * x, *t1, now.dt_s, now.fresh);
            state[1] = relax(state[1], a2 * x, *t2, now.dt_s, now.fresh);
            x - state[0] - state[1]
        }
        (JointEffect::FirstOrderLag, [time, ..]) => {
            state[0] = if *time > 0.0 { relax(state[0], x, *time, now.dt_s, now.fresh) } else { x };
            state[0]
        }
        (JointEffect::Drift, [size, rise, ..]) => x + size * (1.0 - (-now.elapsed_s / rise).exp()),
        _ => x,
    }
}
