//! Every fault of the serial line, on servos of both makes, one of three at a time: the others are read in the same cycle, and the next is whole.

use crate::rig::{ZERO, config, on_each_make, three};
use krait_drives::emulator::{Emulator, Faults, Servo, ServoWire};
use krait_drives::{ActuatorBus, Goals, Seen, ServoBus, ServoMake, Trouble};
use krait_slave::ActuatorConfig;
use std::time::Duration;

/// A bus and its emulator.
fn bus(make: ServoMake) -> (Emulator, ServoBus, Seen) {
    let emulator = Emulator::start(three(make)).unwrap();
    let mut drive = config(make, &emulator).drive;
    // On a machine under load an answer may be late by itself; here it is late when it shall be.
    drive.timeout_ms = 300.0;
    let (bus, seen) = ServoBus::open(&drive).unwrap();
    assert_eq!(seen.counts[..3], [2049, 2050, 2051]);
    (emulator, bus, seen)
}

fn spoil(emulator: &Emulator, faults: Faults) {
    emulator.wire().servo(2).unwrap().faults = faults;
}

#[test]
fn a_reply_that_is_spoilt_on_its_way_costs_one_reading_of_one_servo() {
    on_each_make(|make| {
        type Fault = (&'static str, fn(&mut Faults));
        let faults: [Fault; 5] = [
            ("checksum", |f| f.bad_checksum = 1),
            ("cut short", |f| f.cut_short = 1),
            ("other id", |f| f.other_id = 1),
            ("wrong length", |f| f.wrong_length = 1),
            ("later than the time-out", |f| f.late = Duration::from_millis(400)),
        ];
        let (emulator, mut bus, mut seen) = bus(make);
        for (name, set) in faults {
            let mut fault = Faults::default();
            set(&mut fault);
            spoil(&emulator, fault);
            let before = seen;
            // What the others say is new.
            for servo in &mut emulator.wire().servos {
                servo.place += 5.0;
            }
            bus.ask(&mut seen).unwrap();
            let is_late = name.starts_with("later");
            assert!(seen.has_answered[0] && !seen.has_answered[1], "{name}: {:?}", seen.has_answered);
            // The wire is one: behind a servo that is late all are late.
            assert!(seen.has_answered[2] || is_late, "{name}");
            assert_eq!(seen.counts[0], before.counts[0] + 5, "{name}");
            assert_eq!((seen.counts[1], seen.sampled_ns[1]), (before.counts[1], before.sampled_ns[1]), "{name}");
            spoil(&emulator, Faults::default());
            let whole = (0..3).position(|_| {
                bus.ask(&mut seen).unwrap();
                seen.has_answered[..3] == [true; 3]
            });
            assert!(whole.is_some_and(|n| n == 0 || is_late), "{name}: whole again after {whole:?}");
            assert_eq!(seen.counts[1], before.counts[1] + 5, "{name}: the newest answer counts");
        }
    });
}

#[test]
fn a_stray_byte_a_pause_a_late_reply_within_the_time_out_and_an_echo_cost_nothing() {
    on_each_make(|make| {
        let (emulator, mut bus, mut seen) = bus(make);
        let ms = Duration::from_millis;
        for faults in [
            Faults { stray_byte: 1, ..Faults::default() },
            Faults { two_pieces: 1, late: ms(2), ..Faults::default() },
            Faults { late: ms(3), ..Faults::default() },
        ] {
            spoil(&emulator, faults);
            bus.ask(&mut seen).unwrap();
            assert_eq!(seen.has_answered[..3], [true; 3], "{faults:?}");
            spoil(&emulator, Faults::default());
        }
        emulator.wire().echoes = true;
        for _ in 0..3 {
            bus.ask(&mut seen).unwrap();
            assert_eq!(seen.has_answered[..3], [true; 3]);
        }
        assert_eq!(seen.trouble[..3], [Trouble::None; 3]);
    });
}

#[test]
fn a_servo_that_is_unplugged_hides_no_other_wherever_it_hangs() {
    on_each_make(|make| {
        let (emulator, mut bus, mut seen) = bus(make);
        for k in 0..3 {
            emulator.wire().servos[k].faults.is_silent = true;
            bus.ask(&mut seen).unwrap();
            let others: Vec<bool> = (0..3).map(|other| other != k).collect();
            assert_eq!(seen.has_answered[..3], others[..]);
            emulator.wire().servos[k].faults.is_silent = false;
        }
    });
}

#[test]
fn what_a_servo_complains_of_is_read_with_its_position() {
    on_each_make(|make| {
        let (emulator, mut bus, mut seen) = bus(make);
        // 5 are two of them at once.
        let complaints = match make {
            ServoMake::Sts3215 => [(1, "supply"), (2, "encoder"), (4, "hot"), (8, "current"), (5, "several")],
            ServoMake::Xl330 => [(1, "supply"), (8, "encoder"), (4, "hot"), (16, "electrical"), (5, "several")],
        };
        for (error, meaning) in complaints {
            // An XL330 keeps an error until it starts anew.
            emulator.wire().servo(2).unwrap().brown_out();
            bus.ask(&mut seen).unwrap();
            spoil(&emulator, Faults { error, ..Faults::default() });
            bus.ask(&mut seen).unwrap();
            let Trouble::Tripped { code, meaning: found } = seen.trouble[1] else { panic!("{:?}", seen.trouble) };
            assert!(code == u16::from(error) && found.contains(meaning), "{found}");
        }
        emulator.wire().servo(2).unwrap().brown_out();
        bus.ask(&mut seen).unwrap();
        spoil(&emulator, Faults { error: 1 << 5, ..Faults::default() });
        bus.ask(&mut seen).unwrap();
        assert_eq!(seen.trouble[..3], [Trouble::None, Trouble::Limp, Trouble::None]);
    });
}

#[test]
fn an_old_answer_and_a_lost_goal_are_told_by_the_goal_that_the_servo_knows() {
    on_each_make(|make| {
        let (emulator, mut bus, mut seen) = bus(make);
        let mut goals = Goals { counts: [2100; 12], counts_per_s: [1000.0; 12] };
        bus.switch(true, &goals).unwrap();
        bus.ask(&mut seen).unwrap();
        assert_eq!((seen.goal_counts[..3].to_vec(), seen.is_powered[..3].to_vec()), (vec![2100; 3], vec![true; 3]));
        // Half of it: 500 per mille, or of a duty of 885.
        let (at, limit) = if make == ServoMake::Sts3215 { (48, 500_u16) } else { (100, 443) };
        let limits = |servo: &Servo| u16::from_le_bytes([servo.registers[at], servo.registers[at + 1]]);
        assert_eq!(
            emulator.wire().servos.iter().map(limits).collect::<Vec<_>>(),
            [limit; 3],
            "the limit is in the servos"
        );
        spoil(&emulator, Faults { is_deaf: true, ..Faults::default() });
        goals.counts = [2101; 12];
        bus.tell(&goals).unwrap();
        bus.ask(&mut seen).unwrap();
        assert_eq!(seen.goal_counts[..3], [2101, 2100, 2101]);
    });
}

#[test]
fn a_cycle_is_two_packets_whatever_the_number_of_servos() {
    on_each_make(|make| {
        let (emulator, mut bus, mut seen) = bus(make);
        let before = emulator.wire().n_requests;
        for _ in 0..10 {
            bus.tell(&Goals { counts: [2100; 12], counts_per_s: [1.0; 12] }).unwrap();
            bus.ask(&mut seen).unwrap();
        }
        assert_eq!(emulator.wire().n_requests - before, 20);
    });
}

#[test]
fn twelve_servos_are_told_and_read_in_two_packets_and_one_that_is_spoilt_or_unplugged_hides_no_other() {
    const N: usize = 12;
    on_each_make(|make| {
        let servos = (1..=N as u8).map(|id| Servo::of(make, id, f64::from(ZERO) + f64::from(id))).collect();
        let emulator = Emulator::start(ServoWire::new(servos)).unwrap();
        let mut drive = config(make, &emulator).drive;
        drive.timeout_ms = 300.0;
        let actuator = |id| ActuatorConfig { id, zero_count: Some(ZERO), ..ActuatorConfig::default() };
        drive.actuator = (1..=N as u32).map(actuator).collect();
        let (mut bus, mut seen) = ServoBus::open(&drive).unwrap();
        assert_eq!(seen.counts, core::array::from_fn(|k| ZERO + 1 + k as i32));
        let mut goals = Goals { counts: core::array::from_fn(|k| 2100 + k as i32), counts_per_s: [1000.0; N] };
        bus.switch(true, &goals).unwrap();
        bus.ask(&mut seen).unwrap();
        assert_eq!((seen.goal_counts, seen.is_powered), (goals.counts, [true; N]));
        let before = emulator.wire().n_requests;
        for _ in 0..5 {
            goals.counts = goals.counts.map(|counts| counts + 1);
            bus.tell(&goals).unwrap();
            bus.ask(&mut seen).unwrap();
            assert_eq!((seen.goal_counts, seen.has_answered), (goals.counts, [true; N]));
        }
        assert_eq!(emulator.wire().n_requests - before, 10);
        for k in [0, 5, N - 1] {
            let others: [bool; N] = core::array::from_fn(|other| other != k);
            for faults in [
                Faults { is_silent: true, ..Faults::default() },
                Faults { bad_checksum: 1, ..Faults::default() },
                Faults { cut_short: 1, ..Faults::default() },
            ] {
                emulator.wire().servos[k].faults = faults;
                bus.ask(&mut seen).unwrap();
                assert_eq!(seen.has_answered, others, "{faults:?}");
                emulator.wire().servos[k].faults = Faults::default();
                bus.ask(&mut seen).unwrap();
                assert_eq!(seen.has_answered, [true; N], "{faults:?}");
            }
        }
    });
}
