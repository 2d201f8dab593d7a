//! System calls per sample, counted with strace on the processes of a running chain: a rig of its own, because tracing
//! slows what it watches.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a panic is how a test fails; a count is printed")]

use core::time::Duration;
use krait_tests::{Krait, TempFolder, instance_name, pid_of, wait_for_motion};
use rustix::process::Signal;
use std::process::Command;

const PATIENCE: Duration = Duration::from_secs(240);
/// Calls that a hop may make for each sample.
const MOST: f64 = 4.0;
/// How long each process is watched, s.
const WATCHED_S: &str = "1.5";

/// Calls of a process by name, over a moment.
fn calls_of(pid: u32, log: &str) -> Option<Vec<String>> {
    let traced = Command::new("timeout")
        .args(["--signal=INT", WATCHED_S, "strace", "-f", "-q", "-o", log, "-p", &pid.to_string()])
        .output();
    let text = traced.ok().and_then(|_| std::fs::read_to_string(log).ok()).unwrap_or_default();
    let name = |line: &str| {
        let call = line.split_once(' ')?.1.trim();
        (!call.starts_with("<...") && !call.starts_with('+') && !call.starts_with('-')).then(|| {
            call.split('(').next().unwrap_or(call).to_owned() + if call.contains("FUTEX_WAKE") { " wake" } else { "" }
        })
    };
    let calls: Vec<String> = text.lines().filter_map(name).collect();
    (!calls.is_empty()).then_some(calls)
}

#[test]
fn a_hop_makes_at_most_four_system_calls_a_sample() {
    let (instance, folder) = (instance_name("calls"), TempFolder::new("calls"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let mut skipped = false;
    for name in ["resolve", "compensate"] {
        let pid = pid_of(&instance, name).expect("it runs");
        let Some(calls) = calls_of(pid, &folder.file(name)) else {
            println!("SKIPPED ALOUD: strace is not installed or may not trace (apt install strace; ptrace_scope 0)");
            skipped = true;
            break;
        };
        // Each sample wakes the next stage once, if that one sleeps: the wakes count the samples from below.
        let n_wakes = calls.iter().filter(|call| call.ends_with(" wake")).count();
        let per_sample = calls.len() as f64 / n_wakes.max(1) as f64;
        println!("{name}: {} calls, {n_wakes} samples that woke somebody, {per_sample:.2} calls a sample", calls.len());
        assert!(n_wakes > 300, "{name} passes samples on: {n_wakes}");
        assert!((1.0..=MOST).contains(&per_sample), "{name}: {per_sample:.2} calls a sample, at most {MOST} allowed");
    }
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(skipped || ended.code == Some(0) || ended.code == Some(1), "{}", ended.stderr);
}
