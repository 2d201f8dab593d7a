//! Joints that are told apart: one that stands still shows no gain, and effects of one kind on several joints have names of their own.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Verdict, diagnose};
use krait_lab::machine::{JointsLab, MachineUnderTest};
use krait_lab::{
    AddOptions, Added, LabError, Measurements, Quantity, Term, add, called, fitted_to, parameters_called, refit, save,
};
use krait_model::model_file::ModelFile;

const N: usize = 2;
const ROWS: usize = 1200;
const NOISE: f64 = 5e-4;

fn model(text: &str) -> (ModelFile, JointsLab) {
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n{text}")).expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    (file, machine)
}

/// Two joints of gain 1 behind plays of these half-widths; the second is told where to be.
fn data(half_width: [f64; N], second: impl Fn(usize) -> f64) -> Measurements {
    let mut noise = Noise(3);
    let first = |row: usize| 0.4 * (0.031 * row as f64).sin() + 0.2 * (0.083 * row as f64).sin();
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    let mut held = [first(0), second(0)];
    for row in 0..ROWS {
        for (k, u) in [first(row), second(row)].into_iter().enumerate() {
            held[k] = held[k].clamp(u - half_width[k], u + half_width[k]);
            inputs.push(u);
            outputs.push(held[k] + NOISE * noise.normal());
        }
    }
    let time_s = (0..ROWS).map(|row| 0.02 * row as f64).collect();
    let bare = Measurements::bare("made.csv".to_owned(), Quantity::Joints, time_s, (inputs, N), (outputs, N));
    Measurements { sha256: "5eed".repeat(16), ..bare }
}

fn moving(row: usize) -> f64 {
    0.5 * (0.023 * row as f64 + 1.0).sin() + 0.2 * (0.067 * row as f64).sin()
}

fn backlash_on(joint: f64, recordings: &[(String, usize)]) -> AddOptions {
    let term = Term::new("backlash", vec![joint, 0.0]);
    AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: recordings.to_vec() }
}

fn options(recordings: &[(String, usize)]) -> DiagnoseOptions {
    DiagnoseOptions { recordings: recordings.to_vec(), max_effects: 1, ..DiagnoseOptions::default() }
}

const HELD: &str = "gain = [1.0, 1.0]\noffset = [0.0, 0.0]\n";

#[test]
fn an_open_gain_of_a_joint_that_does_not_move_is_refused_with_the_joint_and_what_to_do() {
    let data = data([0.05, 0.05], |_| 0.3);
    let is_said = |refused: LabError| {
        let said = refused.to_string();
        let words = ["made.csv: joint 2 does not move", "record it in motion", "as a number in the model file"];
        assert!(words.iter().all(|own| said.contains(own)), "{said}");
    };
    let free = "gain = \"free\"\noffset = [0.0, 0.0]\n";
    for open in ["", free] {
        let (_, machine) = model(open);
        // The other joint is diagnosed all the same, and nothing is said of this one.
        let found = diagnose(&machine, &data, &options(&[])).expect("the first joint moves");
        let named: Vec<_> = found.effects.iter().map(|own| (own.name.as_str(), own.joint)).collect();
        assert_eq!(named, [("backlash", Some(1))], "{}", found.sentence);
        let is_cautioned = found.cautions.iter().any(|own| own.starts_with("joint 2 does not move, so that its gain"));
        assert!(is_cautioned && found.calibration.iter().all(|own| own.joint == Some(1)), "{:?}", found.calibration);
    }
    let (_, machine) = model("");
    assert!(add(&machine, &data, &backlash_on(1.0, &[])).is_ok());
    let (_, machine) = model(free);
    is_said(add(&machine, &data, &backlash_on(1.0, &[])).expect_err("refused"));
    is_said(refit(&machine, &data, &[]).expect_err("refused"));
    // A gain that is freed by name is open too; the first joint's is not the second one's.
    let (_, machine) = model(HELD);
    let by_name = |name: &str| vec![("machine".to_owned(), name.to_owned())];
    is_said(refit(&machine, &data, &by_name("gain2")).expect_err("refused"));
    assert!(refit(&machine, &data, &by_name("gain1")).is_ok());
}

#[test]
fn a_joint_that_stands_still_behind_a_held_gain_is_let_be_and_has_no_effect() {
    let data = data([0.05, 0.05], |_| 0.3);
    let (_, machine) = model(HELD);
    let found = diagnose(&machine, &data, &options(&[])).expect("allowed");
    let named: Vec<_> = found.effects.iter().map(|own| (own.name.as_str(), own.joint)).collect();
    assert_eq!(named, [("backlash", Some(1))], "{}", found.sentence);
    let said = add(&machine, &data, &backlash_on(2.0, &[])).expect_err("refused").to_string();
    assert!(said.contains("it is on joint 2, which does not move in made.csv"), "{said}");
    let given = AddOptions { from_given: true, ..backlash_on(2.0, &[]) };
    assert!(matches!(add(&machine, &data, &given), Err(LabError::CannotShow { .. })));
    let added = add(&machine, &data, &backlash_on(0.0, &[])).expect("a fit");
    let joints: Vec<f64> = added.terms.iter().map(|term| term.values[0]).collect();
    assert_eq!(joints, [1.0], "on every joint that moves");
}

#[test]
fn a_joint_that_moves_in_one_of_several_recordings_shows_its_gain() {
    let (_, machine) = model("");
    let one = |name: &str, second: &dyn Fn(usize) -> f64| Measurements {
        source: name.to_owned(),
        ..data([0.05, 0.05], second)
    };
    let (both, recordings) = Measurements::joined(one("a.csv", &|_| 0.3), [one("b.csv", &moving)]);
    assert!(add(&machine, &both, &backlash_on(1.0, &recordings)).is_ok());
    // Another pose in each recording is no motion: each has an offset of its own.
    let (still, recordings) = Measurements::joined(one("a.csv", &|_| 0.3), [one("b.csv", &|_| 0.5)]);
    let found = diagnose(&machine, &still, &options(&recordings)).expect("the first joint moves");
    assert!(found.cautions.iter().any(|own| own.starts_with("joint 2 does not move")), "{:?}", found.cautions);
}

const TWO: &str = "gain = [1.0, 1.0]\noffset = [0.0, 0.0]\n[[effect]]\nkind = \"backlash\"\njoint = 1\nhalf_width = 0.03\n\
                   [[effect]]\nkind = \"backlash\"\njoint = 2\nhalf_width = 0.03\n";

fn half_widths(added: &Added) -> Vec<f64> {
    added.terms.iter().filter(|term| term.name == "backlash").map(|term| term.values[1]).collect()
}

fn near(found: &[f64], truth: &[f64]) -> bool {
    found.len() == truth.len() && found.iter().zip(truth).all(|(own, truth)| (own / truth - 1.0).abs() < 0.03)
}

#[test]
fn plays_of_two_joints_are_freed_together_or_each_by_its_own_name() {
    let data = data([0.05, 0.08], moving);
    let (file, machine) = model(TWO);
    let free = |effect: &str| vec![(effect.to_owned(), "half_width".to_owned())];
    let both = refit(&machine, &data, &free("backlash")).expect("a fit");
    assert!(near(&half_widths(&both), &[0.05, 0.08]), "{:?}", half_widths(&both));
    assert_eq!(parameters_called(&both, &machine), ["backlash-1.half_width", "backlash-2.half_width"]);
    assert!(both.before > 5.0 * both.after, "before is of the file's values: {} and {}", both.before, both.after);
    // Named twice it is one number.
    let twice = refit(&machine, &data, &[free("backlash"), free("backlash-2")].concat()).expect("a fit");
    assert_eq!(twice.variables.len(), 2);

    let second = refit(&machine, &data, &free("backlash-2")).expect("a fit");
    assert!(near(&half_widths(&second), &[0.03, 0.08]), "{:?}", half_widths(&second));
    assert_eq!(parameters_called(&second, &machine), ["half_width"]);
    let saved = save(&file, &second, "fit", &data, "2026-11-30").expect("a model");
    assert_eq!(fitted_to(&saved, &data), free("backlash-2"), "the first one's stays held");
    let refused = refit(&machine, &data, &free("backlash-3")).expect_err("there is none").to_string();
    assert!(refused.contains("which has backlash-1, backlash-2"), "{refused}");
    let found = DiagnoseOptions { free: free("backlash"), ..options(&[]) };
    let found = diagnose(&machine, &data, &found).expect("a diagnosis");
    let own = found.calibration.iter().filter(|own| own.name == "backlash.half_width");
    let own: Vec<_> = own.map(|own| (own.joint, near(&[own.value], &[0.05]), near(&[own.value], &[0.08]))).collect();
    assert_eq!(own, [(Some(1), true, false), (Some(2), false, true)], "{:?}", found.calibration);
}

#[test]
fn an_effect_that_is_added_on_every_joint_shows_each_joint_s_values_and_a_single_one_its_own_names() {
    let data = data([0.05, 0.08], moving);
    let (_, machine) = model(HELD);
    let every = add(&machine, &data, &backlash_on(0.0, &[])).expect("a fit");
    assert_eq!(parameters_called(&every, &machine), ["backlash-1.half_width", "backlash-2.half_width"]);
    let one = add(&machine, &data, &backlash_on(2.0, &[])).expect("a fit");
    assert_eq!(parameters_called(&one, &machine), ["half_width"]);
}

#[test]
fn what_a_force_s_joint_has_is_freed_by_its_own_name() {
    let own = |joint: usize| format!("[[effect]]\nkind = \"coulomb\"\njoint = {joint}\ntorque = 0.1\n");
    let (machine, data) = super::force_columns::made(2, 5).filtered(&(own(1) + &own(2)));
    let free = |effect: &str| vec![(effect.to_owned(), "torque".to_owned())];
    let places = |effect: &str| -> Vec<usize> {
        let found = refit(&machine, &data, &free(effect)).expect("a fit");
        found.variables.iter().map(|own| own.effect).collect()
    };
    assert_eq!((places("coulomb"), places("coulomb-2")), (vec![0, 1], vec![1]));
    let found = diagnose(&machine, &data, &DiagnoseOptions { free: free("coulomb"), ..options(&[]) }).expect("said");
    let joints: Vec<_> = found.calibration.iter().map(|own| own.joint).collect();
    assert_eq!(joints, [Some(1), Some(2)], "{:?}", found.calibration);
    assert_eq!(called("force", machine.effects()), ["coulomb-1", "coulomb-2"]);
}

/// A value that the file calls "free" is found by every fit, and the model that is written has it.
#[test]
fn a_play_that_the_file_leaves_free_is_found_by_a_fit_and_by_a_diagnosis() {
    let data = data([0.05, 0.08], moving);
    let (file, machine) = model(&TWO.replace("half_width = 0.03", "half_width = \"free\""));
    assert_eq!(file.first_open(), Some(("half_width", "backlash")));
    let fitted = refit(&machine, &data, &[]).expect("a fit");
    assert!(near(&half_widths(&fitted), &[0.05, 0.08]), "{:?}", half_widths(&fitted));
    let saved = save(&file, &fitted, "fit", &data, "2026-11-30").expect("a model");
    assert_eq!(saved.first_open(), None, "{}", saved.to_toml());
    let found = diagnose(&machine, &data, &options(&[])).expect("a diagnosis");
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    let own: Vec<f64> = found.calibration.iter().filter(|own| own.name.contains('.')).map(|own| own.value).collect();
    assert!(near(&own, &[0.05, 0.08]), "{:?}", found.calibration);
}
