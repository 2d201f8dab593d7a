//! How the slave stops by itself when commands do.

use super::*;

#[test]
fn when_commands_stop_the_slave_brakes_steadily_rests_within_its_time_and_says_stale() {
    let mut bench = Bench::ready();
    let mut before = bench.ramp(0.0, 1e-3);
    let mut speed = 10e-3;
    let mut rested_after = 0;
    for ms in 1..=60 {
        let state = bench.tick();
        let new_speed = (state.setpoint_q_m[0] - before.setpoint_q_m[0]).abs() / 1e-3;
        // The first tick comes within the grace of a late command and moves nothing; the next one makes up for it.
        if ms > 3 {
            assert!(new_speed <= speed + 1e-9, "{ms} ms: it never speeds up");
            assert!(speed - new_speed <= 1.05e-3, "{ms} ms: at most 1 m/s2, {speed} to {new_speed}");
        }
        if new_speed > 0.0 {
            rested_after = ms;
        }
        assert_eq!(has(&state, Reason::CommandStale), ms > 50, "{ms} ms");
        (speed, before) = (new_speed, state);
    }
    assert!(rested_after > 5 && rested_after < 15, "rest after {rested_after} ms");
    let state = bench.go(-before.setpoint_q_m[0]);
    assert!(!follows(&state) && has(&state, Reason::ChainStalled), "not without the operator");
    bench.engage();
    let state = bench.go(-before.setpoint_q_m[0]);
    assert!(follows(&state) && state.reasons == 0, "it resumes from the setpoint: {state:?}");
}

#[test]
fn commands_that_are_all_refused_count_as_none_and_end_in_the_same_rest() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 1e-3);
    let mut states = Vec::new();
    for _ in 0..60 {
        states.push(bench.go(f64::NAN));
    }
    let last = states.last().unwrap();
    assert!(has(last, Reason::CommandStale) && has(last, Reason::NotFinite));
    assert!(states.windows(2).skip(15).all(|pair| pair[0].setpoint_q_m == pair[1].setpoint_q_m), "at rest");
    assert!(!bench.core.is_following());
}
