//! Each finding of the probe that showed it, on the slave alone.

use super::*;

/// How far a line moved between two states.
fn moved_m(before: &SlaveState, after: &SlaveState) -> f64 {
    (0..3).map(|i| (after.setpoint_q_m[i] - before.setpoint_q_m[i]).abs()).fold(0.0, f64::max)
}

#[test]
fn a_burst_of_late_commands_is_held_and_moves_no_faster_than_time() {
    let mut bench = Bench::ready();
    let before = bench.ramp(0.0, 1e-3);
    // A stage stood still for 45 ms, and now sends what came meanwhile, a microsecond apart.
    let begun_ns = bench.now_ns;
    bench.now_ns += 45 * MS;
    let (mut last, mut last_ns) = (before, begun_ns);
    for k in 1..=45 {
        bench.now_ns += 1000;
        let mut command = bench.command(DIRECTION.map(|d| d * (1e-3 + f64::from(k) * 20e-6)));
        command.sample_ns = begun_ns + i64::from(k) * MS;
        let state = bench.take(&command);
        let allowed_m = 30e-3 * ((bench.now_ns - last_ns).min(MS) as f64 * 1e-9) + 1e-6;
        assert!(moved_m(&last, &state) <= allowed_m, "command {k}: {} m", moved_m(&last, &state));
        assert!(has(&state, Reason::CommandLate) || k > 35, "command {k} is late: {state:?}");
        (last, last_ns) = (state, bench.now_ns);
    }
    assert!(moved_m(&before, &last) < 32e-6, "{} m in all", moved_m(&before, &last));
}

#[test]
fn a_stall_ends_the_engagement_and_names_its_length() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.5e-3);
    for _ in 0..60 {
        bench.tick();
    }
    let way_m = -bench.core.report(bench.now_ns).setpoint_q_m[0];
    let state = bench.go(way_m);
    assert!(!state.is_engaged() && has(&state, Reason::NotEngaged) && has(&state, Reason::ChainStalled));
    let note = bench.core.findings(bench.now_ns).note_of(Reason::ChainStalled).unwrap();
    assert!(note.value > 50.0 && note.value < 52.0 && note.limit == 50.0, "{note:?}");
}

#[test]
fn a_load_that_is_not_measured_is_refused_where_one_is_limited() {
    let mut bench = Bench::ready();
    let before = bench.ramp(0.0, 0.5e-3);
    bench.core.drive_mut().tau_n = lines([f64::NAN, 1.0, 1.0]);
    bench.core.report(bench.now_ns);
    let state = bench.go(0.51e-3);
    assert!(has(&state, Reason::LoadUnknown) && !state.is_engaged() && !follows(&state));
    assert!(moved_m(&before, &state) < 10e-6, "it brakes");
    assert!(!bench.engage().is_engaged(), "and nobody can engage");

    let mut config = SlaveConfig::default();
    (config.limits.pull_n, config.limits.push_n) = (f64::INFINITY, f64::INFINITY);
    config.check().unwrap();
    let drive = Mock { tau_n: lines([f64::NAN; 3]), ..Mock::default() };
    let mut bench = Bench { core: SlaveCore::new(drive, &config), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
    bench.tick();
    assert!(bench.engage().is_engaged(), "without a limit nobody asks for loads");
}

#[test]
fn each_condition_that_is_missing_is_named_with_its_value_and_limit() {
    type Spoil = fn(&mut Bench, &mut Command);
    /// Late, and not so old that it is not believed at all.
    const LATE_NS: i64 = 30 * MS;
    let conditions: [(Reason, Spoil); 3] = [
        (Reason::CommandLate, |b, c| c.sample_ns = b.now_ns - LATE_NS),
        (Reason::StepLimit, |_, c| c.q_tilde_m[0] += 3e-4),
        (Reason::LoadUnknown, |b, _| b.core.drive_mut().tau_n = lines([1.0, f64::NAN, 1.0])),
    ];
    for (reason, spoil) in conditions {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 0.2e-3);
        bench.core.transition(Transition::Pause, bench.now_ns).unwrap();
        bench.core.transition(Transition::Resume, bench.now_ns).unwrap();
        // Samples never go back in time, late ones neither.
        for _ in 0..100 {
            bench.tick();
        }
        let q_m = bench.tick().setpoint_q_m;
        for reasons in [1 << Reason::OperatorAbsent as u32, 0] {
            bench.now_ns += MS;
            let mut command = bench.command(q_m);
            (command.phase, command.reasons) = (Phase::Holding as u32, reasons);
            spoil(&mut bench, &mut command);
            bench.core.report(bench.now_ns);
            bench.take(&command);
        }
        let state = bench.core.report(bench.now_ns);
        assert!(!state.is_engaged() && has(&state, reason), "{reason:?}: {state:?}");
        let note = bench.core.findings(bench.now_ns).note_of(reason).unwrap();
        let is_beyond = if reason == Reason::LoadUnknown { note.value < note.limit } else { note.value > note.limit };
        assert!(is_beyond && note.limit > 0.0, "{reason:?}: {note:?}");
        assert!(!reason.unit().is_empty(), "{reason:?}");
    }
}

#[test]
fn an_operator_who_was_never_seen_absent_moves_nothing() {
    let mut bench = Bench { core: SlaveCore::new(Mock::default(), &SlaveConfig::default()), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
    bench.tick();
    for k in 0..200 {
        let state = bench.go(f64::from(k) * 10e-6);
        assert!(!state.is_engaged() && state.setpoint_q_m == [0.0; 12], "{state:?}");
    }
}

#[test]
fn whatever_could_surprise_asks_for_a_new_engagement() {
    type Event = fn(&mut Bench);
    type Spoil = fn(&mut Command);
    let spoilt = |bench: &mut Bench, spoil: Spoil| {
        bench.now_ns += MS;
        let q_m = bench.core.report(bench.now_ns).setpoint_q_m;
        let mut command = bench.command(q_m);
        (command.setpoint_sequence, command.input_sequence) = (50, 50);
        spoil(&mut command);
        bench.take(&command);
    };
    let commands: [(Spoil, Reason); 11] = [
        (|c| c.input_sequence = 1, Reason::StageRestarted),
        (|c| c.setpoint_sequence = 1, Reason::StageRestarted),
        (|c| c.sequence = 1, Reason::StageRestarted),
        (|c| c.model_hash = 2, Reason::ModelExchanged),
        (|c| c.reasons = 1 << Reason::DeviceLost as u32, Reason::DeviceLost),
        (|c| c.reasons = 1 << Reason::HandJumped as u32, Reason::HandJumped),
        (|c| c.reasons = 1 << Reason::InputStale as u32, Reason::InputStale),
        (|c| c.reasons = 1 << Reason::SetpointStale as u32, Reason::SetpointStale),
        (|c| c.reasons = 1 << Reason::StateStale as u32, Reason::StateStale),
        (|c| c.reasons = 1 << Reason::MismatchTrip as u32, Reason::MismatchTrip),
        (|c| c.reasons = 1 << Reason::FormulaFault as u32, Reason::FormulaFault),
    ];
    for (spoil, reason) in commands {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 0.2e-3);
        spoilt(&mut bench, |_| ());
        assert!(bench.core.is_engaged());
        spoilt(&mut bench, spoil);
        let state = bench.core.report(bench.now_ns);
        assert!(!state.is_engaged() && has(&state, reason), "{reason:?}: {state:?}");
    }
    let events: [Event; 5] = [
        |b| b.core.on_new_writer(),
        |b| b.core.stop(b.now_ns),
        |b| b.core.transition(Transition::Pause, b.now_ns).unwrap(),
        |b| b.core.transition(Transition::Home, b.now_ns).unwrap(),
        |b| b.core.transition(Transition::Disable, b.now_ns).unwrap(),
    ];
    for event in events {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 0.2e-3);
        event(&mut bench);
        assert!(!bench.core.is_engaged());
    }
}

#[test]
fn a_stop_wins_over_what_was_asked_for_before_it() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.2e-3);
    let ask = |transition: Transition, sample_ns: i64| StateCommand {
        sequence: 1,
        sample_ns,
        transition: transition as u32,
        sender_pid: 1,
    };
    bench.core.stop(bench.now_ns);
    let state = bench.tick();
    assert_eq!((state.operating(), state.desired()), (Some(OperatingState::Paused), Some(OperatingState::Paused)));
    let refused = bench.core.on_state_command(&ask(Transition::Resume, bench.now_ns - 5 * MS), bench.now_ns);
    assert_eq!(refused, Err(TransitionRefused::BeforeStop { transition: Transition::Resume }));
    bench.core.on_state_command(&ask(Transition::Resume, bench.now_ns), bench.now_ns).unwrap();
    let state = bench.tick();
    assert!(state.is_ready() && !state.is_engaged() && state.n_stops == 1);
}
