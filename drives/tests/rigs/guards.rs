//! Guards of servos that nobody acknowledges: until each reads back what it was told, power does not count as there.

use crate::rig::{Rig, ZERO, config, on_each_make, three};
use krait_drives::emulator::Emulator;
use krait_drives::{ActuatorBus, Goals, Seen, ServoBus, ServoMake};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, MAX_ACTUATORS};
use krait_slave::{ActuatorState, Drive, DriveError, Switching, lines};

#[test]
fn power_counts_as_there_only_under_the_limit_of_torque_and_the_watchdog_that_were_told() {
    for (make, at) in [(ServoMake::Xl330, 98), (ServoMake::Xl330, 100), (ServoMake::Sts3215, 48)] {
        let mut rig = Rig::new(make);
        rig.emulator.wire().servos[1].faults.refuses = Some(at);
        let mut states = Vec::new();
        // As many cycles of the bus as would be enough by far.
        for _ in 0..4 {
            assert_eq!(rig.drive.set_power(monotonic_ns(), true), Ok(Switching::Busy), "register {at}");
            states = rig.cycles(4).state[..3].to_vec();
            let refused = rig.drive.write(monotonic_ns(), lines([1e-4; 3]));
            assert_eq!(refused, Err(DriveError::NotPowered), "register {at}");
        }
        assert_eq!(states, [ActuatorState::On, ActuatorState::Switching, ActuatorState::On], "register {at}");
        let is_unguarded = |rig: &mut Rig| {
            let cycles: Vec<_> = core::iter::from_fn(|| rig.drive.next_cycle()).collect();
            let last = cycles.last().unwrap();
            core::array::from_fn(|k| last.actuators[k].has(ActuatorCycle::UNGUARDED))
        };
        assert_eq!(is_unguarded(&mut rig), [false, true, false], "register {at}");
        // Powered and not moved: where each stands is where it was told to stay.
        let places = |rig: &Rig| rig.emulator.wire().servos.iter().map(|servo| servo.place.round()).collect::<Vec<_>>();
        assert_eq!(places(&rig), [2049.0, 2050.0, 2051.0], "register {at}");
        rig.emulator.wire().servos[1].faults.refuses = None;
        rig.power_up();
        rig.cycles(2);
        assert_eq!((is_unguarded(&mut rig), rig.drive.failure()), ([false; 3], None), "register {at}");
        rig.drive.write(monotonic_ns(), lines([0.0; 3])).unwrap();
        rig.cycles(8);
        assert_eq!(rig.goals(), vec![ZERO; 3], "register {at}");
    }
}

#[test]
fn a_limit_of_torque_that_is_lost_in_motion_is_told_again_in_the_same_cycle_and_costs_nothing_else() {
    on_each_make(|make| {
        let emulator = Emulator::start(three(make)).unwrap();
        let (mut bus, mut seen): (ServoBus, Seen) = ServoBus::open(&config(make, &emulator).drive).unwrap();
        let goals = Goals { counts: [ZERO; MAX_ACTUATORS], counts_per_s: [1.0; MAX_ACTUATORS] };
        bus.switch(true, &goals).unwrap();
        bus.ask(&mut seen).unwrap();
        assert_eq!((seen.is_powered[..3].to_vec(), seen.is_unguarded[..3].to_vec()), (vec![true; 3], vec![false; 3]));
        let at = if make == ServoMake::Sts3215 { 48 } else { 100 };
        let told = emulator.wire().servos[1].registers[at];
        emulator.wire().servos[1].registers[at] = !told;
        let before = emulator.wire().n_requests;
        let mut n_requests = Vec::new();
        for is_unguarded in [true, false, false] {
            bus.ask(&mut seen).unwrap();
            assert_eq!(seen.is_unguarded[..3], [false, is_unguarded, false], "{make:?}");
            n_requests.push(emulator.wire().n_requests - before);
        }
        assert_eq!(emulator.wire().servos[1].registers[at], told, "{make:?}");
        let [first, second, third] = n_requests[..] else { panic!("three") };
        assert!(third - second == 1 && second > first, "{make:?}: {n_requests:?}");
    });
}
