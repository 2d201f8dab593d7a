//! Power that takes time, and drives that fail: what the state says, and what goes on only when somebody asks.

use super::*;

#[test]
fn drives_that_fail_or_do_not_follow_are_a_fault_that_only_a_retry_leaves() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.1e-3);
    bench.core.drive_mut().is_dead = true;
    let state = bench.go(0.11e-3);
    assert_eq!(state.operating(), Some(OperatingState::Fault));
    assert!(has(&state, Reason::FollowingError) && !bench.core.drive().powered);
    assert_eq!(bench.core.drive_error(), Some(DriveError::Failed { what: "cable pulled" }));
    bench.core.drive_mut().is_dead = false;
    assert_eq!(bench.tick().operating(), Some(OperatingState::Fault), "it does not come back by itself");
    bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
    assert!(bench.tick().is_ready());
    bench.engage();

    bench.core.drive_mut().is_frozen = true;
    let state = bench.ramp(0.1e-3, 0.5e-3);
    assert_eq!(state.operating(), Some(OperatingState::Fault));
    assert!(bench.core.findings(bench.now_ns).note_of(Reason::FollowingError).unwrap().value > 0.3e-3);
}

#[test]
fn power_that_takes_time_is_waited_for_tick_by_tick_and_nothing_moves_before() {
    let drive = Mock { n_busy: 6, q_m: DIRECTION.map(|d| d * 1e-3), ..Mock::default() };
    let mut bench = Bench { core: SlaveCore::new(drive, &SlaveConfig::default()), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, MS).unwrap();
    for _ in 0..5 {
        let state = bench.tick();
        assert!(state.flags & SlaveState::IS_BUSY != 0 && state.flags & SlaveState::IS_HOMED == 0);
        assert!(!bench.core.drive().powered && !follows(&bench.go(1e-3)));
    }
    bench.tick();
    assert!(bench.core.drive().powered);
    let state = bench.tick();
    assert!(state.flags & SlaveState::IS_BUSY == 0 && state.flags & SlaveState::IS_HOMED != 0, "homed after power");
    assert_eq!(state.setpoint_q_m, DIRECTION.map(|d| d * 1e-3), "the setpoint is where the encoders say");

    let drive = Mock { n_busy: u32::MAX, ..Mock::default() };
    let mut bench = Bench { core: SlaveCore::new(drive, &SlaveConfig::default()), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, MS).unwrap();
    let n_ticks = (0..6000).take_while(|_| bench.tick().operating() == Some(OperatingState::Enabled)).count();
    assert_eq!(n_ticks, 5000, "power that does not come in 5 s is a fault");
}

#[test]
fn a_state_says_that_hardware_took_the_power_until_the_fault_is_cleared_and_never_that_what_is_off_holds() {
    let stop = DriveError::HardwareStop { actuator: 3, code: 0x9000 };
    for holds in [true, false] {
        let mut bench = Bench::with(Mock { holds, ..Mock::default() });
        bench.ramp(0.0, 1e-3);
        assert_eq!(bench.tick().failed_drive(), None);
        bench.core.drive_mut().failure = Some(stop);
        for state in [bench.tick(), bench.tick()] {
            assert!(state.operating() == Some(OperatingState::Fault) && state.is_hardware_stopped(), "{state:?}");
            assert_eq!(state.failed_drive(), Some(3));
            assert_eq!(state.flags & SlaveState::OTHERS_HOLD != 0, holds, "{state:?}");
            let sentence = bench.core.failure_sentence().unwrap();
            assert_eq!((sentence.contains("hold"), sentence.contains("power was taken from all")), (holds, !holds));
        }
        bench.core.drive_mut().failure = None;
        bench.core.transition(Transition::ClearFault, bench.now_ns).unwrap();
        let state = bench.tick();
        assert!(!state.is_hardware_stopped() && state.failed_drive().is_none(), "{state:?}");
    }
}

#[test]
fn drives_that_hold_on_a_fault_keep_their_power_and_go_on_only_when_enabled_anew() {
    let mut bench = Bench::with(Mock { holds: true, ..Mock::default() });
    bench.ramp(0.0, 1e-3);
    assert_eq!(bench.tick().has_power().collect::<Vec<_>>(), [true; 3]);
    let failure = DriveError::Lost { actuator: 2, silent_ms: 15.0 };
    bench.core.drive_mut().failure = Some(failure);
    let state = bench.tick();
    assert_eq!((state.operating(), bench.core.drive_error()), (Some(OperatingState::Fault), Some(failure)));
    assert!(failure.to_string().starts_with("Drive 2 failed; the others hold"), "{failure}");
    assert!(bench.core.drive().powered && bench.core.drive().n_quick_stops == 1, "under power, told to stop once");
    assert_eq!(state.failed_drive(), Some(2), "the state names it");
    assert!(state.flags & SlaveState::OTHERS_HOLD != 0 && !state.is_hardware_stopped());
    bench.core.drive_mut().failure = None;
    let state = bench.go(1e-3);
    assert!(!follows(&state) && state.operating() == Some(OperatingState::Fault), "nothing resumes by itself");
    assert!(state.flags & SlaveState::IS_HOMED == 0, "a fault forgets the zero");
    bench.core.transition(Transition::ClearFault, bench.now_ns).unwrap();
    assert!(!bench.core.drive().powered);
    assert_eq!(bench.tick().has_power().collect::<Vec<_>>(), [false; 3]);
    bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
    assert!(bench.tick().flags & SlaveState::IS_HOMED != 0);
}

#[test]
fn an_emergency_without_a_failure_is_said_while_it_stands_and_stops_nothing() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.1e-3);
    assert!(!has(&bench.tick(), Reason::DriveEmergency));
    bench.core.drive_mut().has_emergency = true;
    let state = bench.ramp(0.1e-3, 0.2e-3);
    assert!(has(&state, Reason::DriveEmergency) && follows(&state), "{state:?}");
    bench.core.drive_mut().failure = Some(DriveError::Tripped { actuator: 2, code: 0x4210, meaning: "too hot" });
    let state = bench.tick();
    assert!(state.operating() == Some(OperatingState::Fault) && !has(&state, Reason::DriveEmergency), "{state:?}");
    (bench.core.drive_mut().failure, bench.core.drive_mut().has_emergency) = (None, false);
    bench.core.transition(Transition::ClearFault, bench.now_ns).unwrap();
    assert!(!has(&bench.tick(), Reason::DriveEmergency));
}
