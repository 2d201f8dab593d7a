//! Symmetries, derivatives against central differences, and smoothness through the straight pose.

use core::f64::consts::{FRAC_PI_2, PI};
use krait_model::oracle::{Extension, F_S_N};
use krait_model::{MachineParameters, Psi, Snake};
use nalgebra::{Matrix2, Rotation2, SMatrix, SVector, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 64, rng_seed: RngSeed::Fixed(26), failure_persistence: None, ..ProptestConfig::default() }
}

prop_compose! {
    fn bend()(b in 0.02..1.6, delta in -PI..PI) -> Vector2<f64> {
        Vector2::new(b * f64::cos(delta), b * f64::sin(delta))
    }
}

prop_compose! {
    fn signs()(s in prop::array::uniform3(-1.0..1.0)) -> Vector3<f64> {
        Vector3::from(s)
    }
}

/// Derivative of a vector by two coordinates, by central differences of fourth order.
fn difference<const N: usize>(f: impl Fn(Vector2<f64>) -> SVector<f64, N>, at: Vector2<f64>) -> SMatrix<f64, N, 2> {
    let h = 1e-3;
    let along = |e: Vector2<f64>| {
        ((f(at + e * h) - f(at - e * h)) * 8.0 - (f(at + e * (2.0 * h)) - f(at - e * (2.0 * h)))) / (12.0 * h)
    };
    SMatrix::from_columns(&[along(Vector2::x()), along(Vector2::y())])
}

/// The two agree, and the comparison means something: neither is zero, nor are they the same numbers.
fn agree<const N: usize>(analytic: SMatrix<f64, N, 2>, numeric: SMatrix<f64, N, 2>) -> Result<(), TestCaseError> {
    prop_assert!(analytic.norm() > 0.0 && numeric.norm() > 0.0);
    prop_assert!(analytic != numeric);
    prop_assert!((analytic - numeric).norm() < 1e-8 * analytic.norm(), "{analytic} {numeric}");
    Ok(())
}

fn psi(at: Vector2<f64>) -> Psi {
    Psi { theta_l_rad: at.x, delta_rad: at.y }
}

fn close<const N: usize>(a: SVector<f64, N>, b: SVector<f64, N>) -> bool {
    (a - b).norm() <= 1e-12 * (a.norm() + b.norm())
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn turning_the_plane_by_120_degrees_permutes_the_lines(b in bend(), s in signs()) {
        let m = snake();
        let turned = Rotation2::new(2.0 * PI / 3.0) * b;
        let next = |v: Vector3<f64>| Vector3::new(v.y, v.z, v.x);
        prop_assert!(close(m.q(turned), next(m.q(b))));
        prop_assert!(close(m.tau_n(turned), next(m.tau_n(b))));
        let (here, there) = (m.extension_with_signs(b, 1.2, 1e-4, &s), m.extension_with_signs(turned, 1.2, 1e-4, &next(s)));
        prop_assert!(close(there.eps_m, next(here.eps_m)));
        prop_assert!((m.energy_j(turned) / m.energy_j(b) - 1.0).abs() < 1e-12);
        prop_assert!((m.tip_pos_in_base_m(turned).z - m.tip_pos_in_base_m(b).z).abs() < 1e-15);
    }

    #[test]
    fn reflecting_the_plane_swaps_lines_2_and_3(b in bend(), s in signs()) {
        let m = snake();
        let mirrored = Vector2::new(b.x, -b.y);
        let swap = |v: Vector3<f64>| Vector3::new(v.x, v.z, v.y);
        prop_assert!(close(m.q(mirrored), swap(m.q(b))));
        prop_assert!(close(m.tau_n(mirrored), swap(m.tau_n(b))));
        let (here, there) = (m.extension_with_signs(b, 1.2, 1e-4, &s), m.extension_with_signs(mirrored, 1.2, 1e-4, &swap(s)));
        prop_assert!(close(there.eps_m, swap(here.eps_m)));
        let tip = m.tip_pos_in_base_m(b);
        prop_assert!(close(m.tip_pos_in_base_m(mirrored), Vector3::new(tip.x, -tip.y, tip.z)));
    }

    #[test]
    fn configuration_survives_the_way_through_psi_and_through_the_lines(b in bend(), common_m in -1e-3..1e-3) {
        let m = snake();
        prop_assert!(close(Psi::from_bend(b).bend(), b));
        prop_assert!((m.bend_from_q(m.q(b).add_scalar(common_m)) - b).norm() < 1e-12);
        prop_assert!(close(m.q_of_psi(Psi::from_bend(b)), m.q(b)));
    }

    #[test]
    fn jacobians_in_the_bend_vector_are_the_derivatives(b in bend(), s in signs()) {
        let m = snake();
        let j_x = m.j_x_bend(b);
        agree(j_x.fixed_rows::<3>(0).into_owned(), difference(|b| m.tip_pos_in_base_m(b), b))?;
        let here = m.base_from_tip_rotation(b).inverse();
        agree(j_x.fixed_rows::<3>(3).into_owned(), difference(|b| (m.base_from_tip_rotation(b) * here).scaled_axis(), b))?;
        agree(m.grad_energy_bend_nm(b).transpose(), difference(|b| SVector::from([m.energy_j(b)]), b))?;
        agree(m.hess_energy_bend_nm(b), difference(|b| m.grad_energy_bend_nm(b), b))?;
        agree(m.j_tau_bend_n(b), difference(|b| m.tau_n(b), b))?;
        agree(m.extension_naive(b).alpha_m_per_rad, difference(|b| m.extension_naive(b).eps_m, b))?;
        // The branches of the friction have a kink where they take all of the load: stay off it.
        let kink = |b: Vector2<f64>| (m.tau_n(b) * 1.2).iter().map(|t| (t.abs() - F_S_N).abs()).fold(f64::MAX, f64::min);
        if kink(b) > 0.2 {
            let signed = |b| m.extension_with_signs(b, 1.2, 1e-4, &s);
            agree(signed(b).alpha_m_per_rad, difference(|b| signed(b).eps_m, b))?;
        }
    }

    #[test]
    fn jacobians_in_psi_are_the_derivatives(b in bend()) {
        let m = snake();
        let at = Psi::from_bend(b);
        let x = Vector2::new(at.theta_l_rad, at.delta_rad);
        agree(at.j_bend_psi(), difference(|x| psi(x).bend(), x))?;
        agree(m.j_q_psi(at), difference(|x| m.q_of_psi(psi(x)), x))?;
        agree(m.j_x_psi(at).fixed_rows::<3>(0).into_owned(), difference(|x| m.tip_pos_in_base_m(psi(x).bend()), x))?;
        agree(m.grad_energy_psi_nm(at).transpose(), difference(|x| SVector::from([m.energy_j(psi(x).bend())]), x))?;
        agree(m.hess_energy_psi_nm(at), difference(|x| m.grad_energy_psi_nm(psi(x)), x))?;
        agree(m.j_tau_psi_n(at), difference(|x| m.tau_n(psi(x).bend()), x))?;
        let naive = m.extension_naive(b);
        agree(m.alpha_psi(&naive, at), difference(|x| m.extension_naive(psi(x).bend()).eps_m, x))?;
    }

    #[test]
    fn corrected_jacobians_invert_the_resolved_rate(b in bend(), s in signs()) {
        let m = snake();
        let at = Psi::from_bend(b);
        let Extension { alpha_m_per_rad: alpha, .. } = m.extension_with_signs(b, 1.22, 1e-4, &s);
        let alpha_psi = alpha * at.j_bend_psi();
        let rate = Vector2::new(0.3, -0.2);
        let q_tilde_vel = m.q_tilde_vel_m_per_s(&alpha, rate);
        prop_assert!((m.j_tilde_bend(&alpha).unwrap() * q_tilde_vel - rate).norm() < 1e-12);
        let resolved = m.j_q_psi(at) + alpha_psi;
        let identity = Matrix2::identity();
        prop_assert!((m.j_tilde_psi(at, &alpha_psi).unwrap() * resolved - identity).norm() < 1e-10);
        let lines_1_2 = m.j_tilde_psi_q12(at, &alpha_psi).unwrap() * resolved.fixed_rows::<2>(0);
        prop_assert!((lines_1_2 - identity).norm() < 1e-10);
    }

    #[test]
    fn loads_balance_the_bending_moment_and_the_wrench(b in bend(), w in prop::array::uniform6(-0.5..0.5)) {
        let m = snake();
        let wrench = Vector6::from(w).component_mul(&Vector6::new(1.0, 1.0, 1.0, 0.01, 0.01, 0.01));
        let tau = m.tau_with_wrench_n(b, &wrench);
        let left = m.j_q_bend().transpose() * tau;
        let right = m.grad_energy_bend_nm(b) - m.j_x_bend(b).transpose() * wrench;
        prop_assert!((left - right).norm() < 1e-12 * (1.0 + right.norm()));
        prop_assert!(tau.sum().abs() < 1e-9, "minimum norm has no internal load");
    }

    #[test]
    fn bend_rate_moves_the_tip_as_wanted(b in bend(), rate in prop::array::uniform2(-1.0..1.0)) {
        let m = snake();
        let rate = Vector2::from(rate);
        let velocity = m.j_x_bend(b).fixed_rows::<3>(0) * rate;
        let found = m.bend_rate_for_tip_velocity(b, velocity, 1.0, 2e-3);
        prop_assert!((found.bend_vel_rad_per_s - rate).norm() < 1e-10 && found.residual_m_per_s < 1e-12);
        prop_assert!(found.smallest_singular_value_m_per_rad > 0.39 * m.l_m());
    }

    #[test]
    fn everything_is_smooth_through_the_straight_pose(delta in -PI..PI, s in signs()) {
        let m = snake();
        let (near, zero) = (Vector2::new(delta.cos(), delta.sin()) * 1e-9, Vector2::zeros());
        let alpha = |b| m.extension_with_signs(b, 1.22, 1e-4, &s).alpha_m_per_rad;
        prop_assert!((m.tip_pos_in_base_m(near) - m.tip_pos_in_base_m(zero)).norm() < 1e-10);
        prop_assert!((m.j_x_bend(near) - m.j_x_bend(zero)).norm() < 3e-9);
        prop_assert!((m.hess_energy_bend_nm(near) - m.hess_energy_bend_nm(zero)).norm() < 1e-9);
        prop_assert!((m.tau_n(near) - m.tau_n(zero)).norm() < 1e-7);
        prop_assert!((alpha(near) - alpha(zero)).norm() < 1e-9);
        prop_assert!((m.j_tilde_bend(&alpha(near)).unwrap() - m.j_tilde_bend(&alpha(zero)).unwrap()).norm() < 1e-4);
    }
}

#[test]
fn inverses_in_psi_are_refused_where_delta_has_no_meaning() {
    let m = snake();
    let straight = Psi { theta_l_rad: FRAC_PI_2, delta_rad: 0.3 };
    let alpha = m.alpha_psi(&m.extension_naive(Vector2::zeros()), straight);
    assert!(m.j_psi_q12(straight).is_none() && m.j_psi_q(straight).is_none());
    assert!(m.j_tilde_psi(straight, &alpha).is_none() && m.j_tilde_psi_q12(straight, &alpha).is_none());
    assert_eq!(Psi::from_bend(Vector2::zeros()), Psi { theta_l_rad: FRAC_PI_2, delta_rad: 0.0 });
}

#[test]
fn a_common_displacement_bends_nothing_with_three_lines_and_6_degrees_with_lines_1_and_2() {
    let m = snake();
    let at = Psi { theta_l_rad: FRAC_PI_2 - 45_f64.to_radians(), delta_rad: 0.0 };
    let alpha = m.alpha_psi(&m.extension_naive(at.bend()), at);
    let common = Vector3::repeat(0.178e-3);
    let three = m.j_psi_q(at).unwrap() * common;
    assert!(three.norm() < 1e-12 && (m.j_tilde_psi(at, &alpha).unwrap() * common).norm() < 1e-12);
    let two = m.j_psi_q12(at).unwrap() * common.xy();
    assert!((two.x.to_degrees() - 6.06).abs() < 0.01, "{}", two.x.to_degrees());
    let two = m.j_tilde_psi_q12(at, &alpha).unwrap() * common.xy();
    assert!((two.x.to_degrees() - 3.26).abs() < 0.05, "{}", two.x.to_degrees());
}

#[test]
fn a_force_that_helps_to_bend_relieves_the_lines() {
    let m = snake();
    let b = Vector2::new(0.8, 0.0);
    let helping = Vector6::new(0.5, 0.0, 0.0, 0.0, 0.0, 0.0);
    assert!(m.tip_pos_in_base_m(b).x > 0.0);
    assert!(m.tau_with_wrench_n(b, &helping).norm() < m.tau_n(b).norm());
    assert!(m.tau_with_wrench_n(b, &-helping).norm() > m.tau_n(b).norm());
}

#[test]
fn bend_rate_is_damped_where_the_jacobian_is_singular() {
    let m = snake();
    // At a bend of 2 pi the arc closes to a circle: turning its plane does not move the tip.
    let b = Vector2::new(2.0 * PI, 0.0);
    let sideways = Vector3::new(0.0, 0.05, 0.0);
    let found = m.bend_rate_for_tip_velocity(b, sideways, 1.0, 2e-3);
    assert!(found.smallest_singular_value_m_per_rad < 1e-12 && found.bend_vel_rad_per_s.norm() < 1e-6);
    assert!((found.residual_m_per_s - 0.05).abs() < 1e-9);
    assert!(m.bend_rate_for_tip_velocity(b, sideways, 1.0, 0.0).bend_vel_rad_per_s.iter().all(|v| v.is_finite()));
    let (free, damped) = (
        m.bend_rate_for_tip_velocity(Vector2::zeros(), sideways, 1.0, 2e-3),
        m.bend_rate_for_tip_velocity(Vector2::zeros(), sideways, 1.0, 20e-3),
    );
    assert!(damped.bend_vel_rad_per_s.norm() < 0.7 * free.bend_vel_rad_per_s.norm() && damped.residual_m_per_s > 0.01);
}
