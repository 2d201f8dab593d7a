//! Data with a hidden effect: sizes as asked for, answers that name effects of the catalogue, files that prove themselves.

use krait_lab::machine::{MachineUnderTest, SnakeLab};
use krait_lab_benchmark::generate::{
    Answer, GenerateError, KINDS, Kind, Motion, NoiseKind, Recipe, base_model, generate, pick,
};
use krait_model::effects::EffectKind;
use krait_model::model_file::ModelFile;
use std::collections::BTreeSet;

fn short(kind: &str, size: f64) -> Recipe {
    Recipe { hidden: vec![(Kind::from_name(kind).unwrap(), size)], seconds: 60.0, seed: 11, ..Recipe::default() }
}

#[test]
fn every_kind_has_the_size_that_was_asked_for_and_names_effects_of_the_catalogue() {
    for kind in Kind::all() {
        // In its first minute a rich motion only goes up and down: nothing that needs a turning plane shows.
        let recipe = Recipe { motion: Motion::Teleop, ..short(kind.name, 1.0) };
        let made = generate(&recipe).unwrap_or_else(|e| panic!("{}: {e}", kind.name));
        let size = made.answer.effect_rms_deg / (2.0_f64.sqrt() * 0.3);
        assert!((size - 1.0).abs() < 0.25, "{} has size {size}", kind.name);
        assert!(!made.answer.params.is_empty(), "{}", kind.name);
        for name in made.answer.right.iter().flatten() {
            assert!(name == "unknown" || EffectKind::from_name(name).is_some(), "{name}");
        }
        for (effect, parameters) in &made.answer.known {
            let definition = EffectKind::from_name(effect).unwrap().definition();
            for name in parameters.keys() {
                assert!(definition.parameters.iter().any(|p| p.name == name), "{effect} has no {name}");
            }
        }
    }
}

#[test]
fn without_an_effect_the_base_model_explains_everything_but_the_noise() {
    let made = generate(&Recipe { seconds: 60.0, ..Recipe::default() }).unwrap();
    assert_eq!((made.answer.kind.as_str(), made.answer.effect_rms_deg), ("none", 0.0));
    let lab = SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap();
    let predicted = lab.predict(&[], &made.measurements).unwrap();
    let square: f64 = predicted.iter().zip(&made.measurements.outputs).map(|(p, y)| (p - y).powi(2)).sum();
    let rms_deg = (square / made.measurements.n_rows() as f64).sqrt().to_degrees();
    assert!((rms_deg / (2.0_f64.sqrt() * 0.3) - 1.0).abs() < 0.05, "{rms_deg} deg left");
}

/// The plant's parameters, put into the model, explain the data: the two agree where they have the same law.
#[test]
fn with_the_answer_s_parameters_the_model_explains_what_the_plant_made() {
    let mut n_kinds = 0;
    // The screws' phases are part of what they do, and not among what is known.
    for kind in Kind::all().filter(|kind| kind.is_known() && kind.name != "lead-screw") {
        let quiet = Recipe { sigma_rad: 0.01 * core::f64::consts::PI / 180.0, ..short(kind.name, 60.0) };
        let made = generate(&quiet).unwrap_or_else(|e| panic!("{}: {e}", kind.name));
        let lab = SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap();
        let Some((effect, known)) = made.answer.known.first_key_value() else { continue };
        let definition = EffectKind::from_name(effect).unwrap().definition();
        let values = definition.parameters.iter().map(|p| known.get(p.name).copied().unwrap_or(p.default)).collect();
        let term = krait_lab::Term::new(effect, values);
        let predicted = lab.predict(&[term], &made.measurements).unwrap();
        let square: f64 = predicted.iter().zip(&made.measurements.outputs).map(|(p, y)| (p - y).powi(2)).sum();
        let left_deg = (square / made.measurements.n_rows() as f64).sqrt().to_degrees();
        println!("{:16} {:.3} deg of {:.3} left", kind.name, left_deg, made.answer.effect_rms_deg);
        assert!(left_deg < 0.03 * made.answer.effect_rms_deg, "{}: {left_deg} deg", kind.name);
        n_kinds += 1;
    }
    assert!(n_kinds >= 15, "only {n_kinds} kinds share their law with the catalogue");
}

#[test]
fn equal_recipes_make_equal_bytes_and_other_seeds_others() {
    let recipe = short("backlash", 1.0);
    let (a, b) = (generate(&recipe).unwrap(), generate(&recipe).unwrap());
    assert_eq!((a.csv(), a.answer.to_json()), (b.csv(), b.answer.to_json()));
    assert_ne!(a.csv(), generate(&Recipe { seed: 12, ..recipe }).unwrap().csv());
}

#[test]
fn what_is_read_back_is_what_was_generated_and_the_hashes_are_those_of_the_files() {
    let dir = std::env::temp_dir().join(format!("krait-generate-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let recipe = Recipe { motion: Motion::Teleop, noise: NoiseKind::Coloured(0.5), ..short("cone", 2.0) };
    let made = generate(&recipe).unwrap();
    let sealed = made.clone().seal(&dir.join("run.csv"), None).unwrap();
    let back =
        krait_lab::read::read(&sealed.data, &krait_lab::read::ColumnMap::default(), krait_lab::read::Expected::Snake)
            .unwrap();
    assert_eq!(back.n_rows(), 3000);
    assert_eq!(back.sha256, sealed.data_sha256);
    let worst = back.outputs.iter().zip(&made.measurements.outputs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-6, "{worst} rad");
    let hashes = std::fs::read_to_string(&sealed.hashes).unwrap();
    assert!(hashes.contains(&sealed.answer_sha256) && hashes.contains("run.answer.json"), "{hashes}");
    let answers: Vec<Answer> = serde_json::from_str(&std::fs::read_to_string(&sealed.answer).unwrap()).unwrap();
    assert_eq!((answers[0].kind.as_str(), answers[0].file.as_str()), ("cone", "run.csv"));
    ModelFile::parse(&std::fs::read_to_string(&sealed.model).unwrap()).unwrap();
    std::fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn seeds_pick_every_kind_and_pairs_that_can_be_told_apart() {
    let picked: BTreeSet<&str> = (0..600).map(|seed| pick(seed, false)[0].name).collect();
    assert_eq!(picked.len(), KINDS.len());
    for seed in 0..200 {
        let pair = pick(seed, true);
        assert!(pair.iter().all(|kind| kind.is_known()));
        assert!(!pair[0].right.iter().any(|name| pair[1].right.contains(name)), "{} {}", pair[0].name, pair[1].name);
    }
}

#[test]
fn a_recipe_out_of_range_or_too_large_is_refused_in_one_sentence() {
    let too_long = Recipe { seconds: f64::NAN, ..Recipe::default() };
    assert!(matches!(generate(&too_long), Err(GenerateError::OutOfRange { .. })));
    assert!(matches!(generate(&short("backlash", -1.0)), Err(GenerateError::OutOfRange { .. })));
    let sentence = generate(&short("lead-screw", 20.0)).unwrap_err().to_string();
    assert!(sentence.contains("lead-screw") && sentence.contains("smaller size"), "{sentence}");
}
