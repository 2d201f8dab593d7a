//! Limits that the system sets to a process: each is named in one sentence, and none kills a command.

#![allow(clippy::expect_used, clippy::print_stderr, reason = "a panic is how a test fails; a skipped test says so")]

use core::time::Duration;
use krait_record::Recording;
use krait_tests::{Ended, Krait, TempFolder, instance_name, krait_program, pid_of, wait_for_motion};
use rustix::process::{Pid, Resource, Rlimit, Signal, prlimit};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const PATIENCE: Duration = Duration::from_secs(240);

#[test]
fn a_limit_that_is_too_low_for_a_chain_is_named_at_its_start() {
    for (limit, words) in [
        ("-n 200", "the limit of open files (`ulimit -n`) is 200, expected at least"),
        ("-f 100", "the limit of a file's size (`ulimit -f`) is 51200 bytes, expected at least"),
    ] {
        let instance = instance_name("limited");
        let ended = Ended::limited(limit, &["slave", "--instance", &instance], PATIENCE);
        assert_eq!(ended.code, Some(2), "{limit}: {ended:?}");
        assert!(ended.stderr.contains(words), "{limit}: {}", ended.stderr);
    }
}

#[test]
fn a_full_file_ends_a_command_with_a_sentence_and_a_recording_without_the_motion() {
    let (instance, folder) = (instance_name("xfsz"), TempFolder::new("xfsz"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let pid = pid_of(&instance, "record").expect("it runs");
    let full = Some(fs::metadata(&recording).expect("there").len() + 10_000);
    let pid = Pid::from_raw(pid.cast_signed()).expect("a process id");
    prlimit(Some(pid), Resource::Fsize, Rlimit { current: full, maximum: full }).expect("set");
    std::thread::sleep(Duration::from_secs(3));
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("the motion is not affected"), "{}", ended.stderr);
    Recording::open(Path::new(&recording)).expect("readable");
    for verb in ["recover", "export"] {
        let ended = Ended::limited("-f 20", &[verb, &recording, "--out", &folder.file(verb)], PATIENCE);
        assert_eq!(ended.code, Some(2), "{verb}: {ended:?}");
        assert!(ended.stderr.contains("File too large"), "{verb}: {}", ended.stderr);
    }
}

/// Bytes that a process keeps in RAM, kB, by the kernel's word.
fn locked_kb(pid: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmLck:")).expect("a line of it");
    line.trim().trim_end_matches(" kB").parse().expect("a number")
}

#[test]
fn the_slave_keeps_its_memory_in_ram_where_that_is_allowed() {
    if !krait_ipc::may_lock_all() {
        eprintln!("SKIPPED: the limit of locked memory does not allow it here");
        return;
    }
    let (instance, folder) = (instance_name("locked"), TempFolder::new("locked"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let locked = |name: &str| locked_kb(pid_of(&instance, name).expect("it runs"));
    assert!(locked("slave") > 1000, "{} kB", locked("slave"));
    assert_eq!(locked("record"), 0, "what may wait locks nothing");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}

#[test]
fn a_reader_of_what_krait_prints_that_goes_away_ends_nothing_by_a_signal_and_no_motion() {
    let (instance, folder) = (instance_name("pipe"), TempFolder::new("pipe"));
    let recording = folder.file("run.mcap");
    let arguments = ["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--seconds", "4"];
    let mut chain = Command::new(krait_program());
    let mut chain = chain.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    drop((chain.stdout.take(), chain.stderr.take()));
    let ended = chain.wait().expect("it ends");
    assert!(ended.code().is_some(), "no signal ends it: {ended}");
    let contents = Recording::open(Path::new(&recording)).expect("readable").contents().clone();
    assert!(contents.missing.is_empty() && contents.is_indexed, "{:?}", contents.missing);
    assert!(contents.channels[&krait_schema::Channel::Command].n_messages > 2000, "it moved to the end");
    for verb in [&["config"][..], &["model", "show", "naive"], &["verify", &recording]] {
        let mut one = Command::new(krait_program());
        let mut one = one.args(verb).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        drop(one.stdout.take());
        let ended = one.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code().is_some() && !said.contains("panicked"), "{verb:?}: {ended:?}");
    }
}

#[test]
fn the_configuration_in_force_has_nothing_of_fault_injection() {
    let printed = Ended::of(&["config"], PATIENCE);
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    let keys = printed.stdout.lines().filter(|line| !line.trim_start().starts_with('#'));
    for key in keys.filter_map(|line| line.split('=').next()) {
        for word in ["relay", "inject", "burst", "stall", "strike", "unplug"] {
            assert!(!key.contains(word), "{key:?} has {word:?}");
        }
    }
    // What only a simulated machine has stands in a truth file of its own, and none is named by itself.
    assert!(!printed.stdout.contains("sticks_at_m"), "{}", printed.stdout);
    for forbidden in [["fault", "--config", "x.toml", "nan"], ["fault", "--instance", "mine", "nan"]] {
        let refused = Ended::of(&forbidden, PATIENCE);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.sentence().contains("leave out --config and --instance"), "{}", refused.stderr);
    }
}
