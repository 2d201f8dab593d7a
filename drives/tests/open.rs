//! What is wrong with port, servos or configuration is refused before anything moves, in one sentence with what to do.
#![allow(clippy::unwrap_used, clippy::panic)] // Helpers of tests fail as tests do.

mod rig;

use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_drives::sts3215::{self, scan};
use krait_slave::{Drive, SlaveConfig};
use rig::{ZERO, config, three};

/// The refusal of a bus that was changed, and of a configuration that was.
fn refusal(wire: ServoWire, change: impl Fn(&mut SlaveConfig)) -> String {
    let emulator = Emulator::start(wire).unwrap();
    let mut config = config(&emulator);
    change(&mut config);
    let sentence = match sts3215::open_drive(&config, None) {
        Ok(drive) => match drive.traits().check(&config.limits) {
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

fn broken(change: impl Fn(&mut ServoWire)) -> String {
    let mut wire = three();
    change(&mut wire);
    refusal(wire, |_| ())
}

#[test]
fn whatever_is_wrong_with_the_servos_is_said_before_anything_moves() {
    let sentence = broken(|wire| wire.baud = 500_000);
    assert!(sentence.contains("no servo answers") && sentence.contains("1000000 baud"), "{sentence}");
    let sentence = broken(|wire| wire.servos.clear());
    assert!(sentence.contains("no servo answers") && sentence.contains("ids 1, 2, 3"), "{sentence}");
    let sentence = broken(|wire| wire.servos[1].faults.is_silent = true);
    assert!(sentence.contains("actuator 2 (id 2) does not answer"), "{sentence}");
    let sentence = broken(|wire| wire.servos[2].registers[3..5].copy_from_slice(&1284_u16.to_le_bytes()));
    assert!(sentence.contains("actuator 3 (id 3) is a stranger: its model number is 1284, expected 777"), "{sentence}");
    let sentence = broken(|wire| wire.servos.push(Servo::new(2, 1000.0)));
    assert!(sentence.contains("two servos seem to have the id 2"), "{sentence}");
    let sentence = broken(|wire| wire.servos[0].registers[33] = 1);
    assert!(sentence.contains("register 33 (mode) is 1, expected 0"), "{sentence}");
    let sentence = broken(|wire| wire.servos[0].registers[11..13].fill(0));
    assert!(sentence.contains("register 11 (largest angle) is 0"), "{sentence}");
    let sentence = broken(|wire| wire.servos[0].registers[9..11].copy_from_slice(&1900_u16.to_le_bytes()));
    assert!(sentence.contains("register 9 (smallest angle) is 1900, expected at most 1559"), "{sentence}");
}

#[test]
fn whatever_is_wrong_with_the_configuration_is_said_before_anything_moves() {
    let sentence = refusal(three(), |config| config.drive.port = Some("/dev/ttyNone7".into()));
    assert!(sentence.contains("no serial port /dev/ttyNone7"), "{sentence}");
    let sentence = refusal(three(), |config| config.drive.port = Some("/dev/zero".into()));
    assert!(sentence.contains("/dev/zero is no serial port"), "{sentence}");
    let sentence = refusal(three(), |config| config.drive.actuator[1].zero_count = None);
    assert!(sentence.contains("actuator 2 has no zero_count") && sentence.contains("--zero"), "{sentence}");
    let sentence = refusal(three(), |config| config.drive.actuator[2].zero_count = Some(300));
    assert!(sentence.contains("actuator 3") && sentence.contains("begins anew"), "{sentence}");
    let slow = |config: &mut SlaveConfig| (config.drive.period_ms, config.drive.timeout_ms) = (2.0, 1.0);
    let sentence = refusal(three(), slow);
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
        let sentence = refusal(three(), change);
        assert!(sentence.contains("[slave.limits]") && sentence.contains(words), "{sentence}");
    }
}

#[test]
fn a_port_that_another_has_is_refused_until_it_is_given_back() {
    let emulator = Emulator::start(three()).unwrap();
    let first = sts3215::open_drive(&config(&emulator), None).unwrap();
    let second = sts3215::open_drive(&config(&emulator), None).unwrap_err().to_string();
    assert!(second.contains("is in use by another program"), "{second}");
    let looking = scan(emulator.path(), &[1_000_000], 3).unwrap_err().to_string();
    assert!(looking.contains("is in use by another program"), "{looking}");
    drop(first);
    sts3215::open_drive(&config(&emulator), None).unwrap();
}

#[test]
fn a_scan_finds_every_servo_at_its_rate_strangers_too_and_changes_nothing() {
    let mut wire = three();
    wire.baud = 500_000;
    wire.servos[1].registers[3..5].copy_from_slice(&1284_u16.to_le_bytes());
    let before: Vec<_> = wire.servos.iter().map(|servo| servo.registers).collect();
    for echoes in [false, true] {
        wire.echoes = echoes;
        let emulator = Emulator::start(wire.clone()).unwrap();
        let found = scan(emulator.path(), &[1_000_000, 500_000], 4).unwrap();
        let ids: Vec<_> =
            found.iter().map(|servo| (servo.baud, servo.identity.id, servo.identity.is_known())).collect();
        assert_eq!(ids, [(500_000, 1, true), (500_000, 2, false), (500_000, 3, true)]);
        assert_eq!(emulator.wire().servos.iter().map(|servo| servo.registers).collect::<Vec<_>>(), before);
    }
    assert_eq!(ZERO, 2048);
}
