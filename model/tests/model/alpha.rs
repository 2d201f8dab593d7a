//! alpha in closed form against nested dual numbers, which differentiate the definitions themselves.
//!
//! The only formulas on the dual side are q_i and the energy. Their derivatives, the minimum-norm loads and the extension
//! follow numerically: J_q and grad E from the inner dual number, d eps from the outer one. No algebra is shared.

use crate::dual::{Dual, Number};
use core::f64::consts::{FRAC_PI_2, PI};
use krait_model::oracle::{F_S_N, MU};
use krait_model::{MachineParameters, Psi, Snake};
use nalgebra::{Matrix3x2, SMatrix, Vector2, Vector3};

const TOLERANCE: f64 = 1e-12;
const ETA: f64 = 1.22;
const LAMBDA_M: f64 = 0.089e-3;

fn parameters() -> MachineParameters {
    MachineParameters::default()
}

fn snake() -> Snake {
    Snake::new(&parameters()).unwrap()
}

/// The two ways to name a configuration.
#[derive(Clone, Copy)]
enum Coordinates {
    Psi,
    Bend,
}

/// q_i of Eq. (1), m.
fn q<N: Number>(x: [N; 2], coordinates: Coordinates) -> [N; 3] {
    let r = parameters().r_m;
    [0.0, 1.0, 2.0].map(|k| {
        let g = k * 2.0 * PI / 3.0;
        match coordinates {
            Coordinates::Psi => (x[1] + N::of(g)).cos() * (x[0] - N::of(FRAC_PI_2)) * N::of(r),
            Coordinates::Bend => (x[0] * N::of(g.cos()) - x[1] * N::of(g.sin())) * N::of(-r),
        }
    })
}

/// Elastic energy, J.
fn energy<N: Number>(x: [N; 2], coordinates: Coordinates) -> N {
    let p = parameters();
    let inertia_m4 = PI / 64.0 * (p.d_outer_m.powi(4) - p.d_inner_m.powi(4));
    let square = match coordinates {
        Coordinates::Psi => (x[0] - N::of(FRAC_PI_2)) * (x[0] - N::of(FRAC_PI_2)),
        Coordinates::Bend => x[0] * x[0] + x[1] * x[1],
    };
    let lengths = q(x, coordinates).map(|q_m| q_m + N::of(p.l_m));
    let sum = lengths.into_iter().fold(N::of(1.0 / p.l_m), |sum, l| sum + N::of(1.0) / l);
    square * sum * N::of(0.5 * p.e_pa * inertia_m4)
}

/// Minimum-norm loads, N: J (J^T J)^-1 grad E, all from derivatives.
fn loads<N: Number>(x: [N; 2], coordinates: Coordinates) -> [N; 3] {
    let along = |k: usize| [0, 1].map(|c| Dual { re: x[c], eps: N::of(if c == k { 1.0 } else { 0.0 }) });
    let gradient = [0, 1].map(|k| energy(along(k), coordinates).eps);
    let columns = [0, 1].map(|k| q(along(k), coordinates).map(|q_i| q_i.eps));
    let dot = |a: [N; 3], b: [N; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (a, b, d) = (dot(columns[0], columns[0]), dot(columns[0], columns[1]), dot(columns[1], columns[1]));
    let determinant = a * d - b * b;
    let first = (d * gradient[0] - b * gradient[1]) / determinant;
    let second = (a * gradient[1] - b * gradient[0]) / determinant;
    [0, 1, 2].map(|i| columns[0][i] * first + columns[1][i] * second)
}

/// How a line's load at its actuator follows from that at the snake.
#[derive(Clone, Copy)]
enum Friction {
    /// The loading branch whatever the line does.
    AsPrinted,
    /// The branch of each line's motion.
    Signs(Vector3<f64>),
}

/// eps of Eq. (18), m.
fn extension<N: Number>(x: [N; 2], coordinates: Coordinates, eta: f64, lambda_m: f64, friction: Friction) -> [N; 3] {
    let p = parameters();
    let area_m2 = PI / 4.0 * (p.d_outer_m.powi(2) - p.d_inner_m.powi(2));
    let (c_d, c_c) = (p.l_d_m / (p.e_pa * area_m2), p.l_c_m / (p.e_pa * area_m2));
    let capstan = (2.0 * MU * p.phi_rad).exp();
    let tau = loads(x, coordinates);
    core::array::from_fn(|i| {
        let load = tau[i] * N::of(eta);
        let sign = match friction {
            Friction::AsPrinted => 1.0,
            Friction::Signs(signs) => signs[i],
        };
        let driven = load + N::of(sign * F_S_N);
        let helps = matches!(friction, Friction::Signs(_)) && driven.value() * sign < 0.0;
        let factor = if helps { 1.0 / capstan } else { capstan };
        load * N::of(c_d) + driven * N::of(factor * c_c) + N::of(lambda_m * sign)
    })
}

fn derivative<const R: usize>(at: Vector2<f64>, f: impl Fn([Dual<f64>; 2]) -> [Dual<f64>; R]) -> SMatrix<f64, R, 2> {
    let column = |k: usize| {
        let x = [0, 1].map(|c| Dual { re: at[c], eps: if c == k { 1.0 } else { 0.0 } });
        nalgebra::SVector::<f64, R>::from(f(x).map(|y| y.eps))
    };
    SMatrix::from_columns(&[column(0), column(1)])
}

/// Equal to 1e-12 of each column, and the comparison means something: neither is zero, nor are they the same numbers.
fn agree<const R: usize>(what: &str, analytic: SMatrix<f64, R, 2>, dual: SMatrix<f64, R, 2>) {
    assert!(analytic != dual, "{what}: the two are the same numbers: {analytic}");
    for k in 0..2 {
        let (a, d) = (analytic.column(k), dual.column(k));
        assert!(a.norm() > 0.0 && d.norm() > 0.0, "{what}: column {k} is zero");
        let relative = (a - d).norm() / d.norm();
        assert!(relative < TOLERANCE, "{what}, column {k}: {relative:e}\n{analytic}{dual}");
    }
}

/// Bends from 1 to 90 deg in planes that meet no symmetry of the lines.
fn poses() -> impl Iterator<Item = Vector2<f64>> {
    (1..=90).step_by(4).flat_map(|b| {
        (0..24).map(move |k| {
            let (sin, cos) = (0.1 + f64::from(k) * PI / 12.0).sin_cos();
            Vector2::new(cos, sin) * f64::from(b).to_radians()
        })
    })
}

/// Every combination of directions of the lines.
fn signs() -> impl Iterator<Item = Vector3<f64>> {
    (0..8_u8).map(|k| Vector3::from([0, 1, 2].map(|i| if k >> i & 1 == 1 { 1.0 } else { -1.0 })))
}

#[test]
fn alpha_in_paper_coordinates_is_the_derivative_of_the_printed_extension() {
    let s = snake();
    for bend in poses() {
        let psi = Psi::from_bend(bend);
        for (eta, lambda_m) in [(1.0, 0.0), (ETA, LAMBDA_M)] {
            let analytic = s.alpha_psi(&s.extension_as_printed(bend, eta, lambda_m), psi);
            let at = Vector2::new(psi.theta_l_rad, psi.delta_rad);
            let f = |x| extension(x, Coordinates::Psi, eta, lambda_m, Friction::AsPrinted);
            agree("alpha(psi)", analytic, derivative(at, f));
        }
    }
}

#[test]
fn alpha_in_the_bend_vector_is_the_derivative_for_every_direction_of_the_lines() {
    let s = snake();
    for bend in poses() {
        let naive = derivative(bend, |x| extension(x, Coordinates::Bend, 1.0, 0.0, Friction::AsPrinted));
        agree("naive alpha", s.extension_naive(bend).alpha_m_per_rad, naive);
        for signs in signs() {
            let analytic = s.extension_with_signs(bend, ETA, LAMBDA_M, &signs).alpha_m_per_rad;
            let f = |x| extension(x, Coordinates::Bend, ETA, LAMBDA_M, Friction::Signs(signs));
            agree("alpha with signs", analytic, derivative(bend, f));
        }
    }
}

#[test]
fn loads_and_their_derivatives_are_those_of_the_definitions() {
    let s = snake();
    for bend in poses() {
        let psi = Psi::from_bend(bend);
        let at = Vector2::new(psi.theta_l_rad, psi.delta_rad);
        let by_value = Vector3::from(loads([at.x, at.y], Coordinates::Psi));
        assert!((s.tau_n(bend) - by_value).norm() < TOLERANCE * by_value.norm(), "{bend}");
        agree("d tau / d psi", s.j_tau_psi_n(psi), derivative(at, |x| loads(x, Coordinates::Psi)));
        agree("d tau / d bend", s.j_tau_bend_n(bend), derivative(bend, |x| loads(x, Coordinates::Bend)));
    }
}

/// At the straight pose the paper's coordinates are singular; in the bend vector alpha has its leading order there.
#[test]
fn alpha_at_the_straight_pose_is_its_leading_order() {
    let s = snake();
    let p = parameters();
    let k_t = 2.0 / (3.0 * p.r_m) * 4.0 * p.e_pa * s.inertia_m4() / p.l_m;
    let leading: Matrix3x2<f64> = s.j_q_bend() * (ETA * s.loading_compliance_m_per_n() * k_t / p.r_m);
    let analytic = s.extension_as_printed(Vector2::zeros(), ETA, LAMBDA_M).alpha_m_per_rad;
    let f = |x| extension(x, Coordinates::Bend, ETA, LAMBDA_M, Friction::AsPrinted);
    agree("alpha at b = 0", analytic, derivative(Vector2::zeros(), f));
    assert!((analytic - leading).norm() < TOLERANCE * leading.norm());
    let rho = leading.norm() / s.j_q_bend().norm();
    assert!((rho - 1.05).abs() < 0.01, "eps is about as large as q: {rho}");
}
