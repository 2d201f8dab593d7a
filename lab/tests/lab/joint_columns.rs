//! Columns of joints that are not what their names say, and gains that a model holds too tightly.

use crate::noise::Noise;
use krait_lab::compare::compare;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::JointsLab;
use krait_lab::{AddOptions, LabError, Measurements, Quantity, Term, add, save};
use krait_model::model_file::ModelFile;

const N: usize = 3;
const ROWS: usize = 1500;

fn model(text: &str) -> (ModelFile, JointsLab) {
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"joints\"\nn = 3\n{text}")).expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    (file, machine)
}

/// Three joints that follow their commands with this gain; the measurement of joint k stands in column `column[k]`.
fn data(gain: f64, column: [usize; N]) -> Measurements {
    let mut noise = Noise(1);
    let command = |row: usize, k: usize| (0.02 * row as f64 * [0.9, 1.7, 2.9][k]).sin() * 0.5;
    let inputs = (0..ROWS).flat_map(|row| (0..N).map(move |k| command(row, k))).collect();
    let mut outputs = vec![0.0; N * ROWS];
    for row in 0..ROWS {
        for k in 0..N {
            outputs[N * row + column[k]] = gain * command(row, k) + 0.05 + 3e-4 * gain * noise.normal();
        }
    }
    let time_s = (0..ROWS).map(|row| 0.02 * row as f64).collect();
    Measurements::bare("made.csv".to_owned(), Quantity::Joints, time_s, (inputs, N), (outputs, N))
}

fn said(machine: &JointsLab, data: &Measurements, free: &[&str]) -> Result<Diagnosis, LabError> {
    let free = free.iter().map(|name| ("machine".to_owned(), (*name).to_owned())).collect();
    diagnose(machine, data, &DiagnoseOptions { free, max_effects: 1, ..DiagnoseOptions::default() })
}

#[test]
fn exchanged_columns_and_three_in_a_ring_are_said_before_anything_is_named() {
    let (_, machine) = model("");
    let found = said(&machine, &data(1.0, [1, 0, 2]), &[]).expect("a chain");
    assert!(found.verdict == Verdict::Unknown && found.effects.is_empty(), "{}", found.sentence);
    assert!(found.sentence.contains("y1 and y2 are probably exchanged"), "{}", found.sentence);
    let found = said(&machine, &data(1.0, [1, 2, 0]), &[]).expect("a chain");
    assert_eq!(found.verdict, Verdict::Unknown, "{}", found.sentence);
    for words in ["y1 probably belongs to u3", "y2 probably belongs to u1", "y3 probably belongs to u2"] {
        assert!(found.cautions.iter().any(|own| own.contains(words)), "{words}: {:?}", found.cautions);
    }
}

#[test]
fn degrees_behind_a_free_gain_are_a_caution_and_behind_a_held_one_the_first_word() {
    let degrees = data(180.0 / core::f64::consts::PI, [0, 1, 2]);
    let found = said(&model("").1, &degrees, &[]).expect("a chain");
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    assert!(found.cautions.iter().any(|own| own.contains("y2 may be measured in degrees")), "{:?}", found.cautions);
    let found = said(&model("gain = [1.0, 1.0, 1.0]\n").1, &degrees, &[]).expect("a chain");
    assert!(found.sentence.contains("y1 is probably measured in degrees"), "{}", found.sentence);
    let found = said(&model("gain = [0.0, 1.0, 1.0]\n").1, &data(1.0, [0, 1, 2]), &[]).expect("a chain");
    assert!(found.sentence.contains("the model holds a gain of 0"), "{}", found.sentence);
}

#[test]
fn a_held_gain_is_freed_by_name_and_for_all_joints_at_once() {
    let (file, machine) = model("gain = [1.0, 1.0, 1.0]\n");
    let data = data(1.2, [0, 1, 2]);
    let held = said(&machine, &data, &[]).expect("a chain");
    assert!(held.effects.iter().all(|own| own.name == "scale") && held.effects.len() == N, "{}", held.sentence);
    let freed = said(&machine, &data, &["gain"]).expect("a chain");
    assert_eq!(freed.verdict, Verdict::None, "{}", freed.sentence);
    let one = said(&machine, &data, &["gain2"]).expect("a chain");
    let joints: Vec<Option<usize>> = one.effects.iter().map(|own| own.joint).collect();
    assert!(joints.len() == 2 && !joints.contains(&Some(2)), "{}", one.sentence);
    let refused = said(&machine, &data, &["gian2"]).expect_err("no such number").to_string();
    assert!(refused.contains("gian2") && refused.contains("gain2"), "{refused}");
    // A gain that is freed beside a new effect goes into the file with it.
    let term = Term::new("backlash", vec![1.0, 0.0]);
    let refit = vec![("machine".to_owned(), "gain1".to_owned())];
    let options = AddOptions { term, from_given: false, free: Vec::new(), refit, recordings: Vec::new() };
    let added = add(&machine, &data, &options).expect("a fit");
    let better = save(&file, &added, "backlash", &data, "2026-11-26").expect("a model").to_toml();
    let gains = better.lines().find(|line| line.starts_with("gain")).expect("gains");
    assert!(gains.contains("1.2") || gains.contains("1.19"), "{gains}");
}

/// A joint that does not move shows no gain: a comparison makes none up and says so, of that joint alone.
#[test]
fn a_comparison_tells_no_gain_of_a_joint_that_does_not_move() {
    let (_, machine) = model("");
    let mut still = data(1.1, [0, 1, 2]);
    still.inputs.iter_mut().skip(1).step_by(N).for_each(|u| *u = 0.3);
    let found = compare(&machine, &still).expect("a chain");
    let joints: Vec<_> = found.calibration.iter().map(|own| (own.name.as_str(), own.joint)).collect();
    let of = |joint| [("gain", Some(joint)), ("offset", Some(joint))];
    assert_eq!(joints, [of(1), of(3)].concat());
    assert_eq!(found.still_joints, [2]);
    let all = compare(&machine, &data(1.1, [0, 1, 2])).expect("a chain");
    assert_eq!((all.calibration.len(), all.still_joints.len()), (2 * N, 0));
    let (_, held) = model("gain = [1.0, 1.0, 1.0]\noffset = [0.0, 0.0, 0.0]");
    let held = compare(&held, &still).expect("a chain");
    assert_eq!(held.still_joints.len(), 0, "what the model holds is no question");
}
