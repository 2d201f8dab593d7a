//! Measurements from krait's recordings: the same as from the recording's export, and cut ones refused.
#![allow(clippy::expect_used, clippy::panic, reason = "the helpers of a test fail as the test does")]

use krait_ipc::message::{HopStamps, Shape, SlaveState};
use krait_lab::read::{ColumnMap, Expected, Mapping, read};
use krait_lab::{Measurements, Quantity};
use krait_model::model_file::ModelFile;
use krait_record::columns::{Columns, write_csv};
use krait_record::{About, RecordingWriter};
use krait_schema::Sample;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const MS: i64 = 1_000_000;

fn state(k: i64, flags: u32) -> Sample {
    let t = k as f64 * 1e-3;
    Sample::State(SlaveState {
        sequence: k as u64 + 1,
        sample_ns: k * MS,
        stamps: HopStamps::default(),
        command_sequence: 0,
        operating_state: 1,
        flags,
        setpoint_q_m: [0.0; 12],
        setpoint_bend_rad: [0.0; 2],
        measured_q_m: krait_ipc::message::lines([1e-3 * t.sin(), -5e-4 * t.sin(), -5e-4 * t.sin()]),
        measured_tau_n: krait_ipc::message::lines([0.1, 0.2, f64::NAN]),
        reasons: 0,
        n_commands: 0,
        n_refused: 0,
        ..SlaveState::default()
    })
}

fn shape(k: i64) -> Sample {
    let t = k as f64 * 1e-3;
    Sample::Shape(Shape::of_bend(k as u64 + 1, k * MS, k * MS, [0.3 * t.sin(), 0.01 * t]).with_sigma(0.005))
}

/// A recording of 4 s at 1 kHz with 50 shapes a second; the drives lose their zero for a moment after 2 s.
fn recording(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.mcap"));
    if path.exists() {
        std::fs::remove_file(&path).expect("the test folder can be written");
    }
    let about = About::run("test", &BTreeMap::new(), Vec::new());
    let mut writer = RecordingWriter::create(&path, 1 << 16, &about).expect("a new file");
    for k in 0..4000 {
        let flags = if (2000..2010).contains(&k) { 0 } else { SlaveState::IS_HOMED };
        writer.write(&state(k, flags), k * MS).expect("writes");
        if k % 20 == 0 {
            writer.write(&shape(k), k * MS).expect("writes");
        }
    }
    writer.finish(&BTreeMap::from([("ended".to_owned(), "in order".to_owned())])).expect("writes");
    path
}

fn snake(path: &Path) -> Measurements {
    read(path, &ColumnMap::default(), Expected::Snake).expect("good")
}

/// Every number of measurements, with what was not measured as a number that nothing else is.
fn numbers(data: &Measurements) -> Vec<f64> {
    let options = [&data.loads_n, &data.sigma].into_iter().flatten().flatten();
    let trials = data.trial.iter().map(|&trial| f64::from(trial));
    let all = data.time_s.iter().chain(&data.inputs).chain(&data.outputs).chain(options).copied().chain(trials);
    all.map(|value| if value.is_nan() { 1e300 } else { value }).collect()
}

#[test]
fn a_recording_and_its_export_are_the_same_measurements() {
    let path = recording("whole");
    let data = snake(&path);
    assert_eq!((data.n_rows(), data.quantity), (3990, Quantity::Snake));
    assert_eq!((data.trial[1999], data.trial[2000]), (0, 1));
    assert!(data.is_scored(20) && !data.is_scored(21));
    assert_eq!(data.sigma.as_ref().map(|s| s[20]), Some(0.005));
    let csv = path.with_extension("csv");
    let mut bytes = Vec::new();
    write_csv(&Columns::read(&path).expect("good"), None, &mut bytes).expect("memory");
    std::fs::write(&csv, bytes).expect("the test folder can be written");
    let exported = snake(&csv);
    let differing = numbers(&exported).iter().zip(numbers(&data)).filter(|(a, b)| **a != *b).count();
    assert_eq!((differing, numbers(&exported).len()), (0, numbers(&data).len()));
}

#[test]
fn a_recording_that_is_cut_is_refused_with_a_way_out() {
    let path = recording("cut");
    let bytes = std::fs::read(&path).expect("there");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("the test folder can be written");
        read(&path, &ColumnMap::default(), Expected::Snake).expect_err("cut").to_string()
    };
    let sentence = refused(&bytes[..bytes.len() * 2 / 3]);
    assert!(sentence.contains("cut.mcap") && sentence.contains("krait export"), "{sentence}");
    let sentence = refused(&bytes[..20]);
    assert!(sentence.contains("cut at byte"), "{sentence}");
}

#[test]
fn a_recording_is_of_a_snake_and_has_its_own_columns() {
    let path = recording("other");
    let joints = ModelFile::parse("format = 1\n[machine]\nkind = \"joints\"\nn = 3\n").expect("a model");
    let sentence = read(&path, &ColumnMap::default(), joints.machine().into()).expect_err("joints").to_string();
    assert!(sentence.contains("a snake, but the model is of 3 joints"), "{sentence}");
    let map: ColumnMap = ["q1_m=a".parse::<Mapping>().expect("well formed")].into_iter().collect();
    let sentence = read(&path, &map, Expected::Snake).expect_err("mapped").to_string();
    assert!(sentence.contains("--map"), "{sentence}");
}
