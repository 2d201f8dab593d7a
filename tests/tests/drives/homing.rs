//! Zeros at mechanical stops of emulated servos: found, and each way in which the search must end with a name and without power.

use super::*;
use krait_drives::emulator::Coupling;

/// Stop of the first servo, counts; its line is pushed where counts grow.
const STOP: f64 = 2248.0;
/// Back from it, counts: 1 mm on a spool of 8 mm.
const BACK: f64 = 1e-3 * 4096.0 / (core::f64::consts::TAU * 0.008);

/// Three servos, the first with a stop.
fn with_stop(make: ServoMake, coupling: Option<Coupling>) -> Emulator {
    let mut wire = ServoWire::new((1..=3).map(|id| Servo::of(make, id, ZERO)).collect());
    wire.servos[0].stops = [1000.0, STOP];
    wire.coupling = coupling;
    Emulator::start(wire).expect("a pseudo-terminal")
}

/// A configuration in which the first actuator looks for it. Loads are known to 0.65 N.
fn configured(make: ServoMake, folder: &TempFolder, emulator: &Emulator, more: &str) -> String {
    let mut text = format!(
        "[slave]\nwatchdog_ms = 1000.0\n[slave.limits]\nrate_m_per_s = 0.01\nfollowing_error_m = 0.003\npull_n = 60.0\npush_n = 60.0\n\
         [slave.drive]\n{}\nport = \"{}\"\nperiod_ms = 20.0\ntimeout_ms = 18.0\nlost_cycles = 20\nwish_ms = 900.0\n",
        kind(make),
        emulator.path().display()
    );
    for id in 1..=3 {
        text += &format!("[[slave.drive.actuator]]\nid = {id}\nnewton_metre_per_ampere = 0.8\ntravel_m = 0.005\n");
        if id == 1 {
            text += &format!(
                "homing = {{ method = \"stop_by_load\", direction = \"push\", load_n = 8.0, rate_m_per_s = 0.002, \
                 back_off_m = 0.001, travel_limit_m = {more} }}\n"
            );
        }
    }
    let path = folder.file("krait.toml");
    std::fs::write(&path, text).expect("written");
    path
}

/// What `--zero` comes to after an answer.
fn zero(name: &str, config: &str, answer: &[u8]) -> Ended {
    let instance = instance_name(name);
    let (krait, mut input) =
        Krait::start_with_input(&["drives", "--zero", "--config", config, "--instance", &instance]);
    // Who is refused before any question reads no answer.
    let _is_read = input.write_all(answer);
    krait.end(PATIENCE)
}

/// Nobody is under power, and the others were never moved.
fn check_rest(emulator: &Emulator) {
    let wire = emulator.wire().clone();
    assert!(wire.servos.iter().all(|servo| !servo.is_powered()), "{:?}", wire.servos);
    assert!(wire.servos[1..].iter().all(|servo| (servo.place - ZERO).abs() < 1.0), "{:?}", wire.servos);
}

#[test]
fn a_stop_is_found_by_its_load_and_zero_is_a_stated_way_back_from_it() {
    for make in [ServoMake::Sts3215, ServoMake::Xl330] {
        check_found(make);
    }
}

/// Nobody may stand beside a chain that homes: one that is started again does so by itself.
#[test]
fn home_of_a_running_chain_moves_nothing_toward_a_stop_and_says_so() {
    let (folder, emulator) = (TempFolder::new("home"), with_stop(ServoMake::Sts3215, None));
    let config = configured(ServoMake::Sts3215, &folder, &emulator, "0.0045");
    let text = std::fs::read_to_string(&config).expect("written above");
    let text = text.replace("travel_m = 0.005\n", "travel_m = 0.006\nzero_count = 2048\n");
    std::fs::write(&config, text).expect("written");
    let instance = instance_name("home");
    let krait = Krait::start(&["run", "--instance", &instance, "--config", &config, "--no-recording"]);
    let state = |more: &[&str]| Ended::of(&[&["state", "--instance", &instance], more].concat(), PATIENCE);
    let is_homed = || state(&[]).stdout.starts_with("ENABLED, homed");
    assert!(wait_until(PATIENCE, is_homed), "{:?}", state(&[]));
    let homed = state(&["home"]);
    assert!(homed.code == Some(0) && homed.stdout.starts_with("ENABLED, homed"), "{homed:?}");
    assert!(homed.stdout.contains("`home` moved nothing") && homed.stdout.contains("krait drives --zero"), "{homed:?}");
    assert!(!state(&[]).stdout.contains("moved nothing"), "said of `home` alone");
    let wire = emulator.wire().clone();
    assert!(wire.servos.iter().all(|servo| (servo.place - ZERO).abs() < 1.0), "{:?}", wire.servos);
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
}

fn check_found(make: ServoMake) {
    let (folder, emulator) = (TempFolder::new("stop"), with_stop(make, None));
    let ended = zero("stop", &configured(make, &folder, &emulator, "0.0045"), b"yes\n");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("actuator 1: Push at 2 mm/s, at most 4.5 mm, until 8 N; then 1 mm back"),
        "{}",
        ended.stderr
    );
    let line = ended.stdout.lines().find(|line| line.ends_with("# actuator 1, id 1")).expect("a zero");
    let found: f64 = line.split(['=', '#']).nth(1).and_then(|text| text.trim().parse().ok()).expect("a count");
    // The spool's 8.1 counts of 0.1 mm, and the rounding of goals.
    assert!((found - (STOP - BACK)).abs() <= 3.0, "{found}, expected {}", STOP - BACK);
    assert!(ended.stdout.contains("zero_count = 2048  # actuator 2, id 2"), "{}", ended.stdout);
    assert!((emulator.wire().servos[0].place - found).abs() <= 2.0, "it stands there");
    check_rest(&emulator);
}

#[test]
fn without_a_typed_yes_nothing_moves() {
    let (folder, emulator) = (TempFolder::new("stop-no"), with_stop(ServoMake::Sts3215, None));
    let config = configured(ServoMake::Sts3215, &folder, &emulator, "0.0045");
    for answer in [&b"y\n"[..], b"\n", b"yes please\n"] {
        let ended = zero("stop-no", &config, answer);
        assert!(ended.code == Some(2) && ended.sentence().contains("nothing was moved"), "{}", ended.stderr);
    }
    // What cannot come to anything is not asked for.
    let text = std::fs::read_to_string(&config).expect("written above");
    for (own, other, words) in [
        ("[slave.drive]\n", "[slave.drive]\nmode = \"dry\"\n", "mode = \"dry\": nothing would move"),
        (
            "rate_m_per_s = 0.01\n",
            "rate_m_per_s = 0.003\n",
            "actuator 1: homing.rate_m_per_s = 0.002: expected at most 0.0015",
        ),
        ("id = 3\nnewton_metre_per_ampere = 0.8\n", "id = 3\n", "actuator 3 (id 3): its load is not measured"),
    ] {
        std::fs::write(&config, text.replace(own, other)).expect("written");
        let ended = zero("stop-no", &config, b"yes\n");
        assert!(ended.code == Some(2) && ended.sentence().contains(words), "{}", ended.stderr);
        assert!(!ended.stderr.contains("Type yes"), "{}", ended.stderr);
    }
    let wire = emulator.wire().clone();
    assert!(wire.servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()), "{:?}", wire.servos);
}

#[test]
fn no_stop_within_the_limit_of_the_way_is_said_and_a_load_that_is_gone_against_is_none() {
    let ended = |coupling: Option<Coupling>| {
        let (folder, emulator) = (TempFolder::new("stop-far"), with_stop(ServoMake::Sts3215, coupling));
        let ended = zero("stop-far", &configured(ServoMake::Sts3215, &folder, &emulator, "0.0018"), b"yes\n");
        check_rest(&emulator);
        // 146.7 counts from where it began.
        assert!((100.0..147.5).contains(&(emulator.wire().servos[0].place - ZERO)), "{:?}", emulator.wire().servos[0]);
        ended
    };
    // The second time it drives a load of 26 N all the way.
    for coupling in [None, Some(Coupling::new(|_: &[f64]| vec![0.1, 0.0, 0.0]))] {
        let ended = ended(coupling);
        assert!(ended.code == Some(2), "{} {}", ended.stdout, ended.stderr);
        assert!(
            ended.sentence().contains("actuator 1 (id 1): no stop within travel_limit_m = 1.8 mm"),
            "{}",
            ended.stderr
        );
    }
}

#[test]
fn a_line_of_another_that_is_loaded_ends_the_search_by_name() {
    // The third one's line is pulled as the first one goes: 2.6 N a count from 60 counts on.
    let coupling = Coupling::new(|places: &[f64]| vec![0.0, 0.0, -0.01 * (places[0] - ZERO - 60.0).max(0.0)]);
    let (folder, emulator) = (TempFolder::new("stop-other"), with_stop(ServoMake::Sts3215, Some(coupling)));
    let ended = zero("stop-other", &configured(ServoMake::Sts3215, &folder, &emulator, "0.0045"), b"yes\n");
    let sentence = ended.sentence();
    assert!(ended.code == Some(2) && sentence.contains("the line of actuator 3 (id 3) carries -"), "{}", ended.stderr);
    let went = emulator.wire().servos[0].place - ZERO;
    assert!((60.0..STOP - ZERO - 20.0).contains(&went), "{went}");
    check_rest(&emulator);
}

#[test]
fn a_servo_that_is_not_read_any_more_ends_the_search_by_name() {
    let (folder, emulator) = (TempFolder::new("stop-lost"), with_stop(ServoMake::Sts3215, None));
    let config = configured(ServoMake::Sts3215, &folder, &emulator, "0.0045");
    let instance = instance_name("stop-lost");
    let (krait, mut input) =
        Krait::start_with_input(&["drives", "--zero", "--config", &config, "--instance", &instance]);
    input.write_all(b"yes\n").expect("written");
    assert!(wait_until(PATIENCE, || emulator.wire().servos[0].place > ZERO + 20.0), "it moves");
    emulator.wire().servos[0].faults.is_silent = true;
    let ended = krait.end(PATIENCE);
    let sentence = ended.sentence();
    assert!(
        ended.code == Some(2)
            && sentence.contains("actuator 1 (id 1): while it looked for its stop")
            && sentence.contains("Drive 1 failed"),
        "{}",
        ended.stderr
    );
    let wire = emulator.wire().clone();
    assert!(wire.servos[1..].iter().all(|servo| !servo.is_powered()), "{:?}", wire.servos);
}
