//! A camera whose clock is not the encoders': the clock is reported as calibration, and the effects are named as if both were one.

use krait_lab::diagnose::{Calibration, DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::SnakeLab;
use krait_lab::{ClockOffset, Measurements};
use krait_lab_benchmark::generate::{Kind, Motion, Recipe, base_model, generate};
use krait_model::model_file::ModelFile;

/// Data with these kinds hidden, whose measurements come ahead of the encoders by this clock, a second of theirs being so much longer.
fn by_clock(kinds: &[(&str, f64)], seed: u64, clock: ClockOffset) -> Measurements {
    let hidden = kinds.iter().map(|(name, size)| (Kind::from_name(name).unwrap(), *size)).collect();
    let made = generate(&Recipe { hidden, motion: Motion::Rich, seconds: 80.0, seed, ..Recipe::default() }).unwrap();
    let data = made.measurements;
    let middle_s = 0.5 * (data.time_s[0] + data.time_s[data.n_rows() - 1]);
    // What the encoders say of t is what they were a little before: the measurement of t is ahead of it.
    let at = |t: f64| t - clock.shift_s - clock.rate * (t - middle_s);
    let mut inputs = Vec::new();
    for &t in &data.time_s {
        let after = data.time_s.partition_point(|own| *own < at(t)).clamp(1, data.n_rows() - 1);
        let (early, late) = (data.time_s[after - 1], data.time_s[after]);
        let part = ((at(t) - early) / (late - early)).clamp(0.0, 1.0);
        let between = |(a, b): (&f64, &f64)| a + part * (b - a);
        inputs.extend(data.input(after - 1).iter().zip(data.input(after)).map(between));
    }
    Measurements { inputs, ..data }
}

fn diagnosed(data: &Measurements) -> Diagnosis {
    let snake = SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap();
    diagnose(&snake, data, &DiagnoseOptions::default()).unwrap()
}

fn names(found: &Diagnosis) -> Vec<&str> {
    found.effects.iter().map(|own| own.name.as_str()).collect()
}

fn number<'a>(found: &'a Diagnosis, name: &str) -> &'a Calibration {
    found.calibration.iter().find(|own| own.name == name).unwrap_or_else(|| panic!("no {name}: {}", found.sentence))
}

/// Whether one of the names that are right for this kind is among those that were found.
fn is_named(found: &Diagnosis, kind: &str) -> bool {
    let right = Kind::from_name(kind).unwrap().right;
    names(found).iter().any(|own| right.contains(own))
}

fn assert_near(found: &Calibration, truth: f64) {
    assert!(
        (found.value - truth).abs() < 3.0 * found.se,
        "{} {} +- {}, true {truth}",
        found.name,
        found.value,
        found.se
    );
    assert!(found.se < 0.1 * truth.abs(), "{} +- {} says nothing of {truth}", found.name, found.se);
}

#[test]
fn a_camera_ahead_of_the_encoders_is_calibration_and_nothing_is_missing() {
    let found = diagnosed(&by_clock(&[], 21, ClockOffset { shift_s: 0.045, rate: 0.0 }));
    assert_eq!((found.verdict, names(&found)), (Verdict::None, vec![]), "{}", found.sentence);
    assert_near(number(&found, "delay"), -0.045);
    assert!(found.cautions.iter().any(|own| own.contains("ahead of the motion")), "{:?}", found.cautions);
    assert!(found.as_given_rms > 1.2 * found.final_heldout_rms, "the camera's lead is in the model as given");
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn effects_beside_a_camera_that_is_ahead_are_named_as_without() {
    let kinds = [("backlash", 2.0), ("stiffness", 2.0)];
    let found = diagnosed(&by_clock(&kinds, 22, ClockOffset { shift_s: 0.06, rate: 0.0 }));
    assert_eq!((found.verdict, names(&found).len()), (Verdict::Missing, 2), "{:?}", names(&found));
    assert!(kinds.iter().all(|(kind, _)| is_named(&found, kind)), "{:?}", names(&found));
    assert_near(number(&found, "delay"), -0.06);
}

/// Effects that imitate the clock give way to the effect that is there, search by search.
#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn a_friction_beside_a_camera_that_is_ahead_is_found_though_others_imitate_it() {
    let kinds = [("cone", 2.0), ("camera-offset", 1.5)];
    let found = diagnosed(&by_clock(&kinds, 23, ClockOffset { shift_s: 0.06, rate: 0.0 }));
    assert_eq!((found.verdict, names(&found).len()), (Verdict::Missing, 2), "{:?}", names(&found));
    assert!(kinds.iter().all(|(kind, _)| is_named(&found, kind)), "{:?}", names(&found));
    assert_near(number(&found, "delay"), -0.06);
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn a_clock_of_another_rate_is_calibration_beside_an_effect() {
    let found = diagnosed(&by_clock(&[("stiffness", 2.0)], 24, ClockOffset { shift_s: 0.0, rate: 1500e-6 }));
    assert_eq!((found.verdict, names(&found).len()), (Verdict::Missing, 1), "{:?}", names(&found));
    assert!(is_named(&found, "stiffness"), "{:?}", names(&found));
    assert_near(number(&found, "clock-rate"), 1500.0);
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn a_camera_that_comes_late_is_the_effect_that_it_was() {
    let found = diagnosed(&by_clock(&[], 25, ClockOffset { shift_s: -0.06, rate: 0.0 }));
    assert_eq!((found.verdict, found.calibration.len(), found.clocks.len()), (Verdict::Missing, 0, 0));
    assert!(is_named(&found, "delay"), "{:?}", names(&found));
}
