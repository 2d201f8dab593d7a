//! One drive fails in motion: what is said, what the others do, what the failed one is told.

use super::*;
use crate::Trouble;
use krait_slave::DriveError;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Motion at 20 mm/s for some cycles, then something happens to the second drive.
fn broken(act: impl FnOnce(&mut CanDrive, &mut Vec<Frame>)) -> Bench {
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().with(1, act);
    bench
}

/// Goes on until something has failed; the cycles that took.
fn until_failure(bench: &mut Bench) -> (usize, DriveError) {
    for n in 1..200 {
        bench.go(1);
        if let Some(failure) = bench.report().failure {
            return (n, failure);
        }
    }
    panic!("nothing has failed");
}

/// The others come to rest by their ramp, stay under power, and nothing resumes.
fn others_hold(bench: &mut Bench) {
    let begin = bench.targets.len() - 1;
    bench.go(40);
    // 20 mm/s at 1 m/s2: ten cycles of 2 ms, at most 0.2 mm and a count of rounding each.
    let steps: Vec<i32> = bench.targets[begin..].windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let full = (0.02 * 2e-3 * PER_M).ceil() as i32;
    assert!(steps.iter().all(|step| (0..=full + 1).contains(step)), "{steps:?}");
    assert!(steps.windows(2).all(|pair| pair[1] <= pair[0] + 1), "slower and slower: {steps:?}");
    assert!(steps[12..].iter().all(|step| *step == 0), "{steps:?}");
    let places = bench.places();
    bench.go(100);
    assert_eq!((bench.places()[0], bench.places()[2]), (places[0], places[2]), "nothing resumes by itself");
    assert_eq!((bench.states()[0], bench.states()[2]), (State::OperationEnabled, State::OperationEnabled));
    let states = bench.report().state;
    assert_eq!((states[0], states[2]), (ActuatorState::QuickStopped, ActuatorState::QuickStopped));
}

#[test]
fn one_that_is_silent_is_lost_after_three_cycles() {
    let mut bench = broken(|drive, _| drive.faults.is_silent = true);
    let (n, failure) = until_failure(&mut bench);
    assert!(n == 3 && matches!(failure, DriveError::Lost { actuator: 2, .. }), "{n}: {failure}");
    others_hold(&mut bench);
    assert_eq!(bench.report().state[1], ActuatorState::Lost);
    assert_eq!(bench.states()[1], State::QuickStopActive, "it hears and is told to stop");
    bench.bus.lock().drives[1].faults.is_silent = false;
    bench.go(20);
    assert_eq!(bench.states()[1], State::QuickStopActive, "nothing resumes by itself");
    assert_eq!(bench.power_up(), 1, "from a quick stop it goes on in one step");
    let before = bench.places();
    bench.steps(5);
    assert_eq!(bench.places(), before, "power comes where they stand");
}

#[test]
fn one_whose_encoder_leaps_further_than_its_motor_can_is_stopped_at_once_and_one_that_is_as_fast_as_can_be_is_not() {
    // Twice what 200,000 counts/s are in the three cycles of 2 ms that may be missing.
    let leap = 2.0 * 200_000.0 * 3.0 * 2e-3;
    let mut bench = broken(|drive, _| drive.place -= leap + 100.0);
    let (n, failure) = until_failure(&mut bench);
    assert!(n == 1 && matches!(failure, DriveError::Jumped { actuator: 2, .. }), "{n}: {failure}");
    others_hold(&mut bench);
    let mut bench = broken(|drive, _| drive.place -= leap - 200.0);
    bench.go(20);
    assert_eq!(bench.report().failure, None);
}

#[test]
fn one_that_froze_is_told_to_stop_before_it_can_run_after_stale_targets() {
    let mut bench = broken(|drive, _| drive.faults.is_frozen = true);
    let (n, failure) = until_failure(&mut bench);
    assert!(n == 3 && matches!(failure, DriveError::Lost { actuator: 2, .. }), "{n}: {failure}");
    bench.go(47);
    let frozen_at = bench.places()[1];
    bench.bus.lock().drives[1].faults.is_frozen = false;
    bench.go(50);
    // Of 50 stale cycles it follows those until it counted as lost, then its quick stop's ramp of 10 mm/s.
    let ran_m = (bench.places()[1] - frozen_at).abs() / PER_M;
    assert!(ran_m < 3.0 * 0.01 * 2e-3 + 0.5 * 0.01 * 0.01 + 2e-5, "it ran {ran_m} m");
    assert_eq!(bench.states()[1], State::QuickStopActive);
    others_hold(&mut bench);
}

#[test]
fn one_that_is_lost_and_whose_heartbeat_still_comes_is_said_to_live_with_its_state_and_no_other_is() {
    type Break = fn(&mut CanDrive, &mut Vec<Frame>);
    // A tool of somebody else has taken it out of the cycles; it froze; it has no power.
    let taken_out: Break = |drive, out| drive.take(&frame::manage(2, frame::Nmt::PreOperational), 0, out);
    let stopped: [(Break, Option<&str>); 3] = [
        (taken_out, Some("pre-operational")),
        (|drive, _| drive.faults.is_frozen = true, None),
        (|drive, _| drive.faults.is_dead = true, None),
    ];
    for (act, state) in stopped {
        let mut bench = broken(act);
        let (n, failure) = until_failure(&mut bench);
        assert!(n == 3 && matches!(failure, DriveError::Lost { actuator: 2, .. }), "{n}: {failure}");
        // Two of its heartbeats of 10 ms; one that had come before its last answers is no sign of life.
        bench.go(10);
        let nodes = &mut bench.cycles.bus_mut().nodes;
        assert_eq!([0, 1, 2].map(|k: usize| nodes[k].life(3, 5 * MS)), [None, state, None]);
        assert_eq!(nodes[1].take_life(3, 5 * MS), None, "it was said already");
    }
}

#[test]
fn more_than_one_answer_in_a_cycle_is_not_in_step() {
    let mut bench = broken(|drive, _| drive.faults.answers_twice = true);
    let (n, failure) = until_failure(&mut bench);
    let DriveError::Tripped { actuator: 2, meaning, .. } = failure else { panic!("{failure}") };
    assert!(n <= 2 && meaning.contains("not in step"), "{n}: {failure}");
    others_hold(&mut bench);
    assert_eq!(bench.states()[1], State::QuickStopActive);
}

#[test]
fn a_trip_is_judged_by_the_status_and_explained_by_the_emergency_and_takes_some_more_cycles_to_mend() {
    for (code, words) in
        [(0x2310, "too much current"), (0x3210, "supply voltage"), (0x4310, "too hot"), (0x7305, "encoder")]
    {
        let mut bench = broken(|drive, out| drive.trip(code, out));
        let (n, failure) = until_failure(&mut bench);
        let DriveError::Tripped { actuator: 2, code: found, meaning } = failure else { panic!("{failure}") };
        assert!(n == 1 && found == u32::from(code) && meaning.contains(words), "{n}: {failure}");
        others_hold(&mut bench);
        assert_eq!((bench.states()[1], bench.report().state[1]), (State::Fault, ActuatorState::Faulted));
        assert!(bench.power_up() <= 11, "the twelfth answer says so");
    }
    // The emergency got lost: the status judges all the same.
    let mut bench = broken(|drive, _| drive.trip(0x2310, &mut Vec::new()));
    assert!(matches!(until_failure(&mut bench), (1, DriveError::Tripped { actuator: 2, code: 0x1000, .. })));
}

#[test]
fn one_that_lost_its_power_has_started_anew_and_its_zero_is_gone() {
    let mut bench = broken(CanDrive::power_loss);
    let (n, failure) = until_failure(&mut bench);
    assert!(n == 1 && failure == DriveError::Reset { actuator: 2 }, "{n}: {failure}");
    others_hold(&mut bench);
    assert_eq!(bench.states()[1], State::SwitchOnDisabled, "it is configured again and gets no power");
    assert_eq!(bench.bus.lock().drives[1].object(0x1016, 1), 127 << 16 | 50);
    let n_targets = bench.bus.lock().drives[1].n_targets;
    bench.power_up();
    assert!(bench.bus.lock().drives[1].n_targets > n_targets);
    assert!(bench.q_m()[1].abs() > 0.04, "its encoder begins at 0, which is no place within its travel");
    // Also without power the others know it at once.
    let mut bench = Bench::new();
    bench.steps(3);
    bench.bus.lock().with(2, CanDrive::power_loss);
    bench.step();
    assert_eq!(bench.report().failure, Some(DriveError::Reset { actuator: 3 }));
}

#[test]
fn one_that_jams_or_leaves_by_itself_is_named() {
    let mut bench = broken(|drive, _| drive.faults.is_jammed = true);
    let (_, failure) = until_failure(&mut bench);
    let DriveError::Tripped { actuator: 2, code: 0x8611, meaning } = failure else { panic!("{failure}") };
    assert!(meaning.contains("does not follow"));
    others_hold(&mut bench);
}

/// Three ways in which drives tell an emergency stop: their power is gone without a word, with a code of the class of external
/// errors, or by a failure with such a code.
#[test]
fn an_emergency_stop_of_the_hardware_is_told_from_a_failure() {
    let press = |code| move |drive: &mut CanDrive, out: &mut Vec<Frame>| drive.press_emergency_stop(code, out);
    for (code, expected) in [(None, 0), (Some(0x9000), 0x9000)] {
        let mut bench = broken(press(code));
        let (n, failure) = until_failure(&mut bench);
        assert_eq!((n, failure), (1, DriveError::HardwareStop { actuator: 2, code: expected }));
        others_hold(&mut bench);
        assert_eq!((bench.states()[1], bench.report().state[1]), (State::SwitchOnDisabled, ActuatorState::Off));
        bench.wish = Wish { turn: bench.wish.turn + 1, has_power: true, q_m: [f64::NAN; 12], ..Wish::default() };
        bench.steps(60);
        assert_eq!(bench.states()[1], State::SwitchOnDisabled, "no power comes while it is pressed");
        assert_eq!(bench.report().phase, Phase::Switching);
        bench.bus.lock().drives[1].release_emergency_stop();
        bench.steps(20);
        assert_eq!(bench.report().phase, Phase::On, "released, it comes to those who wait for it");
    }
    let mut bench = broken(|drive, out| drive.trip(0x9001, out));
    assert_eq!(until_failure(&mut bench), (1, DriveError::HardwareStop { actuator: 2, code: 0x9001 }));
    others_hold(&mut bench);
    // A failure that was told explains why power went; so it is no emergency stop.
    let mut bench = broken(press(Some(0x3220)));
    let (_, failure) = until_failure(&mut bench);
    assert!(matches!(failure, DriveError::Tripped { actuator: 2, code: 0x3220, .. }), "{failure}");
    // All at once, as one button does it: nothing holds any more, and nobody says so of the drives.
    let mut bench = Bench::powered();
    bench.go(20);
    for k in 0..3 {
        bench.bus.lock().with(k, press(None));
    }
    assert_eq!(until_failure(&mut bench).1, DriveError::HardwareStop { actuator: 1, code: 0 });
    assert_eq!(bench.report().state[..3], [ActuatorState::Off; 3]);
}

#[test]
fn drives_without_a_master_stop_by_themselves_and_do_not_go_on_when_it_is_back() {
    let mut bench = Bench::powered();
    bench.go(30);
    let (before, gone_ns) = (bench.places(), bench.now_ns());
    // The thread is gone for 300 ms: nobody tells anything, time goes on.
    let (mut wire, _) = bench.bus.own_time();
    let mut stopped_ns = None;
    for ms in 1..=300 {
        bench.bus.lock().step_to(gone_ns + ms * MS);
        if stopped_ns.is_none() && bench.states() == [State::QuickStopActive; 3] {
            stopped_ns = Some(ms * MS);
        }
    }
    assert!((40 * MS..=61 * MS).contains(&stopped_ns.unwrap()), "50 ms after the newest heartbeat: {stopped_ns:?}");
    assert!(wire.receive(0).is_ok());
    let stopped = bench.places();
    assert!((stopped[0] - before[0]).abs() / PER_M < 0.02 * 0.02 + 1e-4, "by the ramp");
    bench.clock.store(gone_ns + 300 * MS, Ordering::Relaxed);
    bench.go(50);
    assert_eq!(bench.states(), [State::QuickStopActive; 3], "nothing resumes by itself");
    assert!(bench.report().failure.is_some());
    let moved = (bench.places()[0] - stopped[0]).abs();
    assert!(moved < 1.0, "it moved {moved} counts");
}

#[test]
fn another_master_in_session_and_an_interface_that_goes_down_end_all_motion() {
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().inject(Frame::new(0x080, &[]));
    bench.go(1);
    assert_eq!(bench.report().failure, Some(DriveError::Bus { what: crate::texts::SECOND_MASTER }));
    bench.go(30);
    let places = bench.places();
    bench.go(30);
    assert_eq!(bench.places(), places);
    let mut bench = Bench::powered();
    bench.go(20);
    bench.bus.lock().gone = Some(BusGone { what: crate::texts::BUS_OFF });
    bench.go(1);
    assert_eq!(bench.report().failure, Some(DriveError::Bus { what: crate::texts::BUS_OFF }));
    assert_eq!(bench.report().state[..3], [ActuatorState::Lost; 3]);
}

#[test]
fn a_hundred_random_drop_outs_never_tell_more_than_the_rate() {
    let full = (0.02 * 2e-3 * PER_M).ceil() as i32 + 1;
    let mut random = ChaCha8Rng::seed_from_u64(16);
    let mut below = |n: u32| (random.next_u32() % n) as usize;
    for k in 0..100 {
        let (n_cycles, lost, fault) = (3 + below(40), below(3), below(4));
        let mut bench = Bench::powered();
        bench.go(n_cycles);
        let begin = bench.targets.len() - 1;
        bench.bus.lock().with(lost, |drive, out| match fault {
            0 => drive.faults.is_silent = true,
            1 => drive.faults.is_frozen = true,
            2 => drive.trip(0x2310, out),
            _ => drive.power_loss(out),
        });
        bench.go(30);
        for pair in bench.targets[begin..].windows(2) {
            // The one that lost its power has no target.
            let steps = (0..3).filter(|i| *i != lost).map(|i| (pair[1][i] - pair[0][i]).abs());
            assert!(steps.max() <= Some(full), "drop-out {k}: {pair:?}");
        }
        let [.., before, last] = &bench.targets[..] else { panic!("two cycles") };
        assert!((0..3).filter(|i| *i != lost).all(|i| before[i] == last[i]), "drop-out {k}");
    }
}

#[test]
fn any_frames_from_the_bus_are_survived_while_under_power_and_never_move_a_drive_beyond_the_rate() {
    let mut state = 16_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 16
    };
    for round in 0..40 {
        let mut bench = Bench::powered();
        bench.go(5);
        let before = bench.places();
        for _ in 0..60 {
            for _ in 0..random() % 30 {
                let bytes = random().to_le_bytes();
                // Mostly of the three drives: that is where harm could come from.
                let id = if random() % 4 == 0 { random() } else { (random() & 0x780) | (1 + random() % 3) };
                let n_bytes = if random() % 3 == 0 { random() % 9 } else { 8 } as usize;
                bench.bus.lock().inject(Frame::new(id as u16, &bytes[..n_bytes]));
            }
            bench.go(1);
        }
        let far = (0..3).map(|k| (bench.places()[k] - before[k]).abs()).fold(0.0, f64::max);
        assert!(far / PER_M <= 0.02 * 60.0 * 2e-3 + 1e-4, "round {round}: {far} counts");
    }
    assert_eq!(Seen::default().trouble[0], Trouble::None);
}
