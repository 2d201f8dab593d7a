//! What only XL330 servos do: their own bus watchdog, registers that are forgotten, errors that stay until they are rebooted.

use crate::rig::{Rig, ZERO, config, three};
use krait_drives::emulator::{Emulator, Servo};
use krait_drives::{ActuatorBus, Goals, Seen, ServoBus, ServoMake, Trouble};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::MAX_ACTUATORS;
use krait_slave::{Drive, lines};
use std::time::Duration;

/// What an XL330 that is told nothing for so long does, ms.
const GIVES_UP_MS: u32 = 200;
/// The slowest that it can be told to go, counts/s.
const SLOWEST: f64 = 0.229 / 60.0 * 4096.0;

fn goals(counts: i32) -> Goals {
    Goals { counts: [counts; MAX_ACTUATORS], counts_per_s: [1.0; MAX_ACTUATORS] }
}

#[test]
fn servos_that_are_told_nothing_stop_by_themselves_and_take_no_goal_until_power_is_switched_anew() {
    let emulator = Emulator::start(three(ServoMake::Xl330)).unwrap();
    let mut drive = config(ServoMake::Xl330, &emulator).drive;
    drive.gives_up_ms = GIVES_UP_MS;
    let (mut bus, mut seen): (ServoBus, Seen) = ServoBus::open(&drive).unwrap();
    // Above all of them, so that they go one way only.
    bus.switch(true, &goals(2090)).unwrap();
    bus.ask(&mut seen).unwrap();
    let from: Vec<f64> = emulator.wire().servos.iter().map(|servo| servo.place).collect();
    bus.tell(&goals(3000)).unwrap();
    std::thread::sleep(Duration::from_millis(2 * u64::from(GIVES_UP_MS)));
    bus.ask(&mut seen).unwrap();
    for k in 0..3 {
        let Trouble::Tripped { code: 255, meaning } = seen.trouble[k] else { panic!("{:?}", seen.trouble[k]) };
        assert!(meaning.contains("a quick stop of its own") && seen.is_powered[k], "{meaning}");
    }
    let stopped: Vec<f64> = emulator.wire().servos.iter().map(|servo| servo.place).collect();
    // Once before it is told, once after.
    let most = 2.0 * SLOWEST * f64::from(GIVES_UP_MS) * 1e-3 + 0.5;
    for (from, stopped) in from.iter().zip(&stopped) {
        assert!((0.0..most).contains(&(stopped - from)), "{from} to {stopped}, at most {most}");
    }
    // It holds where it is, whatever it is told.
    bus.tell(&goals(3000)).unwrap();
    bus.ask(&mut seen).unwrap();
    assert!(seen.goal_counts[..3].iter().all(|goal| *goal < 2100), "{:?}", seen.goal_counts);
    let held: Vec<f64> = emulator.wire().servos.iter().map(|servo| servo.place).collect();
    assert!(held.iter().zip(&stopped).all(|(held, stopped)| (held - stopped).abs() <= 0.5), "{stopped:?} {held:?}");
    bus.switch(true, &goals(2070)).unwrap();
    bus.ask(&mut seen).unwrap();
    assert_eq!((seen.goal_counts[..3].to_vec(), seen.trouble[..3].to_vec()), (vec![2070; 3], vec![Trouble::None; 3]));
}

#[test]
fn a_servo_that_has_lost_its_limit_of_torque_or_its_watchdog_is_told_again() {
    const WATCHDOG: usize = 98;
    const GOAL_PWM: usize = 100;
    let emulator = Emulator::start(three(ServoMake::Xl330)).unwrap();
    let mut drive = config(ServoMake::Xl330, &emulator).drive;
    drive.gives_up_ms = 2000;
    drive.actuator.iter_mut().for_each(|actuator| actuator.torque_limit = 0.5);
    let (mut bus, mut seen): (ServoBus, Seen) = ServoBus::open(&drive).unwrap();
    bus.switch(true, &goals(2060)).unwrap();
    bus.ask(&mut seen).unwrap();
    let bounds = |emulator: &Emulator| -> Vec<[u8; 3]> {
        let wire = emulator.wire();
        let of = |servo: &Servo| [GOAL_PWM, GOAL_PWM + 1, WATCHDOG].map(|at| servo.registers[at]);
        wire.servos.iter().map(of).collect()
    };
    // Half of 885 steps, and 2 s in steps of 20 ms.
    let told = vec![[443u16.to_le_bytes()[0], 443u16.to_le_bytes()[1], 100]; 3];
    assert_eq!(bounds(&emulator), told);
    // As if the word had been spoilt on its way.
    for (of, at, lost) in [(1, GOAL_PWM, 0xFF), (2, WATCHDOG, 0)] {
        emulator.wire().servos[of].registers[at] = lost;
        assert_ne!(bounds(&emulator), told);
        // Once it is seen, once it is told.
        for _ in 0..2 {
            bus.ask(&mut seen).unwrap();
        }
        assert_eq!((bounds(&emulator), seen.is_powered[of]), (told.clone(), true), "{at}");
    }
}

#[test]
fn nobody_gets_power_before_one_that_started_anew_is_read_again() {
    let emulator = Emulator::start(three(ServoMake::Xl330)).unwrap();
    let mut drive = config(ServoMake::Xl330, &emulator).drive;
    drive.timeout_ms = 300.0;
    let (mut bus, mut seen): (ServoBus, Seen) = ServoBus::open(&drive).unwrap();
    {
        let mut wire = emulator.wire();
        wire.servos[1].brown_out();
        // Somebody has turned it meanwhile; what was read before is old.
        wire.servos[1].place = 2300.0;
    }
    bus.ask(&mut seen).unwrap();
    assert!(seen.has_answered[1] && !seen.is_powered[1] && seen.has_let_go[1]);
    let n_powered = || emulator.wire().servos.iter().filter(|servo: &&Servo| servo.is_powered()).count();
    bus.switch(true, &goals(seen.counts[1])).unwrap();
    bus.ask(&mut seen).unwrap();
    assert_eq!((n_powered(), seen.counts[1]), (0, 2300));
    bus.switch(true, &goals(seen.counts[1])).unwrap();
    bus.ask(&mut seen).unwrap();
    assert_eq!((n_powered(), seen.goal_counts[1]), (3, 2300));
}

#[test]
fn an_overload_is_forgiven_by_power_that_is_switched_anew_which_reboots_the_servo() {
    let mut rig = Rig::powered(ServoMake::Xl330);
    {
        let mut wire = rig.emulator.wire();
        (wire.servos[1].overload, wire.servos[1].load) = (0.5, 0.6);
    }
    let sentence = rig.until_failure();
    assert!(sentence.contains("Drive 2 failed") && sentence.contains("overloaded and has let go"), "{sentence}");
    rig.emulator.wire().servos[1].load = 0.0;
    rig.drive.set_power(monotonic_ns(), false).unwrap();
    rig.cycles(4);
    assert!(rig.emulator.wire().servos.iter().all(|servo: &Servo| !servo.is_powered()));
    rig.power_up();
    rig.drive.write(monotonic_ns(), lines([0.0; 3])).unwrap();
    rig.cycles(8);
    assert_eq!((rig.goals(), rig.drive.failure()), (vec![ZERO; 3], None));
}
