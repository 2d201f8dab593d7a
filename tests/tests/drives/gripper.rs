//! A gripper's wire on a real drive behind three lines: it begins where its encoder finds the jaw, and moves as the buttons say.

use super::{PATIENCE, ZERO};
use core::time::Duration;
use krait_drives::ServoMake;
use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_ipc::message::{GRIPPER_WIRE, JAW, SlaveState};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name, wait_until};
use rustix::process::Signal;
use std::path::Path;

/// Counts of a servo for a metre of line on its spool of 8 mm.
const PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
/// Wire for one radian of the jaw, m, as in the model.
const WIRE: f64 = 0.002;
/// How far the jaw stands open when power comes, rad.
const OPEN_RAD: f64 = 0.5;
/// More than play and scale of the wire, less than closing the jaw would take, m.
const PLAY_M: f64 = 0.4e-3;
const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/gripper/snake.toml");

fn emulator() -> Emulator {
    let places = [ZERO, ZERO, ZERO, ZERO + OPEN_RAD * WIRE * PER_M];
    let servos = (1..=4).zip(places).map(|(id, place)| Servo::new(id, place)).collect();
    Emulator::start(ServoWire::new(servos)).expect("a pseudo-terminal")
}

/// `jaw`: what the last of four actuators says of itself.
fn configuration(folder: &TempFolder, emulator: &Emulator, jaw: &str) -> String {
    super::configuration_of(ServoMake::Sts3215, folder, emulator, 4, ["jaw_n = inf\n", "", jaw])
}

fn states(recording: &str) -> Vec<SlaveState> {
    let recording = Recording::open(Path::new(recording)).expect("readable");
    let samples = recording.samples().expect("samples").map(|recorded| recorded.expect("readable").sample);
    samples.filter_map(|sample| if let Sample::State(state) = sample { Some(state) } else { None }).collect()
}

/// A chain in whose hand the snake bends for two seconds and then the jaw opens for a quarter of a second; ended is it by nobody.
fn opened(folder: &TempFolder, config: &str, instance: &str, emulator: &Emulator) -> (Krait, String) {
    let script = folder.file("script.csv");
    let text = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch,jaw\n\
        0,0,0,0,1,0,0\n1,0.003,0,0,1,0,0\n3,0,0,0,1,0,1\n3.25,0,0,0,1,0,0\n4,0,0,0,1,0,0\n";
    std::fs::write(&script, text).expect("written");
    // A machine that stands still for some hundredths of a second ends the engagement, as it must; then the hand begins anew.
    for n in 0..5 {
        let recording = folder.file(&format!("run{n}.mcap"));
        let run = ["run", "--engage", "--instance", instance, "--config", config, "--recording", &recording];
        let krait = Krait::start(&[&run[..], &["--master", "script", "--input", &script, "--model", MODEL]].concat());
        let opens = || jaw_rad(emulator) > OPEN_RAD + 0.2;
        if wait_until(Duration::from_secs(15), opens) {
            std::thread::sleep(Duration::from_millis(1500));
            return (krait, recording);
        }
        krait.signal(Signal::INT);
        krait.end(PATIENCE);
        emulator.wire().servos[3].place = ZERO + OPEN_RAD * WIRE * PER_M;
    }
    panic!("the jaw has not opened in any of five runs: {:?}", emulator.wire().servos);
}

/// The jaw, to within play and scale of its wire.
fn jaw_rad(emulator: &Emulator) -> f64 {
    (emulator.wire().servos[3].place - ZERO) / PER_M / WIRE
}

/// Power off, whatever somebody does to the jaw meanwhile, and on again.
fn switched(instance: &str, emulator: &Emulator, meanwhile: impl Fn()) {
    let ask = |wish| assert_eq!(Ended::of(&["state", wish, "--instance", instance], PATIENCE).code, Some(0), "{wish}");
    let has_power = || emulator.wire().servos.iter().all(Servo::is_powered);
    ask("disable");
    assert!(wait_until(PATIENCE, || !has_power()), "off");
    meanwhile();
    ask("enable");
    assert!(wait_until(PATIENCE, has_power), "on");
    std::thread::sleep(Duration::from_millis(500));
}

#[test]
fn a_jaw_begins_where_its_encoder_finds_it_and_moves_as_its_buttons_say() {
    let (instance, folder, emulator) = (instance_name("jaw"), TempFolder::new("jaw"), emulator());
    let config = configuration(&folder, &emulator, &format!("jaw_m_per_rad = {WIRE}\n"));
    let (krait, recording) = opened(&folder, &config, &instance, &emulator);
    let servo = emulator.wire().servos[3].clone();
    switched(&instance, &emulator, || ());
    switched(&instance, &emulator, || emulator.wire().servos[3].place = ZERO + 0.2 * WIRE * PER_M);
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(!emulator.wire().servos[3].is_powered(), "the end of the chain takes its power: {}", ended.stderr);

    let states = states(&recording);
    let follows = |state: &SlaveState| state.flags & SlaveState::JAW_FOLLOWING != 0;
    let told_rad = |state: &SlaveState| state.setpoint_joints_rad[JAW];
    let wire_m = |state: &SlaveState| state.setpoint_q_m[GRIPPER_WIRE];
    let first = states.iter().position(follows).expect("it follows");
    let begun_rad = told_rad(&states[first]);
    assert!((begun_rad - OPEN_RAD).abs() < 0.02, "it begins where the encoder finds it: {begun_rad}");
    let moved = states.iter().position(|state| told_rad(state) > begun_rad + 0.01).expect("it opens");
    for state in &states[first..moved] {
        assert!((wire_m(state) - OPEN_RAD * WIRE).abs() < PLAY_M, "a bend does not close it: {state:?}");
    }
    let bent_m = states[moved].setpoint_q_m[..3].iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    assert!(bent_m > 0.5e-3, "and the lines bend: {bent_m} m");
    let last = states.iter().rposition(follows).expect("it follows");
    let opened_rad = told_rad(&states[last]);
    assert!((0.08..0.3).contains(&(opened_rad - begun_rad)), "{opened_rad}");
    assert!((wire_m(&states[last]) - WIRE * opened_rad).abs() < PLAY_M, "{:?}", states[last]);
    assert!((servo.place - ZERO - wire_m(&states[last]) * PER_M).abs() < 2.0, "{servo:?} {:?}", states[last]);
    // Without power it stays where it was told to be, with play and stretch of its wire; unless somebody has moved it.
    let ready = states.iter().enumerate().filter(|(k, state)| *k > last && state.is_ready()).map(|(_, state)| state);
    let mut found: Vec<f64> = ready.map(told_rad).collect();
    found.dedup();
    assert_eq!((found.len(), found[0]), (2, opened_rad), "{found:?}");
    assert!((found[1] - 0.2).abs() < 0.02, "{found:?}");
    let again = Ended::of(&["replay", &recording, "--slave", "recorded"], PATIENCE);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
}

#[test]
fn drives_that_are_not_the_models_are_refused_in_one_sentence() {
    let (folder, emulator) = (TempFolder::new("jaws"), emulator());
    for (jaw, model, words) in [
        ("", MODEL, "jaw_m_per_rad is missing, and the model has a [gripper]"),
        ("jaw_m_per_rad = 0.003\n", MODEL, "jaw_m_per_rad = 0.003, expected 0.002"),
        ("jaw_m_per_rad = 0.002\ntravel_m = 0.001\n", MODEL, "travel_m = 0.001, expected at least 0.0020"),
        ("jaw_m_per_rad = 0.002\n", "", "describes 4 actuators, and the machine of the model has 3"),
    ] {
        let config = configuration(&folder, &emulator, jaw);
        let instance = instance_name("jaws");
        let mut run = vec!["run", "--engage", "--instance", &instance, "--config", &config, "--seconds", "1"];
        if !model.is_empty() {
            run.extend(["--model", model]);
        }
        let ended = Ended::of(&run, PATIENCE);
        assert!(ended.code != Some(0) && ended.stderr.contains(words), "{}", ended.stderr);
        assert!(emulator.wire().servos.iter().all(|servo| servo.n_goals == 0), "nothing was told to move");
    }
}
