//! What a snake's list hides is told: a scale in the values of encoders, and an effect that a fit has put into another minimum.

use krait_lab::diagnose::search::{Search, Trial};
use krait_lab::diagnose::{DiagnoseOptions, diagnose};
use krait_lab::machine::{MachineUnderTest, SnakeLab};
use krait_lab::{Problem, Term};
use krait_lab_benchmark::generate::{Generated, Kind, Motion, Recipe, base_model, generate};
use krait_model::model_file::ModelFile;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn snake() -> SnakeLab {
    SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap()
}

fn made(kinds: &[(&str, f64)], seed: u64) -> Generated {
    let hidden = kinds.iter().map(|(name, size)| (Kind::from_name(name).unwrap(), *size)).collect();
    generate(&Recipe { hidden, motion: Motion::Rich, seconds: 60.0, seed, ..Recipe::default() }).unwrap()
}

/// A camera that sees little across its depth: every output counts by its own noise, so that the other one still tells three effects.
#[test]
fn a_component_of_the_bend_that_is_four_times_as_noisy_hides_no_effect() {
    let mut made = made(&[("softening", 3.0), ("plane-offset", 2.0), ("camera-offset", 2.0)], 13);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut even = || f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5;
    // 1.2 deg, as the sum of twelve even numbers.
    let mut noise = || (0..12).map(|_| even()).sum::<f64>() * 1.2_f64.to_radians();
    made.measurements.outputs.chunks_mut(2).for_each(|row| row[1] += noise());
    let options = DiagnoseOptions { max_effects: 3, ..DiagnoseOptions::default() };
    let found = diagnose(&snake(), &made.measurements, &options).unwrap();
    let mut names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["camera-offset", "plane-offset", "superelastic-softening"], "{}", found.sentence);
    let said = found.cautions.iter().find(|own| own.contains("from row to row")).expect("said");
    assert!(said.starts_with("bend y changes 4.") || said.starts_with("bend y changes 3.9"), "{said}");
}

/// Encoders and a camera that reads too much: the encoders alone explain both, and their values are those of both.
#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn errors_of_encoder_scales_have_room_for_a_scale_of_the_picture() {
    let made = made(&[("encoder-scale", 2.0), ("camera-scale", 1.5)], 5);
    let found = diagnose(&snake(), &made.measurements, &DiagnoseOptions::default()).unwrap();
    let names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["encoder-scale"], "the case that this test is about: {}", found.sentence);
    let truth = &made.answer.known["encoder-scale"];
    for own in found.effects[0].parameters.iter().filter(|own| own.is_free) {
        let off = own.value - truth[&own.name];
        assert!(off.abs() > 4.0 * own.se_naive, "{}: the camera's scale is in it: {off}", own.name);
        assert!(off.abs() < 2.0 * own.se, "{} is off by {off}, and its error is {}", own.name, own.se);
    }
    let said = found.cautions.iter().find(|own| own.contains("scale of the picture")).unwrap();
    assert!(said.contains("encoder-scale"), "{said}");
}

/// From one period of a screw no downhill way leads to another: beside other effects it is looked for anew.
#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn a_screw_s_period_in_another_minimum_is_begun_anew_beside_the_other_effects() {
    let made = made(&[("lead-screw", 1.2), ("camera-offset", 2.0)], 6);
    let (snake, known) = (snake(), made.answer.known["lead-screw-error"]["pitch_m"]);
    let candidates = snake.candidates(&made.measurements);
    let problem = Problem::new(&snake, made.measurements, &[], 4.0);
    let search = Search { problem: &problem, candidates: &candidates, base: &[], base_variables: &[], seed: 1 };
    let place = |name: &str| candidates.iter().position(|own| own.name == name).unwrap();
    let found = ["lead-screw-error", "camera-offset"].map(place);
    let term = |name: &str, values: &[f64]| Term::new(name, values.to_vec());
    let start = [term("lead-screw-error", &[1e-5, 1.5 * known, 0.0, 0.0, 0.0]), term("camera-offset", &[0.0, 0.0])];
    let stuck = search.fitted(found.to_vec(), &start).unwrap();
    let pitch = |own: &Trial| own.fit.effects.iter().find(|term| term.name == "lead-screw-error").unwrap().values[1];
    assert!(pitch(&stuck) > 1.2 * known, "the case that this test is about: {} m", pitch(&stuck));
    let swaps = search.swaps(&stuck);
    let anew = swaps.iter().find(|own| found.iter().all(|k| own.found.contains(k))).unwrap();
    assert!((pitch(anew) / known - 1.0).abs() < 0.02, "{} m, true {known} m", pitch(anew));
}

/// Beside two effects that leave much, the signs of a third say little: what brings the error from three times the floor to the floor stands.
#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn a_list_whose_first_effect_passes_no_test_stands_where_it_takes_nearly_all() {
    let hidden = [("encoder-scale", 2.5), ("lead-screw", 1.2), ("curvature", 2.0)]
        .map(|(name, size)| (Kind::from_name(name).unwrap(), size))
        .to_vec();
    let recipe =
        Recipe { hidden, motion: Motion::Rich, seconds: 100.0, seed: 5_605_018_270_729_989_291, ..Recipe::default() };
    let made = generate(&recipe).unwrap();
    let options = DiagnoseOptions { max_effects: 3, ..DiagnoseOptions::default() };
    let found = diagnose(&snake(), &made.measurements, &options).unwrap();
    let least_p = found.candidates.iter().map(|own| own.p_value).fold(1.0, f64::min);
    assert!(least_p > 0.01, "the case that this test is about: {least_p}");
    let names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    let mut sorted = names.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, ["encoder-scale", "lead-screw-error", "non-constant-curvature"], "{}", found.sentence);
    assert!(found.final_heldout_rms < 0.4 * found.base_heldout_rms, "{}", found.sentence);
}

/// A screw before the encoders' scales has another period behind them, to which no downhill way leads: the list stays in the order that
/// explains.
#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn a_list_that_explains_less_in_the_order_of_its_sizes_stays_in_its_own() {
    let hidden = [("compliance", 2.5), ("bend-friction", 1.5), ("encoder-scale", 2.0), ("lead-screw", 1.2)]
        .map(|(name, size)| (Kind::from_name(name).unwrap(), size))
        .to_vec();
    let recipe =
        Recipe { hidden, motion: Motion::Rich, seconds: 100.0, seed: 17_766_301_729_286_486_243, ..Recipe::default() };
    let made = generate(&recipe).unwrap();
    let options = DiagnoseOptions { max_effects: 3, ..DiagnoseOptions::default() };
    let found = diagnose(&snake(), &made.measurements, &options).unwrap();
    let floor = found.noise_floor.unwrap();
    assert!(found.final_heldout_rms < 1.02 * floor, "it was 1.094 of the floor: {}", found.sentence);
}
