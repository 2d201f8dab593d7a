//! Comparison of a snake's model with measurements whose difference is known.

use krait_lab::compare::{Comparison, compare};
use krait_lab::machine::{MachineUnderTest, SnakeLab};
use krait_lab::{Measurements, Quantity};
use krait_model::model_file::ModelFile;
use std::collections::BTreeMap;

fn snake(effects: &str) -> SnakeLab {
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"snake\"\n{effects}")).expect("a model");
    SnakeLab::new(&file).expect("a snake")
}

/// 40 s at 50 Hz: out and back in turning planes, with a rest of 2 s before each second 10.
fn motion() -> Measurements {
    let (mut time_s, mut inputs) = (Vec::new(), Vec::new());
    let mut moved_s = 0.0_f64;
    for k in 0..2000 {
        let t = f64::from(k) * 0.02;
        time_s.push(t);
        moved_s += if t % 10.0 < 8.0 { 0.02 } else { 0.0 };
        let (size_m, azimuth) = (1.5e-3 * (0.9 * moved_s).sin(), 0.2 * moved_s);
        inputs.extend([0.0, 1.0, 2.0].map(|i: f64| size_m * (azimuth + i * core::f64::consts::TAU / 3.0).cos()));
    }
    let n = time_s.len();
    Measurements::bare("motion".to_owned(), Quantity::Snake, time_s, (inputs, 3), (vec![f64::NAN; 2 * n], 2))
}

/// What a machine would show, changed by row.
fn measured(machine: &SnakeLab, change: impl Fn(usize, [f64; 2]) -> [f64; 2]) -> Measurements {
    let mut data = motion();
    let shape = machine.predict(machine.effects(), &data).expect("a chain");
    data.outputs = shape.chunks_exact(2).enumerate().flat_map(|(row, b)| change(row, [b[0], b[1]])).collect();
    data
}

fn compared(data: &Measurements) -> Comparison {
    compare(&snake(""), data).expect("a chain")
}

#[test]
fn a_model_of_itself_has_no_error() {
    let found = compared(&measured(&snake(""), |_, b| b));
    assert_eq!((found.n_rows, found.n_scored, found.error.max), (2000, 2000, 0.0));
    assert_eq!(found.position_rms_m, Some(0.0));
    assert_eq!(found.worst, "The error is about the same everywhere.");
}

#[test]
fn an_error_along_the_bend_is_no_error_of_the_plane() {
    let found = compared(&measured(&snake(""), |_, [x, y]| {
        let size = x.hypot(y);
        if size == 0.0 { [0.0; 2] } else { [x + 0.02 * x / size, y + 0.02 * y / size] }
    }));
    let parts = found.parts.expect("a snake");
    let degrees = 0.02_f64.to_degrees();
    assert!((parts.bend.p95 - degrees).abs() < 1e-9 && (found.error.max - degrees).abs() < 1e-9);
    assert!(parts.plane.max < 1e-9 && parts.azimuth_rms < 1e-6);
    assert!((parts.bend_mean - degrees).abs() < 0.01 * degrees, "bends further than predicted");
    let tip_m = found.position_rms_m.expect("a tip");
    // The tip of a straight snake moves by half its length for each radian; a bent one's by less.
    assert!(tip_m < 0.02 * 0.026 / 2.0 && tip_m > 0.9 * 0.02 * 0.026 / 2.0, "{tip_m}");
}

#[test]
fn a_turned_camera_is_an_error_of_the_plane() {
    let turned = 0.05_f64;
    let turn = |_, [x, y]: [f64; 2]| [x * turned.cos() - y * turned.sin(), x * turned.sin() + y * turned.cos()];
    let parts = compared(&measured(&snake(""), turn)).parts.expect("a snake");
    assert!((parts.azimuth_rms - turned.to_degrees()).abs() < 1e-6, "{}", parts.azimuth_rms);
    assert!(parts.plane_mean > 0.0 && parts.plane.rms > 10.0 * parts.bend.rms);
}

#[test]
fn the_place_of_an_error_comes_first_and_is_said() {
    let late = |row: usize, [x, y]: [f64; 2]| if (1600..1800).contains(&row) { [x + 0.1, y] } else { [x, y] };
    let found = compared(&measured(&snake(""), late));
    assert!(found.bins.windows(2).all(|b| b[0].rms >= b[1].rms || !b[1].is_large(found.n_scored)));
    assert!(found.worst.contains("in the time 32-36 s"), "{}", found.worst);
    let far = |_, [x, y]: [f64; 2]| {
        let is_far = f64::hypot(x, y) > 20_f64.to_radians();
        if is_far { [0.9 * x, 0.9 * y] } else { [x, y] }
    };
    let found = compared(&measured(&snake(""), far));
    assert!(found.worst.contains("at bends of") && found.worst.contains("less than predicted"), "{}", found.worst);
}

#[test]
fn backlash_shows_as_opposite_means_out_and_back() {
    let found = compared(&measured(&snake("[[effect]]\nkind = \"backlash\"\n"), |_, b| b));
    let mean = |bin: &str| found.bins.iter().find(|b| b.by == "direction" && b.bin == bin).and_then(|b| b.mean);
    let (out, back) = (mean("loading").expect("moves out"), mean("unloading").expect("moves back"));
    assert!(out < -0.5 && back > 0.5, "{out} {back}");
    assert!(found.worst.contains("its mean changes with direction"), "{}", found.worst);
}

#[test]
fn every_way_to_sort_holds_every_row_that_it_can() {
    let mut data = measured(&snake(""), |row, [x, y]| if row % 3 == 0 { [f64::NAN; 2] } else { [x, y] });
    data.trial = (0..2000).map(|row| row / 500).collect();
    data.loads_n = Some((0..6000).map(|k| f64::from(k % 7)).collect());
    let found = compared(&data);
    assert_eq!((found.n_rows, found.n_scored), (2000, 1333));
    let mut rows: BTreeMap<&str, usize> = BTreeMap::new();
    for bin in &found.bins {
        *rows.entry(bin.by.as_str()).or_default() += bin.n_rows;
    }
    for by in ["bend", "direction", "time", "rest", "load", "trial"] {
        assert_eq!(rows.get(by), Some(&1333), "{by}");
    }
    assert!(rows["plane"] < 1333 && rows["speed"] < 1333, "straight or resting rows have no plane and no speed");
    let resting: usize = found.bins.iter().filter(|b| b.by == "rest" && b.bin != "moving").map(|b| b.n_rows).sum();
    assert!((180..=300).contains(&resting), "a fifth of the time less what the window takes: {resting}");
}

#[test]
fn the_answer_has_the_names_of_its_contract() {
    let mut data = measured(&snake(""), |_, [x, y]| [x + 0.01, y]);
    data.inputs.iter_mut().for_each(|q| *q += 1e-4);
    let found = compare(&snake(""), &data).expect("a chain");
    let json = found.to_json();
    assert!(json["noise_floor_deg"].is_number() && json["noise_floor_source"].is_string());
    for path in ["/rows", "/scored_rows", "/error_deg/rms", "/error_deg/p95", "/error_deg/max", "/error_deg/bend_rms"] {
        assert!(json.pointer(path).is_some_and(serde_json::Value::is_number), "{path}");
    }
    for path in
        ["/error_deg/plane_rms", "/error_m/rms", "/where/0/rms_deg", "/where/0/rows", "/common_mode/encoder_rms_m"]
    {
        assert!(json.pointer(path).is_some_and(serde_json::Value::is_number), "{path}");
    }
    assert!(json["where"][0]["by"].is_string() && json["where"][0]["bin"].is_string());
    let common_m = found.common_mode.expect("a snake").encoder_rms_m;
    assert!((common_m - 1e-4).abs() < 1e-12, "{common_m}");
}
