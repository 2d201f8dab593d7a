//! Loads at the actuators, where load cells are: against numbers of an independent bench, and through play and stick.

use crate::chains::{bends, chain, circumstances, effect};
use krait_model::effects::EffectKind;
use krait_model::{
    Chain, ChainSettings, Circumstances, EffectSetting, KnownColumns, MachineParameters, Prediction, Predictor,
};
use nalgebra::{Matrix3, Vector3};

/// eta, play's half-width (m), f_s (N), phi (rad), by which the rows are derived.
const TRUTH: [f64; 4] = [1.22, 0.089e-3, 1.959, 41.0 * std::f64::consts::PI / 180.0];
const ANGLE_RAD: f64 = 45.0 * std::f64::consts::PI / 180.0;

/// At 45 degrees, delta 0, no common load, while the bend grows: rows are encoders (mm) and load cells (N) of the three lines, by eta,
/// play (mm), f_s (N), phi (deg), b_x, b_y (rad) and the common load (N). From numpy, by differences of a bench of its own.
const BENDING: [[f64; 7]; 6] = [
    [-1.13836, -1.0, -0.00943426, -0.00123316, -3.4595, 0.0, 0.0803222],
    [0.569182, 1.0, 0.00943426, 0.000672288, 1.72975, 2.98959, 0.0803222],
    [0.569182, 1.0, 0.00943426, 0.000672288, 1.72975, -2.98959, 0.0803222],
    [-20.6999, 0.0, -1.28039, -0.167361, -32.2855, 0.0, 1.28039],
    [10.35, 0.0, 1.28039, 0.0912407, 16.1428, 27.8433, 1.28039],
    [10.35, 0.0, 1.28039, 0.0912407, 16.1428, -27.8433, 1.28039],
];
/// The same while the bend shrinks.
const RETURNING: [[f64; 7]; 6] = [
    [-1.07888, 1.0, 0.00575473, 0.000616284, -3.36672, 0.0, 0.0766427],
    [0.539438, -1.0, -0.00575473, -0.000274161, 1.68336, 2.90958, 0.0766427],
    [0.539438, -1.0, -0.00575473, -0.000274161, 1.68336, -2.90958, 0.0766427],
    [-12.6266, 0.0, 0.781013, 0.0836401, -19.6936, 0.0, 0.781013],
    [6.31329, 0.0, -0.781013, -0.0372083, 9.84679, 16.9839, 0.781013],
    [6.31329, 0.0, -0.781013, -0.0372083, 9.84679, -16.9839, 0.781013],
];
/// Load of line 1 there, N.
const LOAD_1_N: [f64; 2] = [-27.7622, -13.8744];

fn four([eta, half_width_m, f_s_n, phi_rad]: [f64; 4]) -> Chain {
    let effects = [
        effect(EffectKind::StiffnessScale, &[("eta", eta)]),
        effect(EffectKind::StaticFriction, &[("f_s_n", f_s_n)]),
        EffectSetting::new(EffectKind::ConeFriction),
        effect(EffectKind::Backlash, &[("half_width_m", half_width_m)]),
    ];
    let machine = MachineParameters { phi_rad, ..MachineParameters::default() };
    Chain::new(&machine, ChainSettings::default(), &effects, KnownColumns::default()).unwrap()
}

/// Encoder positions at which an elastic snake of scale eta stands at a bend without friction, play and common load, m, and its loads, N.
fn elastic(bend_rad: f64, eta: f64) -> (Vector3<f64>, Vector3<f64>) {
    let snake = krait_model::Snake::new(&MachineParameters::default()).unwrap();
    let bend_rad = nalgebra::Vector2::new(bend_rad, 0.0);
    (snake.q(bend_rad), snake.tau_n(bend_rad) * eta)
}

/// Encoders of the bench at a bend, going up (1) or back (-1), m.
fn encoders_m(bend_rad: f64, way: f64) -> Vector3<f64> {
    let machine = MachineParameters::default();
    let [eta, h, f_s, phi] = TRUTH;
    let (q, load) = elastic(bend_rad, eta);
    let ea = krait_model::Snake::new(&machine).unwrap().axial_stiffness_n();
    q.zip_map(&load, |q, t| {
        let s = way * q.signum();
        let g = (2.0 * 0.1727 * phi * if s * (t + s * f_s) > 0.0 { 1.0 } else { -1.0 }).exp();
        q + t * machine.l_d_m / ea + g * (t + s * f_s) * machine.l_c_m / ea + s * h
    })
}

/// A snake that has come to 45 degrees, going up or back.
fn arrived(chain: &Chain, way: f64) -> Predictor {
    let mut predictor = chain.predictor();
    let mut at = |bend_rad: f64, way: f64| predictor.step(encoders_m(bend_rad, way), &Circumstances::at(0.0));
    let fine = |k: u32| f64::from(k) / 400.0 * ANGLE_RAD;
    for k in 1..=400 {
        at(fine(k), 1.0);
    }
    if way < 0.0 {
        for k in 401..=550 {
            at(fine(k), 1.0);
        }
        for k in (400..550).rev() {
            at(fine(k), -1.0);
        }
    }
    predictor
}

fn outputs(prediction: &Prediction) -> [f64; 6] {
    let (b, load) = (prediction.bend_rad, prediction.actuator_load_n);
    [b.x, b.y, prediction.tau_common_n, load.x, load.y, load.z]
}

#[test]
fn loads_at_the_actuators_are_those_of_the_bench_bending_and_returning() {
    for (way, expected) in [1.0, -1.0].into_iter().zip(LOAD_1_N) {
        let mut predictor = arrived(&four(TRUTH), way);
        let found = predictor.step(encoders_m(ANGLE_RAD, way), &Circumstances::at(0.0));
        assert!((found.bend_rad.x - ANGLE_RAD).abs() < 1e-9 && found.tau_common_n.abs() < 1e-6, "{found:?}");
        assert!((found.actuator_load_n.x - expected).abs() < 1e-4, "{found:?}");
        assert_eq!(found.actuator_load_n.y, found.actuator_load_n.z);
    }
}

/// At given encoders: d(b, t) = -(dq/d(b, t))^-1 dq/d parameter, and d load = that, through the lower rows, and the parameter's own.
#[test]
fn loads_and_shape_change_with_the_parameters_and_encoders_as_the_bench_s_rows_say() {
    for (way, rows) in [(1.0, BENDING), (-1.0, RETURNING)] {
        let block = |first: usize| Matrix3::from_fn(|i, k| rows[first + i][4 + k]);
        let inverse = block(0).try_inverse().unwrap();
        for parameter in 0..4 {
            let own = |first: usize| Vector3::from_fn(|i, _| rows[first + i][parameter]);
            let shape = -inverse * own(0);
            let load = block(3) * shape + own(3);
            // Steps in the units of the rows: 1, mm, N, degrees.
            let (unit, reach) = [(1.0, 1e-5), (1e-3, 1e-4), (1.0, 1e-4), (1_f64.to_radians(), 1e-3)][parameter];
            let at = |side: f64| {
                let mut values = TRUTH;
                values[parameter] += side * reach * unit;
                outputs(&arrived(&four(values), way).step(encoders_m(ANGLE_RAD, way), &Circumstances::at(0.0)))
            };
            let (up, down) = (at(1.0), at(-1.0));
            for (k, expected) in shape.iter().chain(load.iter()).enumerate() {
                let found = (up[k] - down[k]) / (2.0 * reach);
                let size = if k < 2 { 0.1 } else { 1.0 };
                assert!((found - expected).abs() < 2e-4 * size, "{way} {parameter} {k}: {found} and {expected}");
            }
        }
    }
}

/// Turning round at 45 degrees: with play alone nothing changes over its whole width, with static friction alone the load changes from
/// the first micrometre on, along the cone's stiffness and by 2 f_s in all.
#[test]
fn while_play_is_taken_up_no_load_changes_and_static_friction_turns_it_round_gradually() {
    let (half_width_m, f_s_n) = (0.089e-3, 1.959);
    let play = chain(&[effect(EffectKind::Backlash, &[("half_width_m", half_width_m)])], ChainSettings::default());
    let friction = chain(&[effect(EffectKind::StaticFriction, &[("f_s_n", f_s_n)])], ChainSettings::default());
    let machine = MachineParameters::default();
    let ea = krait_model::Snake::new(&machine).unwrap().axial_stiffness_n();
    let (q, _) = elastic(ANGLE_RAD, 1.0);
    let way = q.map(f64::signum);
    for (chain, is_play) in [(play, true), (friction, false)] {
        let mut predictor = chain.predictor();
        let (top, _) = elastic(2.0 * ANGLE_RAD, 1.0);
        for k in 1..=200 {
            predictor.step(top * (f64::from(k) / 200.0), &Circumstances::at(0.0));
        }
        let start = predictor.step(top, &Circumstances::at(0.0));
        let mut seen = Vec::new();
        for k in 1..=250 {
            let back_m = 1e-6 * f64::from(k);
            let now = predictor.step(top - way * back_m, &Circumstances::at(0.0));
            let change = now.actuator_load_n - start.actuator_load_n;
            let moved = (now.bend_rad - start.bend_rad).norm();
            seen.push((back_m, change.x.abs(), moved));
        }
        if is_play {
            let inside = seen.iter().filter(|(back_m, ..)| *back_m < 2.0 * half_width_m - 1e-9);
            assert!(
                inside.clone().count() == 177
                    && inside.clone().all(|(_, change, moved)| *change < 1e-9 && *moved < 1e-12)
            );
            assert!(seen.last().unwrap().1 > 0.3, "beyond the play the load falls");
        } else {
            let k_c = ea / machine.l_c_m;
            let stick_m = 2.0 * f_s_n / k_c;
            let stuck = seen.iter().take_while(|(back_m, ..)| *back_m < stick_m);
            assert_eq!(stuck.clone().count(), 28, "3.918 N on 135.7 N/mm");
            for (back_m, change, moved) in stuck {
                assert!((change - back_m * k_c).abs() < 1e-6 && *moved < 1e-12, "{back_m} {change} {moved}");
            }
            assert!(seen.last().is_some_and(|(.., moved)| *moved > 1e-3), "beyond that the snake follows");
        }
    }
}

#[test]
fn without_friction_the_actuators_carry_what_the_snake_does() {
    let chain = chain(&[EffectSetting::new(EffectKind::Backlash)], ChainSettings::default());
    let (mut compensator, mut predictor) = (chain.compensator().unwrap(), chain.predictor());
    for (k, b) in bends().step_by(10).enumerate() {
        let at = circumstances(k);
        let found = predictor.step(compensator.step(b, &at).q_tilde_m, &at);
        assert_eq!(found.actuator_load_n, found.tau_n);
    }
}
