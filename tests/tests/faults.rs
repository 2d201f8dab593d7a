//! A process killed at any point, a signal at any point: one sentence, a defined state, nothing left behind, nothing lost.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::{InstanceName, resources_of};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{
    Ended, Krait, TempFolder, assert_no_jump, instance_name, pid_of, processes_of, states_in, wait_for_motion,
    wait_until,
};
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);

fn start(instance: &str, recording: &str) -> Krait {
    Krait::start(&["run", "--engage=again", "--instance", instance, "--recording", recording])
}

fn kill(pid: u32, signal: Signal) {
    kill_process(Pid::from_raw(pid.cast_signed()).expect("a process id"), signal).expect("the process lives");
}

fn assert_nothing_is_left(instance: &str) {
    let gone = wait_until(PATIENCE, || processes_of(instance).is_empty());
    assert!(gone, "processes are left: {:?}", processes_of(instance));
    let name = InstanceName::new(instance).expect("a name");
    assert_eq!(resources_of(&name), Vec::<std::path::PathBuf>::new(), "shared memory or files are left");
}

/// The commands that a recording holds, and whether their sequence numbers have no gap.
fn commands_in(recording: &str) -> (u64, bool) {
    let recording = Recording::open(Path::new(recording)).expect("readable");
    let (mut n_commands, mut whole, mut before) = (0, true, None);
    for recorded in recording.samples().expect("samples") {
        if let Sample::Command(command) = recorded.expect("readable").sample {
            whole &= before.is_none_or(|before| command.sequence == before + 1);
            before = Some(command.sequence);
            n_commands += 1;
        }
    }
    (n_commands, whole)
}

#[test]
fn ctrl_c_ctrl_z_and_ctrl_backslash_end_the_chain_cleanly_and_the_recording_is_whole() {
    for signal in [Signal::INT, Signal::TSTP, Signal::QUIT] {
        let (instance, folder) = (instance_name("stop"), TempFolder::new("stop"));
        let recording = folder.file("run.mcap");
        let krait = start(&instance, &recording);
        wait_for_motion(&instance, &recording);
        krait.signal(signal);
        let ended = krait.end(PATIENCE);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert!(ended.stdout.contains(" 0 lost") && ended.stdout.contains(&recording), "{}", ended.stdout);
        assert_nothing_is_left(&instance);
        let (n_commands, whole) = commands_in(&recording);
        assert!(n_commands > 100 && whole, "{n_commands} commands, without a gap: {whole}");
        let contents = Recording::open(Path::new(&recording)).expect("readable");
        assert!(contents.contents().is_indexed && contents.contents().missing.is_empty());
    }
}

#[test]
fn a_chain_that_is_stopped_while_it_starts_leaves_nothing_behind() {
    for delay_ms in [0, 30, 60, 120, 250, 500] {
        let (instance, folder) = (instance_name("early"), TempFolder::new("early"));
        let krait = start(&instance, &folder.file("run.mcap"));
        std::thread::sleep(Duration::from_millis(delay_ms));
        krait.signal(Signal::TERM);
        let ended = krait.end(PATIENCE);
        assert!(matches!(ended.code, Some(0 | 2) | None), "{ended:?}");
        assert_nothing_is_left(&instance);
    }
}

/// Ends a process of a chain, waits until the chain is whole again, and ends that; returns what krait said.
fn lose(victim: &str, signal: Signal) -> String {
    let (instance, folder) = (instance_name("lose"), TempFolder::new("lose"));
    let recording = folder.file("run.mcap");
    let krait = start(&instance, &recording);
    wait_for_motion(&instance, &recording);
    let before = processes_of(&instance);
    let pid = before.iter().find(|(name, _)| name == victim).expect("it runs").1;
    kill(pid, signal);
    let n_then = if victim == "record" { 6 } else { 7 };
    let is_back = || {
        let now = processes_of(&instance);
        // A process that has not begun its own program yet has its parent's name.
        let is_itself = victim == "record" || now.iter().any(|(name, _)| name == victim);
        now.len() == n_then && is_itself && now.iter().all(|(_, now)| *now != pid)
    };
    assert!(wait_until(PATIENCE, is_back), "{victim}: {:?}", processes_of(&instance));
    let others = |all: Vec<(String, u32)>| all.into_iter().filter(|(name, _)| name != victim).collect::<Vec<_>>();
    assert_eq!(others(processes_of(&instance)), others(before), "{victim}: nobody else is started again");
    let size = || std::fs::metadata(&recording).map_or(0, |file| file.len());
    let then = size();
    assert!(victim == "record" || wait_until(PATIENCE, || size() > then + 200_000), "{victim}: it runs on");
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "{victim}: a loss is no success: {}", ended.stderr);
    assert!(ended.stderr.contains(&format!("process `{victim}` (pid {pid})")), "{victim}: {}", ended.stderr);
    assert_nothing_is_left(&instance);
    assert!(commands_in(&recording).0 > 300, "{victim}: what was recorded is kept");
    ended.stderr
}

#[test]
fn a_process_that_is_killed_comes_back_and_no_other_is_started_again() {
    for victim in ["master", "resolve", "compensate", "slave"] {
        assert!(lose(victim, Signal::KILL).contains("until it runs again"));
    }
}

#[test]
fn the_motion_goes_on_without_the_estimator_and_without_the_recorder() {
    assert!(lose("estimate", Signal::KILL).contains("the motion goes on"));
    assert!(lose("record", Signal::KILL).contains("the motion is not affected"));
}

#[test]
fn a_process_that_hangs_is_killed_named_and_started_again() {
    assert!(lose("compensate", Signal::STOP).contains("said nothing for 2 s"));
}

#[test]
fn a_process_that_does_not_end_when_it_is_asked_to_is_killed_and_the_exit_code_says_so() {
    let (instance, folder) = (instance_name("stuck"), TempFolder::new("stuck"));
    let recording = folder.file("run.mcap");
    let krait = start(&instance, &recording);
    wait_for_motion(&instance, &recording);
    let pid = pid_of(&instance, "estimate").expect("it runs");
    kill(pid, Signal::STOP);
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert!(ended.stderr.contains("did not end in time and was killed"), "{}", ended.stderr);
    assert_nothing_is_left(&instance);
    assert!(commands_in(&recording).1, "the recording is whole");
}

/// A chain with a page beside it, what its console is, and where it records.
fn start_with_console(what: &str, folder: &TempFolder) -> (Krait, String, u32, String) {
    let (instance, recording) = (instance_name(what), folder.file("run.mcap"));
    let arguments = ["run", "--console", "--engage=again", "--instance", &instance, "--recording", &recording];
    let krait = Krait::start(&arguments);
    wait_for_motion(&instance, &recording);
    let console = || pid_of(&instance, "console");
    assert!(wait_until(PATIENCE, || console().is_some()), "the console has joined");
    let pid = console().expect("it runs");
    (krait, instance, pid, recording)
}

/// How often the operator engaged in a chain whose console is killed, after everything else was found as it must be.
fn engagements_beside_a_killed_console() -> usize {
    let folder = TempFolder::new("no-page");
    let (krait, instance, pid, recording) = start_with_console("no-page", &folder);
    kill(pid, Signal::KILL);
    let size = || std::fs::metadata(&recording).map_or(0, |file| file.len());
    let then = size();
    assert!(wait_until(PATIENCE, || size() > then + 300_000), "the chain runs on");
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "a loss is no success: {}", ended.stderr);
    let expected = format!("process `console` (pid {pid}) ended: signal: 9 (SIGKILL); the motion goes on");
    assert!(ended.stderr.contains(&expected), "{}", ended.stderr);
    assert_nothing_is_left(&instance);
    assert!(commands_in(&recording).1, "no command is lost");
    let states = states_in(&recording);
    assert_no_jump(&states);
    states.windows(2).filter(|pair| !pair[0].is_engaged() && pair[1].is_engaged()).count()
}

#[test]
fn a_console_that_is_killed_neither_moves_nor_stops_anything_and_its_end_is_said() {
    // A machine that stands still for a moment ends an engagement too, and another follows; that is not the console's doing.
    assert!((0..3).any(|_| engagements_beside_a_killed_console() == 1), "it ended an engagement three times");
}

#[test]
fn a_console_that_is_stopped_delays_the_end_and_does_not_prevent_it() {
    let folder = TempFolder::new("stuck-page");
    let (krait, instance, pid, recording) = start_with_console("stuck-page", &folder);
    kill(pid, Signal::STOP);
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "a forced end is no success: {}", ended.stderr);
    assert!(ended.stderr.contains("did not end in time and was killed"), "{}", ended.stderr);
    assert_nothing_is_left(&instance);
    assert!(commands_in(&recording).1, "the recording is whole");
}

#[test]
fn a_killed_supervisor_takes_the_chain_with_it_and_the_next_start_works() {
    let (instance, folder) = (instance_name("orphan"), TempFolder::new("orphan"));
    let first = folder.file("first.mcap");
    let krait = start(&instance, &first);
    wait_for_motion(&instance, &first);
    krait.signal(Signal::KILL);
    assert_eq!(krait.end(PATIENCE).code, None);
    assert!(wait_until(PATIENCE, || processes_of(&instance).is_empty()), "{:?}", processes_of(&instance));
    assert!(commands_in(&first).0 > 300);

    let second = folder.file("second.mcap");
    let krait = start(&instance, &second);
    wait_for_motion(&instance, &second);
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    assert_nothing_is_left(&instance);
}

#[test]
fn the_slave_stops_by_itself_when_the_operators_side_freezes() {
    let (instance, folder) = (instance_name("freeze"), TempFolder::new("freeze"));
    let recording = folder.file("run.mcap");
    let krait = start(&instance, &recording);
    wait_for_motion(&instance, &recording);
    let pid = pid_of(&instance, "resolve").expect("it runs");
    kill(pid, Signal::STOP);
    std::thread::sleep(Duration::from_millis(700));
    kill(pid, Signal::CONT);
    std::thread::sleep(Duration::from_millis(1500));
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
    assert_nothing_is_left(&instance);

    let mut largest_step_m: f64 = 0.0;
    let (mut n_stale, mut n_after) = (0, 0);
    let mut before: Option<(i64, krait_ipc::message::Actuators)> = None;
    for recorded in Recording::open(Path::new(&recording)).expect("readable").samples().expect("samples") {
        let Sample::State(state) = recorded.expect("readable").sample else { continue };
        let reasons = krait_ipc::Reasons::from_bits(state.reasons);
        n_stale += u32::from(reasons.contains(krait_ipc::Reason::CommandStale));
        n_after += u32::from(n_stale > 0 && state.flags & krait_ipc::message::SlaveState::FOLLOWING != 0);
        if let Some((ns, q_m)) = before {
            let step_m = (0..3).map(|i| (state.setpoint_q_m[i] - q_m[i]).abs()).fold(0.0, f64::max);
            let allowed = (state.sample_ns - ns) as f64 * 1e-9;
            largest_step_m = largest_step_m.max(step_m / allowed.max(1e-3));
        }
        before = Some((state.sample_ns, state.setpoint_q_m));
    }
    assert!(n_stale > 100, "the slave named its reason in {n_stale} states");
    assert!(n_after > 100, "and followed again in {n_after} states");
    assert!(largest_step_m < 0.05, "no step faster than 50 mm/s: {largest_step_m} m/s");
}

#[test]
fn faults_that_are_repeated_end_as_they_must_and_leave_nothing() {
    let ended = Ended::of(&["fault", "--json", "killed-slave", "stalled-resolve", "--repeat", "2"], PATIENCE);
    let outcomes = ended.json();
    let outcomes = outcomes.as_array().expect("a list");
    assert_eq!((ended.code, outcomes.len()), (Some(0), 4), "{ended:?}");
    assert!(outcomes.iter().all(|outcome| outcome["wrong"].is_null() && !outcome["named"].is_null()), "{ended:?}");
}
