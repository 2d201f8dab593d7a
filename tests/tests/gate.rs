//! The gate to the drives on the real processes, sample by sample from the recording: nothing moves that nobody has asked for,
//! nothing jumps, a stall or a stop ends the motion until the operator engages anew.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Command, OperatingState, Phase, SlaveState, StateCommand, Transition};
use krait_ipc::{Bus, ReadOptions, Reason, Reasons};
use krait_tests::{
    Ended, Krait, TempFolder, assert_no_jump, assert_starts_at_setpoint, commands_in, held_terminal, instance_name,
    is_moving, krait_program, signal_process, states_in, wait_for, wait_until,
};
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;

const PATIENCE: Duration = Duration::from_secs(240);
#[test]
fn a_recording_that_was_not_asked_to_engage_moves_nothing_and_says_so() {
    let (instance, folder) = (instance_name("lone"), TempFolder::new("lone"));
    let path = folder.file("run.mcap");
    let ended =
        Ended::of(&["run", "--instance", &instance, "--recording", &path, "--seconds", "4", "--json"], PATIENCE);
    assert!(ended.stderr.contains("--engage"), "{}", ended.stderr);
    let states = states_in(&path);
    assert!(states.len() > 100 && states.iter().all(|state| !state.is_engaged() && state.command_sequence == 0));
    let last = states.iter().rfind(|state| state.is_ready()).expect("it was ready");
    let reasons = Reasons::from_bits(last.reasons);
    assert!(reasons.contains(Reason::NotEngaged) && reasons.contains(Reason::OperatorAbsent), "{last:?}");
}

#[test]
fn a_stall_of_each_stage_ends_the_motion_for_good_and_no_write_jumps() {
    for (stage, stall_ms) in [("master", 400), ("resolve", 150), ("compensate", 300), ("slave", 200)] {
        let (instance, folder) = (instance_name("stall"), TempFolder::new("stall"));
        let path = folder.file("run.mcap");
        let krait = Krait::start(&["run", "--engage", "--instance", &instance, "--recording", &path]);
        wait_for(&instance, "moving", is_moving);
        signal_process(&instance, stage, Signal::STOP);
        std::thread::sleep(Duration::from_millis(stall_ms));
        let continued_ns = monotonic_ns();
        signal_process(&instance, stage, Signal::CONT);
        std::thread::sleep(Duration::from_millis(1000));
        let shown = Ended::of(&["state", "--json", "--instance", &instance], PATIENCE).json();
        krait.signal(Signal::INT);
        krait.end(PATIENCE);
        let held = shown["reasons"].as_array().expect("a list");
        let is_measured = |held: &serde_json::Value| held["value"].as_f64() > held["limit"].as_f64();
        assert!(held.iter().any(is_measured), "{stage}: what stood still for how long: {shown}");
        let states = states_in(&path);
        assert_no_jump(&states);
        // The recorded hand takes hold once in a while; what the stall has ended, its old grip does not renew.
        let after: Vec<&SlaveState> = states.iter().filter(|state| state.sample_ns > continued_ns).collect();
        let quiet = after.iter().take_while(|state| !state.is_engaged()).count();
        assert!(quiet > 300, "{stage}: engaged again after {quiet} of {} states", after.len());
        assert!(after.iter().any(|state| Reasons::from_bits(state.reasons).contains(Reason::NotEngaged)), "{stage}");
    }
}

#[test]
fn a_stop_from_another_process_pauses_at_once_and_only_a_resume_and_a_new_edge_go_on() {
    let (instance, folder) = (instance_name("stopped"), TempFolder::new("stopped"));
    let path = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &path]);
    wait_for(&instance, "moving", is_moving);
    let asked_ns = monotonic_ns();
    let stopped = Ended::of(&["stop", "--instance", &instance], PATIENCE);
    assert_eq!((stopped.code, stopped.stdout.contains("stand still")), (Some(0), true), "{stopped:?}");
    let acknowledged_ns = monotonic_ns();
    let shown = Ended::of(&["state", "--json", "--instance", &instance], PATIENCE).json();
    assert_eq!(
        (&shown["state"], &shown["is_engaged"], &shown["n_stops"]),
        (&"PAUSED".into(), &false.into(), &1.into())
    );
    let refused = Ended::of(&["state", "enable", "--instance", &instance], PATIENCE);
    assert_eq!(refused.code, Some(2));
    assert!(refused.sentence().contains("`enable` is not valid in PAUSED"), "{}", refused.stderr);
    let resumed_ns = monotonic_ns();
    let resumed = Ended::of(&["state", "resume", "--instance", &instance], PATIENCE);
    assert!(resumed.code == Some(0) && resumed.stdout.starts_with("ENABLED"), "{resumed:?}");
    wait_for(&instance, "engaged anew", SlaveState::is_engaged);
    wait_for(&instance, "moving again", is_moving);
    std::thread::sleep(Duration::from_millis(500));
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
    let states = states_in(&path);
    assert_no_jump(&states);
    let starts = assert_starts_at_setpoint(&commands_in(&path), &states);
    assert!(
        starts.iter().any(|start| start.sample_ns > resumed_ns),
        "the motion after the pause begins where it stood"
    );
    let between: Vec<&SlaveState> =
        states.iter().filter(|s| (acknowledged_ns..resumed_ns).contains(&s.sample_ns)).collect();
    assert!(between.len() > 10 && between.iter().all(|s| s.operating() == Some(OperatingState::Paused)));
    assert!(
        between.iter().all(|s| s.setpoint_q_m == between[0].setpoint_q_m),
        "nothing moves after the acknowledgement"
    );
    assert!(acknowledged_ns > asked_ns);
}

#[test]
fn a_slave_whose_terminal_stands_still_goes_on() {
    let instance = instance_name("ctrls");
    let (read_end, write_end) = held_terminal();
    let bus = Bus::open(&instance, "launch").expect("joined");
    let mut orders = bus.writer::<StateCommand>().expect("the authority");
    let mut commands = bus.writer::<Command>().expect("the writer");
    let mut slave = std::process::Command::new(krait_program())
        .args(["slave", "--instance", &instance])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::from(write_end))
        .spawn()
        .expect("started");
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing()).expect("read");
    let mut newest = SlaveState::default();
    let mut until = |what: &str, send: &mut dyn FnMut(), is_so: &dyn Fn(&SlaveState) -> bool| {
        let found = wait_until(PATIENCE, || {
            send();
            newest = states.take_newest().expect("taken").map_or(newest, |state| *state);
            is_so(&newest)
        });
        assert!(found, "never {what}: {newest:?}");
        newest.sequence
    };
    until("there", &mut || {}, &|state| state.sequence > 0);
    let mut order = |transition: Transition| {
        let (sequence, sample_ns) = (orders.n_sent() + 1, monotonic_ns());
        let command = StateCommand { sequence, sample_ns, transition: transition as u32, sender_pid: 1 };
        orders.send(&command).expect("sent");
    };
    order(Transition::Enable);
    until("ready", &mut || {}, &SlaveState::is_ready);
    // Each of these is worth a warning: a refused state command, and a command that is no number.
    order(Transition::Resume);
    let mut spoil = || {
        let (sequence, sample_ns) = (commands.n_sent() + 1, monotonic_ns());
        let phase = Phase::Following as u32;
        let command = Command { sequence, sample_ns, phase, q_tilde_m: [f64::NAN; 12], ..Command::default() };
        commands.send(&command).expect("sent");
    };
    let before = until("refused", &mut spoil, &|state| state.n_refused > 200);
    until("still there", &mut || {}, &|state| state.sequence > before + 1000);
    kill_process(Pid::from_child(&slave), Signal::KILL).expect("it lives");
    slave.wait().expect("ended");
    drop(read_end);
}
