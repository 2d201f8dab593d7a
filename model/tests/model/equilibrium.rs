//! The forward model inverts the inverse one: all planes, all bends, through the straight pose.

use krait_model::oracle::EquilibriumStatus;
use krait_model::{MachineParameters, Snake};
use nalgebra::{Vector2, Vector3};

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

fn bends() -> impl Iterator<Item = Vector2<f64>> {
    let bends_rad = [0.0, 1e-12, 1e-9, 1e-4].into_iter().chain((1..=90).map(|d| f64::from(d).to_radians()));
    bends_rad.flat_map(|b| (-180..180).step_by(15).map(move |a| direction(f64::from(a)) * b))
}

fn direction(degrees: f64) -> Vector2<f64> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Vector2::new(cos, sin)
}

#[test]
fn round_trip_without_friction_closes_to_1e_10_rad() {
    let s = snake();
    let compliance = s.frictionless_compliance_m_per_n();
    for eta in [1.0, 1.22] {
        for bend in bends() {
            let q_tilde_m = s.q(bend) + s.tau_n(bend) * eta * compliance;
            let found = s.equilibrium(q_tilde_m, compliance, eta);
            assert_eq!(found.status, EquilibriumStatus::Converged, "{bend} {found:?}");
            assert!((found.bend_rad - bend).norm() < 1e-10 && found.n_iterations <= 8, "{bend} {found:?}");
            assert!(found.tau_common_n.abs() < 1e-9, "minimum-norm loads leave no internal load: {found:?}");
        }
    }
}

#[test]
fn the_printed_extension_is_inverted_and_its_uniform_terms_become_internal_load() {
    let s = snake();
    for bend in bends() {
        let q_tilde_m = s.q(bend) + s.extension_as_printed(bend, 1.22, 0.178e-3).eps_m;
        let found = s.equilibrium(q_tilde_m, s.loading_compliance_m_per_n(), 1.22);
        assert!((found.bend_rad - bend).norm() < 1e-10, "{bend} {found:?}");
        assert!((2.0..3.0).contains(&found.tau_common_n), "{found:?}");
    }
}

#[test]
fn an_uncompensated_snake_reaches_about_half() {
    let s = snake();
    let bend = Vector2::new(60_f64.to_radians(), 0.0);
    let found = s.equilibrium(s.q(bend), s.loading_compliance_m_per_n(), 1.0);
    assert!((found.bend_rad.norm() / bend.norm() - 0.54).abs() < 0.01, "{found:?}");
}

#[test]
fn positions_beyond_the_machine_are_out_of_range() {
    let s = snake();
    let compliance = s.frictionless_compliance_m_per_n();
    for q_tilde_m in
        [Vector3::new(-0.05, 0.025, 0.025), Vector3::new(f64::NAN, 0.0, 0.0), Vector3::repeat(f64::INFINITY)]
    {
        assert_eq!(s.equilibrium(q_tilde_m, compliance, 1.0).status, EquilibriumStatus::OutOfRange, "{q_tilde_m}");
    }
}
