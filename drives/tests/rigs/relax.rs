//! One of three emulated servos lets go of its line; the others bend a simulated snake on cables and feel it.

use crate::rig::{Rig, ZERO, config, newton_metre_per_ampere, on_each_make, three};
use krait_drives::emulator::{Coupling, Emulator, Servo, ServoWire};
use krait_drives::{ServoMake, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_sim::{CableSnake, Truth};
use krait_slave::{ActuatorConfig, ActuatorState, Drive, OnFault};
use std::time::Duration;

const PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
/// Largest of a servo, N.
const LARGEST_N: f64 = 200.0;
const RELAX_M: f64 = 0.4e-3;

/// What became of the servos' places, m, and loads, N, after the second has failed in this way; the states on the way.
fn after(make: ServoMake, on_fault: OnFault, fail: fn(&mut Servo), stands: bool) -> ([f64; 3], [f64; 3], bool) {
    let mut snake = CableSnake::new(Truth::default());
    let mut wire = three(make);
    wire.coupling = Some(Coupling::new(move |places| {
        let q_m = core::array::from_fn(|k| (places[k] - f64::from(ZERO)) / PER_M);
        snake.loads_n(q_m).map(|load_n| load_n / LARGEST_N).to_vec()
    }));
    let emulator = Emulator::start(wire).unwrap();
    let mut config = config(make, &emulator);
    // A machine under load keeps answers back for a tenth of a second, and nothing here is about that.
    config.drive.lost_cycles = 8;
    (config.drive.on_fault, config.drive.relax_m, config.drive.relax_n) = (on_fault, RELAX_M, 0.5);
    for actuator in &mut config.drive.actuator {
        actuator.newton_metre_per_ampere = newton_metre_per_ampere(make, LARGEST_N);
    }
    let mut rig = Rig { drive: open_drive(&config, None).unwrap(), emulator };
    rig.power_up();
    rig.cycles(3);
    let places = |rig: &Rig| [0, 1, 2].map(|k| rig.emulator.wire().servos[k].place / PER_M);
    let loads = |rig: &Rig| [0, 1, 2].map(|k| rig.emulator.wire().servos[k].load.abs() * LARGEST_N);
    let (from_m, from_n) = (places(&rig), loads(&rig));
    fail(&mut rig.emulator.wire().servos[1]);
    let mut relaxes = false;
    for _ in 0..1500 {
        std::thread::sleep(Duration::from_millis(1));
        let reading = rig.drive.read(monotonic_ns()).unwrap();
        relaxes |= reading.state[0] == ActuatorState::Relaxing;
        if stands && rig.drive.failure().is_some() {
            rig.drive.stand(monotonic_ns());
        }
    }
    let sentence = rig.drive.failure().unwrap().to_string();
    assert!(sentence.starts_with("Drive 2 failed; the others hold: "), "{sentence}");
    let (way_m, change_n) = (places(&rig), loads(&rig));
    // What has ended does not begin again, whatever comes back.
    rig.emulator.wire().servos[1].faults = Default::default();
    std::thread::sleep(Duration::from_millis(300));
    rig.drive.read(monotonic_ns()).unwrap();
    assert_eq!(places(&rig), way_m);
    assert!([0, 2].map(|k| rig.emulator.wire().servos[k].is_powered()) == [true; 2]);
    (core::array::from_fn(|k| way_m[k] - from_m[k]), core::array::from_fn(|k| change_n[k] - from_n[k]), relaxes)
}

#[test]
fn where_one_says_that_it_is_limp_the_loads_of_the_others_fall_within_the_bound_and_else_nothing_moves() {
    let limp: fn(&mut Servo) = |servo| servo.overload = 0.0;
    let hot: fn(&mut Servo) = |servo| servo.faults.error = 4;
    let silent: fn(&mut Servo) = |servo| servo.faults.is_silent = true;
    on_each_make(|make| {
        let (way_m, change_n, relaxes) = after(make, OnFault::Relax, limp, false);
        for k in [0, 2] {
            assert!(change_n[k] < -1.0, "{make:?}: {change_n:?}");
            assert!(way_m[k] > 0.0 && way_m[k] <= RELAX_M + 1.0 / PER_M, "{make:?}: {way_m:?}");
        }
        assert!(relaxes, "{make:?}");
        // A hot XL330 lets go; a hot STS3215 keeps its torque.
        let lets_go = make == ServoMake::Xl330;
        for (on_fault, fail, gives_way) in
            [(OnFault::Hold, limp, false), (OnFault::Relax, hot, lets_go), (OnFault::Relax, silent, false)]
        {
            let (way_m, change_n, relaxes) = after(make, on_fault, fail, false);
            assert_eq!(relaxes, gives_way, "{make:?}");
            let stays = |k: &usize| way_m[*k] == 0.0 && change_n[*k] > -0.5;
            assert!(gives_way || [0, 2].iter().all(stays), "{make:?}: {way_m:?} {change_n:?}");
        }
        let (stopped_m, ..) = after(make, OnFault::Relax, limp, true);
        let ends = [0, 2].iter().all(|k| stopped_m[*k] < 0.75 * way_m[*k]);
        assert!(ends, "{make:?}: a stop ends it: {stopped_m:?} of {way_m:?}");
    });
}

/// Whether lines 1 and 3, and the jaw's wire, gave way after the servo of this number, from 0, has let go of what it held.
fn with_a_jaw_gave_way(limp: usize) -> [bool; 2] {
    let make = ServoMake::Sts3215;
    let mut snake = CableSnake::new(Truth::default());
    let mut wire = ServoWire::new((1..=4).map(|id| Servo::new(id, f64::from(ZERO) + f64::from(id))).collect());
    wire.coupling = Some(Coupling::new(move |places| {
        let q_m = core::array::from_fn(|k| (places[k] - f64::from(ZERO)) / PER_M);
        // The jaw pulls at something with 20 N.
        snake.loads_n(q_m).into_iter().chain([-20.0]).map(|load_n| load_n / LARGEST_N).collect()
    }));
    let emulator = Emulator::start(wire).unwrap();
    let mut config = config(make, &emulator);
    config.drive.lost_cycles = 8;
    (config.drive.on_fault, config.drive.relax_m, config.drive.relax_n) = (OnFault::Relax, RELAX_M, 0.5);
    config.drive.actuator.push(ActuatorConfig {
        id: 4,
        jaw_m_per_rad: Some(0.002),
        ..config.drive.actuator[2].clone()
    });
    for actuator in &mut config.drive.actuator {
        actuator.newton_metre_per_ampere = newton_metre_per_ampere(make, LARGEST_N);
    }
    let mut rig = Rig { drive: open_drive(&config, None).unwrap(), emulator };
    assert_eq!((rig.drive.traits().n_together, rig.drive.traits().alone()), (3, Some(3)));
    rig.power_up();
    rig.cycles(3);
    let goals = rig.goals();
    rig.emulator.wire().servos[limp].overload = 0.0;
    for _ in 0..1500 {
        std::thread::sleep(Duration::from_millis(1));
        rig.drive.read(monotonic_ns()).unwrap();
    }
    let sentence = rig.drive.failure().unwrap().to_string();
    assert!(sentence.starts_with(&format!("Drive {} failed; the others hold: ", limp + 1)), "{sentence}");
    let went = rig.goals();
    [[0, 2].iter().any(|k| went[*k] != goals[*k]), went[3] != goals[3]]
}

#[test]
fn a_jaw_goes_on_holding_while_lines_give_way_and_no_line_gives_way_for_a_jaw() {
    assert_eq!(with_a_jaw_gave_way(1), [true, false]);
    assert_eq!(with_a_jaw_gave_way(3), [false, false]);
}
