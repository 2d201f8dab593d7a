//! What was gone comes back: an interface, a drive that was silent or has started anew unheard. Only power that is switched anew
//! looks for it, and then it is identified and configured as at the beginning.

use super::*;
use krait_slave::DriveError;

/// In motion, and then the interface goes down for long enough that drives have stopped by themselves.
fn down() -> Bench {
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().gone = Some(BusGone { what: crate::texts::CAN_DOWN });
    bench.go(60);
    assert_eq!(bench.report().failure, Some(DriveError::Bus { what: crate::texts::CAN_DOWN }));
    assert_eq!(bench.states(), [State::QuickStopActive; 3], "50 ms after the newest heartbeat");
    bench
}

/// What `clear-fault` does: power is switched anew, off; what has failed within so many cycles.
fn clear(bench: &mut Bench, n: usize) -> Option<DriveError> {
    bench.wish = Wish { turn: bench.wish.turn + 1, q_m: [f64::NAN; 12], ..Wish::default() };
    (0..n).find_map(|_| bench.step().failure)
}

#[test]
fn an_interface_that_is_up_again_moves_nothing_until_power_is_switched_anew_and_then_all_are_configured() {
    let mut bench = down();
    // One has lost its power meanwhile, and nobody heard it start.
    bench.bus.lock().drives[1].power_loss(&mut Vec::new());
    bench.bus.lock().gone = None;
    let places = bench.places();
    bench.go(30);
    assert_eq!((bench.places(), bench.states()[0]), (places, State::QuickStopActive), "nothing resumes by itself");
    assert_eq!((bench.report().failure.is_some(), bench.bus.lock().n_reopened), (true, 0));
    assert_eq!(bench.bus.lock().drives[1].object(0x1016, 1), 0, "and nobody is configured");
    assert_eq!(clear(&mut bench, 100), None);
    assert_eq!(
        (bench.states(), bench.places()),
        ([State::SwitchOnDisabled; 3], places),
        "without power, where they stand"
    );
    assert_eq!((bench.report().state[..3] == [ActuatorState::Off; 3], bench.bus.lock().n_reopened), (true, 1));
    assert_eq!(bench.bus.lock().drives[1].object(0x1016, 1), 127 << 16 | 50);
    assert!(
        bench.q_m()[1].abs() > 0.04,
        "its encoder began at 0: its zero is gone, and it is no place within its travel"
    );
    assert!(bench.cycles.is_off());
    bench.power_up();
    let moved = (0..3).map(|k| (bench.places()[k] - places[k]).abs()).fold(0.0, f64::max);
    assert!(moved < 1.0, "power comes where they stand, to a count: {moved}");
}

#[test]
fn an_interface_that_is_still_down_is_said_at_each_try_and_touched_at_none() {
    let mut bench = down();
    let n_frames = bench.bus.lock().n_frames;
    for _ in 0..2 {
        assert_eq!(clear(&mut bench, 5), Some(DriveError::Bus { what: crate::texts::CAN_DOWN }));
    }
    let drives = bench.bus.lock();
    assert_eq!((drives.n_frames, drives.n_reopened), (n_frames, 0));
}

#[test]
fn another_drive_behind_an_interface_that_is_back_is_named_and_gets_no_power() {
    let mut bench = down();
    bench.bus.lock().drives[1].set_object(0x1018, 1, 0x777);
    bench.bus.lock().gone = None;
    assert_eq!(clear(&mut bench, 100), Some(DriveError::Bus { what: crate::texts::OTHER_DRIVES }));
    bench.wish = Wish { turn: bench.wish.turn + 1, has_power: true, q_m: [f64::NAN; 12], ..Wish::default() };
    bench.steps(200);
    assert_ne!(bench.report().phase, Phase::On);
    assert_ne!(bench.states()[1], State::OperationEnabled, "a stranger is never moved");
}

#[test]
fn a_drive_that_started_anew_unheard_is_configured_when_power_is_switched_anew() {
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().drives[1].power_loss(&mut Vec::new());
    bench.go(40);
    assert!(matches!(bench.report().failure, Some(DriveError::Lost { actuator: 2, .. })));
    assert_eq!(clear(&mut bench, 100), None);
    assert_eq!(bench.states(), [State::SwitchOnDisabled; 3]);
    assert_eq!(bench.bus.lock().drives[1].object(0x1016, 1), 127 << 16 | 50);
    assert_eq!(bench.bus.lock().n_reopened, 0, "the interface was there all the time");
}

#[test]
fn a_drive_that_stays_silent_is_lost_again_and_keeps_nobody_s_power() {
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().drives[1].faults.is_dead = true;
    bench.go(40);
    assert!(matches!(bench.report().failure, Some(DriveError::Lost { actuator: 2, .. })));
    assert_eq!(clear(&mut bench, 5), None);
    let states = bench.states();
    assert_eq!(
        (states[0], states[2]),
        (State::SwitchOnDisabled, State::SwitchOnDisabled),
        "the others' power goes at once"
    );
    // Three questions of 100 ms, and then three cycles.
    let n = (0..400).find(|_| bench.step().failure.is_some());
    assert!(matches!(bench.report().failure, Some(DriveError::Lost { actuator: 2, .. })), "{n:?}");
    assert!(n.is_some_and(|n| n < 170), "{n:?}");
}

#[test]
fn after_another_master_was_named_the_power_of_all_goes_as_soon_as_somebody_asks() {
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().inject(Frame::new(0x080, &[]));
    bench.go(20);
    assert_eq!(bench.report().failure, Some(DriveError::Bus { what: crate::texts::SECOND_MASTER }));
    assert_eq!(clear(&mut bench, 3), None);
    assert_eq!((bench.states(), bench.bus.lock().n_reopened), ([State::SwitchOnDisabled; 3], 0));
}
