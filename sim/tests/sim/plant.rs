//! The simulated snake against formulas written out here, against symmetry, and against what friction and play must do.

use core::f64::consts::PI;
use krait_sim::{EffectsTruth, LinesTruth, SimulatedSnake, Truth};
use krait_slave::{Drive, SeenShape, lines};
use proptest::prelude::*;

const R_M: f64 = 1.684e-3;
const L_M: f64 = 26e-3;
const DEG: f64 = PI / 180.0;

fn snake(effects: EffectsTruth) -> SimulatedSnake {
    let mut snake = SimulatedSnake::new(&Truth { effects, ..Truth::default() });
    snake.set_power(0, true).unwrap();
    snake
}

/// Elastic lines alone.
fn ideal() -> EffectsTruth {
    EffectsTruth::none()
}

fn write(snake: &mut SimulatedSnake, q_tilde_m: [f64; 3]) {
    snake.write(0, lines(q_tilde_m)).unwrap();
}

/// Eq. (1): q_i = -r b cos(delta + (i - 1) 120 deg).
fn q_m(bend: f64, delta: f64) -> [f64; 3] {
    core::array::from_fn(|i| -R_M * bend * (delta + i as f64 * 2.0 * PI / 3.0).cos())
}

/// Bending energy of the four backbones, J.
fn energy_j(bx: f64, by: f64) -> f64 {
    let inertia = PI / 64.0 * (0.66e-3_f64.powi(4) - 0.50e-3_f64.powi(4));
    let (bend, delta) = (bx.hypot(by), by.atan2(bx));
    let lengths: f64 = 1.0 / L_M + q_m(bend, delta).iter().map(|q| 1.0 / (L_M + q)).sum::<f64>();
    54e9 * inertia * bend * bend / 2.0 * lengths
}

/// Minimum-norm loads of Eq. (11) in the bend vector: tau = J (J^T J)^-1 grad E, by central differences.
fn tau_n(bend: f64, delta: f64, load_scale: f64) -> [f64; 3] {
    let (bx, by, h) = (bend * delta.cos(), bend * delta.sin(), 1e-5);
    let gx = (energy_j(bx + h, by) - energy_j(bx - h, by)) / (2.0 * h);
    let gy = (energy_j(bx, by + h) - energy_j(bx, by - h)) / (2.0 * h);
    core::array::from_fn(|i| {
        let gamma = i as f64 * 2.0 * PI / 3.0;
        -load_scale * 2.0 / (3.0 * R_M) * (gamma.cos() * gx - gamma.sin() * gy)
    })
}

fn axial_n() -> f64 {
    54e9 * PI / 4.0 * (0.66e-3_f64.powi(2) - 0.50e-3_f64.powi(2))
}

fn error_rad(snake: &SimulatedSnake, bend: f64, delta: f64) -> f64 {
    let [x, y] = snake.bend_rad();
    (x - bend * delta.cos()).hypot(y - bend * delta.sin())
}

#[test]
fn an_ideal_snake_comes_to_the_bend_whose_stretch_was_added_to_the_command() {
    for bend_deg in [1.0, 15.0, 45.0, 60.0, 80.0] {
        for delta_deg in [-150.0, -60.0, 0.0, 20.0, 90.0, 170.0] {
            let (bend, delta) = (bend_deg * DEG, delta_deg * DEG);
            let compliance = (0.480 + 0.058) / axial_n();
            let (q, tau) = (q_m(bend, delta), tau_n(bend, delta, 1.0));
            let mut snake = snake(ideal());
            write(&mut snake, core::array::from_fn(|i| q[i] + compliance * tau[i]));
            assert!(error_rad(&snake, bend, delta) < 1e-7, "{bend_deg} deg, {delta_deg} deg: {:?}", snake.bend_rad());
            for (found, expected) in snake.actuator_loads_n().into_iter().zip(tau) {
                assert!((found - expected).abs() < 1e-5, "load {found} N, expected {expected} N");
            }
            assert_eq!(snake.n_unsolved(), 0);
        }
    }
}

#[test]
fn an_uncompensated_command_reaches_about_half_the_bend() {
    let mut snake = snake(ideal());
    write(&mut snake, q_m(60.0 * DEG, 0.0));
    let part = snake.bend_rad()[0] / (60.0 * DEG);
    assert!((part - 0.54).abs() < 0.01, "reached {part} of the command");
}

#[test]
fn compensation_with_the_loading_branch_is_exact_on_a_one_way_ramp_of_the_full_plant() {
    let effects = Truth::default().effects;
    let (capstan, half_play) = ((2.0 * effects.mu * 41.0 * DEG).exp(), effects.play_m / 2.0);
    let (bend, delta) = (50.0 * DEG, 25.0 * DEG);
    let q_tilde = |bend: f64| -> [f64; 3] {
        let (q, tau) = (q_m(bend, delta), tau_n(bend, delta, effects.load_scale));
        core::array::from_fn(|i| {
            let sign = tau[i].signum();
            let cone = (tau[i] + sign * effects.f_s_n) * capstan;
            q[i] + 0.480 / axial_n() * tau[i] + 0.058 / axial_n() * cone + sign * half_play
        })
    };
    let mut snake = snake(effects.clone());
    for step in 1..=50 {
        write(&mut snake, q_tilde(bend * f64::from(step) / 50.0));
    }
    assert!(error_rad(&snake, bend, delta) < 1e-3 * DEG, "error {} deg", error_rad(&snake, bend, delta) / DEG);
}

#[test]
fn play_leaves_a_dead_band_of_its_full_width_after_a_reversal() {
    let play_m = 0.178e-3;
    let mut snake = snake(EffectsTruth { play_m, ..ideal() });
    let direction = [-1.0, 0.5, 0.5];
    let at = |s: f64| direction.map(|d| d * s);
    // Line 1 travels fastest and leaves its gap first.
    write(&mut snake, at(1.5e-3));
    let top = snake.bend_rad();
    write(&mut snake, at(1.5e-3 - 0.999 * play_m));
    assert_eq!(snake.bend_rad(), top, "inside the gap nothing moves at all");
    write(&mut snake, at(1.5e-3 - 1.1 * play_m));
    assert!(snake.bend_rad()[0] < top[0] - 1e-4, "behind the gap it moves");
}

/// Width of the actuator load's loop on line 1 for a small motion up and down around a bend.
fn loop_width_n(middle_deg: f64, effects: EffectsTruth) -> f64 {
    let mut snake = snake(effects);
    let middle = q_m(2.0 * middle_deg * DEG, 0.0);
    let offset = |part: f64| middle.map(|q| q * part);
    let swing = 0.6e-3 / middle[0].abs();
    write(&mut snake, offset(1.0 - swing));
    write(&mut snake, offset(1.0));
    let (up, up_bend) = (snake.actuator_loads_n()[0], snake.bend_rad()[0]);
    write(&mut snake, offset(1.0 + swing));
    let mut part = 1.0 + swing;
    while snake.bend_rad()[0] > up_bend {
        part -= swing / 1000.0;
        write(&mut snake, offset(part));
    }
    (snake.actuator_loads_n()[0] - up).abs()
}

#[test]
fn the_capstan_loop_widens_with_the_load_and_closes_without_friction() {
    let capstan = EffectsTruth { mu: 0.1727, ..ideal() };
    let (small, large) = (loop_width_n(15.0, capstan.clone()), loop_width_n(45.0, capstan));
    assert!(small > 1.0, "{small} N");
    assert!((large / small - 3.0).abs() < 0.3, "three times the load, {} times the width", large / small);
    assert!(loop_width_n(45.0, ideal()) < 0.1);
}

#[test]
fn wire_friction_jumps_by_twice_its_value_at_a_reversal_even_unloaded() {
    let mut snake = snake(EffectsTruth { f_s_n: 1.959, ..ideal() });
    // A common motion loads no bend: push through, then pull back until every line slips the other way.
    write(&mut snake, [0.3e-3; 3]);
    let pushed = snake.actuator_loads_n()[0];
    let stuck = snake.clone();
    write(&mut snake, [0.3e-3 - 1e-6; 3]);
    let drop_per_m = (pushed - snake.actuator_loads_n()[0]) / 1e-6;
    // While it sticks only the cone is squeezed.
    assert!((drop_per_m / (axial_n() / 0.058) - 1.0).abs() < 1e-6);
    let mut snake = stuck;
    write(&mut snake, [0.3e-3 - 40e-6; 3]);
    let slope_total = (0.480 + 0.058) / axial_n() + 3.0 * L_M / axial_n();
    let jump = pushed - snake.actuator_loads_n()[0] - 40e-6 / slope_total;
    let expected = 2.0 * 1.959 * (1.0 - 0.058 / axial_n() / slope_total);
    assert!((jump - expected).abs() < 1e-6, "jump {jump} N, expected {expected} N");
}

#[test]
fn a_common_command_makes_preload_and_no_bend() {
    let mut snake = snake(ideal());
    write(&mut snake, [0.178e-3; 3]);
    assert!(error_rad(&snake, 0.0, 0.0) < 1e-12);
    let expected = 0.178e-3 / ((0.480 + 0.058 + 3.0 * L_M) / axial_n());
    for load in snake.actuator_loads_n() {
        assert!((load - expected).abs() < 1e-9, "{load} N, expected {expected} N");
    }
    let q = q_m(40.0 * DEG, 0.7);
    write(&mut snake, q);
    let without = snake.bend_rad();
    write(&mut snake, q.map(|q| q + 0.178e-3));
    assert!((snake.bend_rad()[0] - without[0]).hypot(snake.bend_rad()[1] - without[1]) < 1e-9);
}

#[test]
fn commands_passed_on_to_the_next_line_turn_the_snake_by_120_degrees() {
    let (mut one, mut two) = (snake(Truth::default().effects), snake(Truth::default().effects));
    for (bend_deg, delta) in [(30.0, 0.3), (50.0, 1.2), (20.0, 2.0), (45.0, -1.0)] {
        let q = q_m(bend_deg * DEG, delta);
        write(&mut one, q);
        write(&mut two, [q[2], q[0], q[1]]);
        let ([x, y], turn) = (one.bend_rad(), -2.0 * PI / 3.0);
        let expected = [x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos()];
        let found = two.bend_rad();
        assert!((found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-9, "{found:?}, expected {expected:?}");
    }
}

/// Work that the actuators do over one lap of a closed path, J.
fn work_per_lap_j(effects: EffectsTruth) -> f64 {
    let mut snake = snake(effects);
    let path = |k: u32| {
        let t = f64::from(k) / 4000.0 * 2.0 * PI;
        q_m((40.0 + 25.0 * (2.0 * t).sin()) * DEG, 1.5 * t.sin())
    };
    let mut work = 0.0;
    for lap in 0..2 {
        for k in 0..4000 {
            let (from, before) = (snake.q_tilde_m(), snake.actuator_loads_n());
            write(&mut snake, path(k + 1));
            let (to, after) = (snake.q_tilde_m(), snake.actuator_loads_n());
            if lap == 1 {
                work += (0..3).map(|i| 0.5 * (before[i] + after[i]) * (to[i] - from[i])).sum::<f64>();
            }
        }
    }
    work
}

#[test]
fn a_closed_loop_costs_energy_with_friction_and_none_without() {
    let free = work_per_lap_j(ideal());
    let with_capstan = work_per_lap_j(EffectsTruth { mu: 0.1727, ..ideal() });
    let with_both = work_per_lap_j(EffectsTruth { mu: 0.1727, f_s_n: 1.959, ..ideal() });
    assert!(with_capstan > 1e-3, "{with_capstan} J");
    assert!(with_both > with_capstan, "{with_both} J");
    assert!(free.abs() < 1e-4 * with_capstan, "{free} J");
}

#[test]
fn one_large_write_ends_where_many_small_ones_end() {
    let (mut large, mut small) = (snake(Truth::default().effects), snake(Truth::default().effects));
    let mut from = [0.0; 3];
    for (bend_deg, delta) in [(70.0, 0.3), (20.0, 1.0), (60.0, -2.0), (0.0, 0.0), (35.0, 2.5)] {
        let to = q_m(1.6 * bend_deg * DEG, delta);
        write(&mut large, to);
        for k in 1..=7001 {
            let part = f64::from(k) / 7001.0;
            write(&mut small, core::array::from_fn(|i| from[i] + part * (to[i] - from[i])));
        }
        from = to;
        let (a, b) = (large.bend_rad(), small.bend_rad());
        let apart_deg = (a[0] - b[0]).hypot(a[1] - b[1]) / DEG;
        assert!(apart_deg < 1e-3, "{apart_deg} deg apart");
    }
}

#[test]
fn a_tip_force_bends_a_straight_snake_its_way() {
    let mut snake = snake(EffectsTruth { tip_force_in_base_n: [0.1, 0.0], ..ideal() });
    write(&mut snake, [0.0; 3]);
    let [x, y] = snake.bend_rad();
    let inertia = PI / 64.0 * (0.66e-3_f64.powi(4) - 0.50e-3_f64.powi(4));
    let lines = 1.5 * R_M * R_M * axial_n() / (0.480 + 0.058);
    let expected = 0.1 * L_M / 2.0 / (4.0 * 54e9 * inertia / L_M + lines);
    assert!((x / expected - 1.0).abs() < 1e-3 && y.abs() < 1e-9, "{x} rad, expected {expected} rad");
    assert_eq!(snake.n_unsolved(), 0);
}

#[test]
fn asymmetry_makes_pulled_lines_softer_than_pushed_ones() {
    let mut snake = snake(EffectsTruth { asymmetry: 0.2, ..ideal() });
    write(&mut snake, [0.1e-3; 3]);
    let pushed = snake.actuator_loads_n()[0];
    write(&mut snake, [-0.1e-3; 3]);
    let pulled = snake.actuator_loads_n()[0];
    let lines = (0.480 + 0.058) / axial_n();
    let primary = 3.0 * L_M / axial_n();
    assert!((pushed - 0.1e-3 / (0.8 * lines + primary)).abs() < 1e-9);
    assert!((pulled + 0.1e-3 / (1.2 * lines + primary)).abs() < 1e-9);
}

#[test]
fn the_same_commands_give_the_same_bytes() {
    let run = || {
        let mut snake = snake(Truth::default().effects);
        let mut bytes = Vec::new();
        for k in 0..3000_i64 {
            let t = k as f64 * 1e-3;
            snake.write(k * 1_000_000, lines(q_m(0.8 * (2.0 * t).sin(), 1.3 * t))).unwrap();
            let reading = snake.read(k * 1_000_000).unwrap();
            let shape = snake.shape(k * 1_000_000).map_or([0.0; 2], |shape| match shape.seen {
                SeenShape::Bend(bend_rad) => bend_rad,
                SeenShape::Joints(..) => [f64::NAN; 2],
            });
            for x in reading.q_tilde_m.into_iter().chain(reading.tau_n).chain(shape) {
                bytes.extend(x.to_le_bytes());
            }
        }
        bytes
    };
    assert_eq!(run(), run());
}

#[test]
fn the_paper_s_eighty_degrees_fit_the_default_limits() {
    let (mut load, mut stroke): (f64, f64) = (0.0, 0.0);
    for delta_deg in 0..12 {
        let mut snake = snake(Truth::default().effects);
        let mut part = 0.0;
        while snake.bend_rad()[0].hypot(snake.bend_rad()[1]) < 80.0 * DEG {
            part += 0.002;
            write(&mut snake, q_m(part * 80.0 * DEG, f64::from(delta_deg) * 30.0 * DEG));
        }
        load = snake.actuator_loads_n().into_iter().fold(load, |m, x| m.max(x.abs()));
        stroke = snake.q_tilde_m().into_iter().fold(stroke, |m, x| m.max(x.abs()));
    }
    println!("80 deg needs {load:.1} N and {:.2} mm", stroke * 1e3);
    let limits = krait_slave::Limits::default();
    assert!(load < limits.pull_n.min(limits.push_n) && load > 0.7 * limits.pull_n, "needs {load} N");
    assert!(stroke < limits.stroke_m && stroke > 0.8 * limits.stroke_m, "needs {stroke} m");
}

fn any_effects() -> impl Strategy<Value = EffectsTruth> {
    (0.0..2e-3, 0.2..5.0, 0.0..1.0, 0.0..20.0, -0.5..0.5, [-1.0..1.0, -1.0..1.0]).prop_map(
        |(play_m, load_scale, mu, f_s_n, asymmetry, tip_force_in_base_n)| EffectsTruth {
            play_m,
            load_scale,
            mu,
            f_s_n,
            asymmetry,
            tip_force_in_base_n,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_command_within_five_millimetres_makes_the_default_snake_leave_the_numbers(
        path in prop::collection::vec([-5e-3..5e-3, -5e-3..5e-3, -5e-3..5e-3], 1..12)
    ) {
        let mut snake = snake(Truth::default().effects);
        for command in path {
            write(&mut snake, command);
            prop_assert!(snake.bend_rad().into_iter().chain(snake.actuator_loads_n()).all(f64::is_finite));
            prop_assert_eq!(snake.n_unsolved(), 0);
        }
    }

    #[test]
    fn no_truth_in_range_makes_the_snake_leave_the_numbers(
        effects in any_effects(),
        (inside, cone_radius_m) in (0.0..1.5, prop_oneof![4 => Just(0.0), 1 => 0.0..0.04]),
        path in prop::collection::vec([-5e-3..5e-3, -5e-3..5e-3, -5e-3..5e-3], 1..6)
    ) {
        let lines = LinesTruth { inside, cone_radius_m, ..LinesTruth::default() };
        let mut snake = SimulatedSnake::new(&Truth { effects, lines, ..Truth::default() });
        snake.set_power(0, true).unwrap();
        for command in path {
            write(&mut snake, command);
            prop_assert!(snake.bend_rad().into_iter().chain(snake.actuator_loads_n()).all(f64::is_finite));
            prop_assert_eq!(snake.n_unsolved(), 0);
        }
    }
}
