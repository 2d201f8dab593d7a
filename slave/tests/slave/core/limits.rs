//! Stroke, load, and one gate for all actuators.

use super::*;

#[test]
fn twelve_actuators_of_eight_joints_pass_the_same_gate_and_the_twelfth_counts_like_the_first() {
    let mut bench = Bench::with(Mock { n_more: 9, ..Mock::default() });
    let joints_rad: [f64; 8] = core::array::from_fn(|k| 0.1 * k as f64);
    let all = |way_m: f64| core::array::from_fn(|k| way_m * (1.0 - k as f64 / 24.0));
    let go = |bench: &mut Bench, way_m: f64, change: Change| {
        bench.now_ns += MS;
        let mut command = bench.command(all(way_m));
        (command.joints_rad, command.n_joints, command.bend_rad) = (joints_rad, 8, [f64::NAN; 2]);
        change(&mut command);
        bench.take(&command)
    };
    let state = (1..=50).map(|k| go(&mut bench, f64::from(k) * 10e-6, |_| {})).last().unwrap();
    assert!(follows(&state) && state.setpoint_q_m == all(0.5e-3), "{state:?}");
    assert_eq!((state.n_actuators, state.n_joints, state.setpoint_joints_rad), (12, 8, joints_rad));
    let state = go(&mut bench, 0.6e-3, |_| {});
    let moved = |k: usize| state.setpoint_q_m[k] - all(0.5e-3)[k];
    assert!(
        (moved(0) - 30e-6).abs() < 1e-12 && (moved(11) / moved(0) - 13.0 / 24.0).abs() < 1e-9,
        "one factor for all"
    );
    let spoilt: [(Change, Reason); 5] = [
        (|c| c.q_tilde_m[11] = f64::NAN, Reason::NotFinite),
        (|c| c.joints_rad[7] = f64::INFINITY, Reason::NotFinite),
        (|c| c.n_actuators = 3, Reason::OutOfRange),
        (|c| c.n_actuators = 0, Reason::OutOfRange),
        (|c| c.n_joints = 9, Reason::OutOfRange),
    ];
    for (spoil, reason) in spoilt {
        let before = bench.core.report(bench.now_ns).n_refused;
        let state = go(&mut bench, 0.5e-3, spoil);
        assert!(has(&state, reason) && state.n_refused == before + 1, "{reason:?}: {state:?}");
    }
    bench.core.drive_mut().tau_n[11] = -61.0;
    bench.now_ns += 100 * MS;
    bench.tick();
    bench.engage();
    let at = bench.core.report(bench.now_ns).setpoint_q_m;
    bench.now_ns += MS;
    let mut command = bench.command(at.map(|q| q - 10e-6));
    (command.joints_rad, command.n_joints) = (joints_rad, 8);
    let state = bench.take(&command);
    assert!(has(&state, Reason::ForceLimit), "the twelfth actuator pulls too hard: {state:?}");
}

#[test]
fn the_end_of_the_stroke_stops_all_lines_and_the_way_back_is_free() {
    let mut bench = Bench::ready();
    let state = bench.ramp(0.0, 5.6e-3);
    assert!(has(&state, Reason::StrokeLimit));
    let expected = DIRECTION.map(|d| d * 5.5e-3);
    for (found, expected) in state.setpoint_q_m.into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{:?}", state.setpoint_q_m);
    }
    let state = bench.go(5.49e-3);
    assert!(follows(&state) && state.reasons == 0);
}

#[test]
fn a_load_beyond_its_limit_forbids_more_of_it_and_allows_less() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 1e-3);
    bench.core.drive_mut().tau_n = lines([-61.0, 20.0, 20.0]);
    bench.tick();
    bench.go(1e-3);
    let before = bench.go(1e-3);
    let state = bench.go(1.01e-3);
    assert!(has(&state, Reason::ForceLimit) && state.setpoint_q_m == before.setpoint_q_m);
    let state = bench.go(0.99e-3);
    assert!(follows(&state) && !has(&state, Reason::ForceLimit));
}
