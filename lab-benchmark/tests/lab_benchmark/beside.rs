//! A known effect of a snake is named beside one that no effect of the library makes, and a rest is said to remain.

use krait_lab::diagnose::{DiagnoseOptions, Verdict, diagnose};
use krait_lab::machine::SnakeLab;
use krait_lab_benchmark::generate::{Kind, Motion, Recipe, base_model, generate};
use krait_model::model_file::ModelFile;

/// The verdict on an unknown and a known kind together, and the names that are asserted.
fn answer(kinds: [&str; 2], motion: Motion, seed: u64) -> (Verdict, Vec<String>) {
    let hidden = kinds.map(|name| Kind::from_name(name).unwrap()).into_iter().zip([2.5, 1.5]).collect();
    let made = generate(&Recipe { hidden, motion, seconds: 60.0, seed, ..Recipe::default() }).unwrap();
    let snake = SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap();
    let found = diagnose(&snake, &made.measurements, &DiagnoseOptions::default()).unwrap();
    (found.verdict, found.effects.into_iter().map(|effect| effect.name).collect())
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn friction_is_named_beside_planes_that_the_snake_prefers() {
    let found = answer(["x_detent", "bend-friction"], Motion::Teleop, 11);
    assert_eq!(found, (Verdict::Partly, vec!["bend-friction".to_owned()]));
}

#[test]
fn a_collision_is_no_drift_beside_friction() {
    let (verdict, names) = answer(["x_collision", "static-friction"], Motion::Rich, 12);
    assert_eq!((verdict, names.len()), (Verdict::Partly, 1), "{names:?}");
    assert!(Kind::from_name("static-friction").unwrap().right.contains(&names[0].as_str()), "{names:?}");
}
