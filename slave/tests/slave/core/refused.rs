//! Commands that are refused, counted and named, and those that must begin at the setpoint.

use super::*;

#[test]
fn commands_that_are_wrong_are_refused_counted_and_named() {
    type Spoil = fn(&mut Command);
    let cases: [(Spoil, Reason); 9] = [
        (|c| c.q_tilde_m[1] = f64::NAN, Reason::NotFinite),
        (|c| c.q_tilde_m[2] = f64::NEG_INFINITY, Reason::NotFinite),
        (|c| c.bend_rad[0] = f64::INFINITY, Reason::NotFinite),
        (|c| c.phase = 7, Reason::OutOfRange),
        (|c| c.reasons = 1 << 63, Reason::OutOfRange),
        (|c| c.sample_ns -= 51 * MS, Reason::CommandStale),
        (|c| c.sample_ns += 51 * MS, Reason::OutOfRange),
        (|c| c.sequence -= 1, Reason::OutOfOrder),
        (|c| c.sample_ns -= 2 * MS, Reason::OutOfOrder),
    ];
    for (spoil, reason) in cases {
        let mut bench = Bench::ready();
        let before = bench.ramp(0.0, 30e-6);
        bench.now_ns += MS;
        let mut command = bench.command(before.setpoint_q_m);
        spoil(&mut command);
        let state = bench.take(&command);
        assert!(has(&state, reason), "{reason:?}: {state:?}");
        assert!(!follows(&state));
        assert_eq!((state.n_refused, state.n_commands, state.command_sequence), (1, 7, 6), "{reason:?}");
        let state = bench.go(30e-6);
        if reason == Reason::CommandStale {
            assert!(!follows(&state) && has(&state, Reason::ChainStalled), "a stall ends the engagement: {state:?}");
        } else {
            assert!(follows(&state) && state.reasons == 0, "the next good one is followed: {state:?}");
        }
    }
}

#[test]
fn the_first_command_after_every_kind_of_hold_must_begin_at_the_setpoint() {
    let holds: [fn(&mut Bench); 4] = [
        |b| {
            for _ in 0..60 {
                b.tick();
            }
        },
        |b| {
            b.core.transition(Transition::Pause, b.now_ns).unwrap();
            b.tick();
            b.core.transition(Transition::Resume, b.now_ns).unwrap();
        },
        |b| {
            b.core.transition(Transition::Disable, b.now_ns).unwrap();
            b.core.transition(Transition::Enable, b.now_ns).unwrap();
        },
        |b| {
            let mut command = b.command(lines([0.0; 3]));
            command.phase = Phase::Holding as u32;
            b.take(&command);
        },
    ];
    for hold in holds {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 1e-3);
        hold(&mut bench);
        let at_rest = (0..20).map(|_| bench.tick()).last().unwrap();
        if !at_rest.is_engaged() {
            assert!(bench.engage().is_engaged());
        }
        let state = bench.go(1.3e-3);
        assert!(has(&state, Reason::StepLimit), "a start 0.3 mm away is refused");
        assert_eq!(state.setpoint_q_m, at_rest.setpoint_q_m);
        let state = bench.go(-at_rest.setpoint_q_m[0]);
        assert!(follows(&state), "a start at the setpoint is followed: {state:?}");
    }
}

#[test]
fn a_jump_while_following_is_refused_and_a_fast_motion_is_shortened_in_its_direction() {
    let mut bench = Bench::ready();
    let before = bench.ramp(0.0, 0.5e-3);
    let state = bench.go(1.1e-3);
    assert!(has(&state, Reason::StepLimit) && !follows(&state));
    assert_eq!(bench.core.findings(bench.now_ns).note_of(Reason::StepLimit).unwrap().limit, 0.5e-3);
    // What the slave still does is brake from 10 mm/s.
    assert!((state.setpoint_q_m[0] - before.setpoint_q_m[0]).abs() < 10.1e-6);
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.5e-3);
    let state = bench.go(0.65e-3);
    assert!(has(&state, Reason::ActuatorRateLimit) && !follows(&state), "0.12 mm behind is not following");
    let moved: Vec<f64> = (0..3).map(|i| state.setpoint_q_m[i] - DIRECTION[i] * 0.5e-3).collect();
    assert!((moved[0] + 30e-6).abs() < 1e-12, "30 mm/s for 1 ms, moved {moved:?}");
    assert!((moved[1] + 0.5 * moved[0]).abs() < 1e-12 && (moved[2] + 0.5 * moved[0]).abs() < 1e-12);
}
