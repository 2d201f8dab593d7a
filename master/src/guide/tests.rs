//! A guide against a setpoint that does what it is asked for, as `resolve` does, with a snake's limits or without.

use super::*;
use krait_ipc::message::{HopStamps, MAX_JOINTS, N_LINES, OperatingState, lines};

const MS: i64 = 1_000_000;

fn plan() -> GuidePlan {
    let leg = |pose, x: f64| GuideLeg { pose, tip_pos_in_base_m: vec![[0.5 * x, 0.0, 0.026], [x, 0.0, 0.026]] };
    GuidePlan {
        view_roll_rad: 0.3,
        speed_m_per_s: 0.01,
        rest_m: 5e-6,
        settle_s: 0.05,
        measure_s: 0.1,
        patience_s: 1.0,
        awaits_orders: false,
        leg: vec![leg(1, 0.004), leg(0, -0.002), leg(2, 0.001), leg(0, 0.0)],
    }
}

fn setpoint(now_ns: i64, tip_pos_in_base_m: [f64; 3]) -> Setpoint {
    Setpoint {
        sequence: 1,
        sample_ns: now_ns,
        input_sequence: 1,
        state_sequence: 1,
        tip_pos_in_base_m,
        motion_scale: 1.0,
        phase: Phase::Following as u32,
        ..Setpoint::default()
    }
}

fn state(now_ns: i64, q_m: f64) -> SlaveState {
    SlaveState {
        sequence: 1,
        sample_ns: now_ns,
        stamps: HopStamps::default(),
        command_sequence: 1,
        operating_state: OperatingState::Enabled as u32,
        flags: SlaveState::IS_HOMED | SlaveState::ENGAGED,
        desired_state: OperatingState::Enabled as u32,
        n_stops: 0,
        state_command_sequence: 0,
        setpoint_ns: 0,
        setpoint_q_m: lines([0.0; N_LINES]),
        setpoint_bend_rad: [0.0; 2],
        setpoint_joints_rad: [0.0; MAX_JOINTS],
        measured_q_m: lines([q_m; N_LINES]),
        measured_tau_n: lines([0.0; N_LINES]),
        n_actuators: 0,
        n_joints: 0,
        reasons: Reasons::NONE.with(Reason::NotEngaged).bits(),
        n_commands: 0,
        n_refused: 0,
    }
}

/// A setpoint that goes as fast as it is told, and the marks that were set; `spoil` may change what the guide sees.
fn marks(plan: GuidePlan, spoil: impl Fn(i64, &mut Setpoint, &mut SlaveState)) -> Vec<(i64, f64, ExperimentMark)> {
    let (roll, mut guide) = (plan.view_roll_rad, Guide::new(plan));
    let (mut tip, mut marks) = ([0.0, 0.0, 0.026], Vec::new());
    for ms in 1..60_000 {
        let now_ns = ms * MS;
        let (mut setpoint, mut state) = (setpoint(now_ns, tip), state(now_ns, tip[0]));
        spoil(ms, &mut setpoint, &mut state);
        let step = guide.step(now_ns, Some(&setpoint), Some(&state));
        marks.extend(step.mark.map(|mark| (ms, tip[0], mark)));
        let Some(asked) = step.sample else { return marks };
        assert!(asked.is_present || ms < 150 || marks.iter().any(|(.., m)| matches!(m, ExperimentMark::Failed(_))));
        let [x, y, z] = asked.tip_vel_in_view_m_per_s;
        let (sin, cos) = roll.sin_cos();
        let in_base = [cos * x - sin * y, sin * x + cos * y, z];
        assert!(length(in_base) <= 0.021, "twice the speed at most: {in_base:?}");
        let is_seen = setpoint.tip_pos_in_base_m == tip;
        tip = core::array::from_fn(|k| tip[k] + in_base[k] * 1e-3);
        assert!(!is_seen || tip[0] <= 0.004 + ARRIVED_M, "past the furthest stop by {} m", tip[0] - 0.004);
    }
    panic!("it never ends: {marks:?}");
}

#[test]
fn every_pose_is_reached_without_overshoot_rests_and_is_marked_in_its_turn() {
    let found = marks(plan(), |_, _, _| {});
    let kinds: Vec<&ExperimentMark> = found.iter().map(|(.., mark)| mark).collect();
    let at_rest = |pose| ExperimentMark::AtRest { pose, for_ns: 100 * MS };
    assert_eq!(kinds, [&ExperimentMark::Begins, &at_rest(1), &at_rest(2), &ExperimentMark::Ends]);
    for ((_, x, _), wanted) in found.iter().zip([0.0, 0.004, 0.001, 0.0]) {
        assert!((x - wanted).abs() <= ARRIVED_M, "{x} instead of {wanted}");
    }
}

#[test]
fn actuators_that_never_rest_and_a_slave_that_does_not_follow_are_named_and_bounded() {
    let sentence = |found: &[(i64, f64, ExperimentMark)]| match found.last() {
        Some((_, _, ExperimentMark::Failed(sentence))) => sentence.clone(),
        other => panic!("{other:?}"),
    };
    let creeping = marks(plan(), |ms, _, state| state.measured_q_m = lines([ms as f64 * 1e-6; N_LINES]));
    assert!(sentence(&creeping).contains("pose 1") && sentence(&creeping).contains("rest"), "{creeping:?}");
    let lost = marks(plan(), |ms, _, state| {
        if ms > 400 {
            state.flags = SlaveState::IS_HOMED;
        }
    });
    assert!(sentence(&lost).contains("did not follow for 1 s"), "{lost:?}");
    assert!((1400..1500).contains(&lost[1].0), "{lost:?}");
    let stuck = marks(plan(), |_, setpoint, _| setpoint.tip_pos_in_base_m = [0.0, 0.0, 0.026]);
    assert!(sentence(&stuck).contains("did not arrive"), "{stuck:?}");
}

#[test]
fn a_short_loss_of_hold_costs_a_measurement_nothing_but_time() {
    let found = marks(plan(), |ms, setpoint, _| {
        // In the middle of the first pose's rest.
        if (700..800).contains(&ms) {
            setpoint.phase = Phase::Holding as u32;
        }
    });
    let whole = marks(plan(), |_, _, _| {});
    let kinds = |found: &[(i64, f64, ExperimentMark)]| found.iter().map(|(.., m)| m.clone()).collect::<Vec<_>>();
    assert_eq!(kinds(&found), kinds(&whole));
    assert!(found[1].0 > whole[1].0, "{found:?}, {whole:?}");
}

#[test]
fn a_guide_that_awaits_orders_goes_where_it_is_told_one_after_the_other_and_ends_when_it_is_told() {
    let mut guide = Guide::new(GuidePlan { awaits_orders: true, leg: Vec::new(), ..plan() });
    let go = |number, x| GuideOrder::Go { number, tip_pos_in_base_m: [x, 0.0, 0.026] };
    // When each is told, ms; a number that was had before is not gone to again, nor is anything without an order.
    let orders = [(300, go(1, 0.003)), (1500, go(1, 0.009)), (4000, go(2, -0.001)), (7000, GuideOrder::End)];
    let (mut tip, mut marks) = ([0.0, 0.0, 0.026], Vec::new());
    for ms in 1..9000 {
        let now_ns = ms * MS;
        orders.iter().filter(|(at, _)| *at == ms).for_each(|(_, order)| guide.order(*order));
        let step = guide.step(now_ns, Some(&setpoint(now_ns, tip)), Some(&state(now_ns, tip[0])));
        marks.extend(step.mark.map(|mark| (ms, tip[0], mark)));
        let Some(asked) = step.sample else { break };
        let (sin, cos) = 0.3_f64.sin_cos();
        let [x, y, z] = asked.tip_vel_in_view_m_per_s;
        assert!(length([x, y, z]) < 1e-12 || !(150..300).contains(&ms), "it moves unasked at {ms} ms");
        let in_base = [cos * x - sin * y, sin * x + cos * y, z];
        tip = core::array::from_fn(|k| tip[k] + in_base[k] * 1e-3);
    }
    let at_rest = |pose| ExperimentMark::AtRest { pose, for_ns: 100 * MS };
    let kinds: Vec<&ExperimentMark> = marks.iter().map(|(.., mark)| mark).collect();
    assert_eq!(kinds, [&ExperimentMark::Begins, &at_rest(1), &at_rest(2), &ExperimentMark::Ends]);
    for (found, wanted) in marks[1..].iter().zip([0.003, -0.001, -0.001]) {
        assert!((found.1 - wanted).abs() <= ARRIVED_M, "{found:?}");
    }
    assert!(marks[1].0 > 300 && marks[2].0 > 4000 && marks[3].0 == 7000, "{marks:?}");
}

#[test]
fn a_plan_of_an_experiment_hears_no_orders() {
    let mut guide = Guide::new(plan());
    guide.order(GuideOrder::Go { number: 9, tip_pos_in_base_m: [0.2, 0.0, 0.0] });
    assert_eq!(guide.plan, plan());
}
