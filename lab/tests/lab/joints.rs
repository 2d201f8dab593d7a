//! A joint whose cable has play, from a file that another program made (`data/joint.py`): read, compared, and explained.

use crate::noise::Noise;
use krait_lab::compare::compare;
use krait_lab::diagnose::{DiagnoseOptions, diagnose};
use krait_lab::machine::{JointsLab, MachineUnderTest};
use krait_lab::read::{ColumnMap, read};
use krait_lab::{AddOptions, Added, Measurements, Term, add, fitted_to, refit, save};
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
    let term = |half_width: f64| Term::new("backlash", vec![0.0, half_width]);
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
    let term = Term::new("backlash", vec![0.0, 0.0]);
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
            let term = Term::new(candidate.name, values.clone());
            two.predict(&[term], &data).expect("a chain")
        };
        assert_eq!(predict(&candidate.neutral), bare, "{}", candidate.name);
        for start in &candidate.starts {
            assert_ne!(predict(start), bare, "{} {start:?}", candidate.name);
        }
    }
}

/// What a cable with this play and a drive with this lag make of a hand's motion, seen with noise; gain 1.1, offset 0.05 rad.
fn played_then_lagged(half_width: f64, time_s: f64) -> Measurements {
    let dt_s = 0.02;
    let at = |row: usize, hz: f64| (core::f64::consts::TAU * hz * dt_s * row as f64).sin();
    let mut noise = Noise(1);
    let n = 3000;
    let inputs: Vec<f64> = (0..n).map(|row| 0.5 * at(row, 0.11) + 0.2 * at(row, 0.37)).collect();
    let (mut behind_play, mut behind_lag) = (0.0_f64, 0.0_f64);
    let outputs = inputs.iter().map(|&u| {
        let before = behind_play;
        behind_play = behind_play.clamp(u - half_width, u + half_width);
        // Small steps of the lag between two rows, over which the position behind the play is a ramp.
        for step in 0..50 {
            let position = before + (behind_play - before) * (f64::from(step) + 0.5) / 50.0;
            behind_lag += (position - behind_lag) * dt_s / 50.0 / time_s;
        }
        1.1 * behind_lag + 0.05 + 1e-3 * noise.normal()
    });
    let outputs = outputs.collect();
    let time_s = (0..n).map(|row| dt_s * row as f64).collect();
    Measurements { source: "one.csv".to_owned(), time_s, inputs, outputs, trial: vec![0; n], ..wrist().1 }
}

#[test]
fn a_second_effect_of_joints_moves_the_first_that_was_fitted_alone_towards_the_truth() {
    let data = played_then_lagged(0.03, 0.15);
    let (file, bare) = machine("n = 1\n");
    let adding = |machine: &JointsLab, name: &str, data: &Measurements, refit| -> Added {
        let term = Term::new(name, vec![0.0; 2]);
        let options = AddOptions { term, from_given: false, free: Vec::new(), refit, recordings: Vec::new() };
        add(machine, data, &options).expect("a fit")
    };
    let half_width = |added: &Added| added.terms[0].values[1];
    let alone = adding(&bare, "backlash", &data, Vec::new());
    let first = half_width(&alone);
    let saved = save(&file, &alone, "backlash", &data, "2026-11-23").expect("a model");
    let saved = ModelFile::parse(&saved.to_toml()).expect("read back");
    // The same data under another name are the same; others of this name are not, and the value a prior.
    let copy = Measurements { source: "copy.csv".to_owned(), ..data.clone() };
    let other = Measurements { sha256: "of other data".to_owned(), ..data.clone() };
    let again = fitted_to(&saved, &copy);
    assert_eq!(again, [("backlash".to_owned(), "half_width".to_owned())]);
    assert_eq!(fitted_to(&saved, &other), []);
    let own = JointsLab::new(&saved).expect("joints");
    let both = adding(&own, "first-order-lag", &copy, again);
    // A bare number is held.
    let (_, held) = machine(&format!("n = 1\n[[effect]]\nkind = \"backlash\"\nhalf_width = {first}\n"));
    let held = adding(&held, "first-order-lag", &data, Vec::new());
    let drawn = adding(&own, "first-order-lag", &other, Vec::new());
    let [first, held_at, drawn_to, found] = [first, half_width(&held), half_width(&drawn), half_width(&both)];
    println!("{first} alone, {held_at} held, {drawn_to} drawn, {found} together");
    assert!((first - 0.03).abs() > 0.005 && held_at == first, "{first} alone, {held_at} held");
    assert!((found - 0.03).abs() < 0.1 * (first - 0.03).abs(), "{first} alone, {found} together");
    assert!((found - drawn_to).abs() > 0.0 && (drawn_to - first).abs() > 0.0, "{drawn_to} drawn");
    assert!(both.after < held.after, "{} held, {} together", held.after, both.after);
    let names: Vec<&str> = both.variables.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["half_width", "time_s"], "gain and offset are calibration");
    for (own, (name, truth)) in both.calibration.iter().zip([("gain", 1.1), ("offset", 0.05_f64.to_degrees())]) {
        assert_eq!(own.name, name);
        assert!((own.value - truth).abs() < 5.0 * own.se, "{name}: {} +- {}", own.value, own.se);
    }
    // `krait lab fit` of the half width alone finds the same, gain and offset with it.
    let two = save(&saved, &both, "first-order-lag", &copy, "2026-11-23").expect("a model");
    let of_one = machine(&format!(
        "n = 1\n[[effect]]\nkind = \"backlash\"\nhalf_width = {first}\n[[effect]]\nkind = \"first-order-lag\"\ntime_s = {}\n",
        both.terms[1].values[1]
    ));
    let fitted = refit(&of_one.1, &data, &[("backlash".to_owned(), "half_width".to_owned())]).expect("a fit");
    assert!((half_width(&fitted) - found).abs() < 1e-4, "{} fitted, {found} together", half_width(&fitted));
    let gain = &fitted.calibration[0];
    assert!((gain.value - 1.1).abs() < 5.0 * gain.se && gain.se > 0.0, "{gain:?}");
    // Written as fitted to the data of both, gain and offset still left to the next fit.
    let better = two.to_toml();
    assert!(better.matches("from = \"copy.csv\"").count() == 2 && !better.contains("gain"), "{better}");
}

#[test]
fn a_play_that_was_fitted_alone_gives_way_when_the_lag_beside_it_is_looked_for() {
    let data = played_then_lagged(0.03, 0.15);
    let (file, bare) = machine("n = 1\n");
    let term = Term::new("backlash", vec![0.0; 2]);
    let options = AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() };
    let alone = add(&bare, &data, &options).expect("a fit");
    let wrong = alone.terms[0].values[1];
    assert!((wrong - 0.03).abs() > 0.005, "{wrong} alone");
    let saved = save(&file, &alone, "backlash", &data, "2026-11-24").expect("a model");
    let own = JointsLab::new(&ModelFile::parse(&saved.to_toml()).expect("read back")).expect("joints");
    let two = |free| DiagnoseOptions { free, max_effects: 2, ..DiagnoseOptions::default() };
    let found = diagnose(&own, &data, &two(Vec::new())).expect("a chain");
    let named: Vec<&str> = found.effects.iter().map(|effect| effect.name.as_str()).collect();
    assert_eq!(named, ["first-order-lag"], "{}", found.sentence);
    let of = |name: &str| found.calibration.iter().find(|own| own.name == name).expect("is reported");
    let half_width = of("backlash.half_width");
    assert!((half_width.value - 0.03).abs() < 4.0 * half_width.se && half_width.se < 0.002, "{half_width:?}");
    let time = &found.effects[0].parameters.iter().find(|own| own.is_free).expect("a time");
    assert!((time.value - 0.15).abs() < 0.01, "{time:?}");
    assert!(found.final_heldout_rms < 1.05 * found.noise_floor.expect("white noise"), "{}", found.sentence);
    assert!(found.base_heldout_rms > found.effects[0].after, "{}", found.base_heldout_rms);
    // A number of the model that nobody left open is held, unless it is freed by name.
    let held = format!("n = 1\n[[effect]]\nkind = \"backlash\"\nhalf_width = {wrong}\n");
    let (_, held) = machine(&held);
    let free = vec![("backlash".to_owned(), "half_width".to_owned())];
    let freed = diagnose(&held, &data, &two(free)).expect("a chain");
    assert_eq!(freed.effects.iter().map(|effect| effect.name.as_str()).collect::<Vec<_>>(), ["first-order-lag"]);
    let held = diagnose(&held, &data, &two(Vec::new())).expect("a chain");
    assert!(held.final_heldout_rms > 1.05 * freed.final_heldout_rms, "{}", held.final_heldout_rms);
}
