//! The gate to the drives on the real processes, sample by sample from the recording: nothing moves that nobody has asked for,
//! nothing jumps, a stall or a stop ends the motion until the operator engages anew.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Command, OperatingState, Phase, SlaveState, StateCommand, Transition};
use krait_ipc::{Bus, ReadOptions, Reason, Reasons};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name, krait_program, processes_of, wait_until};
use rustix::process::{Pid, Signal, kill_process};
use std::io::Write;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::Stdio;

const PATIENCE: Duration = Duration::from_secs(240);
/// The slave's default rate limit, m/s, and the credit that one write can have, ns.
const RATE_M_PER_S: f64 = 30e-3;
const PERIOD_NS: i64 = 1_000_000;

fn states_in(recording: &str) -> Vec<SlaveState> {
    let recording = Recording::open(Path::new(recording)).expect("readable");
    let samples = recording.samples().expect("samples");
    samples
        .filter_map(|recorded| match recorded.expect("readable").sample {
            Sample::State(state) => Some(state),
            _ => None,
        })
        .collect()
}

fn step_m(before: &SlaveState, after: &SlaveState) -> f64 {
    (0..3).map(|i| (after.setpoint_q_m[i] - before.setpoint_q_m[i]).abs()).fold(0.0, f64::max)
}

/// No write went further than the rate allows in the time since the write before, at most one period, and a micrometre.
/// Power that comes and homing seed the setpoint anew; they are no writes of the gate.
fn assert_no_jump(states: &[SlaveState]) {
    let mut n_moved = 0;
    for pair in states.windows(2) {
        let [before, after] = pair else { continue };
        let seeded = before.flags & SlaveState::IS_BUSY != 0 || before.operating() != after.operating();
        if seeded || after.sequence != before.sequence + 1 {
            continue;
        }
        let credit_ns = (after.setpoint_ns - before.setpoint_ns).clamp(0, PERIOD_NS);
        let allowed_m = RATE_M_PER_S * credit_ns as f64 * 1e-9 + 1e-6;
        assert!(step_m(before, after) <= allowed_m, "{} m, {allowed_m} m allowed: {after:?}", step_m(before, after));
        n_moved += u32::from(step_m(before, after) > 0.0);
    }
    assert!(n_moved > 100, "{n_moved} writes moved the drives");
}

fn signal(instance: &str, process: &str, signal: Signal) {
    let pid = processes_of(instance).into_iter().find(|(name, _)| name == process).expect("it runs").1;
    kill_process(Pid::from_raw(pid.cast_signed()).expect("a process id"), signal).expect("it lives");
}

/// Waits until the slave of an instance says something.
fn wait_for(instance: &str, what: &str, is_so: impl Fn(&SlaveState) -> bool) {
    // A chain starts only where nobody is in the instance yet: observe it once all of it is there.
    assert!(wait_until(PATIENCE, || processes_of(instance).len() == 7), "{:?}", processes_of(instance));
    let bus = Bus::open(instance, "test").expect("joined");
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing()).expect("read");
    let mut last = None;
    let found = wait_until(PATIENCE, || {
        last = states.take_newest().expect("taken").map(|state| *state).or(last);
        last.as_ref().is_some_and(&is_so)
    });
    assert!(found, "never {what}; last {last:?}");
}

/// Engaged, and a line has moved by more than 0.3 mm from home: the recorded hand rests in its first second.
fn is_moving(state: &SlaveState) -> bool {
    state.is_engaged() && state.setpoint_q_m.iter().any(|q_m| q_m.abs() > 0.3e-3)
}

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
        signal(&instance, stage, Signal::STOP);
        std::thread::sleep(Duration::from_millis(stall_ms));
        let continued_ns = monotonic_ns();
        signal(&instance, stage, Signal::CONT);
        std::thread::sleep(Duration::from_millis(1000));
        krait.signal(Signal::INT);
        krait.end(PATIENCE);
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
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
    let states = states_in(&path);
    assert_no_jump(&states);
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
    let (read_end, write_end) = std::io::pipe().expect("a pipe");
    // Full, and nobody reads: as a terminal after Ctrl-S.
    let filled = write_end.try_clone().expect("cloned");
    rustix::fs::fcntl_setfl(&filled, rustix::fs::OFlags::NONBLOCK).expect("set");
    let mut filler = std::fs::File::from(OwnedFd::from(filled));
    while filler.write(&[b'.'; 4096]).is_ok() {}
    rustix::fs::fcntl_setfl(&filler, rustix::fs::OFlags::empty()).expect("set back");
    let bus = Bus::open(&instance, "launch").expect("joined");
    let mut orders = bus.writer::<StateCommand>().expect("the authority");
    let mut commands = bus.writer::<Command>().expect("the writer");
    let mut slave = std::process::Command::new(krait_program())
        .args(["slave", "--instance", &instance])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::from(OwnedFd::from(write_end)))
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
