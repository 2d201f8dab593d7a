//! Effects of a joint that act in another order than the usual one, a shape that no order makes, and a command that was rounded.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::JointsLab;
use krait_lab::{Measurements, Quantity};
use krait_model::model_file::ModelFile;

const ROWS: usize = 3000;
const STEP_S: f64 = 0.02;
/// The plant makes so many steps from one row to the next.
const FINE: usize = 40;

/// What a joint whose position follows the hand's motion by `follow(u, dt_s)` shows with noise: gain 1.2, offset 0.1 rad. The commands are
/// recorded in steps of `rounded` rad where that is not zero.
fn diagnosed(rounded: f64, mut follow: impl FnMut(f64, f64) -> f64) -> Diagnosis {
    let mut noise = Noise(7);
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for step in 0..ROWS * FINE {
        let at = |hz: f64, phase: f64| (core::f64::consts::TAU * hz * STEP_S / FINE as f64 * step as f64 + phase).sin();
        let u = 0.45 * at(0.11, 0.0) + 0.35 * at(0.29, 1.0) + 0.2 * at(0.43, 2.0);
        let y = follow(u, STEP_S / FINE as f64);
        if step % FINE == 0 {
            inputs.push(if rounded > 0.0 { (u / rounded).round() * rounded } else { u });
            outputs.push(1.2 * y + 0.1 + 2e-3 * noise.normal());
        }
    }
    diagnosed_of(STEP_S, inputs, outputs)
}

/// What is said of one joint's commands and positions at rows of this step.
pub(super) fn diagnosed_of(step_s: f64, inputs: Vec<f64>, outputs: Vec<f64>) -> Diagnosis {
    let time_s = (0..inputs.len()).map(|row| step_s * row as f64).collect();
    let data = Measurements::bare("made.csv".to_owned(), Quantity::Joints, time_s, (inputs, 1), (outputs, 1));
    let file = ModelFile::parse("format = 1\n[machine]\nkind = \"joints\"\nn = 1\n").expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    diagnose(&machine, &data, &DiagnoseOptions::default()).expect("computed")
}

/// A lag, step by step.
fn lag(time_s: f64) -> impl FnMut(f64, f64) -> f64 {
    let mut behind = None;
    move |x, dt_s| {
        let own = behind.get_or_insert(x);
        *own += (x - *own) * dt_s / time_s;
        *own
    }
}

/// Play, step by step.
pub(super) fn play(half_width: f64) -> impl FnMut(f64) -> f64 {
    let mut behind = None;
    move |x| {
        let own = behind.get_or_insert(x);
        *own = own.clamp(x - half_width, x + half_width);
        *own
    }
}

/// Effects in the order in which they act, and values of some numbers within 5 %.
fn is_found(found: &Diagnosis, effects: &[&str], values: &[(&str, &str, f64)]) {
    let names: Vec<&str> = found.terms.iter().map(|term| term.name.as_str()).collect();
    assert_eq!((found.verdict, names.as_slice()), (Verdict::Missing, effects), "{}", found.sentence);
    for (effect, parameter, truth) in values {
        let own = found.effects.iter().find(|own| own.name == *effect).expect("named");
        let value = own.parameters.iter().find(|own| own.name == *parameter).expect("a parameter").value;
        assert!((value / truth - 1.0).abs() < 0.05, "{effect}.{parameter} is {value}, made with {truth}");
    }
}

#[test]
fn a_gear_behind_a_lagging_drive_has_its_own_size() {
    let mut lag = lag(0.15);
    let found = diagnosed(0.0, |u, dt_s| {
        let x = lag(u, dt_s);
        x + 0.025 * (core::f64::consts::TAU * x / 0.35 + 1.0).sin()
    });
    let values = [("periodic-error", "amplitude", 0.025), ("first-order-lag", "time_s", 0.15)];
    is_found(&found, &["first-order-lag", "periodic-error"], &values);
}

#[test]
fn play_behind_a_dead_zone_is_not_a_dead_zone_behind_play() {
    let mut play = play(0.06);
    let found = diagnosed(0.0, |u, _| play(u - (u - 0.1).clamp(-0.12, 0.12)));
    let values = [("backlash", "half_width", 0.06), ("dead-zone", "half_width", 0.12)];
    is_found(&found, &["dead-zone", "backlash"], &values);
}

#[test]
fn a_lag_behind_play_is_not_play_behind_a_lag() {
    let (mut play, mut lag) = (play(0.06), lag(0.2));
    let found = diagnosed(0.0, |u, dt_s| lag(play(u), dt_s));
    let values = [("backlash", "half_width", 0.06), ("first-order-lag", "time_s", 0.2)];
    is_found(&found, &["backlash", "first-order-lag"], &values);
}

#[test]
fn the_usual_order_stays() {
    let (mut play, mut lag) = (play(0.06), lag(0.2));
    let found = diagnosed(0.0, |u, dt_s| play(lag(u, dt_s)));
    is_found(&found, &["first-order-lag", "backlash"], &[("backlash", "half_width", 0.06)]);
}

#[test]
fn hysteresis_that_unloads_straight_is_no_friction_by_load() {
    let (mut z, mut last) = (0.0, None);
    let found = diagnosed(0.0, |u, _| {
        let change = u - last.replace(u).unwrap_or(u);
        let sign = if z * change > 0.0 { 1.0 } else { -1.0 };
        z += change / 0.14 * (1.0 - 0.5 * f64::abs(z) * sign - 0.5 * f64::abs(z));
        u - 0.08 * z
    });
    is_found(&found, &["bouc-wen"], &[("bouc-wen", "amplitude", 0.08), ("bouc-wen", "gamma", 0.5)]);
}

#[test]
fn a_gain_that_warms_up_is_never_called_noise() {
    let mut time_s = 0.0;
    let found = diagnosed(0.0, |u, dt_s| {
        time_s += dt_s;
        u * (1.0 + 0.12 * (1.0 - (-time_s / 15.0_f64).exp()))
    });
    assert!(matches!(found.verdict, Verdict::Unknown | Verdict::Partly), "{}", found.sentence);
}

#[test]
fn a_command_that_was_rounded_has_neither_a_swing_nor_a_clock() {
    let mut play = play(0.07);
    let found = diagnosed(0.01, |u, _| play(u));
    let names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    assert_eq!((names.as_slice(), found.clocks.len()), (&["backlash"][..], 0), "{}", found.sentence);
}
