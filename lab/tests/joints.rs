//! A joint whose cable has play, from a file that another program made (`data/joint.py`): read, compared, and explained.
#![allow(clippy::expect_used, clippy::panic, reason = "the helpers of a test fail as the test does")]

use krait_lab::compare::compare;
use krait_lab::diagnose::{DiagnoseOptions, diagnose};
use krait_lab::machine::{JointsLab, MachineUnderTest};
use krait_lab::read::{ColumnMap, read};
use krait_lab::{AddOptions, Measurements, Term, add, save};
use krait_model::model_file::ModelFile;
use std::path::Path;

fn machine(text: &str) -> (ModelFile, JointsLab) {
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"joints\"\n{text}")).expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    (file, machine)
}

fn wrist() -> (JointsLab, Measurements) {
    let (file, machine) = machine("n = 1\ngain = [1.0]\noffset = [0.0]\n");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/joint.csv");
    let data = read(&path, &ColumnMap::default(), file.machine().into()).expect("good");
    (machine, data)
}

#[test]
fn play_of_a_joint_shows_by_direction() {
    let (machine, data) = wrist();
    let found = compare(&machine, &data).expect("a chain");
    assert_eq!((found.unit.as_str(), found.n_scored), ("deg", 4000));
    assert!((0.6..1.0).contains(&found.error.rms), "half of the gap is 0.8 deg: {}", found.error.rms);
    let mean = |bin: &str| found.bins.iter().find(|b| b.by == "direction of u1" && b.bin == bin).and_then(|b| b.mean);
    assert!(mean("rising").expect("rises") < -0.5 && mean("falling").expect("falls") > 0.5);
    assert!(found.worst.contains("direction"), "{}", found.worst);
    let floor = found.noise_floor.expect("white noise");
    assert!((0.045..0.06).contains(&floor), "noise of 0.05 deg: {floor}");
    let json = found.to_json();
    assert!(json["error_deg"]["rms"].is_number() && json["error_deg"]["bend_rms"].is_null());
}

#[test]
fn the_right_play_leaves_noise_alone() {
    let (machine, data) = wrist();
    let term = |half_width: f64| Term { name: "backlash".to_owned(), values: vec![0.0, half_width], formula: None };
    let rms_deg = |half_width: f64| {
        let predicted = machine.predict(&[term(half_width)], &data).expect("a chain");
        let sum: f64 = predicted.iter().zip(&data.outputs).map(|(f, y)| (f - y).powi(2)).sum();
        (sum / data.n_rows() as f64).sqrt().to_degrees()
    };
    let right = rms_deg(0.8_f64.to_radians());
    assert!(right < 0.06, "noise of 0.05 deg: {right}");
    assert!(rms_deg(0.6_f64.to_radians()) > 2.0 * right && rms_deg(1.0_f64.to_radians()) > 2.0 * right);
}

#[test]
fn the_diagnosis_names_the_play() {
    let (machine, data) = wrist();
    let found = diagnose(&machine, &data, &DiagnoseOptions::default()).expect("a chain");
    let first = found.effects.first().unwrap_or_else(|| panic!("{}", found.sentence));
    assert!(first.class.iter().any(|name| name == "backlash"), "{}", found.sentence);
    assert!(found.final_heldout_rms < 1.1 * found.noise_floor.expect("white noise"), "{}", found.sentence);
}

#[test]
fn errors_of_a_joint_in_millimetres_are_never_called_degrees() {
    let (file, machine) = machine("n = 1\nu_unit = \"mm\"\ny_unit = \"mm\"\n");
    let data = wrist().1;
    let in_mm = |values: &[f64]| values.iter().map(|v| v * 500.0).collect::<Vec<f64>>();
    let data = Measurements { inputs: in_mm(&data.inputs), outputs: in_mm(&data.outputs), ..data };
    let options = DiagnoseOptions { max_effects: 1, ..DiagnoseOptions::default() };
    let json = diagnose(&machine, &data, &options).expect("a chain").to_json();
    assert_eq!((&json["unit"], &json["effects"][0]["unit"]), (&"mm".into(), &"mm".into()), "{json}");
    assert!(json["base_heldout_rms"].is_number() && json["base_heldout_rms_deg"].is_null(), "{json}");
    assert_eq!(json["effects"][0]["params"]["half_width"]["unit"], "mm", "{json}");
    let term = Term { name: "backlash".to_owned(), values: vec![0.0, 0.0], formula: None };
    let added = add(
        &machine,
        &data,
        &AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() },
    )
    .expect("a fit");
    let better = save(&file, &added, "backlash", &data, "2026-11-22").expect("a model");
    let text = better.to_toml();
    assert!(text.contains("heldout_rms = {") && text.contains("unit = \"mm\"") && !text.contains("_deg"), "{text}");
    assert_eq!(ModelFile::parse(&text).expect("read back"), better);
}

#[test]
fn every_candidate_of_joints_is_a_model_that_its_neutral_values_do_not_change() {
    let (_, two) = machine("n = 2\n");
    let mut data = wrist().1.select(&(0..500).collect::<Vec<_>>());
    let twice = |values: &[f64]| values.iter().flat_map(|v| [*v, -v]).collect::<Vec<f64>>();
    (data.inputs, data.outputs) = (twice(&data.inputs), twice(&data.outputs));
    (data.n_inputs, data.n_outputs) = (2, 2);
    let bare = two.predict(&[], &data).expect("no effects");
    let candidates = two.candidates(&data);
    assert_eq!(candidates.len(), 21);
    for candidate in candidates {
        let predict = |values: &Vec<f64>| {
            let term = Term { name: candidate.name.to_owned(), values: values.clone(), formula: None };
            two.predict(&[term], &data).expect("a chain")
        };
        assert_eq!(predict(&candidate.neutral), bare, "{}", candidate.name);
        for start in &candidate.starts {
            assert_ne!(predict(start), bare, "{} {start:?}", candidate.name);
        }
    }
}
