//! The drive on an emulated bus: units there and back, and how each failure of one actuator ends for all.

use crate::rig::{Rig, ZERO, config, on_each_make, three};
use krait_drives::emulator::{Emulator, ServoWire};
use krait_drives::{BusDrive, ServoMake, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{ActuatorState, Drive, DriveError, DriveMode, Switching, lines};
use std::time::Duration;

/// Counts per metre of the default spool.
const PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);

#[test]
fn wishes_become_counts_and_come_back_as_readings_that_know_their_instant() {
    on_each_make(|make| {
        let mut rig = Rig::powered(make);
        let before = rig.cycles(2);
        assert_eq!(before.state[..3], [ActuatorState::On; 3]);
        assert!((before.q_tilde_m[2] - 3.0 / PER_M).abs() < 1e-9, "{:?}", before.q_tilde_m);
        let wish = lines([-1e-3, 0.5e-3, 2e-3]);
        rig.drive.write(monotonic_ns(), wish).unwrap();
        rig.cycles(6);
        let expected: Vec<i32> = wish[..3].iter().map(|q| ZERO + (q * PER_M).round() as i32).collect();
        assert_eq!(rig.goals(), expected);
        let reading = rig.cycles(2);
        for (k, wished_m) in wish.into_iter().take(3).enumerate() {
            assert!((reading.q_tilde_m[k] - wished_m).abs() < 1.0 / PER_M, "{:?}", reading.q_tilde_m);
            assert!(reading.sampled_ns[k] > before.sampled_ns[k] && reading.sampled_ns[k] <= monotonic_ns());
            assert!(reading.tau_n[k].is_nan(), "nothing measures the load here");
        }
        assert_eq!(rig.drive.failure(), None);
        drop(rig.drive);
        assert!(rig.emulator.wire().servos.iter().all(|servo| !servo.is_powered()), "the end takes the power away");
    });
}

#[test]
fn what_must_not_be_done_is_refused_and_moves_nothing() {
    on_each_make(|make| {
        let mut rig = Rig::new(make);
        assert_eq!(rig.drive.write(monotonic_ns(), lines([0.0; 3])), Err(DriveError::NotPowered));
        assert_eq!(rig.goals(), [0; 3], "no goal before power");
        rig.power_up();
        let before = rig.goals();
        assert_eq!(before, [2049, 2050, 2051], "power comes where they stand");
        let far = rig.drive.write(monotonic_ns(), lines([0.0, 7e-3, 0.0]));
        assert_eq!(far, Err(DriveError::OutOfTravel { actuator: 2, found_m: 7e-3, limit_m: 6e-3 }));
        let nan = rig.drive.write(monotonic_ns(), lines([0.0, 0.0, f64::NAN]));
        assert!(matches!(nan, Err(DriveError::NotFinite { actuator: 3, .. })));
        rig.cycles(3);
        assert_eq!(rig.goals(), before);
        assert_eq!(rig.drive.failure(), None);
    });
}

/// Breaks the second servo in motion; the sentence, and the states of all after some more cycles.
fn broken(make: ServoMake, break_it: fn(&Emulator)) -> (Rig, String) {
    let mut rig = Rig::powered(make);
    rig.drive.write(monotonic_ns(), lines([1e-3, -0.5e-3, -0.5e-3])).unwrap();
    rig.cycles(3);
    break_it(&rig.emulator);
    let sentence = rig.until_failure();
    (rig, sentence)
}

#[test]
fn whatever_becomes_of_one_the_others_hold_under_power_and_nothing_resumes_by_itself() {
    on_each_make(|make| {
        type Case = (fn(&Emulator), &'static str, ActuatorState);
        let cases: [Case; 6] = [
            (|e| e.wire().servos[1].faults.is_silent = true, "not answered", ActuatorState::Lost),
            (|e| e.wire().servos[1].faults.is_deaf = true, "knows another goal", ActuatorState::Lost),
            (
                |e| {
                    let servo = &mut e.wire().servos[1];
                    (servo.overload, servo.load) = (0.5, 0.6);
                },
                "overloaded and has let go",
                ActuatorState::Limp,
            ),
            (|e| e.wire().servos[1].brown_out(), "started anew", ActuatorState::Off),
            (|e| e.wire().servos[1].faults.error = 4, "too hot (code 4)", ActuatorState::Faulted),
            (|e| e.wire().servos[1].place = 4094.0, "leapt by", ActuatorState::QuickStopped),
        ];
        for (break_it, words, state) in cases {
            let (mut rig, sentence) = broken(make, break_it);
            assert!(
                sentence.starts_with("Drive 2 failed; the others hold: ") && sentence.contains(words),
                "{sentence}"
            );
            // Four periods: the others have braked.
            std::thread::sleep(Duration::from_millis(200));
            let (goals, reading) = (rig.goals(), rig.drive.read(monotonic_ns()).unwrap());
            assert_eq!(reading.state[0], ActuatorState::QuickStopped, "{words}");
            assert_eq!((reading.state[1], reading.state[2]), (state, ActuatorState::QuickStopped), "{words}");
            // It comes back, and the slave goes on asking for motion: nothing moves.
            rig.emulator.wire().servos[1].faults = Default::default();
            assert!(rig.drive.write(monotonic_ns(), lines([2e-3, -1e-3, -1e-3])).is_err(), "{words}");
            std::thread::sleep(Duration::from_millis(200));
            assert_eq!((rig.goals()[0], rig.goals()[2]), (goals[0], goals[2]), "{words}");
            assert!(rig.emulator.wire().servos[0].is_powered() && rig.emulator.wire().servos[2].is_powered());
        }
    });
}

#[test]
fn power_that_is_switched_anew_forgives_what_has_been_mended() {
    on_each_make(|make| {
        let (mut rig, _) = broken(make, |e| e.wire().servos[1].faults.is_silent = true);
        rig.drive.quick_stop(monotonic_ns());
        assert_eq!(rig.drive.set_power(monotonic_ns(), true), Ok(Switching::Busy), "a new turn");
        let again = rig.until_failure();
        assert!(again.contains("Drive 2 failed"), "it is still silent: {again}");
        rig.emulator.wire().servos[1].faults.is_silent = false;
        rig.drive.set_power(monotonic_ns(), false).unwrap();
        rig.cycles(3);
        rig.power_up();
        rig.drive.write(monotonic_ns(), lines([0.0; 3])).unwrap();
        rig.cycles(8);
        assert_eq!((rig.goals(), rig.drive.failure()), (vec![ZERO; 3], None));
    });
}

#[test]
fn a_slave_that_falls_silent_is_noticed_by_the_bus_itself() {
    on_each_make(|make| {
        let emulator = Emulator::start(three(make)).unwrap();
        let mut config = config(make, &emulator);
        config.drive.wish_ms = 200.0;
        let mut rig = Rig { drive: open_drive(&config, None).unwrap(), emulator };
        rig.power_up();
        rig.drive.write(monotonic_ns(), lines([1e-3, -0.5e-3, -0.5e-3])).unwrap();
        std::thread::sleep(Duration::from_millis(500));
        let sentence = rig.until_failure();
        assert!(
            sentence.starts_with("the slave was silent for ") && sentence.contains("expected at most 200 ms"),
            "{sentence}"
        );
        assert!(rig.emulator.wire().servos.iter().all(|servo| servo.is_powered()), "they hold");
    });
}

#[test]
fn an_adapter_that_is_unplugged_is_a_failure_of_the_bus_and_ends_the_thread_in_order() {
    on_each_make(|make| {
        let Rig { emulator, mut drive } = Rig::powered(make);
        drop(emulator);
        for _ in 0..5000 {
            std::thread::sleep(Duration::from_millis(1));
            drive.read(monotonic_ns()).unwrap();
            if drive.failure().is_some() {
                break;
            }
        }
        let failure = drive.failure().unwrap().to_string();
        assert!(failure.contains("its port is gone"), "{failure}");
    });
}

#[test]
fn an_adapter_that_is_plugged_in_again_is_opened_again_when_power_is_switched_and_strangers_on_it_are_not_moved() {
    on_each_make(|make| {
        let folder = std::env::temp_dir().join(format!("krait-replug-{make:?}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // As a lasting name in /dev/serial/by-id is one.
        let link = folder.join("adapter");
        let plug = |wire: ServoWire| {
            let emulator = Emulator::start(wire).unwrap();
            // There is none before the first.
            std::fs::remove_file(&link).ok();
            std::os::unix::fs::symlink(emulator.path(), &link).unwrap();
            emulator
        };
        let emulator = plug(three(make));
        let mut config = config(make, &emulator);
        config.drive.port = Some(link.clone());
        let mut rig = Rig { drive: open_drive(&config, None).unwrap(), emulator };
        rig.power_up();
        drop(rig.emulator);
        let failure = |drive: &mut BusDrive| {
            for _ in 0..5000 {
                std::thread::sleep(Duration::from_millis(1));
                drive.read(monotonic_ns()).unwrap();
                if let Some(failure) = drive.failure() {
                    return failure.to_string();
                }
            }
            panic!("nothing has failed")
        };
        assert!(failure(&mut rig.drive).contains("its port is gone"));
        rig.drive.set_power(monotonic_ns(), false).unwrap();
        let still = failure(&mut rig.drive);
        assert!(still.contains("its port is still gone; plug the USB adapter in"), "{still}");
        let mut others = three(make);
        others.servos[1].set_model(1284);
        let strangers = plug(others);
        rig.drive.set_power(monotonic_ns(), false).unwrap();
        let stranger = failure(&mut rig.drive);
        assert!(stranger.contains("its port is back, but not with the servos of the configuration"), "{stranger}");
        assert!(strangers.wire().servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()));
        drop(strangers);
        let mut again = Rig { emulator: plug(three(make)), drive: rig.drive };
        again.drive.set_power(monotonic_ns(), false).unwrap();
        again.cycles(3);
        assert_eq!(again.drive.failure(), None);
        again.power_up();
        again.drive.write(monotonic_ns(), lines([0.0; 3])).unwrap();
        again.cycles(8);
        assert_eq!((again.goals(), again.drive.failure()), (vec![ZERO; 3], None));
        std::fs::remove_dir_all(folder).unwrap();
    });
}

#[test]
fn a_dry_run_reads_the_servos_shows_the_wishes_and_never_switches_power() {
    on_each_make(|make| {
        let emulator = Emulator::start(three(make)).unwrap();
        let mut config = config(make, &emulator);
        config.drive.mode = DriveMode::Dry;
        let mut drive = open_drive(&config, None).unwrap();
        let until = |drive: &mut BusDrive, done: &dyn Fn(&mut BusDrive) -> bool| {
            (0..2000).any(|_| {
                std::thread::sleep(Duration::from_millis(1));
                done(drive)
            })
        };
        assert!(until(&mut drive, &|drive| drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done));
        let wish = lines([1e-3, -0.5e-3, -0.5e-3]);
        drive.write(monotonic_ns(), wish).unwrap();
        assert!(until(&mut drive, &|drive| drive.read(monotonic_ns()).unwrap().q_tilde_m == wish));
        assert_eq!(drive.read(monotonic_ns()).unwrap().state[..3], [ActuatorState::Off; 3]);
        drop(drive);
        let wire = emulator.wire();
        assert!(wire.servos.iter().all(|servo| !servo.is_powered() && servo.n_goals == 0));
    });
}
