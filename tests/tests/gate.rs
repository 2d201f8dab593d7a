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
fn a_recording_or_a_script_that_was_not_asked_to_engage_moves_nothing_and_says_so() {
    let folder = TempFolder::new("lone");
    let script = folder.file("script.csv");
    let hand = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present\n0,0,0,0,0\n0.5,0.006,0,0,1\n60,0.006,0,0,1\n";
    std::fs::write(&script, hand).expect("written");
    for (name, master) in [("recording", &[][..]), ("script", &["--master", "script", "--input", &script])] {
        let (instance, path) = (instance_name(name), folder.file(&format!("{name}.mcap")));
        let run = ["run", "--instance", &instance, "--recording", &path, "--seconds", "4", "--json"];
        let ended = Ended::of(&[&run[..], master].concat(), PATIENCE);
        assert!(ended.stderr.contains("--engage"), "{name}: {}", ended.stderr);
        let states = states_in(&path);
        let is_led = |state: &SlaveState| state.is_engaged() || state.command_sequence != 0;
        assert!(states.len() > 100 && !states.iter().any(is_led), "{name}");
        // In the middle of the run: at its end the processes in front of the slave go one by one.
        let ready: Vec<_> = states.iter().filter(|state| state.is_ready()).collect();
        let middle = ready.get(ready.len() / 2).expect("it was ready");
        let reasons = Reasons::from_bits(middle.reasons);
        assert!(reasons.contains(Reason::NotEngaged) && reasons.contains(Reason::OperatorAbsent), "{name}: {middle:?}");
    }
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

/// A hand that pushes all the time, as raw reports; its button is down in these spans, s.
fn pushing_hand(down_s: &[[f64; 2]]) -> String {
    let mut text = String::from("krait-report-recording 1\ndevice 046d:c626\nlayout split\nreports\n");
    let mut is_down = false;
    for ms in (0_i64..8000).step_by(8) {
        let shall = down_s.iter().any(|[from, to]| (from * 1e3..to * 1e3).contains(&(ms as f64)));
        if shall != is_down {
            text += &format!("{} 03{:02x}00\n", ms * 1_000_000 - 1000, u8::from(shall));
            is_down = shall;
        }
        // To and fro, so that the snake stays within its limits.
        let push = if ms / 400 % 2 == 0 { "8000" } else { "80ff" };
        text += &format!("{} 01{push}00000000\n", ms * 1_000_000);
    }
    let n_reports = text.lines().count() - 4;
    text + &format!("end {n_reports}\n")
}

#[test]
fn a_button_engages_while_it_is_held_or_from_one_press_to_the_next_as_configured() {
    // Engaged from 0.5 s to 1.5 s and from 2.5 s to 3.5 s, once by holding, once by presses.
    let modes =
        [("hold", vec![[0.5, 1.5], [2.5, 3.5]]), ("toggle", vec![[0.5, 0.6], [1.5, 1.6], [2.5, 2.6], [3.5, 3.6]])];
    for (mode, down_s) in modes {
        let (instance, folder) = (instance_name(mode), TempFolder::new(mode));
        let (hand, config, path) = (folder.file("hand.krr"), folder.file("krait.toml"), folder.file("run.mcap"));
        std::fs::write(&hand, pushing_hand(&down_s)).expect("written");
        std::fs::write(&config, format!("[master]\npresence = \"{mode}:0\"\n")).expect("written");
        let run = ["run", "--engage", "--config", &config, "--instance", &instance, "--input", &hand];
        let ended = Ended::of(&[&run[..], &["--recording", &path, "--seconds", "6"]].concat(), PATIENCE);
        assert!(matches!(ended.code, Some(0 | 1)), "{mode}: {}", ended.stderr);
        let states = states_in(&path);
        assert_no_jump(&states);
        let edges: Vec<usize> =
            (1..states.len()).filter(|k| states[k - 1].is_engaged() != states[*k].is_engaged()).collect();
        assert!(edges.len() == 4, "{mode}: engaged and let go twice, found {} edges", edges.len());
        // Held still between the two, though the hand pushes on.
        let between = &states[edges[1] + 50..edges[2]];
        assert!(between.len() > 500 && between.iter().all(|s| s.setpoint_q_m == between[0].setpoint_q_m), "{mode}");
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
