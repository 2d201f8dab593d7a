//! Every file that somebody names is read as what it should be, or refused in one sentence: no hang, no gigabytes, no nonsense.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_record::{About, Recorded, Recording, RecordingWriter};
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name};
use rustix::fs::{CWD, Mode, mkfifoat};
use rustix::process::Signal;
use std::fs;
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);

/// A recording of three seconds of a chain.
fn fresh(folder: &TempFolder) -> String {
    let (instance, path) = (instance_name("fresh"), folder.file("fresh.mcap"));
    let run = ["run", "--engage=again", "--instance", &instance, "--recording", &path, "--seconds", "3"];
    let ended = Ended::of(&run, PATIENCE);
    assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
    path
}

/// A model that every command takes.
const MODEL: &str = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"cone-friction\"\nmu = 0.1727\n\
                     [[effect]]\nkind = \"static-friction\"\nf_s_n = 1.959\n";

/// The commands that read a file, each with the file's place marked.
const READERS: [&[&str]; 45] = [
    &["config", "--config", "FILE"],
    &["run", "--config", "FILE"],
    &["run", "--model", "FILE"],
    &["run", "--truth", "FILE"],
    &["run", "--input", "FILE"],
    &["run", "--master", "script", "--input", "FILE"],
    &["verify", "FILE"],
    &["replay", "FILE", "--no-recording"],
    &["replay", "FILE.csv", "--no-recording"],
    &["export", "FILE", "--out", "OUT"],
    &["recover", "FILE", "--out", "OUT"],
    &["compare", "FILE", "FILE"],
    &["console", "FILE"],
    &["calibrate", "friction", "--csv", "FILE", "--model", "MODEL"],
    &["calibrate", "play", "--csv", "FILE", "--model", "MODEL"],
    &["calibrate", "poses", "--csv", "FILE", "--model", "MODEL"],
    &["calibrate", "poses", "--csv", "OUT", "--model", "FILE"],
    &["calibrate", "photo", "FILE"],
    &["calibrate", "stem", "--model", "FILE", "--data", "DATA"],
    &["calibrate", "stem", "--model", "MODEL", "--data", "FILE"],
    &["run", "--master", "hid", "--profile", "FILE"],
    &["experiment", "fig10", "--from", "FILE", "--out", "OUT"],
    &["experiment", "poses", "--poses", "FILE", "--engage", "--out", "OUT"],
    &["experiment", "fig10", "--model", "FILE", "--engage", "--out", "OUT"],
    &["model", "check", "FILE"],
    &["model", "show", "FILE"],
    &["model", "save-learnt", "FILE", "--out", "OUT"],
    &["model", "compensate", "MODEL", "--in", "FILE", "--out", "OUT"],
    &["model", "compensate", "FILE", "--in", "DATA", "--out", "OUT"],
    &["lab", "init", "FILE"],
    &["lab", "diagnose", "--model", "FILE", "--data", "DATA"],
    &["lab", "compare", "--model", "FILE", "--data", "DATA"],
    &["lab", "compare", "--model", "MODEL", "--data", "FILE"],
    &["lab", "compare", "--model", "MODEL", "--data", "FILE.csv"],
    &["lab", "compare", "--model", "MODEL", "--data", "FILE.mcap"],
    &["lab", "compare", "--model", "MODEL", "--data", "FILE.parquet"],
    &["lab", "compare", "--model", "MODEL", "--data", "FILE.mat"],
    &["lab", "compare", "--model", "MODEL", "--data", "DATA", "--map-file", "FILE"],
    &["lab", "init", "FILE.mat"],
    &["lab", "add", "backlash", "--model", "FILE", "--data", "DATA", "--out", "OUT"],
    &["lab", "add", "backlash", "--model", "MODEL", "--data", "FILE", "--out", "OUT"],
    &["lab", "fit", "--model", "MODEL", "--data", "FILE", "--out", "OUT"],
    &["model", "exchange", "FILE"],
    &["experiment", "fig10", "--truth", "FILE", "--engage", "--out", "OUT"],
    &["console", "FILE.mcap"],
];

/// Some readers go by the ending of the name.
const ENDINGS: [&str; 4] = ["csv", "mcap", "parquet", "mat"];

#[test]
fn a_pipe_a_device_a_directory_and_two_gigabytes_are_refused_by_every_reader() {
    let folder = TempFolder::new("readers");
    let (pipe, zeros, directory, sparse) =
        (folder.file("pipe"), folder.file("zeros"), folder.file("directory"), folder.file("sparse"));
    mkfifoat(CWD, &pipe, Mode::RUSR | Mode::WUSR).expect("made");
    std::os::unix::fs::symlink("/dev/zero", &zeros).expect("made");
    fs::create_dir(&directory).expect("made");
    fs::File::create(&sparse).expect("made").set_len(2 << 30).expect("sparse");
    let (model, data) = (folder.file("model.toml"), folder.file("data.csv"));
    fs::write(&model, MODEL).expect("written");
    fs::write(&data, "q1_m,q2_m,q3_m,theta_l_rad,delta_rad\n0,0,0,1.5,0\n").expect("written");
    for path in [pipe, zeros, directory, sparse] {
        for ending in ENDINGS {
            std::os::unix::fs::symlink(&path, format!("{path}.{ending}")).expect("made");
        }
        for reader in READERS {
            let (instance, out) = (instance_name("readers"), folder.file("out"));
            let word = |word: &&str| match *word {
                "FILE" => path.clone(),
                word if word.starts_with("FILE.") => word.replace("FILE", &path),
                "OUT" => out.clone(),
                "MODEL" => model.clone(),
                "DATA" => data.clone(),
                other => other.to_owned(),
            };
            let mut arguments: Vec<String> = reader.iter().map(word).collect();
            arguments.extend(["--instance".to_owned(), instance]);
            if reader[0] == "run" {
                arguments.extend(["--recording".to_owned(), folder.file("run.mcap")]);
            }
            let ended = Ended::of(&arguments, PATIENCE);
            assert!(matches!(ended.code, Some(1 | 2)), "{arguments:?}: {ended:?}");
            assert!(ended.sentence().contains(&path), "{arguments:?}: {}", ended.stderr);
        }
    }
}

#[test]
fn a_table_of_nothing_just_below_the_largest_size_is_refused_in_little_memory() {
    let folder = TempFolder::new("nothing");
    let (model, data) = (folder.file("model.toml"), folder.file("nothing.csv"));
    fs::write(&model, MODEL).expect("written");
    fs::File::create(&data).expect("made").set_len((1 << 30) - 1).expect("sparse");
    for verb in [&["lab", "compare", "--model", model.as_str(), "--data", data.as_str()][..], &["lab", "init", &data]] {
        // Memory that is asked for, in kB: a program of 60 MB, the stacks of its threads and the table.
        let ended = Ended::limited("-d 262144", verb, PATIENCE);
        assert_eq!(ended.code, Some(2), "{verb:?}: {}", ended.stderr);
        let said = ended.stderr;
        assert!(said.contains(&data) && said.contains("a row has more than"), "{verb:?}: {said}");
    }
}

/// A copy of a recording with its samples changed.
fn edited(whole: &str, folder: &TempFolder, name: &str, mut edit: impl FnMut(&mut Sample)) -> String {
    let recording = Recording::open(Path::new(whole)).expect("readable");
    let contents = recording.contents();
    let about = About::run("edited", &contents.metadata["krait"], contents.attachments.clone());
    let path = folder.file(name);
    let mut writer = RecordingWriter::create(Path::new(&path), 256 * 1024, &about).expect("made");
    for recorded in recording.samples().expect("samples") {
        let Recorded { mut sample, .. } = recorded.expect("readable");
        edit(&mut sample);
        writer.write(&sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&contents.metadata["krait.end"]).expect("finished");
    path
}

#[test]
fn a_recording_whose_setpoints_are_no_numbers_or_enormous_is_refused_before_anything_moves() {
    let folder = TempFolder::new("setpoints");
    let whole = fresh(&folder);
    for (name, bend_rad) in [("nan.mcap", f64::NAN), ("enormous.mcap", 1e9)] {
        let path = edited(&whole, &folder, name, |sample| {
            if let Sample::Setpoint(setpoint) = sample {
                setpoint.bend_rad[0] = bend_rad;
            }
        });
        for time in [&["--speed", "max"][..], &["--real-time"][..]] {
            let arguments = [&["replay", path.as_str(), "--no-recording"], time].concat();
            let ended = Ended::of(&arguments, PATIENCE);
            assert_eq!(ended.code, Some(2), "{}", ended.stderr);
            assert!(ended.sentence().contains("expected a bend of at most"), "{}", ended.stderr);
        }
    }
}

#[test]
fn a_replay_ends_at_the_first_ctrl_c() {
    let folder = TempFolder::new("interrupted");
    let path = fresh(&folder);
    let krait = Krait::start(&["replay", path.as_str(), "--no-recording", "--speed", "0.01"]);
    std::thread::sleep(Duration::from_secs(3));
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(ended.code.is_some() && !ended.stdout.contains("0.01 times"), "{ended:?}");
}

#[test]
fn verify_says_when_a_file_is_cut() {
    let folder = TempFolder::new("cut");
    let whole = fresh(&folder);
    let bytes = fs::read(&whole).expect("there");
    let path = folder.file("cut.mcap");
    fs::write(&path, &bytes[..bytes.len() * 2 / 3]).expect("written");
    let ended = Ended::of(&["verify", path.as_str()], PATIENCE);
    assert!(ended.stdout.contains("not whole: the recording is cut"), "{ended:?}");
    let json = Ended::of(&["verify", "--json", path.as_str()], PATIENCE).json();
    assert!(json["missing"].as_array().is_some_and(|missing| !missing.is_empty()), "{json}");
    let whole = Ended::of(&["verify", whole.as_str()], PATIENCE);
    assert!(whole.code == Some(0) && !whole.stdout.contains("not whole"), "{whole:?}");
}

#[test]
fn a_model_that_is_nonsense_passes_no_check_and_steers_nothing() {
    let folder = TempFolder::new("nonsense");
    let path = folder.file("metre.toml");
    let effect = "[[effect]]\nkind = \"formula\"\nname = \"metre\"\nhook = \"eps\"\nformula = \"1\"\n";
    fs::write(&path, format!("format = 1\n[machine]\nkind = \"snake\"\n{effect}")).expect("written");
    let checked = Ended::of(&["model", "check", path.as_str()], PATIENCE);
    assert_eq!(checked.code, Some(1), "{checked:?}");
    assert!(checked.stdout.contains("REFUSED") && checked.stdout.contains("1000.000 mm"), "{}", checked.stdout);
    let instance = instance_name("nonsense");
    let run = Ended::of(&["run", "--model", path.as_str(), "--instance", &instance, "--no-recording"], PATIENCE);
    assert_eq!(run.code, Some(2), "{run:?}");
    assert!(run.sentence().contains("must not steer a machine"), "{}", run.stderr);
}

#[test]
fn a_model_of_joints_that_is_nonsense_passes_no_check_and_steers_nothing() {
    let folder = TempFolder::new("joints-nonsense");
    let wrist =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/joints/wrist.toml")).expect("there");
    let formula = "\n[[effect]]\nkind = \"formula\"\nname = \"three\"\nhook = \"joint\"\nformula = \"3\"\n";
    let files = [
        ("wrist", wrist.clone(), true),
        ("slack", wrist.replace("half_width = 0.05", "half_width = 3.0"), false),
        ("three", wrist + formula, false),
    ];
    for (name, text, is_good) in files {
        let path = folder.file(name);
        fs::write(&path, text).expect("written");
        let checked = Ended::of(&["model", "check", path.as_str()], PATIENCE);
        assert_eq!(checked.code, Some(if is_good { 0 } else { 1 }), "{checked:?}");
        if is_good {
            continue;
        }
        assert!(checked.stdout.contains("REFUSED") && checked.stdout.contains("corrects the command"), "{checked:?}");
        let instance = instance_name(name);
        let run = ["run", "--model", path.as_str(), "--instance", &instance, "--no-recording", "--seconds", "1"];
        let run = Ended::of(&run, PATIENCE);
        assert_eq!(run.code, Some(2), "{run:?}");
        assert!(run.sentence().contains("must not steer a machine"), "{}", run.stderr);
    }
}
