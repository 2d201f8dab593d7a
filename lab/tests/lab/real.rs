//! Measurements of real machines, with the model that a user has at first: no gain, no offset, no effect.
//!
//! Extracts of the da Vinci jaw (ODbL) and of the SO-101's servos (Apache-2.0) lie in `data/`, with their licences. The other open
//! files are read from `../shared/real` where a workplace has them, and skipped aloud where not.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "the helpers of a test fail as the test does"
)]

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, FoundEffect, Verdict, diagnose};
use krait_lab::machine::JointsLab;
use krait_lab::read::{ColumnMap, read};
use krait_lab::{AddOptions, Measurements, Session, Term, add, save};
use krait_model::model_file::{Known, Machine, ModelFile};
use std::path::{Path, PathBuf};

const PLAY: [&str; 4] = ["backlash", "bouc-wen", "prandtl-ishlinskii", "generalised-prandtl-ishlinskii"];
const LATE: [&str; 4] = ["latency", "first-order-lag", "second-order", "rate-limit"];

/// File, joint, what one of the effects must be, and the largest error that may be left, degrees. Plain least squares with
/// the one effect leaves 0.26 to 0.27 for the jaw.
type Expected = (&'static str, usize, &'static [&'static str], f64);
const SHIPPED: [Expected; 4] = [
    ("davinci-jaw/00.csv", 1, &PLAY, 0.34),
    ("davinci-jaw/09.csv", 1, &PLAY, 0.33),
    ("so101/backlash_detection_4.csv", 1, &LATE, 0.16),
    ("so101/slow_precision_2.csv", 1, &PLAY, 0.30),
];
const SHARED: [Expected; 9] = [
    ("davinci-jaw/05.csv", 1, &PLAY, 0.33),
    ("davinci-jaw/40.csv", 1, &PLAY, 0.33),
    ("davinci-jaw/45.csv", 1, &PLAY, 0.33),
    ("davinci-jaw/49.csv", 1, &PLAY, 0.33),
    ("so101/backlash_detection.csv", 1, &LATE, 0.16),
    ("so101/prbs_excitation.csv", 1, &LATE, 0.60),
    ("so101/prbs_excitation.csv", 6, &LATE, 0.40),
    ("so101/slow_precision.csv", 2, &PLAY, 0.30),
    ("so101/slow_precision.csv", 3, &PLAY, 0.30),
];

fn model(text: &str) -> (ModelFile, JointsLab) {
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"joints\"\n{text}")).expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    (file, machine)
}

/// One joint of a file, as a machine of one joint.
fn joint(path: &Path, number: usize) -> Measurements {
    let n = if path.to_string_lossy().contains("real/so101") { 6 } else { 1 };
    let (file, _) = model(&format!("n = {n}\n"));
    let all = read(path, &ColumnMap::default(), file.machine().into()).expect("good data");
    let own = |values: &[f64]| values.iter().skip(number - 1).step_by(n).copied().collect();
    Measurements { inputs: own(&all.inputs), outputs: own(&all.outputs), n_inputs: 1, n_outputs: 1, ..all }
}

fn diagnosed(data: &Measurements) -> Diagnosis {
    diagnose(&model("n = 1\n").1, data, &DiagnoseOptions::default()).expect("a chain")
}

fn check(folder: &Path, (name, number, effects, largest): Expected) {
    let found = diagnosed(&joint(&folder.join(name), number));
    assert!(matches!(found.verdict, Verdict::Missing | Verdict::Partly), "{name}: {}", found.sentence);
    let is_one = |own: &FoundEffect| effects.contains(&own.name.as_str());
    assert!(found.effects.iter().any(is_one), "{name}: {}", found.sentence);
    assert!(found.final_heldout_rms < largest, "{name}: {}", found.sentence);
    assert!(found.explained_share.is_none_or(|share| share > 0.8), "{name}: {}", found.sentence);
}

/// Where the other open files are, if this workplace has them.
fn shared() -> Option<PathBuf> {
    let shared: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/real");
    let found = [shared.clone(), PathBuf::from("/work/shared/real")].into_iter().find(|folder| folder.is_dir());
    if found.is_none() {
        eprintln!("skipped: {} is not there; the shipped extracts are tested", shared.display());
    }
    found
}

#[test]
fn play_of_a_jaw_and_lag_of_servos_are_named_without_any_calibration() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    SHIPPED.into_iter().for_each(|expected| check(&folder, expected));
}

#[test]
fn the_other_open_files_are_named_as_well() {
    let Some(folder) = shared() else { return };
    SHARED.into_iter().for_each(|expected| check(&folder, expected));
}

#[test]
fn the_jaw_s_gain_is_calibration_and_no_effect() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let found = diagnosed(&joint(&folder.join("davinci-jaw/00.csv"), 1));
    let gain = found.calibration.iter().find(|own| own.name == "gain").expect("a gain");
    assert!((-1.1..-0.7).contains(&gain.value) && gain.se > 0.0 && !gain.is_held, "{gain:?}");
    assert!(found.as_given_rms > 10.0 * found.base_heldout_rms, "{} {}", found.as_given_rms, found.base_heldout_rms);
    let json = found.to_json();
    assert_eq!(json["format"], 2);
    assert!(json["calibration"][0]["value"].is_number() && json["effects"][0]["joint"] == 1, "{json}");
}

/// Drift and friction by load, which leave half as much on the first recording's own strokes, leave more on the second.
#[test]
fn four_strokes_do_not_name_what_another_recording_of_the_same_jaw_denies() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let found = diagnosed(&joint(&folder.join("davinci-jaw/00.csv"), 1));
    let names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    assert!(names.len() == 1 && PLAY.contains(&names[0]), "{}", found.sentence);
    assert_eq!(found.verdict, Verdict::Partly, "{}", found.sentence);
}

/// Joint 3 moves there and a part of the way back: nine tenths of what it was sent are play, and its error stands in the last seconds.
#[test]
fn a_play_of_nine_tenths_of_the_motion_is_named_alone_and_leaves_the_gain_near_one() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let found = diagnosed(&joint(&folder.join("so101/slow_precision_3.csv"), 1));
    let names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["backlash"], "{}", found.sentence);
    let gain = found.calibration.iter().find(|own| own.name == "gain").expect("a gain");
    assert!((1.02..1.12).contains(&gain.value), "{gain:?}");
    assert!(found.final_heldout_rms < 0.1 * found.base_heldout_rms, "{}", found.sentence);
}

/// What stands out from its neighbours in the other joints is left out in this one too: the answer hung on those rows.
#[test]
fn the_same_joint_is_named_among_the_others() {
    let Some(folder) = shared() else { return };
    let (file, machine) = model("n = 6\n");
    let all = read(&folder.join("so101/slow_precision.csv"), &ColumnMap::default(), file.machine().into());
    let found = diagnose(&machine, &all.expect("good data"), &DiagnoseOptions::default()).expect("a chain");
    let is_play = |own: &&FoundEffect| own.joint == Some(3) && PLAY.contains(&own.name.as_str());
    assert!(found.effects.iter().any(|own| is_play(&own)), "{}", found.sentence);
}

#[test]
fn a_held_gain_of_the_wrong_sign_is_said_before_anything_is_named() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let data = joint(&folder.join("davinci-jaw/00.csv"), 1);
    let (_, held) = model("n = 1\ngain = [1.0]\noffset = [0.0]\n");
    let found = diagnose(&held, &data, &DiagnoseOptions::default()).expect("a chain");
    assert_eq!(found.verdict, Verdict::Unknown);
    assert!(found.sentence.contains("y1 is probably negated") && found.effects.is_empty(), "{}", found.sentence);
}

#[test]
fn an_effect_added_to_an_uncalibrated_model_leaves_gain_and_offset_free() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let data = joint(&folder.join("davinci-jaw/00.csv"), 1);
    let (file, machine) = model("n = 1\n");
    let term = Term::new("backlash", vec![0.0, 0.0]);
    let added = add(
        &machine,
        &data,
        &AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() },
    )
    .expect("a fit");
    assert!(added.after < 0.34 && added.before > 1.0, "{} {}", added.before, added.after);
    let better = save(&file, &added, "backlash", &data, "2026-11-22").expect("a model");
    let Machine::Joints(joints) = better.machine() else { panic!("joints") };
    assert!(joints.gain_known.iter().chain(&joints.offset_known).all(|known| *known == Known::Absent));
    assert!(!better.to_toml().contains("gain ="), "{}", better.to_toml());
    let width = better.effects()[0].setting().value("half_width").expect("a width").to_degrees();
    assert!((1.2..2.2).contains(&width), "{width} deg");
    // What the file says is what the lab finds again: nothing larger is left to explain.
    let again = krait_lab::compare::compare(&JointsLab::new(&better).expect("joints"), &data).expect("a chain");
    assert!(again.error.rms < 0.45, "{} deg", again.error.rms);
}

#[test]
fn recordings_of_one_machine_share_its_physics_and_keep_their_own_gain_and_offset() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/davinci-jaw");
    let dir = std::env::temp_dir().join(format!("krait-lab-recordings-{}", std::process::id()));
    std::fs::create_dir_all(&dir).expect("a folder");
    let model = dir.join("jaw.toml");
    std::fs::write(&model, "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n").expect("written");
    let session =
        Session::open_all(&model, std::slice::from_ref(&folder), &ColumnMap::default()).expect("two recordings");
    let names: Vec<&str> = session.recordings.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!((names, session.data.n_rows()), (vec!["00.csv", "09.csv"], 1999));
    let options =
        DiagnoseOptions { recordings: session.recordings.clone(), max_effects: 2, ..DiagnoseOptions::default() };
    let found = diagnose(session.machine.as_ref(), &session.data, &options).expect("a chain");
    assert!(found.effects.iter().any(|own| PLAY.contains(&own.name.as_str())), "{}", found.sentence);
    assert!(found.final_heldout_rms < 0.4 && found.base_heldout_rms > 1.2, "{}", found.sentence);
    let gains: Vec<_> = found.calibration.iter().filter(|own| own.name == "gain").collect();
    assert_eq!(gains.len(), 2, "each recording has its own");
    assert_eq!(gains[1].recording.as_deref(), Some("09.csv"));
    let term = Term::new("backlash", vec![0.0, 0.0]);
    let recordings = session.recordings.clone();
    let own = AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings };
    let added = add(session.machine.as_ref(), &session.data, &own).expect("a fit");
    // One gain and one offset for both would leave 4 degrees.
    assert!(added.before < 2.0 && added.after < 0.34, "{} {}", added.before, added.after);
    assert_eq!(added.calibration.iter().filter_map(|own| own.recording.as_deref()).count(), 4);
    let empty = dir.join("empty");
    std::fs::create_dir_all(&empty).expect("a folder");
    let refused = Session::open_all(&model, &[empty], &ColumnMap::default()).err().expect("refused").to_string();
    assert!(refused.contains("without .csv"), "{refused}");
    std::fs::remove_dir_all(&dir).expect("removed");
}
