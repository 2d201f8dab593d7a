//! Each effect that a truth file can hide: it shows where it should, and is gone at its neutral value.

use core::f64::consts::PI;
use krait_sim::{BendingTruth, EffectsTruth, EncodersTruth, LinesTruth, SightTruth, SimulatedSnake, SlowTruth, Truth};
use krait_slave::{Drive, lines};

const MS: i64 = 1_000_000;
const DEG: f64 = PI / 180.0;

fn bare() -> Truth {
    Truth { effects: EffectsTruth::none(), ..Truth::default() }
}

fn snake(truth: &Truth) -> SimulatedSnake {
    truth.check("test").unwrap();
    let mut snake = SimulatedSnake::new(truth);
    snake.set_power(0, true).unwrap();
    snake
}

/// About the command for a bend vector: twice what lines without stretch need.
fn q_m(bend: [f64; 2]) -> [f64; 3] {
    core::array::from_fn(|i| {
        let (sin, cos) = (i as f64 * 2.0 * PI / 3.0).sin_cos();
        -2.0 * 1.684e-3 * (bend[0] * cos - bend[1] * sin)
    })
}

/// What is seen along a path with planes up and down, rotations and rests, 5 ms a step.
fn seen(truth: &Truth) -> Vec<[f64; 2]> {
    let mut snake = snake(truth);
    let mut seen = Vec::new();
    for k in 0..6000_i64 {
        let t = k as f64 * 5e-3;
        let size = 60.0 * DEG * (0.7 * t).sin().abs().min(0.8);
        let delta = 0.5 * t;
        snake.write(k * 5 * MS, krait_slave::lines(q_m([size * delta.cos(), size * delta.sin()]))).unwrap();
        seen.push(snake.seen_rad(k * 5 * MS));
    }
    assert_eq!(snake.n_unsolved(), 0, "{truth:?}");
    seen
}

fn apart_deg(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    (a.iter().zip(b).map(square).sum::<f64>() / a.len() as f64).sqrt() / DEG
}

#[test]
fn every_hidden_effect_shows_and_solves_and_repeats() {
    let base = seen(&bare());
    let in_lines = |lines: LinesTruth| Truth { lines, ..bare() };
    let bending = |bending: BendingTruth| Truth { bending, ..bare() };
    let encoders = |encoders: EncodersTruth| Truth { encoders, ..bare() };
    let sight = |sight: SightTruth| Truth { sight, ..bare() };
    let slow = |slow: SlowTruth| Truth { slow, ..bare() };
    let (l, b, e, s, d) =
        (LinesTruth::default, BendingTruth::default, EncodersTruth::default, SightTruth::default, SlowTruth::default);
    let hidden = [
        ("actuator compliance", in_lines(LinesTruth { actuator_m_per_n: 5e-6, ..l() })),
        ("stretch inside the snake", in_lines(LinesTruth { inside: 1.0, ..l() })),
        ("creep", in_lines(LinesTruth { creep_part: 0.1, creep_time_s: 3.0, ..l() })),
        ("drag", in_lines(LinesTruth { drag_n_s_per_m: 1500.0, ..l() })),
        ("rubbing", in_lines(LinesTruth { rub_n: 1.0, ..l() })),
        ("breakaway", in_lines(LinesTruth { rub_n: 1.0, rub_breakaway: 0.5, ..l() })),
        ("disks", in_lines(LinesTruth { disk_mu: 0.1, ..l() })),
        (
            "friction spread along the cone",
            Truth {
                effects: EffectsTruth { mu: 0.17, ..EffectsTruth::none() },
                ..in_lines(LinesTruth { cone_radius_m: 0.02, ..l() })
            },
        ),
        ("angles", in_lines(LinesTruth { angle_rad: [0.0, 0.05, -0.05], ..l() })),
        ("radii", in_lines(LinesTruth { radius: [0.0, 0.05, -0.05], ..l() })),
        ("softness", in_lines(LinesTruth { softness: [0.0, 0.1, -0.1], ..l() })),
        ("coupling", in_lines(LinesTruth { coupling: [0.05, 0.0, 0.0, 0.0, 0.0, 0.0], ..l() })),
        ("softening", bending(BendingTruth { softening: 0.7, soft_strain: 0.006, ..b() })),
        ("bend friction", bending(BendingTruth { friction_n_m: 1e-3, ..b() })),
        ("bend friction by load", bending(BendingTruth { friction_m: 1e-4, ..b() })),
        ("axial force", bending(BendingTruth { axial_tip_force_n: -0.3, ..b() })),
        ("detents", bending(BendingTruth { detent_n_m_per_rad: 2e-3, ..b() })),
        ("zero", encoders(EncodersTruth { zero_m: [5e-5, 0.0, 0.0], ..e() })),
        ("scale", encoders(EncodersTruth { scale: [0.02, 0.0, 0.0], ..e() })),
        ("screw", encoders(EncodersTruth { screw_m: 3e-5, ..e() })),
        ("twist", sight(SightTruth { twist_rad_per_rad: 0.05, ..s() })),
        ("plane slip", sight(SightTruth { plane_slip_per_rad: 0.1, ..s() })),
        ("dead zone", sight(SightTruth { dead_bend_rad: 0.03, ..s() })),
        ("curvature", sight(SightTruth { curvature_slope: 0.1, ..s() })),
        ("curvature by bend", sight(SightTruth { curvature_slope_per_rad2: 0.3, ..s() })),
        ("product", sight(SightTruth { product_per_rad: 0.1, ..s() })),
        ("camera scale", sight(SightTruth { scale: 0.03, ..s() })),
        ("tilt", sight(SightTruth { offset_rad: [0.01, 0.01], ..s() })),
        ("sway", sight(SightTruth { sway_rad: [0.02, 0.0], ..s() })),
        ("wrong clock", sight(SightTruth { clock_error_s: 0.1, ..s() })),
        ("stiffness drift", slow(SlowTruth { stiffness: 0.1, time_s: 10.0, ..d() })),
        ("line drift", slow(SlowTruth { line_m: [1e-4, 0.0, 0.0], time_s: 10.0, ..d() })),
        ("collision", slow(SlowTruth { collision_m: [1e-4, 0.0, 0.0], collision_time_s: 12.0, ..d() })),
        ("play that appears", slow(SlowTruth { change_play_m: 2e-4, change_time_s: 12.0, ..d() })),
        ("stiffness that appears", slow(SlowTruth { change_stiffness: 0.2, change_time_s: 12.0, ..d() })),
    ];
    for (name, truth) in hidden {
        let with = seen(&truth);
        let apart = apart_deg(&with, &base);
        assert!(apart > 0.1 && apart < 10.0, "{name} shows by {apart} deg");
        assert!(with.iter().flatten().all(|x| x.is_finite()), "{name}");
        assert_eq!(with, seen(&truth), "{name} does not repeat");
    }
}

#[test]
fn rubbing_and_bend_friction_make_loops_and_elastic_effects_none() {
    let width_deg = |truth: Truth| {
        let mut snake = snake(&truth);
        let mut at = |size: f64, k: i64| {
            snake.write(k * MS, krait_slave::lines(q_m([size, 0.0]))).unwrap();
            snake.bend_rad()[0] / DEG
        };
        (0..400).for_each(|k| {
            at(0.4 * k as f64 / 400.0, k);
        });
        let up = at(0.4, 400);
        (0..=800).for_each(|k| {
            at(0.4 + 0.4 * (k as f64 / 400.0 * PI / 2.0).sin(), 401 + k);
        });
        (up - at(0.4, 1202)).abs()
    };
    let hidden = LinesTruth { rub_n: 1.0, ..LinesTruth::default() };
    assert!(width_deg(Truth { lines: hidden, ..bare() }) > 0.5);
    let bending = BendingTruth { friction_n_m: 1e-3, ..BendingTruth::default() };
    assert!(width_deg(Truth { bending, ..bare() }) > 0.5);
    let bending =
        BendingTruth { softening: 0.5, soft_strain: 0.004, axial_tip_force_n: 0.3, ..BendingTruth::default() };
    assert!(width_deg(Truth { bending, ..bare() }) < 1e-6);
}

#[test]
fn creep_goes_on_while_the_actuators_rest_and_nobody_commands() {
    let hidden = LinesTruth { creep_part: 0.2, creep_time_s: 1.0, ..LinesTruth::default() };
    let mut snake = snake(&Truth { lines: hidden, ..bare() });
    for k in 0..100 {
        snake.write(k * MS, krait_slave::lines(q_m([0.6 * k as f64 / 100.0, 0.0]))).unwrap();
    }
    let at_once = snake.bend_rad()[0];
    for k in 100..10_000 {
        snake.shape(k * MS);
    }
    let rested = snake.bend_rad()[0];
    assert!(rested < at_once - 0.5 * DEG, "{at_once} rad at once, {rested} rad after ten seconds");
    // The stretch under load is a fifth more: bend falls by (1 + rho) / (1 + 1.2 rho) with rho = C k_t / r = 0.86.
    assert!((rested / at_once - 1.86 / 2.03).abs() < 0.01, "{}", rested / at_once);
}

#[test]
fn drag_needs_speed_and_a_stiff_snake_of_twice_the_load_bends_less() {
    let end = |drag: f64, n: i64| {
        let hidden = LinesTruth { drag_n_s_per_m: drag, ..LinesTruth::default() };
        let mut snake = snake(&Truth { lines: hidden, ..bare() });
        for k in 0..=n {
            snake.write(k * MS, krait_slave::lines(q_m([0.6 * k as f64 / n as f64, 0.0]))).unwrap();
        }
        snake.bend_rad()[0]
    };
    let (fast, slow, free) = (end(3000.0, 500), end(3000.0, 5000), end(0.0, 500));
    assert!(free - fast > 5.0 * (free - slow) && free - slow > 0.0, "{fast} {slow} {free}");
}

#[test]
fn a_drive_with_false_encoders_still_goes_where_its_encoders_read_the_command() {
    let encoders = EncodersTruth {
        zero_m: [1e-4, 0.0, -1e-4],
        scale: [0.01, 0.0, 0.0],
        screw_m: 1e-5,
        ..EncodersTruth::default()
    };
    let mut snake = snake(&Truth { encoders, ..bare() });
    assert_eq!(snake.q_tilde_m(), [0.0; 3]);
    assert!((snake.read(0).unwrap().q_tilde_m[0] - 1e-4).abs() < 1e-6, "a straight snake reads its zero");
    let command = q_m([0.4, 0.2]);
    snake.write(MS, lines(command)).unwrap();
    let read = snake.read(MS).unwrap().q_tilde_m;
    assert!(read.iter().zip(command).all(|(read, command)| (read - command).abs() <= 0.5e-6), "{read:?}");
    assert!((snake.q_tilde_m()[0] - command[0]).abs() > 5e-5);
}
