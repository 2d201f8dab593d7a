//! The step of a chain with load scale, play, static and cone friction, written straight-line: what the chain is compared with.
//!
//! Everything that the chain's step gives and checks, in closed form, without effects, traits or numbers with tangents.

#![allow(dead_code, reason = "each user uses its own part")]

use krait_model::{ChainCommand, ChainStatus, Circumstances, MachineParameters};
use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, Vector2, Vector3};
use std::f64::consts::PI;

pub struct StraightLine {
    pub eta: f64,
    pub half_width_m: f64,
    pub f_s_n: f64,
    pub transition_m: f64,
    g: f64,
    l_m: f64,
    stiffness_nm2: f64,
    c_d: f64,
    c_c: f64,
    strain_per_rad: f64,
    max_bend_rad: f64,
    j_q: Matrix3x2<f64>,
    j: Matrix2x3<f64>,
    friction_travel_m: f64,
    play_travel_m: f64,
    friction_signs: Vector3<f64>,
    play_signs: Vector3<f64>,
    seat_m: Vector3<f64>,
    middle_m: Vector3<f64>,
    half_m: Vector3<f64>,
    time_s: f64,
    last: ChainCommand,
}

impl StraightLine {
    pub fn new(m: &MachineParameters, eta: f64, half_width_m: f64, f_s_n: f64, mu: f64, transition_m: f64) -> Self {
        let ea = m.e_pa * PI / 4.0 * (m.d_outer_m.powi(2) - m.d_inner_m.powi(2));
        let stiffness_nm2 = m.e_pa * PI / 64.0 * (m.d_outer_m.powi(4) - m.d_inner_m.powi(4));
        let (c, s) = (0.5, 3.0_f64.sqrt() / 2.0);
        let j_q = Matrix3x2::new(-1.0, 0.0, c, s, c, -s) * m.r_m;
        let (g, c_d, c_c) = ((2.0 * mu * m.phi_rad).exp(), m.l_d_m / ea, m.l_c_m / ea);
        let k = eta * 2.0 / (3.0 * m.r_m * m.r_m) * 4.0 * stiffness_nm2 / m.l_m;
        let middle = 0.5 * (g + 1.0 / g);
        Self {
            eta,
            half_width_m,
            f_s_n,
            transition_m,
            g,
            l_m: m.l_m,
            stiffness_nm2,
            c_d,
            c_c,
            strain_per_rad: 0.5 * m.d_outer_m / m.l_m,
            max_bend_rad: (0.04 * 2.0 * m.l_m / m.d_outer_m).min(0.999 * PI),
            j_q,
            j: j_q.transpose() * (2.0 / (3.0 * m.r_m * m.r_m)),
            friction_travel_m: transition_m * (1.0 + k * c_d),
            // With f_s both limits lie on the loading branch at no load.
            play_travel_m: transition_m * (1.0 + k * (c_d + c_c * if f_s_n > 0.0 { g } else { middle })),
            friction_signs: Vector3::zeros(),
            play_signs: Vector3::zeros(),
            seat_m: Vector3::zeros(),
            middle_m: Vector3::zeros(),
            half_m: Vector3::repeat(g * f_s_n * c_c),
            time_s: 0.0,
            last: four().compensator().unwrap().step(Vector2::zeros(), &Circumstances::at(0.0)),
        }
    }

    pub fn step(&mut self, bend_rad: Vector2<f64>, at: &Circumstances) -> ChainCommand {
        if !(bend_rad.x.is_finite() && bend_rad.y.is_finite()) {
            self.last.status = ChainStatus::NotFinite;
            return self.last;
        }
        self.time_s = if at.time_s > self.time_s { at.time_s } else { self.time_s };
        let (mut b, mut status) = (bend_rad, ChainStatus::Good);
        if b.norm_squared() > self.max_bend_rad * self.max_bend_rad {
            status = ChainStatus::BeyondStrain { strain: b.norm() * self.strain_per_rad, limit: 0.04 };
            b *= self.max_bend_rad / b.norm();
        }
        let q_m = self.j_q * b;
        let inverse = q_m.map(|q| 1.0 / (self.l_m + q));
        let sum = 1.0 / self.l_m + inverse.sum();
        let slope = self.j_q.transpose() * inverse.map(|x| -x * x);
        let moment = (b * sum + slope * (0.5 * b.norm_squared())) * (self.stiffness_nm2 * self.eta);
        let tau_n = self.j.transpose() * moment;

        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for i in 0..3 {
            let (cube, x, y) = (inverse[i] * inverse[i] * inverse[i], self.j_q[(i, 0)], self.j_q[(i, 1)]);
            (xx, xy, yy) = (xx + cube * x * x, xy + cube * x * y, yy + cube * y * y);
        }
        let square = b.norm_squared();
        let mixed = b.x * slope.y + b.y * slope.x + square * xy;
        let hessian = Matrix2::new(
            sum + 2.0 * b.x * slope.x + square * xx,
            mixed,
            mixed,
            sum + 2.0 * b.y * slope.y + square * yy,
        ) * (self.stiffness_nm2 * self.eta);
        let j_tau = self.j.transpose() * hessian;

        let (mut q_tilde_m, mut tau_tilde_n, mut alpha) = (q_m, tau_n, j_tau);
        for i in 0..3 {
            let (x_high, x_low) = (tau_n[i] + self.f_s_n, tau_n[i] - self.f_s_n);
            let slope_high = if x_high >= 0.0 { self.g } else { 1.0 / self.g };
            let slope_low = if x_low <= 0.0 { self.g } else { 1.0 / self.g };
            let (load, load_half) = middle_and_half(slope_low * x_low, slope_high * x_high);
            let (slope, slope_half) = middle_and_half(slope_low, slope_high);
            let seat = q_m[i] + tau_n[i] * self.c_d;
            let (middle, half) = (seat + load * self.c_c, load_half * self.c_c);

            let before = self.friction_signs[i];
            let s = (before + 2.0 * (seat - self.seat_m[i]) / self.friction_travel_m).clamp(-1.0, 1.0);
            let (now, limits) = (middle + s * half, middle + s * half - (self.middle_m[i] + s * self.half_m[i]));
            let travelled = limits.abs().copysign(now - (self.middle_m[i] + before * self.half_m[i]));
            let p = (self.play_signs[i] + 2.0 * travelled / self.play_travel_m).clamp(-1.0, 1.0);
            (self.seat_m[i], self.middle_m[i], self.half_m[i]) = (seat, middle, half);
            (self.friction_signs[i], self.play_signs[i]) = (s, p);

            q_tilde_m[i] = now + self.half_width_m * p;
            tau_tilde_n[i] = load + s * load_half;
            alpha.row_mut(i).scale_mut(self.c_d + self.c_c * (slope + s * slope_half));
        }
        let gain = Matrix2::identity() + self.j * alpha;
        let j_tilde_rad_per_m = gain.try_inverse().map_or_else(Matrix2x3::zeros, |inverse| inverse * self.j);
        self.last = ChainCommand {
            q_m,
            eps_m: q_tilde_m - q_m,
            q_tilde_m,
            tau_n,
            tau_tilde_n,
            alpha_m_per_rad: alpha,
            j_tilde_rad_per_m,
            signs: self.friction_signs,
            status,
        };
        self.last
    }
}

fn middle_and_half(low: f64, high: f64) -> (f64, f64) {
    (0.5 * (high + low), 0.5 * (high - low))
}

/// A smooth motion with reversals and plane rotations, rad.
pub fn motion(n: usize) -> Vec<Vector2<f64>> {
    let at = |k: usize| {
        let t = k as f64 * 1e-3;
        let b = 1.2 * (0.9 * t).sin();
        Vector2::new((0.4 * t).cos(), (0.4 * t).sin()) * b
    };
    (0..n).map(at).collect()
}

/// The chain of the same four effects.
pub fn four() -> krait_model::Chain {
    use krait_model::effects::EffectKind as K;
    let effects =
        [K::StiffnessScale, K::Backlash, K::StaticFriction, K::ConeFriction].map(krait_model::EffectSetting::new);
    krait_model::Chain::new(&MachineParameters::default(), Default::default(), &effects, Default::default()).unwrap()
}

/// The same four by hand.
pub fn four_by_hand() -> StraightLine {
    StraightLine::new(&MachineParameters::default(), 1.22, 8.9e-5, 1.959, 0.1727, 20e-6)
}
