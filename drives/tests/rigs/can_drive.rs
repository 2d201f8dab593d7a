//! CAN drives through the bus's own thread: power, motion, loads, a failure, the end.

use crate::can_rig::{PER_M, ZERO, config, three};
use krait_drives::cia402::{State, open_drive_on};
use krait_drives::{BusDrive, emulator::CanBus};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{ActuatorState, Drive, DriveError, DriveMode, Homing, Switching, lines};
use std::time::Duration;

fn until(drive: &mut BusDrive, mut done: impl FnMut(&mut BusDrive) -> bool) {
    let is_done = (0..5000).any(|_| {
        std::thread::sleep(Duration::from_millis(1));
        drive.read(monotonic_ns()).unwrap();
        done(drive)
    });
    assert!(is_done, "{:?}", drive.failure());
}

fn powered(bus: &CanBus) -> BusDrive {
    let mut drive = open_drive_on(bus.wire(), &config(), None).unwrap();
    assert_eq!(drive.write(monotonic_ns(), lines([0.0; 3])), Err(DriveError::NotPowered));
    until(&mut drive, |drive| drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done);
    assert_eq!(drive.home(monotonic_ns()), Ok(Homing::Done));
    drive
}

#[test]
fn drives_follow_the_slave_through_the_bus_s_thread_and_lose_their_power_at_its_end() {
    let bus = three();
    let mut drive = powered(&bus);
    let traits = drive.traits();
    assert!(traits.measures_load && traits.n_actuators == 3 && traits.period_ns == 10_000_000);
    let wish = lines([1e-3, -0.5e-3, -0.5e-3]);
    drive.write(monotonic_ns(), wish).unwrap();
    until(&mut drive, |drive| {
        let reading = drive.read(monotonic_ns()).unwrap();
        (0..3).all(|k| (reading.q_tilde_m[k] - wish[k]).abs() < 1.0 / PER_M)
    });
    let reading = drive.read(monotonic_ns()).unwrap();
    assert_eq!(reading.state[..3], [ActuatorState::On; 3]);
    assert!(reading.tau_n[..3].iter().all(|tau_n| tau_n.is_finite()), "{:?}", reading.tau_n);
    assert_eq!(bus.lock().drives[0].target(), ZERO + (1e-3 * PER_M) as i32);
    assert_eq!(drive.failure(), None);
    drop(drive);
    assert!(bus.lock().drives.iter().all(|drive| drive.state() == State::SwitchOnDisabled));
}

#[test]
fn a_trip_is_told_to_the_slave_in_one_sentence_and_what_was_mended_goes_on_after_power_anew() {
    let bus = three();
    let mut drive = powered(&bus);
    bus.lock().with(1, |drive, out| drive.trip(0x2310, out));
    until(&mut drive, |drive| drive.failure().is_some());
    let sentence = drive.failure().unwrap().to_string();
    assert!(
        sentence.starts_with("Drive 2 failed; the others hold: it reports too much current (code 2310h)"),
        "{sentence}"
    );
    assert!(drive.write(monotonic_ns(), lines([1e-3, 0.0, 0.0])).is_err());
    drive.set_power(monotonic_ns(), false).unwrap();
    until(&mut drive, |drive| drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done);
    drive.write(monotonic_ns(), lines([0.0; 3])).unwrap();
    until(&mut drive, |drive| drive.read(monotonic_ns()).unwrap().q_tilde_m[..3].iter().all(|q| q.abs() < 1e-9));
}

#[test]
fn drives_that_lost_their_power_are_far_from_their_zero_until_it_is_set_again() {
    let bus = three();
    let mut drive = powered(&bus);
    bus.lock().with(2, |drive, out| drive.power_loss(out));
    until(&mut drive, |drive| drive.failure() == Some(DriveError::Reset { actuator: 3 }));
    drive.set_power(monotonic_ns(), false).unwrap();
    // It is configured again while nobody has power.
    until(&mut drive, |drive| {
        let sampled_ns = drive.read(monotonic_ns()).unwrap().sampled_ns[2];
        bus.lock().drives[2].object(0x1800, 1) == 0x4000_0183 && monotonic_ns() - sampled_ns < 50_000_000
    });
    drive.set_power(monotonic_ns(), false).unwrap();
    until(&mut drive, |drive| drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done);
    let refused = drive.home(monotonic_ns()).unwrap_err();
    assert!(matches!(refused, DriveError::FarFromZero { actuator: 3, .. }), "{refused}");
    assert!(refused.to_string().contains("krait drives --zero"), "{refused}");
}

#[test]
fn a_dry_run_never_gives_power_and_never_tells_a_target() {
    let bus = three();
    let mut config = config();
    config.drive.mode = DriveMode::Dry;
    let mut drive = open_drive_on(bus.wire(), &config, None).unwrap();
    until(&mut drive, |drive| drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done);
    let wish = lines([1e-3, -0.5e-3, -0.5e-3]);
    drive.write(monotonic_ns(), wish).unwrap();
    until(&mut drive, |drive| drive.read(monotonic_ns()).unwrap().q_tilde_m == wish);
    drop(drive);
    for drive in &bus.lock().drives {
        assert_eq!((drive.state(), drive.n_targets), (State::SwitchOnDisabled, 0));
    }
}
