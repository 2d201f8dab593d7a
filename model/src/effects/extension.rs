//! Effects on the extension of each line: compliance, extension inside the snake, asymmetry, buckling, hysteresis, creep, temperature, coupling.

use super::EffectKind;
use super::definition::{Class, Definition, Hook, Needs, effect, parameter};
use super::friction::{Limits, add};
use super::operators::{bouc_wen, play, relax};
use super::prepared::{Constants, Now, Prepared};
use super::real::{Real, Scalar};
use core::f64::consts::PI;

pub(super) static ACTUATOR_COMPLIANCE: Definition = Definition {
    also: &["compliance", "elasticity"],
    parameters: &[parameter(
        "compliance_m_per_n",
        "m/N",
        [0.0, 1e-4],
        5e-6,
        "gears, screw, clamp; 1e-6 to 2e-5, engineering",
    )],
    ..effect("actuator-compliance", Hook::Eps, Class::Proportional, "eps += compliance tau~")
};

pub(super) static INSIDE_EXTENSION: Definition = Definition {
    parameters: &[parameter(
        "share",
        "1",
        [0.0, 1.5],
        1.0,
        "share of the snake's load that lines carry along it; 1 if eta is stiffness, (1 + 1/eta)/2 if it rubs at the disks, unverified",
    )],
    ..effect("inside-extension", Hook::Eps, Class::Proportional, "eps_i += share tau_i (L + q_i)/(E A)")
};

pub(super) static BOUC_WEN: Definition = Definition {
    also: &["hysteresis"],
    n_states: 6,
    repeatable: true,
    parameters: &[
        parameter("amplitude_m", "m", [0.0, 2e-3], 9e-5, "extension at saturation; the measured play's half-width"),
        parameter("transition_m", "m", [1e-6, 5e-3], 1e-4, "travel of q over which it builds up; a start value")
            .fixed("a threshold"),
        parameter("gamma", "1", [-1.0, 0.5], 0.0, "asymmetry of loading and unloading; beta = 1 - gamma"),
    ],
    ..effect(
        "bouc-wen",
        Hook::Eps,
        Class::ConstantHysteresis,
        "eps += amplitude z, dz = (dq - beta |dq| z - gamma dq |z|) / transition",
    )
};

pub(super) static PRANDTL_ISHLINSKII: Definition = Definition {
    also: &["hysteresis"],
    n_states: 24,
    parameters: &[
        parameter("reach_m", "m", [1e-6, 5e-3], 5e-4, "largest threshold; a start value").fixed("a threshold"),
        parameter("w1", "1", [0.0, 5.0], 0.04, "weight of threshold 1/8 reach; a start value"),
        parameter("w2", "1", [0.0, 5.0], 0.04, "weight of threshold 2/8 reach; a start value"),
        parameter("w3", "1", [0.0, 5.0], 0.04, "weight of threshold 3/8 reach; a start value"),
        parameter("w4", "1", [0.0, 5.0], 0.04, "weight of threshold 4/8 reach; a start value"),
        parameter("w5", "1", [0.0, 5.0], 0.04, "weight of threshold 5/8 reach; a start value"),
        parameter("w6", "1", [0.0, 5.0], 0.04, "weight of threshold 6/8 reach; a start value"),
        parameter("w7", "1", [0.0, 5.0], 0.04, "weight of threshold 7/8 reach; a start value"),
        parameter("w8", "1", [0.0, 5.0], 0.04, "weight of threshold reach; a start value"),
    ],
    ..effect(
        "prandtl-ishlinskii",
        Hook::Eps,
        Class::ConstantHysteresis,
        "eps += sum w_k (q - p_k), p_k the play of half-width k/8 reach driven by q",
    )
};

pub(super) static TENSION_COMPRESSION_ASYMMETRY: Definition = Definition {
    also: &["asymmetry"],
    parameters: &[parameter("a", "1", [-0.5, 0.5], 0.05, "relative difference of the compliances; a start value")],
    ..effect("tension-compression-asymmetry", Hook::Eps, Class::Asymmetry, "eps -= a |L_d/(E A) tau + L_c/(E A) tau~|")
};

pub(super) static LINE_BUCKLING: Definition = Definition {
    also: &["buckling"],
    parameters: &[parameter(
        "clearance_m",
        "m",
        [0.0, 1e-3],
        1e-4,
        "radial clearance in the holder's bore; a start value",
    )],
    ..effect("line-buckling", Hook::Eps, Class::Asymmetry, "eps += clearance^2 L_d/(4 E I) max(tau, 0)")
};

pub(super) static CREEP: Definition = Definition {
    also: &["relaxation", "viscoelasticity"],
    needs: Needs::Time,
    n_states: 9,
    parameters: &[
        parameter("a1", "1", [0.0, 0.5], 0.05, "share of the elastic extension; 1 to 10 %, unverified"),
        parameter("t1_s", "s", [0.1, 1e5], 10.0, "its time; 1 to 300 s, unverified"),
        parameter("a2", "1", [0.0, 0.5], 0.0, "second share"),
        parameter("t2_s", "s", [0.1, 1e5], 100.0, "its time"),
        parameter("a3", "1", [0.0, 0.5], 0.0, "third share"),
        parameter("t3_s", "s", [0.1, 1e5], 1000.0, "its time"),
    ],
    ..effect("creep", Hook::Eps, Class::Rest, "eps += sum x_k, dx_k/dt = (a_k (1/K_d + 1/K_c) tau - x_k) / t_k")
};

pub(super) static THERMAL_DRIFT: Definition = Definition {
    also: &["temperature", "drift"],
    needs: Needs::Time,
    parameters: &[
        parameter(
            "modulus_per_k",
            "1/K",
            [-0.05, 0.05],
            0.005,
            "growth of the snake's stiffness; 0.3 to 1 %/K, unverified",
        ),
        parameter("line1_m_per_k", "m/K", [-1e-4, 1e-4], 5.28e-6, "expansion of line 1: 11e-6/K times 480 mm"),
        parameter("line2_m_per_k", "m/K", [-1e-4, 1e-4], 5.28e-6, "expansion of line 2"),
        parameter("line3_m_per_k", "m/K", [-1e-4, 1e-4], 5.28e-6, "expansion of line 3"),
        parameter("reference_c", "deg C", [-20.0, 100.0], 20.0, "temperature at calibration, where the column exists")
            .fixed("a reference"),
        parameter("rise_k", "K", [-100.0, 100.0], 17.0, "final rise, where the column is missing; room to body"),
        parameter("rise_time_s", "s", [1.0, 1e5], 600.0, "time of the rise; a start value"),
    ],
    ..effect(
        "thermal-drift",
        Hook::Eps,
        Class::Drift,
        "eps_i += (modulus (1/K_d + 1/K_c) tau_i + line_i) dT, dT = T - reference, or rise (1 - e^(-t/rise_time))",
    )
};

pub(super) static CROSS_COUPLING: Definition = Definition {
    also: &["crosstalk", "coupling"],
    parameters: &[
        parameter("k12", "1", [-0.4, 0.4], 0.0, "what line 1 takes up when line 2 moves"),
        parameter("k13", "1", [-0.4, 0.4], 0.0, "what line 1 takes up when line 3 moves"),
        parameter("k21", "1", [-0.4, 0.4], 0.0, "what line 2 takes up when line 1 moves"),
        parameter("k23", "1", [-0.4, 0.4], 0.0, "what line 2 takes up when line 3 moves"),
        parameter("k31", "1", [-0.4, 0.4], 0.0, "what line 3 takes up when line 1 moves"),
        parameter("k32", "1", [-0.4, 0.4], 0.0, "what line 3 takes up when line 2 moves"),
    ],
    ..effect("cross-coupling", Hook::Eps, Class::Coupling, "eps_i += sum over j of k_ij q_j")
};

/// Adds the lines' extension inside the snake to the displacements at its base, m. `shape` are those of the bent arc alone;
/// `c_d` the compliances of the lines in the holder, of the length L_d, m/N: the same tubes go on into the snake.
#[inline]
pub(crate) fn apply_inside<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    machine: &Constants,
    c_d: &[P; 3],
    shape: &[S; 3],
    tau: &[S; 3],
    q: &mut [S; 3],
) {
    if e.kind != EffectKind::InsideExtension {
        return;
    }
    for i in 0..3 {
        let length = shape[i] + P::constant(machine.l_m);
        q[i] += tau[i] * length * (e.c[0] * c_d[i] * P::constant(1.0 / machine.l_d_m));
    }
}

/// What extension effects look at.
pub(crate) struct Lines<'a, S> {
    pub q: [S; 3],
    /// Loads at the snake.
    pub tau: [S; 3],
    /// Loads in the holder.
    pub holder: &'a [Limits<S>; 3],
    /// Mean loads along the cone.
    pub cone: &'a [Limits<S>; 3],
    /// Loads at the actuator.
    pub actuator: &'a [Limits<S>; 3],
}

/// Adds an effect to the extensions, m, of lines about to be drawn back (low) and pushed (high).
#[inline]
pub(crate) fn apply<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    machine: &Constants,
    lines: &Lines<S>,
    now: &Now,
    eps: &mut [Limits<S>; 3],
) {
    let elastic = P::constant(machine.c_d_m_per_n + machine.c_c_m_per_n);
    for i in 0..3 {
        let (holder, cone, actuator) = (&lines.holder[i], &lines.cone[i], &lines.actuator[i]);
        match e.kind {
            EffectKind::ActuatorCompliance => {
                eps[i].low += actuator.low * e.c[0];
                eps[i].high += actuator.high * e.c[0];
            }
            EffectKind::TensionCompressionAsymmetry => {
                let stretch = |d: S, c: S| d * P::constant(machine.c_d_m_per_n) + c * P::constant(machine.c_c_m_per_n);
                eps[i].low = eps[i].low - stretch(holder.low, cone.low).abs() * e.c[0];
                eps[i].high = eps[i].high - stretch(holder.high, cone.high).abs() * e.c[0];
            }
            EffectKind::LineBuckling => {
                let buckled = |load: S| if load.value() > 0.0 { load * e.c[0] } else { S::constant(0.0) };
                eps[i].low += buckled(holder.low);
                eps[i].high += buckled(holder.high);
            }
            EffectKind::BoucWen => add(&mut eps[i], micro_slip(e, state, i, lines.q[i], now)),
            EffectKind::PrandtlIshlinskii => add(&mut eps[i], plays(e, state, i, lines.q[i], now)),
            EffectKind::Creep => add(&mut eps[i], crept(e, state, i, lines.tau[i] * elastic, now)),
            EffectKind::ThermalDrift => {
                let rise = S::lift(temperature_rise(e, now));
                add(&mut eps[i], (lines.tau[i] * (e.c[0] * elastic) + e.c[1 + i]) * rise);
            }
            EffectKind::CrossCoupling => {
                let (j, k) = [(1, 2), (0, 2), (0, 1)][i];
                add(&mut eps[i], lines.q[j] * e.c[2 * i] + lines.q[k] * e.c[2 * i + 1]);
            }
            EffectKind::StemCoupling => {
                let azimuth = e.c[2] + P::constant([0.0, 2.0, 4.0][i] * PI / 3.0);
                // Without an angle nothing is known of the stem.
                let angle_rad = now.stem_angle_rad().unwrap_or(0.0);
                add(&mut eps[i], S::lift(e.c[1] * azimuth.cos() * P::constant(angle_rad)));
            }
            _ => {}
        }
    }
}

fn micro_slip<P: Real, S: Scalar<P>>(e: &Prepared<P>, state: &mut [P], i: usize, q: S, now: &Now) -> S {
    let (z, q_before) = (state[e.state + i], state[e.state + 3 + i]);
    let z = if now.fresh { S::constant(0.0) } else { bouc_wen(z, q - q_before, e.c[1], e.c[2]) };
    if now.commit {
        state[e.state + i] = z.settle();
        state[e.state + 3 + i] = q.settle();
    }
    z * e.c[0]
}

fn plays<P: Real, S: Scalar<P>>(e: &Prepared<P>, state: &mut [P], i: usize, q: S, now: &Now) -> S {
    let mut sum = S::constant(0.0);
    let mut share = 0.0;
    for k in 0..8 {
        share += 0.125;
        let own = &mut state[e.state + 8 * i + k];
        let p = play(*own, q, e.c[0] * P::constant(share), now.fresh);
        if now.commit {
            *own = p.settle();
        }
        sum += (q - p) * e.c[1 + k];
    }
    sum
}

fn crept<P: Real, S: Scalar<P>>(e: &Prepared<P>, state: &mut [P], i: usize, stretch: S, now: &Now) -> S {
    let mut sum = S::constant(0.0);
    for k in 0..3 {
        let own = &mut state[e.state + 3 * i + k];
        let x = relax(*own, stretch * e.c[2 * k], e.c[2 * k + 1], now.dt_s, now.fresh);
        if now.commit {
            *own = x.settle();
        }
        sum += x;
    }
    sum
}

fn temperature_rise<P: Real>(e: &Prepared<P>, now: &Now) -> P {
    if let Some(temperature_c) = now.temperature_c() {
        return P::constant(temperature_c) - e.c[4];
    }
    e.c[5] * (P::constant(1.0) - (P::constant(-now.time_s) / e.c[6]).exp())
}
