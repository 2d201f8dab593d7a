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

#[test]
fn an_actuators_own_limits_of_load_and_speed_count_for_it_alone_and_slow_all_down_by_one_factor() {
    let actuator = |k: u32| {
        let own = |value: f64| (k == 2).then_some(value);
        ActuatorConfig { id: k, load_n: own(8.0), rate_m_per_s: own(5e-3), ..ActuatorConfig::default() }
    };
    let drive =
        DriveConfig { kind: DriveKind::Sts3215, actuator: (1..=3).map(actuator).collect(), ..Default::default() };
    let config = SlaveConfig { drive, ..SlaveConfig::default() };
    let go = |bench: &mut Bench, q_m: [f64; 3]| {
        bench.now_ns += MS;
        let command = bench.command(lines(q_m));
        bench.take(&command)
    };
    // 20 mm/s of the first and 10 mm/s of the second, which may do 5; behind by 0.1 mm it is not called following.
    let mut bench = Bench::of(Mock::default(), &config);
    for k in 1..=8 {
        let (before, way_m) = (bench.core.report(bench.now_ns).setpoint_q_m, f64::from(k) * 10e-6);
        let state = go(&mut bench, [2.0 * way_m, way_m, -way_m]);
        assert!(follows(&state) && state.setpoint_q_m[1] - before[1] <= 5e-6 + 1e-12, "{state:?}");
        assert!((state.setpoint_q_m[0] - 2.0 * state.setpoint_q_m[1]).abs() < 1e-12, "the direction stays: {state:?}");
        assert!(k < 3 || has(&state, Reason::ActuatorRateLimit), "{state:?}");
    }
    for (load_n, is_limited) in [([-50.0, -7.0, 0.0], false), ([0.0, -9.0, 0.0], true), ([0.0, 9.0, 0.0], false)] {
        let mut bench = Bench::of(Mock::default(), &config);
        bench.core.drive_mut().tau_n[..3].copy_from_slice(&load_n);
        bench.tick();
        let at = bench.core.report(bench.now_ns).setpoint_q_m;
        let state = go(&mut bench, [at[0] - 2e-6, at[1] - 2e-6, at[2] + 2e-6]);
        assert_eq!(has(&state, Reason::ForceLimit), is_limited, "{load_n:?}: {state:?}");
        assert_eq!(state.setpoint_q_m == at, is_limited, "one factor for all: {load_n:?}: {state:?}");
    }
}
