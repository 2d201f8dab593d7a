//! What a user does with a recording: marks it, rotates it, exports it, recovers it; and what each refuses.

use core::time::Duration;
use krait_record::Recording;
use krait_schema::{Channel, Sample};
use krait_tests::{Ended, Krait, TempFolder, instance_name, wait_until};
use rustix::process::Signal;
use std::fs;
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);

fn krait(arguments: &[&str]) -> Ended {
    Ended::of(arguments, PATIENCE)
}

#[test]
fn a_run_is_marked_rotated_exported_broken_and_recovered() {
    let folder = TempFolder::new("recording");
    let (instance, path) = (instance_name("recording"), folder.file("run.mcap"));
    let run = Krait::start(&[
        "run",
        "--engage=again",
        "--json",
        "--instance",
        &instance,
        "--recording",
        &path,
        "--seconds",
        "300",
        "--rotate-s",
        "2",
    ]);
    let mut refused = String::new();
    let marked = wait_until(PATIENCE, || {
        let mark = krait(&["mark", "vessel", "touched", "--instance", &instance]);
        refused = mark.stderr;
        mark.code == Some(0)
    });
    let long_enough = marked && wait_until(PATIENCE, || n_parts(&folder) >= 5);
    // The chain runs by now: its own progress shows the mark.
    let again = krait(&["mark", "seen", "by", "all", "--instance", &instance]);
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    std::thread::sleep(Duration::from_secs(1));
    run.signal(Signal::INT);
    let ended = run.end(PATIENCE);
    check_progress(&ended.stderr);
    assert!(marked && long_enough, "a mark is taken while the chain runs: {refused}the chain said: {}", ended.stderr);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!((&ended.json()["recording_is_whole"], &ended.json()["samples"]["lost"]), (&true.into(), &0.into()));

    let parts = Recording::open_parts(Path::new(&path)).expect("opened");
    assert!(parts.len() >= 3, "{} parts", parts.len());
    for part in &parts {
        let about = &part.contents().metadata["krait"];
        assert_eq!(about["device"], "recorded reports of 046d:c626 (the shipped ones)");
        assert_eq!(about["device_serial"], "none (recorded reports)");
    }
    let samples = parts.iter().flat_map(|part| part.samples().expect("there"));
    let marks = samples.filter_map(|recorded| match recorded.expect("readable").sample {
        Sample::Marker(marker) => marker.text().map(str::to_owned),
        _ => None,
    });
    assert!(marks.into_iter().any(|text| text == "vessel touched"), "the mark is in the recording");

    check_every_part_is_verified(&parts, &path);
    check_export(&folder, &path);
    // The last but one is two whole seconds of a chain that runs, however long its start took.
    check_recover(&folder, &parts[parts.len() - 2].path().display().to_string());
}

/// The line of a run has state, error, plane, late and lost samples in 80 columns, and a mark stands in a line of its own.
fn check_progress(stderr: &str) {
    let line = stderr.lines().find(|line| line.contains("following  ")).expect("it followed");
    for word in [" of ", "deg, off ", "plane ", " late, ", " lost"] {
        assert!(line.contains(word), "{word:?} is not in {line}");
    }
    let line = stderr.lines().find(|line| line.contains("mark: ")).expect("a mark");
    assert!(line.ends_with(" s  mark: seen by all") || line.ends_with(" s  mark: vessel touched"), "{line}");
    assert!(stderr.lines().any(|line| line.ends_with(" s  mark: seen by all")), "{stderr}");
    let shown = stderr.lines().filter(|line| line.contains("following  ") || line.contains("mark: "));
    assert!(shown.clone().all(|line| line.chars().count() < 80), "{stderr}");
}

fn check_every_part_is_verified(parts: &[Recording], path: &str) {
    let n_in_all = |channel| {
        let counts = parts.iter().filter_map(|part| part.contents().channels.get(&channel));
        counts.map(|counts| counts.n_messages).sum::<u64>()
    };
    let verified = krait(&["verify", "--json", path]);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stdout, verified.stderr);
    let verdict = verified.json();
    assert_eq!((&verdict["parts"], &verdict["passes"]), (&parts.len().into(), &1.into()), "{verdict}");
    assert_eq!(verdict["setpoints_identical"], n_in_all(Channel::Setpoint), "{verdict}");
    assert_eq!(verdict["commands_identical"], n_in_all(Channel::Command), "{verdict}");
    let replayed = krait(&["replay", "--json", "--speed", "max", "--no-recording", path]);
    assert_eq!(replayed.code, Some(0), "{}{}", replayed.stdout, replayed.stderr);
    assert_eq!(replayed.json()["samples"]["recorded"], n_in_all(Channel::Input), "{}", replayed.stdout);
}

/// Recordings so far: each part is a file.
fn n_parts(folder: &TempFolder) -> usize {
    fs::read_dir(folder.path()).map_or(0, |files| files.flatten().filter(|f| is_recording(&f.path())).count())
}

fn is_recording(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "mcap")
}

fn check_export(folder: &TempFolder, path: &str) {
    let (csv, parquet) = (folder.file("run.csv"), folder.file("run.parquet"));
    let exported = krait(&["export", path, "--out", &csv, "--json"]);
    assert_eq!(exported.code, Some(0), "{}", exported.stderr);
    let n_rows = exported.json()["rows"].as_u64().expect("rows");
    let text = fs::read_to_string(&csv).expect("written");
    assert!(
        text.starts_with("time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,tau1_n,tau2_n,tau3_n,trial\n")
    );
    assert_eq!(text.lines().count() as u64, n_rows + 1);
    let last_s: f64 = text.lines().last().and_then(|line| line.split(',').next()?.parse().ok()).expect("a time");
    assert!(last_s > 5.0 && n_rows > 5000, "every part is in it: {n_rows} rows over {last_s} s");
    assert_eq!(krait(&["export", path, "--format", "parquet", "--out", &parquet]).code, Some(0));
    assert!(fs::read(&parquet).is_ok_and(|bytes| bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1")));
    let again = krait(&["export", path, "--out", &csv]);
    assert!(again.code == Some(2) && again.sentence().contains("run.csv could not be written"), "{}", again.stderr);
}

fn check_recover(folder: &TempFolder, path: &str) {
    let whole = krait(&["recover", path]);
    assert!(whole.code == Some(0) && whole.stdout.contains("is whole"), "{}{}", whole.stdout, whole.stderr);
    let bytes = fs::read(path).expect("there");
    let (broken, saved) = (folder.file("broken.mcap"), folder.file("saved.mcap"));
    fs::write(&broken, &bytes[..bytes.len() * 2 / 3]).expect("written");
    let recovered = krait(&["recover", &broken, "--out", &saved, "--json"]);
    assert_eq!(recovered.code, Some(0), "{}", recovered.stderr);
    let said = recovered.json();
    let n_commands = said["messages"]["/krait/command"].as_u64().expect("commands");
    let contents = Recording::open(Path::new(&saved)).expect("opened").contents().clone();
    assert_eq!(contents.channels[&krait_schema::Channel::Command].n_messages, n_commands);
    assert!(contents.is_indexed && n_commands > 500, "{said}");
    assert!(said["bytes_dropped"].as_u64().is_some_and(|n| n < 200_000), "{said}");
    assert!(said["missing"].as_array().is_some_and(|m| !m.is_empty()), "{said}");
    let again = krait(&["recover", &broken, "--out", &saved]);
    assert!(again.code == Some(2) && again.sentence().contains("exists already"), "{}", again.stderr);
}

#[test]
fn what_cannot_be_done_is_one_sentence() {
    let folder = TempFolder::new("recording_bad");
    let instance = instance_name("nobody");
    let alone = krait(&["mark", "hello", "--instance", &instance]);
    assert!(alone.code == Some(2) && alone.sentence().contains("no chain runs in instance"), "{}", alone.stderr);
    let long = krait(&["mark", &"x".repeat(241), "--instance", &instance]);
    assert!(long.code == Some(2) && long.sentence().contains("241 bytes"), "{}", long.stderr);
    let foreign = folder.file("foreign.mcap");
    fs::write(&foreign, "time,theta\n").expect("written");
    for verb in ["export", "recover"] {
        let refused = krait(&[verb, &foreign, "--out", &folder.file("out")]);
        assert!(refused.code == Some(2) && refused.sentence().contains("not an MCAP file"), "{}", refused.stderr);
        assert!(!Path::new(&folder.file("out")).exists(), "nothing is written");
    }
}
