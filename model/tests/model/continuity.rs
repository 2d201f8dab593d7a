//! Walks through the straight pose: nothing in bend-vector form jumps, whatever the direction and however small the step.

use core::f64::consts::PI;
use krait_model::{LoadBounds, LoadRequest, MachineParameters, Snake};
use nalgebra::{Matrix2x3, Vector2, Vector3};

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

struct Here {
    q_m: Vector3<f64>,
    tau_n: Vector3<f64>,
    bounded_n: Vector3<f64>,
    j_tilde_rad_per_m: Matrix2x3<f64>,
}

fn look(s: &Snake, bend: Vector2<f64>) -> Here {
    let alpha = s.extension_as_printed(bend, 1.22, 0.0).alpha_m_per_rad;
    let bounds = LoadBounds::new(Vector3::repeat(-100.0), Vector3::zeros()).unwrap();
    Here {
        q_m: s.q(bend),
        tau_n: s.tau_n(bend),
        bounded_n: s.line_loads(bend, &LoadRequest::default(), &bounds).tau_n,
        j_tilde_rad_per_m: s.j_tilde_bend(&alpha).unwrap(),
    }
}

/// Straight walks in every direction, through the straight pose itself and past it at distances down to a nanoradian.
fn walks() -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>, f64)> {
    (0..24).flat_map(|k| {
        let (sin, cos) = (f64::from(k) * PI / 12.0).sin_cos();
        let (along, across) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
        [0.0, 1e-9, 1e-6, 1e-3]
            .into_iter()
            .flat_map(move |miss| [1e-9, 1e-6, 1e-3].into_iter().map(move |step| (across * miss, along, step)))
    })
}

#[test]
fn q_loads_and_corrected_jacobian_change_no_faster_through_the_straight_pose_than_elsewhere() {
    let s = snake();
    // Rates a little above those of a snake bent by 0.1 rad: q and tau are linear to 0.2 % there, J~ turns slowly.
    let (q_rate, tau_rate) = (1.01 * s.j_q_bend().norm(), 1.05 * s.j_tau_bend_n(Vector2::zeros()).norm());
    let j_scale = look(&s, Vector2::zeros()).j_tilde_rad_per_m.norm();
    for (past, along, step) in walks() {
        for k in -20..20 {
            let (a, b) =
                (look(&s, past + along * (f64::from(k) * step)), look(&s, past + along * (f64::from(k + 1) * step)));
            let rounding = 1e-15;
            assert!((a.q_m - b.q_m).norm() <= q_rate * step + rounding * 1e-3);
            assert!((a.tau_n - b.tau_n).norm() <= tau_rate * step + rounding * 10.0);
            assert!((a.bounded_n - b.bounded_n).norm() <= 3.0 * tau_rate * step + rounding * 10.0);
            assert!((a.j_tilde_rad_per_m - b.j_tilde_rad_per_m).norm() <= j_scale * (0.5 * step + 10.0 * rounding));
            assert!(a.q_m != b.q_m && a.tau_n != b.tau_n, "the walk moves");
        }
    }
}

#[test]
fn values_at_the_straight_pose_are_the_limits() {
    let s = snake();
    let zero = look(&s, Vector2::zeros());
    assert_eq!((zero.q_m, zero.tau_n), (Vector3::zeros(), Vector3::zeros()));
    for (_, along, step) in walks() {
        let near = look(&s, along * step);
        assert!((near.j_tilde_rad_per_m - zero.j_tilde_rad_per_m).norm() <= zero.j_tilde_rad_per_m.norm() * step);
    }
}

/// Friction takes energy on every closed path, whatever the loads: what the actuators put in exceeds what the snake gets.
#[test]
fn friction_creates_no_energy_over_a_closed_loop() {
    let s = snake();
    for (amplitude, turns) in [(0.2, 1), (0.8, 3), (1.4, 5)] {
        let n = 2000;
        let at = |k: i32| {
            let u = 2.0 * PI * f64::from(k) / f64::from(n);
            Vector2::new(u.sin(), (f64::from(turns) * u).sin()) * amplitude
        };
        let mut lost_j = 0.0;
        let mut n_given = 0;
        for k in 0..n {
            let step_m = s.q(at(k + 1)) - s.q(at(k));
            let tau_n = s.tau_n((at(k) + at(k + 1)) * 0.5);
            for i in 0..3 {
                let at_actuator = s.cone_load_with_sign(tau_n[i], step_m[i].signum()).tau_tilde_n;
                let here_j = (at_actuator - tau_n[i]) * step_m[i];
                assert!(here_j >= 0.0, "line {i} gains {here_j} J");
                n_given += i32::from(here_j > 0.0);
                lost_j += here_j;
            }
        }
        assert!(lost_j > 0.0 && n_given > 5 * n / 2, "{lost_j} J over the loop, {n_given}");
    }
}
