//! A chain on real drives, which are emulated servos of either make behind a pseudo-terminal: it follows, and what ends it ends defined.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

#[path = "drives/cycles.rs"]
mod cycles;
#[path = "drives/dry.rs"]
mod dry;
#[path = "drives/gripper.rs"]
mod gripper;
#[path = "drives/groups.rs"]
mod groups;
#[path = "drives/homing.rs"]
mod homing;
#[path = "drives/killed.rs"]
mod killed;
#[path = "drives/loads.rs"]
mod loads;
#[path = "drives/machines.rs"]
mod machines;
#[path = "drives/permission.rs"]
mod permission;
#[path = "drives/watch.rs"]
mod watch;
#[path = "drives/zeros.rs"]
mod zeros;

use core::time::Duration;
use krait_drives::ServoMake;
use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_ipc::message::OperatingState;
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name, pid_of, wait_until};
use rustix::process::Signal;
use std::io::Write;
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(120);
const ZERO: f64 = 2048.0;

fn emulator(make: ServoMake) -> Emulator {
    Emulator::start(ServoWire::new((1..=3).map(|id| Servo::of(make, id, ZERO)).collect())).expect("a pseudo-terminal")
}

/// What a configuration says of its servos. A machine under load may hold a chain up for longer than an XL330's own watchdog would wait.
fn kind(make: ServoMake) -> &'static str {
    match make {
        ServoMake::Sts3215 => "kind = \"sts3215\"",
        ServoMake::Xl330 => "kind = \"xl330\"\ngives_up_ms = 2000",
    }
}

/// A configuration for three emulated servos.
fn configuration(make: ServoMake, folder: &TempFolder, emulator: &Emulator, more: &str) -> String {
    configuration_of(make, folder, emulator, 3, ["", more, ""])
}

/// The same for `n`, with patience for a machine under load: more limits, more of the drives, and more of the last actuator.
fn configuration_of(
    make: ServoMake,
    folder: &TempFolder,
    emulator: &Emulator,
    n: u8,
    [limits, more, of_last]: [&str; 3],
) -> String {
    let actuators: String =
        (1..=n).map(|id| format!("[[slave.drive.actuator]]\nid = {id}\nzero_count = 2048\n")).collect();
    let text = format!(
        "[slave.limits]\nrate_m_per_s = 0.01\nfollowing_error_m = 0.003\npull_n = inf\npush_n = inf\n{limits}\
         [slave.drive]\n{}\nport = \"{}\"\nperiod_ms = 20.0\ntimeout_ms = 18.0\nlost_cycles = 20\nwish_ms = 900.0\n{more}\n{actuators}{of_last}",
        kind(make),
        emulator.path().display()
    );
    let path = folder.file("krait.toml");
    std::fs::write(&path, text).expect("written");
    path
}

/// Largest distance of any servo from its zero, counts.
fn farthest(emulator: &Emulator) -> f64 {
    emulator.wire().servos.iter().fold(0.0, |m: f64, servo| m.max((servo.place - ZERO).abs()))
}

/// A chain whose servos are in motion.
fn in_motion(instance: &str, config: &str, recording: &str, emulator: &Emulator) -> Krait {
    let krait =
        Krait::start(&["run", "--engage", "--instance", instance, "--config", config, "--recording", recording]);
    assert!(wait_until(PATIENCE, || farthest(emulator) > 20.0), "the servos move: {:?}", emulator.wire().servos);
    krait
}

/// Operating state, setpoint and encoders of every slave state of a recording.
fn states_in(recording: &str) -> Vec<(u32, [f64; 3], [f64; 3])> {
    let recording = Recording::open(Path::new(recording)).expect("readable");
    let mut states = Vec::new();
    for recorded in recording.samples().expect("samples") {
        if let Sample::State(state) = recorded.expect("readable").sample {
            let three = |q: krait_ipc::message::Actuators| [q[0], q[1], q[2]];
            states.push((state.operating_state, three(state.setpoint_q_m), three(state.measured_q_m)));
        }
    }
    states
}

#[test]
fn the_chain_follows_on_servos_and_one_that_is_unplugged_stops_the_others_where_they_hold() {
    follows_and_holds(ServoMake::Sts3215);
}

#[test]
#[ignore = "what another test does, with the other make; .ci/run runs it"]
fn the_chain_follows_on_xl330_servos_and_one_that_is_unplugged_stops_the_others_where_they_hold() {
    follows_and_holds(ServoMake::Xl330);
}

fn follows_and_holds(make: ServoMake) {
    let (instance, folder, emulator) = (instance_name("servos"), TempFolder::new("servos"), emulator(make));
    let recording = folder.file("run.mcap");
    let config = configuration(make, &folder, &emulator, "");
    let krait = in_motion(&instance, &config, &recording, &emulator);
    assert!(wait_until(PATIENCE, || farthest(&emulator) > 60.0), "it follows");
    let goals = || emulator.wire().servos.iter().map(|servo| servo.n_goals).sum::<u64>();
    refused_beside_a_chain(&config, &instance);
    emulator.wire().servos[1].faults.is_silent = true;
    // The slave says so; the chain stays and does not move.
    std::thread::sleep(Duration::from_millis(1000));
    let held: Vec<f64> = emulator.wire().servos.iter().map(|servo| servo.place).collect();
    let shown = Ended::of(&["state", "--json", "--instance", &instance], PATIENCE).json();
    assert_eq!(shown["has_power"], serde_json::json!([true, false, true]), "{shown}");
    emulator.wire().servos[1].faults.is_silent = false;
    std::thread::sleep(Duration::from_millis(1000));
    let wire = emulator.wire().clone();
    assert!(wire.servos.iter().all(Servo::is_powered), "under power");
    assert_eq!((wire.servos[0].place, wire.servos[2].place), (held[0], held[2]), "nothing resumes by itself");
    let ask = |wish| Ended::of(&["state", wish, "--instance", &instance], PATIENCE);
    let shown = Ended::of(&["state", "--instance", &instance], PATIENCE).stdout;
    assert!(shown.contains("FAULT") && shown.contains("Drive 2 failed; the others hold."), "{shown}");
    assert_eq!(ask("clear-fault").code, Some(0));
    let off = wait_until(PATIENCE, || emulator.wire().servos.iter().all(|servo| !servo.is_powered()));
    assert!(off, "DISABLED takes the power away");
    let n_goals = goals();
    assert_eq!(ask("enable").code, Some(0));
    assert!(wait_until(PATIENCE, || emulator.wire().servos.iter().all(Servo::is_powered)), "enabled anew");
    assert!(goals() > n_goals && farthest(&emulator) < 1000.0);
    let places: Vec<f64> = emulator.wire().servos.iter().map(|servo| servo.place).collect();
    assert_eq!((places[0], places[2]), (held[0], held[2]), "power comes where they stand");
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    let n_said = ended.stderr.matches("Drive 2 failed; the others hold: it has not answered").count();
    assert_eq!(n_said, 1, "said once: {}", ended.stderr);
    assert!(emulator.wire().servos.iter().all(|servo| !servo.is_powered()), "the end of the chain takes the power");
    let states = states_in(&recording);
    let fault = OperatingState::Fault as u32;
    let before: Vec<_> = states.iter().take_while(|state| state.0 != fault).collect();
    assert!(states.iter().any(|state| state.0 == fault), "FAULT is recorded");
    // Encoders come back from the servos: they have moved, and end near where they were told to be.
    let moved = before.iter().filter(|(_, told, read)| told[0].abs() > 5e-4 && (told[0] - read[0]).abs() < 1e-3);
    assert!(moved.count() > 100, "encoders follow the setpoint");
    cycles::are_whole_and_repeat_the_slave(make, &recording, &folder, &config);
}

#[test]
fn drives_that_do_not_fit_are_refused_in_one_sentence_before_the_chain_runs() {
    let make = ServoMake::Sts3215;
    let (instance, folder, emulator) = (instance_name("refused"), TempFolder::new("refused"), emulator(make));
    emulator.wire().servos[2].set_model(1284);
    let config = configuration(make, &folder, &emulator, "");
    let run = |more: &[&str]| {
        let arguments = ["run", "--engage", "--no-recording", "--instance", &instance, "--config", &config];
        Ended::of(&[&arguments[..], more].concat(), PATIENCE)
    };
    let ended = run(&[]);
    assert_eq!(ended.code, Some(2));
    assert!(ended.sentence().contains("actuator 3 (id 3) is a stranger"), "{}", ended.stderr);
    let again = Ended::of(&["run", "--engage=again", "--instance", &instance, "--config", &config], PATIENCE);
    assert!(again.sentence().contains("--engage=again would move real drives"), "{}", again.stderr);
    let truth = run(&["--truth", "none.toml"]);
    assert!(truth.sentence().contains("--truth is for simulated drives"), "{}", truth.stderr);
    assert!(emulator.wire().servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()));
}

/// Nothing else may move what a chain moves: neither in its instance nor on its port.
fn refused_beside_a_chain(config: &str, instance: &str) {
    for wish in [&["--jog", "1"][..], &["--zero"], &["--calibrate"]] {
        let taken = Ended::of(&[&["drives", "--config", config, "--instance", instance][..], wish].concat(), PATIENCE);
        assert!(taken.sentence().contains("is already running"), "{wish:?}: {}", taken.stderr);
    }
    let other = instance_name("jog");
    for wish in [&["--jog", "1"][..], &["--zero"], &["--calibrate"]] {
        let busy = Ended::of(&[&["drives", "--config", config, "--instance", &other][..], wish].concat(), PATIENCE);
        assert!(busy.sentence().contains("is in use by another program"), "{wish:?}: {}", busy.stderr);
    }
    let looking = Ended::of(&["drives", "--config", config], PATIENCE);
    assert!(looking.sentence().contains("is in use by another program"), "{}", looking.stderr);
}

#[test]
fn servos_are_found_their_zeros_read_and_one_is_moved_by_single_steps_and_never_a_stranger() {
    found_and_stepped(ServoMake::Sts3215);
}

#[test]
#[ignore = "what another test does, with the other make; .ci/run runs it"]
fn xl330_servos_are_found_their_zeros_read_and_one_is_moved_by_single_steps_and_never_a_stranger() {
    found_and_stepped(ServoMake::Xl330);
}

fn found_and_stepped(make: ServoMake) {
    let (instance, folder, emulator) = (instance_name("steps"), TempFolder::new("steps"), emulator(make));
    let config = configuration(make, &folder, &emulator, "");
    let mut stranger = Servo::of(make, 9, 100.0);
    stranger.set_model(1284);
    emulator.wire().servos.push(stranger);
    let port = emulator.path().display().to_string();
    let found = Ended::of(&["drives", "--port", &port, "--last-id", "9", "--json"], PATIENCE).json();
    let ids: Vec<_> = found.as_array().expect("servos").iter().map(|servo| &servo["id"]).collect();
    assert_eq!(ids, [1, 2, 3, 9]);
    assert_eq!((&found[0]["reading"]["counts"], &found[0]["reading"]["is_powered"]), (&2048.into(), &false.into()));
    assert!(found[3]["is_known"] == false && found[3]["reading"].is_null(), "{found}");
    let shown = Ended::of(&["drives", "--port", &port, "--last-id", "9"], PATIENCE).stdout;
    let rows: Vec<Vec<&str>> = shown.lines().map(|line| line.split_whitespace().collect()).collect();
    let heads = "counts power current A deg C supply V says";
    assert!(rows.iter().any(|row| row.join(" ").ends_with(heads)), "{shown}");
    let of_id = |id: &str| rows.iter().find(|row| row.get(2) == Some(&id)).unwrap_or_else(|| panic!("{id}: {shown}"));
    let supply_v = if make == ServoMake::Xl330 { "5.0" } else { "7.4" };
    let end = format!(" 2048 off 0.000 31 {supply_v} well");
    assert!(of_id("1").join(" ").ends_with(&end), "{shown}");
    assert!(of_id("9").join(" ").contains("stranger (model 1284), never moved"), "{shown}");
    watch::second_moves_to(2100, make, &emulator);
    let zero = Ended::of(&["drives", "--zero", "--config", &config, "--instance", &instance], PATIENCE);
    assert!(zero.stdout.contains("zero_count = 2100  # actuator 2, id 2"), "{} {}", zero.stdout, zero.stderr);
    assert!(zero.stdout.contains("1 of the zeros to change; --out FILE"), "{}", zero.stdout);
    zeros::written_to_a_file(&folder, &config, &instance);
    assert!(emulator.wire().servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()), "nothing has moved");

    let arguments = ["drives", "--jog", "2", "--config", &config, "--instance", &instance];
    let (mut krait, mut input) = Krait::start_with_input(&arguments);
    assert!(krait.line().contains("Actuator 2 is under power"));
    let steps: [(&[u8], &str); 5] = [
        (b"\n", "told 0.738 mm"),
        (b"--\n", "\"--\" moves nothing"),
        (b"\xff\n", "\"\u{fffd}\" moves nothing"),
        (b"\n", "told 0.838 mm"),
        (b"-\n", "told 0.738 mm"),
    ];
    for (line, told) in steps {
        input.write_all(line).expect("written");
        let answer = krait.line();
        assert!(answer.starts_with(told), "{answer}");
    }
    // A key that is held repeats faster than a step is made: what is pressed during one is forgotten.
    input.write_all(&b"\n".repeat(20)).expect("written");
    assert!(krait.line().starts_with("told 0.838 mm"));
    input.write_all(b"-\n").expect("written");
    let answer = krait.line();
    assert!(answer.starts_with("told 0.738 mm"), "one step of twenty keys: {answer}");
    // A stall ends the engagement; the first key after it moves nothing.
    krait.signal(Signal::STOP);
    std::thread::sleep(Duration::from_millis(300));
    krait.signal(Signal::CONT);
    for (line, said) in [("\n", "the drives had stopped"), ("\n", "told 0.838 mm"), ("-\n", "told 0.738 mm")] {
        input.write_all(line.as_bytes()).expect("written");
        let answer = krait.line();
        assert!(answer.starts_with(said), "{answer}");
    }
    drop(input);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let wire = emulator.wire().clone();
    let places: Vec<f64> = wire.servos.iter().map(|servo| servo.place.round()).collect();
    // 52 counts from zero are 0.638 mm; 0.1 mm are 8.1 counts.
    assert_eq!(places, [2048.0, 2108.0, 2048.0, 100.0]);
    assert!(wire.servos.iter().all(|servo| !servo.is_powered()) && wire.servos[3].n_goals == 0);
}

/// Asks for directions; the written file is `out.toml` beside the configuration.
fn calibrated(folder: &TempFolder, config: &str, instance: &str, more: &[&str]) -> Ended {
    let out = folder.file("out.toml");
    let arguments = ["drives", "--calibrate", "--config", config, "--instance", instance, "--out", &out];
    Ended::of(&[&arguments[..], more].concat(), PATIENCE)
}

#[test]
fn directions_are_found_against_the_tension_of_the_simulated_snake_and_only_a_wrong_sign_is_changed() {
    calibrated_against_tension(ServoMake::Sts3215);
}

#[test]
#[ignore = "what another test does, with the other make; .ci/run runs it"]
fn directions_are_found_against_the_tension_of_the_simulated_snake_and_only_a_wrong_sign_is_changed_by_xl330_servos() {
    calibrated_against_tension(ServoMake::Xl330);
}

fn calibrated_against_tension(make: ServoMake) {
    let (instance, folder) = (instance_name("calibrate"), TempFolder::new("calibrate"));
    let servo = if make == ServoMake::Xl330 { "xl330" } else { "sts3215" };
    let mut emulated = Krait::start(&["drives", "--emulate", "3", "--servo", servo]);
    let lines: Vec<String> =
        core::iter::repeat_with(|| emulated.line()).take(40).take_while(|line| line.trim() != "id = 3").collect();
    let port = lines.iter().find(|line| line.starts_with("port")).expect("a port");
    // The second one is wound as the others are, and its configuration says that it is not.
    let text = format!(
        "[slave]\nwatchdog_ms = 1000.0 # mine\n[slave.limits]\nrate_m_per_s = 0.02\nfollowing_error_m = 0.003\npull_n = inf\n\
         push_n = inf\n[slave.drive]\n{}\n{port}\nperiod_ms = 20.0\ntimeout_ms = 18.0\nlost_cycles = 20\n\
         wish_ms = 900.0\n[[slave.drive.actuator]]\nid = 1 # left\nzero_count = 2048\n[[slave.drive.actuator]]\nid = 2\n\
         zero_count = 2048\nsign = -1 # as wound\n[[slave.drive.actuator]]\nid = 3\nzero_count = 2048\n",
        kind(make)
    );
    let config = folder.file("krait.toml");
    std::fs::write(&config, &text).expect("written");
    let ended = calibrated(&folder, &config, &instance, &["--json"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let found = ended.json();
    for (k, was) in [1, -1, 1].into_iter().enumerate() {
        let one = &found["actuators"][k];
        assert_eq!((&one["sign"], &one["configured_sign"]), (&1.into(), &was.into()), "{found}");
        let per_mm = |way: &str| one[way].as_f64().expect("a number");
        assert!(per_mm("load_per_mm_counts_down") > 0.03 && per_mm("load_per_mm_counts_up") < 0.0, "{found}");
    }
    let written = std::fs::read_to_string(folder.file("out.toml")).expect("written");
    assert_eq!(written, text.replace("sign = -1 # as wound", "sign = 1 # as wound"));
    // What a person has is not overwritten, and servos are back, without power.
    let again = calibrated(&folder, &config, &instance, &[]);
    assert!(again.sentence().contains("out.toml is already there"), "{}", again.stderr);
    let now = Ended::of(&["drives", "--config", &config, "--last-id", "3", "--json"], PATIENCE).json();
    for servo in now.as_array().expect("servos") {
        let counts = servo["reading"]["counts"].as_i64().expect("counts");
        assert!((counts - 2048).abs() <= 1 && servo["reading"]["is_powered"] == false, "{now}");
    }
    emulated.signal(Signal::INT);
    assert_eq!(emulated.end(PATIENCE).code, Some(0));
}

#[test]
fn a_calibration_that_gets_no_answer_writes_nothing_and_never_moves_a_stranger() {
    let make = ServoMake::Sts3215;
    let (instance, folder, emulator) = (instance_name("deaf"), TempFolder::new("deaf"), emulator(make));
    let mut stranger = Servo::of(make, 9, 100.0);
    stranger.set_model(1284);
    emulator.wire().servos.push(stranger);
    let config = configuration(make, &folder, &emulator, "");
    let text = std::fs::read_to_string(&config).expect("written");
    std::fs::write(&config, format!("[slave]\nwatchdog_ms = 1000.0\n{text}")).expect("written");
    let refused = |words: &str| {
        let ended = calibrated(&folder, &config, &instance, &[]);
        assert_ne!(ended.code, Some(0), "{}", ended.stdout);
        assert!(
            ended.sentence().contains("nothing is written") && ended.sentence().contains(words),
            "{}",
            ended.stderr
        );
        assert!(!Path::new(&folder.file("out.toml")).exists());
        let wire = emulator.wire().clone();
        assert!(
            wire.servos.iter().all(|servo| !servo.is_powered()) && wire.servos[3].n_goals == 0,
            "{:?}",
            wire.servos
        );
        let places: Vec<f64> = wire.servos.iter().map(|servo| servo.place.round()).collect();
        assert_eq!(places, [2048.0, 2048.0, 2048.0, 100.0], "where they began");
    };
    // Nothing couples these servos: they carry no load.
    refused("actuator 1 (id 1): its load grows neither way, expected more than");
    assert!(emulator.wire().servos[0].n_goals > 0);
    emulator.wire().servos[0].faults.is_stuck = true;
    refused("actuator 1 (id 1): its encoder does not follow, expected +0.100 mm, found +0.000 mm");
    emulator.wire().servos[0].faults.is_stuck = false;

    // Ctrl-C and a fault end it where it stands, and take the power.
    let begun = || {
        let krait = Krait::start(&["drives", "--calibrate", "--config", &config, "--instance", &instance]);
        assert!(wait_until(PATIENCE, || farthest(&emulator) > 3.0 && farthest(&emulator) < 1000.0), "it moves");
        krait
    };
    emulator.wire().servos.pop();
    let interrupted = begun();
    interrupted.signal(Signal::INT);
    let ended = interrupted.end(PATIENCE);
    assert!(ended.sentence().contains("the calibration was ended where the actuators stood"), "{}", ended.stderr);
    assert!(emulator.wire().servos.iter().all(|servo| !servo.is_powered()));
    emulator.wire().servos[0].place = ZERO;
    let failing = begun();
    emulator.wire().servos[1].faults.is_silent = true;
    let ended = failing.end(PATIENCE);
    let is_said = ended.sentence().contains("rive 2") && ended.sentence().contains("power was taken from all");
    assert!(is_said && !ended.sentence().contains("hold"), "{}", ended.stderr);
    emulator.wire().servos.remove(1);
    assert!(emulator.wire().servos.iter().all(|servo| !servo.is_powered()), "those that hear are without power");
}

#[test]
fn can_drives_that_cannot_be_had_are_refused_in_one_sentence() {
    let (instance, folder) = (instance_name("can"), TempFolder::new("can"));
    let path = folder.file("can.toml");
    let refusal = |drive: &str, arguments: &[&str]| {
        std::fs::write(&path, format!("[slave.drive]\nkind = \"cia402\"\n{drive}")).expect("written");
        let ended = Ended::of(&[arguments, &["--config", &path, "--instance", &instance]].concat(), PATIENCE);
        assert_ne!(ended.code, Some(0));
        assert!(arguments[0] == "run" || ended.stdout.is_empty(), "{arguments:?}: {}", ended.stdout);
        ended.sentence().to_owned()
    };
    let drive = "[[slave.drive.actuator]]\nid = 1\nvendor = 0x555\nproduct = 1\n";
    let there = "interface = \"can77\"\nspeed_counts_per_s = 1e6\n";
    let three = drive.to_owned() + &drive.replace("id = 1", "id = 2") + &drive.replace("id = 1", "id = 3");
    let zeroed = three.replace("product = 1\n", "product = 1\nzero_count = 1000000\n");
    for (text, arguments, words) in [
        (three.clone(), &["run", "--engage"][..], "interface is missing; name the CAN interface"),
        (format!("{there}{}", drive.replace("vendor", "# ")), &["run"], "vendor or product is missing"),
        (format!("{there}{three}"), &["run", "--engage"], "actuator 1 has no zero_count"),
        (format!("{there}{zeroed}"), &["run", "--engage"], "no CAN interface \"can77\""),
        (format!("{there}{zeroed}"), &["drives", "--zero"], "no CAN interface \"can77\""),
        (
            format!("mode = \"dry\"\n{there}{zeroed}"),
            &["drives", "--zero"],
            "set it to \"live\" for `krait drives --zero`",
        ),
        (format!("{there}{zeroed}"), &["drives", "--jog", "1"], "no CAN interface \"can77\""),
        (format!("{there}{zeroed}"), &["drives"], "no CAN interface \"can77\""),
        (String::new(), &["drives", "--interface", "lo"], "lo is no CAN interface"),
        (String::new(), &["drives", "--emulate", "3", "--interface", "can77"], "no CAN interface \"can77\""),
        (String::new(), &["drives", "--emulate", "3", "--interface", "lo"], "lo is no CAN interface"),
        (format!("{there}{zeroed}"), &["run", "--master", "browser"], "drives simulated drives only"),
    ] {
        // A configuration that does not say enough is refused first.
        let text = if text.is_empty() { format!("{there}{zeroed}") } else { text };
        let sentence = refusal(&text, arguments);
        assert!(sentence.contains(words), "{arguments:?}: {sentence}");
    }
}

#[test]
fn the_play_of_an_actuator_is_found_while_krait_moves_it_and_nothing_moves_without_a_yes() {
    let make = ServoMake::Sts3215;
    let (instance, folder, emulator) = (instance_name("play"), TempFolder::new("play"), emulator(make));
    let config = configuration(make, &folder, &emulator, "");
    let (csv, model) = (folder.file("play.csv"), folder.file("robot.toml"));
    let words = ["calibrate", "play", "--csv", &csv, "--model", &model, "--drives", "--dial-sd-um", "15"];
    let words = [&words[..], &["--config", &config, "--instance", &instance]].concat();
    let ended = Ended::fed(&words, "no\n", PATIENCE);
    assert!(ended.sentence().contains("nothing was moved"), "{}", ended.stderr);
    assert!(emulator.wire().servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()));
    // Four turns of actuator 1 with the dial behind a play of 0.18 mm, then the end.
    let mut typed = "yes\n".to_owned();
    for turn in 1..=4 {
        let direction = if turn % 2 == 0 { 1.0 } else { -1.0 };
        for travel_mm in [0.0, 0.3, 0.4, 0.5] {
            typed += &format!("{:.3}\n", direction * f64::max(travel_mm - 0.18, 0.0));
        }
    }
    let ended = Ended::fed(&words, &(typed + "q\ny\n"), PATIENCE);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    let readings = std::fs::read_to_string(&csv).expect("readings");
    assert_eq!(readings.lines().count(), 1 + 16, "{readings}");
    let text = std::fs::read_to_string(&model).expect("written");
    let file = krait_model::model_file::ModelFile::parse(&text).expect("a model");
    let half_width_m = file.effects()[0].setting().value("half_width_m").expect("found");
    // A count of the servo is 12 um.
    assert!((half_width_m - 0.09e-3).abs() < 8e-6, "{half_width_m}");
    let wire = emulator.wire().clone();
    let stayed = wire.servos[1..].iter().all(|servo| (servo.place - ZERO).abs() < 2.0);
    assert!((wire.servos[0].place - ZERO).abs() > 2.0 && stayed, "one actuator, and no other: {:?}", wire.servos);
    assert!(wire.servos.iter().all(|servo| !servo.is_powered()), "the power is taken away at the end");
}
