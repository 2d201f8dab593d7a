//! The general redundancy resolution against brute force, and one test for each way it can end.

use core::f64::consts::PI;
use krait_model::{LineLoads, LoadBounds, LoadRequest, LoadStatus, MachineParameters, Snake};
use nalgebra::{Matrix2, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 128, rng_seed: RngSeed::Fixed(10), failure_persistence: None, ..ProptestConfig::default() }
}

prop_compose! {
    fn bend()(b in 0.0..1.6, delta in -PI..PI) -> Vector2<f64> {
        Vector2::new(b * f64::cos(delta), b * f64::sin(delta))
    }
}

prop_compose! {
    fn request()(f in prop::array::uniform3(-1.0..1.0), m in prop::array::uniform3(-0.02..0.02), eta in 0.5..2.0, preload_n in -15.0..15.0)
        -> LoadRequest {
        LoadRequest { wrench_on_tip: Vector6::new(f[0], f[1], f[2], m[0], m[1], m[2]), eta, preload_n }
    }
}

prop_compose! {
    fn bounds()(low in prop::array::uniform3(-40.0..5.0), width in prop::array::uniform3(5.0..60.0)) -> LoadBounds {
        let low = Vector3::from(low);
        LoadBounds::new(low, low + Vector3::from(width)).unwrap()
    }
}

/// What the lines have to hold.
fn moment(s: &Snake, bend: Vector2<f64>, request: &LoadRequest) -> Vector2<f64> {
    s.grad_energy_bend_nm(bend) * request.eta - s.j_x_bend(bend).transpose() * request.wrench_on_tip
}

/// Every load that holds the snake, by the load of line 1: lines 2 and 3 follow from the two equations.
fn candidates(s: &Snake, moment: Vector2<f64>, step_n: f64) -> impl Iterator<Item = Vector3<f64>> {
    let j = s.j_q_bend().transpose();
    let of_2_and_3 = Matrix2::new(j[(0, 1)], j[(0, 2)], j[(1, 1)], j[(1, 2)]).try_inverse().unwrap();
    let of_1 = j.column(0).into_owned();
    (-40_000..=40_000_i32).map(move |k| {
        let tau_1 = f64::from(k) * step_n;
        let rest = of_2_and_3 * (moment - of_1 * tau_1);
        Vector3::new(tau_1, rest.x, rest.y)
    })
}

/// Largest excess over any bound, N; negative inside.
fn excess(tau: &Vector3<f64>, low: &Vector3<f64>, high: &Vector3<f64>) -> f64 {
    (0..3).map(|i| (low[i] - tau[i]).max(tau[i] - high[i])).fold(f64::MIN, f64::max)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn no_load_on_a_fine_grid_is_better(
        b in bend(), request in request(), low in prop::array::uniform3(-40.0..5.0), width in prop::array::uniform3(5.0..60.0)
    ) {
        let (s, low) = (snake(), Vector3::from(low));
        let high = low + Vector3::from(width);
        let found = s.line_loads(b, &request, &LoadBounds::new(low, high).unwrap());
        let moment = moment(&s, b, &request);
        prop_assert!((s.j_q_bend().transpose() * found.tau_n - moment).norm() < 1e-12 * (1.0 + moment.norm()));

        let preferred = s.line_loads(b, &request, &LoadBounds::none()).tau_n;
        let step_n = 0.005;
        let distance = |tau: &Vector3<f64>| (tau - preferred).norm();
        let best = candidates(&s, moment, step_n).filter(|t| excess(t, &low, &high) <= 0.0).map(|t| distance(&t)).fold(f64::MAX, f64::min);
        let least_excess = candidates(&s, moment, step_n).map(|t| excess(&t, &low, &high)).fold(f64::MAX, f64::min);
        if let LoadStatus::Infeasible { low_idx, high_idx, gap_n } = found.status {
            prop_assert!(least_excess > 0.0 && best == f64::MAX);
            prop_assert!((excess(&found.tau_n, &low, &high) - 0.5 * gap_n).abs() < 1e-9);
            prop_assert!(0.5 * gap_n <= least_excess + 1e-9 && least_excess <= 0.5 * gap_n + step_n);
            prop_assert!((low[low_idx] - found.tau_n[low_idx] - 0.5 * gap_n).abs() < 1e-9);
            prop_assert!((found.tau_n[high_idx] - high[high_idx] - 0.5 * gap_n).abs() < 1e-9);
        } else {
            prop_assert!(excess(&found.tau_n, &low, &high) < 1e-9, "{found:?}");
            // The grid misses a narrow feasible interval, and the edge of a wide one, by a step at most.
            prop_assert!(distance(&found.tau_n) <= best + 1e-9 && (best == f64::MAX || best <= distance(&found.tau_n) + 2.0 * step_n));
        }
    }

    #[test]
    fn without_an_active_bound_it_is_the_closed_form_plus_the_preload(b in bend(), request in request()) {
        let s = snake();
        let found = s.line_loads(b, &request, &LoadBounds::none());
        let closed = if request.eta == 1.0 { s.tau_with_wrench_n(b, &request.wrench_on_tip) } else {
            s.tau_with_wrench_n(b, &request.wrench_on_tip) + s.tau_n(b) * (request.eta - 1.0)
        };
        prop_assert!((found.tau_n - closed.add_scalar(request.preload_n)).norm() < 1e-10);
        prop_assert!((found.tau_n.mean() - request.preload_n).abs() < 1e-10 && found.tau_common_n == request.preload_n);
        prop_assert_eq!(found.status, LoadStatus::Preferred);
    }

    #[test]
    fn a_bound_that_is_reached_moves_only_the_internal_load(b in bend(), request in request(), bounds in bounds()) {
        let s = snake();
        let found = s.line_loads(b, &request, &bounds);
        let free = s.line_loads(b, &request, &LoadBounds::none());
        if let LoadStatus::Bounded { shift_n, .. } = found.status {
            prop_assert!(shift_n != 0.0 && (found.tau_n - free.tau_n.add_scalar(shift_n)).norm() < 1e-10);
        }
    }
}

/// Bend in the plane delta = 0: line 1 is pulled, lines 2 and 3 are pushed with half its load.
fn bent(request: &LoadRequest, low_n: f64, high_n: f64) -> LineLoads {
    let bounds = LoadBounds::new(Vector3::repeat(low_n), Vector3::repeat(high_n)).unwrap();
    snake().line_loads(Vector2::new(1.0, 0.0), request, &bounds)
}

#[test]
fn lines_that_may_not_be_pushed_are_pulled_together() {
    let free = bent(&LoadRequest::default(), -100.0, 100.0);
    assert_eq!(free.status, LoadStatus::Preferred);
    assert!(free.tau_n.x < -15.0 && free.tau_n.y > 8.0, "{free:?}");
    let wires = bent(&LoadRequest::default(), -100.0, 0.0);
    let LoadStatus::Bounded { line_idx, shift_n } = wires.status else { panic!("{wires:?}") };
    assert!(line_idx != 0 && (shift_n + free.tau_n.y).abs() < 1e-9, "{wires:?}");
    assert!(wires.tau_n.max() < 1e-12 && wires.tau_n.x < free.tau_n.x);
}

#[test]
fn a_pull_that_would_strain_line_1_too_far_is_taken_over_by_pushing_the_others() {
    let free = bent(&LoadRequest::default(), -100.0, 100.0);
    let gentle = bent(&LoadRequest::default(), free.tau_n.x + 2.0, 100.0);
    assert_eq!(gentle.status, LoadStatus::Bounded { line_idx: 0, shift_n: gentle.tau_common_n });
    assert!((gentle.tau_common_n - 2.0).abs() < 1e-9 && (gentle.tau_n.y - free.tau_n.y - 2.0).abs() < 1e-9);
}

#[test]
fn bounds_that_leave_nothing_say_which_lines_and_by_how_much() {
    let free = bent(&LoadRequest::default(), -100.0, 100.0).tau_n;
    let found = bent(&LoadRequest::default(), -5.0, 5.0);
    let LoadStatus::Infeasible { low_idx, high_idx, gap_n } = found.status else { panic!("{found:?}") };
    assert_eq!(low_idx, 0, "line 1 would have to be pulled harder");
    assert_ne!(high_idx, 0);
    assert!((gap_n - (free.max() - free.min() - 10.0)).abs() < 1e-9, "{found:?}");
}

#[test]
fn numbers_that_are_not_finite_are_a_status() {
    let nan = LoadRequest { preload_n: f64::NAN, ..LoadRequest::default() };
    assert_eq!(bent(&nan, -1.0, 1.0).status, LoadStatus::NotFinite);
    let infinite = LoadRequest { eta: f64::INFINITY, ..LoadRequest::default() };
    assert_eq!(bent(&infinite, -1.0, 1.0).status, LoadStatus::NotFinite);
    let lost = snake().line_loads(Vector2::new(f64::NAN, 0.0), &LoadRequest::default(), &LoadBounds::none());
    assert_eq!(lost.status, LoadStatus::NotFinite);
}

#[test]
fn bounds_that_contradict_themselves_are_refused_by_name() {
    let refused = |low: f64, high: f64| {
        LoadBounds::new(Vector3::new(0.0, low, 0.0), Vector3::new(1.0, high, 1.0)).unwrap_err().to_string()
    };
    assert!(refused(3.0, 2.0).contains("low_n is 3, expected"));
    assert!(refused(f64::NAN, 2.0).contains("low_n is NaN"));
    assert!(refused(0.0, f64::NAN).contains("high_n is NaN"));
    assert!(refused(f64::INFINITY, f64::INFINITY).contains("low_n is inf"));
    assert!(refused(f64::NEG_INFINITY, f64::NEG_INFINITY).contains("high_n is -inf"));
}

#[test]
fn the_material_bounds_a_push_by_buckling_and_a_pull_by_what_bending_leaves_of_the_strain() {
    let s = snake();
    let bend = Vector2::new(PI / 4.0, 0.0);
    let strain = s.bending_strain(bend);
    // The tube on the inside of the bend is shorter than 26 mm, the others are longer.
    assert!(strain.x > 0.33 * PI / 4.0 / 26.0 && strain.y < strain.x && (strain.y - strain.z).abs() < 1e-15);
    assert!((strain.mean() - 0.01).abs() < 2e-4, "1 % at 45 deg: {strain}");
    let bounds = LoadBounds::of_material(&s, bend, 10e-3, 0.02).unwrap();
    let pushed_hard = s.line_loads(bend, &LoadRequest { preload_n: 1e3, ..LoadRequest::default() }, &bounds);
    // pi^2 E I / l^2 with E I = 3.3730e-4 N m2.
    assert!((pushed_hard.tau_n.max() - 33.29).abs() < 0.01, "{pushed_hard:?}");
    let pulled_hard = s.line_loads(bend, &LoadRequest { preload_n: -1e3, ..LoadRequest::default() }, &bounds);
    let at_limit = (0..3).map(|i| strain[i] - pulled_hard.tau_n[i] / s.axial_stiffness_n()).fold(f64::MIN, f64::max);
    assert!((at_limit - 0.02).abs() < 1e-12, "{pulled_hard:?}");
}

#[test]
fn a_bend_beyond_the_materials_strain_is_refused_with_the_strain() {
    let bend = Vector2::new(PI / 2.0, 0.0);
    let error = LoadBounds::of_material(&snake(), bend, 10e-3, 0.02).unwrap_err().to_string();
    assert!(error.contains("strain of bending is 0.022") && error.contains("0.02"), "{error}");
}
