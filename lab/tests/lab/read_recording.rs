//! Measurements from recordings: krait's own are the same as their export; tables and bags of other programs the same as CSV.

use krait_ipc::message::{HopStamps, Shape, SlaveState};
use krait_lab::init::{Proposal, propose};
use krait_lab::read::{ColumnMap, Expected, Mapping, read};
use krait_lab::{LoadUse, Measurements, Quantity};
use krait_model::model_file::ModelFile;
use krait_record::columns::{Columns, write_csv, write_parquet};
use krait_record::{About, Attachment, CONFIG_ATTACHMENT, MODEL_ATTACHMENT, RecordingWriter};
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
    recording_of(name, None)
}

/// The same with the configuration of its chain.
fn recording_of(name: &str, config: Option<&str>) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.mcap"));
    if path.exists() {
        std::fs::remove_file(&path).expect("the test folder can be written");
    }
    let attached = config.map(|text| Attachment {
        name: CONFIG_ATTACHMENT.to_owned(),
        media_type: "application/toml".to_owned(),
        data: text.as_bytes().to_vec(),
    });
    let about = About::run("test", &BTreeMap::new(), attached.into_iter().collect());
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
    let parquet = path.with_extension("parquet");
    let file = std::fs::File::create(&parquet).expect("the test folder can be written");
    write_parquet(&Columns::read(&path).expect("good"), None, file).expect("written");
    assert_eq!(numbers(&snake(&parquet)), numbers(&exported));
}

#[test]
fn loads_of_a_recording_count_as_its_configuration_states_them() {
    let stated = LoadUse::Estimated { gain_sd: 0.3 };
    for (k, (config, expected)) in [
        ("[slave.drive]\nkind = \"sts3215\"\nload_gain_sd = 0.3\n", stated),
        ("[slave.drive]\nkind = \"cia402\"\nload_gain_sd = 0.3\n", stated),
        ("[slave.drive]\nkind = \"sts3215\"\n", LoadUse::Shown),
        ("[slave.drive]\nkind = \"sim\"\nload_gain_sd = 0.3\n", LoadUse::Counted { gain_apart: 0.005 }),
        ("[slave.drive]\nload_gain_sd = 0.3\n", LoadUse::Shown),
    ]
    .into_iter()
    .enumerate()
    {
        assert_eq!(snake(&recording_of(&format!("loads-{k}"), Some(config))).load_use, expected, "{config}");
    }
    assert_eq!(snake(&recording("loads-none")).load_use, LoadUse::Shown);
}

#[test]
fn a_recording_of_segments_has_the_loads_of_all_its_lines() {
    let model = include_str!("../../../docs/segments/two.toml");
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("segment-loads.mcap");
    let attachments = [(MODEL_ATTACHMENT, model), (CONFIG_ATTACHMENT, "[slave.drive]\nkind = \"sim\"\n")];
    let attached = attachments.map(|(name, text)| Attachment {
        name: name.to_owned(),
        media_type: "application/toml".to_owned(),
        data: text.as_bytes().to_vec(),
    });
    let _was_there = std::fs::remove_file(&path);
    let about = About::run("test", &BTreeMap::new(), attached.into_iter().collect());
    let mut writer = RecordingWriter::create(&path, 1 << 16, &about).expect("a new file");
    let load_n = |k: i64, line: usize| k as f64 + 0.1 * line as f64;
    for k in 0..2500 {
        let Sample::State(own) = state(k, SlaveState::IS_HOMED) else { panic!("a state") };
        let mut measured_tau_n = [0.0; 12];
        measured_tau_n[..6].iter_mut().enumerate().for_each(|(line, own)| *own = load_n(k, line));
        let of_segments = SlaveState { n_actuators: 6, n_joints: 4, measured_tau_n, ..own };
        writer.write(&Sample::State(of_segments), k * MS).expect("writes");
        if k % 20 == 0 {
            let seen = Shape::of_joints(k as u64 + 1, k * MS, k * MS, &[1e-4 * k as f64, 0.0, 0.01, 0.0]);
            writer.write(&Sample::Shape(seen), k * MS).expect("writes");
        }
    }
    writer.finish(&BTreeMap::from([("ended".to_owned(), "in order".to_owned())])).expect("writes");
    let model = ModelFile::parse(model).expect("a model");
    let data = read(&path, &ColumnMap::default(), model.machine().into()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((data.n_inputs, data.load_use), (6, LoadUse::Counted { gain_apart: 0.005 }));
    let loads_n = data.counted_loads_n().expect("loads");
    assert_eq!(loads_n.len(), 6 * data.n_rows());
    for (row, own) in loads_n.chunks_exact(6).enumerate() {
        assert!(own.iter().enumerate().all(|(line, n)| *n == load_n(row as i64, line)), "row {row}: {own:?}");
    }
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

/// A file of the folder with those of other programs; its README says how each was made.
fn foreign(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/formats").join(name)
}

fn mapped(texts: &[&str]) -> ColumnMap {
    texts.iter().map(|text| text.parse::<Mapping>().expect("well formed")).collect()
}

fn jaw(name: &str, map: &[&str]) -> Measurements {
    let model = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\nu_unit = \"rad\"\ny_unit = \"rad\"\n";
    let model = ModelFile::parse(model).expect("a model");
    read(&foreign(name), &mapped(map), model.machine().into()).unwrap_or_else(|error| panic!("{error}"))
}

fn proposed(name: &str, map: &[&str]) -> Proposal {
    propose(&foreign(name), &mapped(map)).unwrap_or_else(|error| panic!("{error}"))
}

fn is_near(a: &[f64], b: &[f64], within: f64) -> bool {
    let near = |(a, b): (&f64, &f64)| (a.is_nan() && b.is_nan()) || (a - b).abs() <= within;
    a.len() == b.len() && a.iter().zip(b).all(near)
}

#[test]
fn the_same_data_are_the_same_measurements_in_every_format() {
    let csv = jaw("jaw.csv", &[]);
    assert_eq!((csv.n_rows(), csv.extra.len()), (250, 1));
    assert_eq!(csv.outputs.iter().filter(|y| y.is_nan()).count(), 10);
    for name in ["jaw.parquet", "jaw.mat"] {
        let own = jaw(name, &[]);
        assert_eq!(numbers(&own), numbers(&csv), "{name}");
        assert_eq!((&own.extra, &own.names, own.sha256.len()), (&csv.extra, &csv.names, 64), "{name}");
    }
    let map = ["u1_rad=/drive/setpoint/jaw/position [rad]", "y1_rad=/jaw/measured/jaw/position [rad]"];
    let bag = jaw("jaw.mcap", &map);
    assert_eq!((numbers(&bag).len(), bag.extra.len()), (numbers(&csv).len(), 1));
    assert_eq!((&bag.extra[0].0[..], &bag.extra[0].1), ("/drive/setpoint/jaw/effort [Nm]", &csv.extra[0].1));
    // Its radians are the degrees of the others, its nanoseconds their seconds: the last digit may differ.
    assert!(is_near(&bag.time_s, &csv.time_s, 1e-9) && is_near(&bag.inputs, &csv.inputs, 1e-12));
    assert!(is_near(&bag.outputs, &csv.outputs, 1e-12));
}

#[test]
fn a_bag_s_drive_and_jaw_are_recognised_and_what_was_taken_for_granted_is_said() {
    let found = proposed("jaw.mcap", &[]);
    assert_eq!((found.kind, found.rows, found.scored_rows), ("joints", 250, 240));
    assert_eq!(found.dialect, "a ROS 2 bag (MCAP, CDR)");
    let is = |name: &str| found.columns.iter().find(|seen| seen.name == name).and_then(|seen| seen.stands_for.clone());
    assert_eq!(is("time [ns]").as_deref(), Some("time_s"));
    assert_eq!(is("/drive/setpoint/jaw/position [rad]").as_deref(), Some("u1_rad"));
    assert_eq!(is("/jaw/measured/jaw/position [rad]").as_deref(), Some("y1_rad"));
    let said = found.cautions.join("\n");
    assert!(said.contains("stamps in the messages' headers") && said.contains("/jaw/measured has 240"), "{said}");
}

#[test]
fn topics_of_several_rates_share_the_densest_one_s_rows_and_a_command_stands() {
    let found = proposed("rates.mcap", &["u1_rad=/controller/commands/data/0", "y1_rad=/tip/pose/bend_x [rad]"]);
    let said = found.cautions.join("\n");
    assert!(said.contains("times are those of the log, as /controller/commands has no stamp"), "{said}");
    assert!(said.contains("/controller/commands has 125 messages and /tip/pose 250"), "{said}");
    assert!(said.contains("/rosout (std_msgs/msg/String)"), "{said}");
    let model = ModelFile::parse(&found.model).expect("a model");
    let data = read(&foreign("rates.mcap"), &found.map, model.machine().into()).expect("good");
    assert_eq!((data.n_rows(), (0..250).filter(|row| data.is_scored(*row)).count()), (250, 250));
    let csv = jaw("jaw.csv", &[]);
    for row in 0..250 {
        assert!((data.inputs[row] - csv.inputs[row - row % 2]).abs() < 1e-12, "row {row}");
    }
    // The tip leans by the jaw's angle, about y.
    assert!(is_near(&data.outputs[30..], &csv.outputs[30..], 1e-9));
}

#[test]
fn tables_with_times_labels_structs_and_matrices_are_read_and_the_rest_is_named() {
    let found = proposed("other.parquet", &["u1_deg=motor_mdeg", "y1_deg=jaw_deg"]);
    assert!(
        found.cautions.iter().any(|said| said.contains("\"samples.list.element\" is left out")),
        "{:?}",
        found.cautions
    );
    let model = ModelFile::parse(&found.model).expect("a model");
    let data = read(&foreign("other.parquet"), &found.map, model.machine().into()).expect("good");
    assert_eq!((data.n_rows(), data.trial[124], data.trial[125]), (250, 0, 1));
    let csv = jaw("jaw.csv", &[]);
    assert!(is_near(&data.time_s, &csv.time_s, 1e-9));
    assert!(is_near(&data.outputs, &csv.outputs, 1e-6), "single precision");
    assert_eq!(data.inputs[7], (csv.inputs[7].to_degrees() * 1e3).round().to_radians());

    let found = proposed("struct.mat", &["u1_deg=q1_deg", "y1_deg=q2_deg"]);
    let said = found.cautions.join("\n");
    assert!(said.contains("\"rate\" is left out: one number") && said.contains("\"by\" is left out: text"), "{said}");
    let data = read(&foreign("struct.mat"), &found.map, model.machine().into()).expect("good");
    assert!(is_near(&data.time_s, &csv.time_s, 1e-9) && is_near(&data.inputs, &csv.inputs, 1e-6));
    assert!(is_near(&data.outputs, &csv.outputs, 1e-6));
}

#[test]
fn what_cannot_be_read_is_refused_by_name_with_what_to_do() {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("refused.bin");
    let refused = |bytes: &[u8], words: &[&str]| {
        std::fs::write(&path, bytes).expect("the test folder can be written");
        let sentence = propose(&path, &ColumnMap::default()).expect_err("refused").to_string();
        assert!(words.iter().all(|word| sentence.contains(word)) && !sentence.contains('\n'), "{words:?}: {sentence}");
    };
    let shipped = |name: &str| std::fs::read(foreign(name)).expect("a shipped file");
    refused(&shipped("brotli.parquet"), &["BROTLI", "zstd"]);
    refused(&shipped("level4.mat"), &["level 4", "-v7"]);
    refused(b"MATLAB 7.3 MAT-file, Platform: GLNXA64", &["7.3", "-v7"]);
    refused(b"\x89HDF\r\n\x1a\n and more", &["HDF5", "-v7"]);
    refused(b"#ROSBAG V2.0\n", &["ROS 1", "MCAP"]);
    refused(b"SQLite format 3\0", &["ros2 bag convert"]);
    refused(&std::fs::read(recording("own")).expect("there"), &["recording of krait", "diagnose"]);
    for name in ["jaw.mcap", "rates.mcap", "jaw.parquet", "other.parquet", "jaw.mat", "struct.mat"] {
        let whole = shipped(name);
        for part in 1..8 {
            refused(&whole[..whole.len() * part / 8], &["refused.bin"]);
        }
    }
    refused(&shipped("jaw.mat")[..300], &["cut or damaged", "save it again"]);
    refused(&shipped("jaw.parquet")[..2000], &["cut or damaged", "write it again"]);
    refused(&shipped("jaw.mcap")[..9000], &["at byte", "whole copy"]);
}
