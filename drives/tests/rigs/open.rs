//! What is wrong with port, servos or configuration is refused before anything moves, in one sentence with what to do.

use crate::rig::{ZERO, config, three};
use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_drives::{ServoMake, open_drive, scan};
use krait_slave::{Drive, SlaveConfig};

/// The refusal of a bus that was changed, and of a configuration that was.
fn refusal(make: ServoMake, wire: ServoWire, change: impl Fn(&mut SlaveConfig)) -> String {
    let emulator = Emulator::start(wire).unwrap();
    let mut config = config(make, &emulator);
    change(&mut config);
    let sentence = match open_drive(&config, None) {
        Ok(drive) => match drive.traits().check(&config) {
            Ok(()) => panic!("the drive was opened"),
            Err(error) => error.to_string(),
        },
        Err(error) => error.to_string(),
    };
    let wire = emulator.wire();
    assert!(wire.servos.iter().all(|servo| !servo.is_powered() && servo.n_goals == 0), "nothing may have moved");
    assert!(!sentence.contains('\n') && sentence.len() < 330, "{sentence}");
    sentence
}

fn broken(make: ServoMake, change: impl Fn(&mut ServoWire)) -> String {
    let mut wire = three(make);
    change(&mut wire);
    refusal(make, wire, |_| ())
}

#[test]
fn whatever_is_wrong_with_the_servos_is_said_before_anything_moves() {
    for (make, known) in [
        (ServoMake::Sts3215, "expected 777 (STS3215)"),
        (ServoMake::Xl330, "expected 1200 (XL330-M288) or 1190 (XL330-M077)"),
    ] {
        let sentence = broken(make, |wire| wire.baud = 500_000);
        assert!(sentence.contains("no servo answers") && sentence.contains("1000000 baud"), "{sentence}");
        let sentence = broken(make, |wire| wire.servos.clear());
        assert!(sentence.contains("no servo answers") && sentence.contains("ids 1, 2, 3"), "{sentence}");
        let sentence = broken(make, |wire| wire.servos[1].faults.is_silent = true);
        assert!(sentence.contains("actuator 2 (id 2) does not answer"), "{sentence}");
        let sentence = broken(make, |wire| wire.servos[2].set_model(1284));
        let stranger = format!("actuator 3 (id 3) is a stranger: its model number is 1284, {known}");
        assert!(sentence.contains(&stranger), "{sentence}");
        let sentence = broken(make, |wire| wire.servos.push(Servo::of(make, 2, 1000.0)));
        assert!(sentence.contains("two servos seem to have the id 2"), "{sentence}");
        // Servos of the other make speak another language.
        let other = ServoMake::ALL.into_iter().find(|other| *other != make).unwrap();
        let sentence = broken(make, |wire| *wire = three(other));
        assert!(sentence.contains("no servo answers"), "{sentence}");
    }
}

#[test]
fn an_xl330_that_does_not_gather_its_registers_is_refused() {
    let sentence = broken(ServoMake::Xl330, |wire| wire.servos[1].faults.is_deaf = true);
    assert!(sentence.contains("actuator 2 (id 2) keeps other indirect addresses"), "{sentence}");
}

#[test]
fn a_servo_that_is_set_to_something_else_is_refused_with_the_register() {
    type Case = (usize, &'static [u8], &'static str);
    let feetech: [Case; 3] = [
        (33, &[1], "register 33 (mode) is 1, expected 0"),
        (11, &[0, 0], "register 11 (largest angle) is 0"),
        (9, &[0x6C, 7], "register 9 (smallest angle) is 1900, expected at most 1559"),
    ];
    let dynamixel: [Case; 9] = [
        (11, &[4], "register 11 (operating mode) is 4, expected 3 (position)"),
        (10, &[8], "register 10 (drive mode) is 8, expected 0"),
        (12, &[1], "register 12 (secondary id) is 1, expected 255"),
        (9, &[250, 0], "register 9 (return delay time) is 250, expected at most"),
        (20, &[0xFF, 0xFF, 0xFF, 0xFF], "register 20 (homing offset) is -1, expected 0"),
        (60, &[1], "register 60 (startup configuration) is 1, expected 0"),
        (44, &[10, 0, 0, 0], "register 44 (velocity limit) is 10, expected at least 192"),
        (52, &[0x6C, 7, 0, 0], "register 52 (smallest position) is 1900, expected at most 1559"),
        (48, &[0, 9, 0, 0], "register 48 (largest position) is 2304, expected at least 2537"),
    ];
    let cases = [(ServoMake::Sts3215, &feetech[..]), (ServoMake::Xl330, &dynamixel[..])];
    for (make, (at, bytes, words)) in
        cases.iter().flat_map(|(make, cases)| cases.iter().map(move |case| (*make, *case)))
    {
        let mut wire = three(make);
        wire.servos[1].registers[at..at + bytes.len()].copy_from_slice(bytes);
        // The longest return delay of three takes 1.5 ms.
        let brief = |config: &mut SlaveConfig| {
            if words.contains("delay") {
                (config.drive.period_ms, config.drive.timeout_ms) = (5.0, 2.0);
            }
        };
        let sentence = refusal(make, wire, brief);
        assert!(sentence.contains("actuator 2 (id 2)") && sentence.contains(words), "{sentence}");
    }
}

#[test]
fn whatever_is_wrong_with_the_configuration_is_said_before_anything_moves() {
    let sentence = refusal(ServoMake::Sts3215, three(ServoMake::Sts3215), |config| {
        config.drive.port = Some("/dev/ttyNone7".into())
    });
    assert!(sentence.contains("no serial port /dev/ttyNone7"), "{sentence}");
    let sentence =
        refusal(ServoMake::Sts3215, three(ServoMake::Sts3215), |config| config.drive.port = Some("/dev/zero".into()));
    assert!(sentence.contains("/dev/zero is no serial port"), "{sentence}");
    let sentence =
        refusal(ServoMake::Sts3215, three(ServoMake::Sts3215), |config| config.drive.actuator[1].zero_count = None);
    assert!(sentence.contains("actuator 2 has no zero_count") && sentence.contains("--zero"), "{sentence}");
    let sentence = refusal(ServoMake::Sts3215, three(ServoMake::Sts3215), |config| {
        config.drive.actuator[2].zero_count = Some(300)
    });
    assert!(sentence.contains("actuator 3") && sentence.contains("begins anew"), "{sentence}");
    let slow = |config: &mut SlaveConfig| (config.drive.period_ms, config.drive.timeout_ms) = (2.0, 1.0);
    let sentence = refusal(ServoMake::Sts3215, three(ServoMake::Sts3215), slow);
    assert!(sentence.contains("period_ms = 2: 3 servos at 1000000 baud need 2.5 ms"), "{sentence}");
    for (change, words) in [
        (
            Box::new(|c: &mut SlaveConfig| c.drive.actuator[0].travel_m = 5e-3) as Box<dyn Fn(&mut SlaveConfig)>,
            "stroke_m",
        ),
        (Box::new(|c: &mut SlaveConfig| c.drive.speed_counts_per_s = 1000.0), "rate_m_per_s = 0.03"),
        (Box::new(|_: &mut SlaveConfig| ()), "following_error_m = 0.0003"),
        (
            Box::new(|c: &mut SlaveConfig| (c.limits.rate_m_per_s, c.limits.following_error_m) = (1e-3, 1e-3)),
            "pull_n = 60",
        ),
    ] {
        let sentence = refusal(ServoMake::Sts3215, three(ServoMake::Sts3215), change);
        assert!(sentence.contains("[slave.limits]") && sentence.contains(words), "{sentence}");
    }
}

#[test]
fn a_port_that_another_has_is_refused_until_it_is_given_back() {
    let emulator = Emulator::start(three(ServoMake::Sts3215)).unwrap();
    let first = open_drive(&config(ServoMake::Sts3215, &emulator), None).unwrap();
    let second = open_drive(&config(ServoMake::Sts3215, &emulator), None).unwrap_err().to_string();
    assert!(second.contains("is in use by another program"), "{second}");
    let looking = scan(emulator.path(), Some(1_000_000), 3).unwrap_err().to_string();
    assert!(looking.contains("is in use by another program"), "{looking}");
    drop(first);
    open_drive(&config(ServoMake::Sts3215, &emulator), None).unwrap();
}

#[test]
fn a_scan_finds_every_servo_at_its_rate_and_in_its_protocol_strangers_too_and_changes_nothing() {
    let mut wire = three(ServoMake::Sts3215);
    wire.baud = 115_200;
    wire.servos[1].set_model(1284);
    // Of both makes on one bus.
    wire.servos.push(Servo::of(ServoMake::Xl330, 4, 100.0));
    wire.servos.push(Servo::of(ServoMake::Xl330, 5, 100.0));
    wire.servos[4].set_model(1060);
    let before: Vec<_> = wire.servos.iter().map(|servo| servo.registers).collect();
    for echoes in [false, true] {
        wire.echoes = echoes;
        let emulator = Emulator::start(wire.clone()).unwrap();
        let found = scan(emulator.path(), None, 6).unwrap();
        let ids: Vec<_> = found.iter().map(|servo| (servo.baud, servo.identity.id, servo.identity.name())).collect();
        let (sts3215, xl330) = (Some("STS3215"), Some("XL330-M288"));
        assert_eq!(
            ids,
            [(115_200, 1, sts3215), (115_200, 2, None), (115_200, 3, sts3215), (115_200, 4, xl330), (115_200, 5, None)]
        );
        assert!(scan(emulator.path(), Some(57_600), 6).unwrap().is_empty());
        assert_eq!(emulator.wire().servos.iter().map(|servo| servo.registers).collect::<Vec<_>>(), before);
    }
    assert_eq!(ZERO, 2048);
}
