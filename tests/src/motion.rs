//! What the slave did, state by state: waited for while a chain runs, looked up in its recording afterwards.

use crate::program::send;
use crate::world::{pid_of, processes_of, wait_until};
use core::time::Duration;
use krait_ipc::message::{Command, Phase, SlaveState};
use krait_ipc::{Bus, ReadOptions};
use krait_record::Recording;
use krait_schema::Sample;
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);
/// The slave's default rate limit, m/s, and the credit that one write can have, ns.
const RATE_M_PER_S: f64 = 30e-3;
const PERIOD_NS: i64 = 1_000_000;

/// Every sample of a recording.
pub fn samples_in(recording: &str) -> Vec<Sample> {
    let samples = Recording::open(Path::new(recording)).expect("readable").samples().expect("samples");
    samples.map(|recorded| recorded.expect("readable").sample).collect()
}

/// Every slave state of a recording.
pub fn states_in(recording: &str) -> Vec<SlaveState> {
    let samples = samples_in(recording).into_iter();
    samples.filter_map(|sample| if let Sample::State(state) = sample { Some(state) } else { None }).collect()
}

/// Every command of a recording.
pub fn commands_in(recording: &str) -> Vec<Command> {
    let samples = samples_in(recording).into_iter();
    samples.filter_map(|sample| if let Sample::Command(command) = sample { Some(command) } else { None }).collect()
}

/// The largest difference of two states' setpoints, m.
pub fn step_m(before: &SlaveState, after: &SlaveState) -> f64 {
    (0..3).map(|i| (after.setpoint_q_m[i] - before.setpoint_q_m[i]).abs()).fold(0.0, f64::max)
}

/// No write went further than the rate allows in the time since the write before, at most one period, and a micrometre.
/// Power that comes and homing seed the setpoint anew; they are no writes of the gate.
pub fn assert_no_jump(states: &[SlaveState]) {
    let mut n_moved = 0;
    for pair in states.windows(2) {
        let [before, after] = pair else { continue };
        if after.is_seeded_after(before) || after.sequence != before.sequence + 1 {
            continue;
        }
        let allowed_m = allowed_m(before, after);
        assert!(step_m(before, after) <= allowed_m, "{} m, {allowed_m} m allowed: {after:?}", step_m(before, after));
        n_moved += u32::from(step_m(before, after) > 0.0);
    }
    assert!(n_moved > 100, "{n_moved} writes moved the drives");
}

/// Commands that hold before a start counts as one: the slave is then at rest.
const N_HELD: usize = 50;

/// Each command that begins to follow the operator, after a hold, equals the slave's setpoint as it knew it, within one step of
/// the gate. Returns those commands.
pub fn assert_starts_at_setpoint(commands: &[Command], states: &[SlaveState]) -> Vec<Command> {
    let states: BTreeMap<u64, &SlaveState> = states.iter().map(|state| (state.sequence, state)).collect();
    let mut starts = Vec::new();
    // Before the first command nothing has moved.
    let mut n_held = N_HELD;
    for command in commands {
        let held = n_held;
        n_held = if command.phase == Phase::Following as u32 { 0 } else { n_held + 1 };
        if n_held > 0 || held < N_HELD {
            continue;
        }
        let state = states.get(&command.state_sequence).expect("the state that it names");
        let far_m = (0..3).map(|i| (command.q_tilde_m[i] - state.setpoint_q_m[i]).abs()).fold(0.0, f64::max);
        let allowed_m = RATE_M_PER_S * PERIOD_NS as f64 * 1e-9 + 1e-6;
        assert!(far_m <= allowed_m, "{far_m} m from the setpoint, {allowed_m} m allowed: {command:?} {state:?}");
        starts.push(*command);
    }
    assert!(!starts.is_empty(), "nothing began to follow in {} commands", commands.len());
    starts
}

/// How far the gate may go from one state to the next, m.
pub fn allowed_m(before: &SlaveState, after: &SlaveState) -> f64 {
    RATE_M_PER_S * (after.setpoint_ns - before.setpoint_ns).clamp(0, PERIOD_NS) as f64 * 1e-9 + 1e-6
}

/// Sends a signal to a process of an instance.
pub fn signal_process(instance: &str, process: &str, signal: Signal) {
    send(pid_of(instance, process).expect("it runs"), signal);
}

/// Kills a process of an instance, does what shall happen while it is away, and waits until it was started again.
pub fn kill_until_back(instance: &str, process: &str, meanwhile: impl FnOnce()) {
    let pid_now = || pid_of(instance, process);
    let pid = pid_now();
    signal_process(instance, process, Signal::KILL);
    meanwhile();
    let is_back = wait_until(PATIENCE, || pid_now().is_some_and(|now| Some(now) != pid));
    assert!(is_back, "{process} comes back: {:?}", processes_of(instance));
}

/// Waits until the slave of an instance with its whole chain says something.
pub fn wait_for(instance: &str, what: &str, is_so: impl Fn(&SlaveState) -> bool) -> SlaveState {
    // A chain starts only where nobody but a tool is in the instance yet: observe it once all of it is there.
    assert!(wait_until(PATIENCE, || processes_of(instance).len() >= 7), "{:?}", processes_of(instance));
    let bus = Bus::open(instance, "test").expect("joined");
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing()).expect("read");
    let mut last = None;
    let found = wait_until(PATIENCE, || {
        last = states.take_newest().expect("taken").map(|state| *state).or(last);
        last.as_ref().is_some_and(&is_so)
    });
    assert!(found, "never {what}; last {last:?}");
    last.expect("found")
}

/// Waits until all processes of an instance run and its recording holds commands: an interrupt before that ends a start,
/// in which nothing has run.
pub fn wait_for_motion(instance: &str, recording: &str) {
    let all = wait_until(PATIENCE, || processes_of(instance).len() >= 7);
    assert!(all, "six processes and their supervisor: {:?}", processes_of(instance));
    let grown = wait_until(PATIENCE, || std::fs::metadata(recording).is_ok_and(|file| file.len() > 200_000));
    assert!(grown, "the recording grows");
}

/// Engaged, and a line has moved by more than 0.3 mm from home: the recorded hand rests in its first second.
pub fn is_moving(state: &SlaveState) -> bool {
    state.is_engaged() && state.setpoint_q_m.iter().any(|q_m| q_m.abs() > 0.3e-3)
}
