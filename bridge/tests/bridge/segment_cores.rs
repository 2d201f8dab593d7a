//! Segments through the cores of `resolve` and `compensate`, on simulated segments that share no physics with the model.

use crate::allocations::allocations_of;
use crate::common::{T0_NS, TICK_NS, compensate, input, ready_state, resolve};
use krait_bridge::{
    CompensateConfig, LiveModel, ResolveConfig, SegmentCompensateCore, SegmentModel, SegmentResolveCore,
};
use krait_ipc::message::{Command, OperatorInput, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons, clock};
use krait_model::model_file::ModelFile;
use krait_model::segments::Bends;

const TWO: &str = include_str!("../../../docs/segments/two.toml");

fn model(text: &str) -> SegmentModel {
    let model = LiveModel::of(&ModelFile::parse(text).expect("a model")).expect("it can be driven");
    model.segments().expect("segments").clone()
}

fn cores(text: &str) -> (SegmentResolveCore, SegmentCompensateCore) {
    let model = model(text);
    let resolve = SegmentResolveCore::new(&model, ResolveConfig::default()).expect("defaults");
    (resolve, SegmentCompensateCore::new(&model, CompensateConfig::default()).expect("defaults"))
}

fn now_ns(k: u64) -> i64 {
    T0_NS + k as i64 * TICK_NS
}

fn state(k: u64, command: Option<&Command>) -> SlaveState {
    SlaveState {
        setpoint_q_m: command.map_or([0.0; 12], |command| command.q_tilde_m),
        setpoint_joints_rad: command.map_or([0.0; 8], |command| command.joints_rad),
        ..ready_state(k)
    }
}

/// A hand that moves to and fro and turns, m/s and rad/s.
fn hand(k: u64) -> OperatorInput {
    let t_s = k as f64 * 1e-3;
    let wave = |size: f64, period_s: f64| size * (core::f64::consts::TAU * t_s / period_s).cos();
    let tip_angular_vel_in_view_rad_per_s = [wave(-0.2, 4.0), wave(0.55, 5.0), 0.0];
    OperatorInput { tip_angular_vel_in_view_rad_per_s, ..input(k, [wave(0.012, 5.0), wave(0.01, 4.0), 0.0]) }
}

#[test]
fn steps_allocate_nothing_and_a_warm_up_step_leaves_no_trace() {
    let ((mut resolve, mut compensate), (mut resolve_b, mut compensate_b)) = (cores(TWO), cores(TWO));
    let mut n_steps = 0;
    let n = allocations_of(|| {
        let mut last: Option<Command> = None;
        for k in 1..=3000 {
            let (now_ns, state) = (now_ns(k), state(k, last.as_ref()));
            resolve.note_state(&state);
            resolve_b.note_state(&state);
            compensate.note_state(&state);
            compensate_b.note_state(&state);
            let input = hand(k);
            resolve_b.warm_up(&OperatorInput { sample_ns: now_ns - TICK_NS / 2, ..input }, now_ns);
            let (a, b) = (resolve.step(&input, now_ns).expect("good"), resolve_b.step(&input, now_ns).expect("good"));
            compensate_b.warm_up(&Setpoint { sample_ns: now_ns - TICK_NS / 2, ..a }, now_ns);
            let (c, d) = (compensate.step(&a, now_ns).expect("good"), compensate_b.step(&b, now_ns).expect("good"));
            n_steps += u32::from(a.joints_rad == b.joints_rad && c.q_tilde_m == d.q_tilde_m);
            last = Some(c);
        }
    });
    assert_eq!((n, n_steps), (0, 3000));
}

#[test]
fn the_tip_goes_as_the_hand_does_and_messages_say_that_they_are_of_segments() {
    let (mut resolve, mut compensate) = cores(TWO);
    let (mut last, mut tips) = (None::<(Setpoint, Command)>, Vec::new());
    for k in 1..=1000 {
        let state = state(k, last.as_ref().map(|(_, command)| command));
        resolve.note_state(&state);
        compensate.note_state(&state);
        let hand = OperatorInput { tip_angular_vel_in_view_rad_per_s: [0.0, 0.3, 0.0], ..input(k, [0.008, 0.0, 0.0]) };
        let setpoint = resolve.step(&hand, now_ns(k)).expect("a good input");
        let command = compensate.step(&setpoint, now_ns(k)).expect("a good setpoint");
        tips.push(setpoint.tip_pos_in_base_m[0]);
        last = Some((setpoint, command));
    }
    let (setpoint, command) = last.expect("steps");
    assert_eq!((setpoint.n_segments(), setpoint.n_joints, command.n_actuators), (2, 4, 6));
    assert!(setpoint.bend_rad[0].is_nan() && command.q_tilde_m[6..].iter().all(|q| *q == 0.0));
    // 50 ms go into getting up to speed at 40 rad/s2.
    assert!((0.0076..=0.008).contains(&tips[999]), "{} m in a second at 8 mm/s", tips[999]);
    let chain = model(TWO);
    let bends = Bends::from_column_slice(&setpoint.joints_rad[..6]);
    let turned = chain.chain().machine().base_from_tip(&bends).rotation.scaled_axis();
    assert!((0.28..=0.3).contains(&turned.y) && turned.x.abs() < 1e-3, "{turned} rad in a second at 0.3 rad/s");
    let moved = |k: usize| command.q_tilde_m[k] - command.q_uncompensated_m[k];
    assert!((0..6).any(|k| moved(k).abs() > 1e-4), "effects are compensated");
}

#[test]
fn what_no_loads_within_the_bounds_hold_is_not_gone_to_and_every_way_back_is_free() {
    let narrow = TWO.replace("high_n = 40.0", "high_n = 8.0").replace("low_n = -60.0", "low_n = -8.0");
    let (mut resolve, mut compensate) = cores(&narrow);
    let mut last = None::<(Setpoint, Command)>;
    let mut step = |k: u64, velocity: f64| {
        let state = state(k, last.as_ref().map(|(_, command)| command));
        resolve.note_state(&state);
        compensate.note_state(&state);
        let setpoint = resolve.step(&input(k, [velocity, 0.0, 0.0]), now_ns(k)).expect("a good input");
        let command = compensate.step(&setpoint, now_ns(k)).expect("a good setpoint");
        last = Some((setpoint, command));
        (setpoint, command)
    };
    let (mut border, mut command) = step(1, 0.01);
    for k in 2..=3000 {
        (border, command) = step(k, 0.01);
    }
    assert!(Reasons::from_bits(border.reasons).contains(Reason::ForceLimit), "{border:?}");
    assert!(border.tip_pos_in_base_m[0] < 0.02, "it stands before 30 mm: {:?}", border.tip_pos_in_base_m);
    assert!(command.q_tilde_m.iter().all(|q| q.is_finite()));
    let (mut back, _) = step(3001, -0.01);
    for k in 3002..=3300 {
        (back, command) = step(k, -0.01);
    }
    assert!(back.tip_pos_in_base_m[0] < border.tip_pos_in_base_m[0] - 2e-3, "{:?}", back.tip_pos_in_base_m);
    assert!(!Reasons::from_bits(command.reasons).contains(Reason::ForceLimit));
}

#[test]
fn foreign_setpoints_and_bad_numbers_are_refused() {
    let (mut resolve, mut compensate) = cores(TWO);
    let mut bad = input(1, [0.0; 3]);
    bad.tip_angular_vel_in_view_rad_per_s[1] = f64::NAN;
    assert_eq!(resolve.step(&bad, now_ns(1)).expect_err("NaN").reason, Reason::NotFinite);
    let setpoint = resolve.step(&input(1, [0.0; 3]), now_ns(1)).expect("good");
    let mut refused = |edit: fn(&mut Setpoint)| {
        let mut own = setpoint;
        edit(&mut own);
        compensate.step(&own, now_ns(1)).expect_err("refused").reason
    };
    assert_eq!(refused(|own| own.n_joints = 2), Reason::OutOfRange);
    assert_eq!(refused(|own| own.joints_rad[2] = 9.0), Reason::OutOfRange);
    assert_eq!(refused(|own| own.joints_rad[3] = f64::INFINITY), Reason::NotFinite);
    assert_eq!(refused(|own| own.model_hash ^= 1), Reason::OtherModel);
}

/// Time of 2000 steps of both stages of a snake and of two segments in turn, the best of each.
#[test]
fn a_step_of_two_segments_on_six_lines_costs_a_small_multiple_of_the_snake_s() {
    let timed = |step: &mut dyn FnMut(&OperatorInput, &SlaveState, i64) -> Command| {
        let begun_ns = clock::monotonic_ns();
        for k in 1..=2000 {
            core::hint::black_box(step(&hand(k), &ready_state(k), now_ns(k)));
        }
        clock::monotonic_ns() - begun_ns
    };
    let (mut snake_ns, mut two_ns) = (i64::MAX, i64::MAX);
    for _ in 0..15 {
        let (mut a, mut b) = (resolve(ResolveConfig::default()), compensate(CompensateConfig::default()));
        snake_ns = snake_ns.min(timed(&mut |hand, state, now_ns| {
            a.note_state(state);
            b.note_state(state);
            b.step(&a.step(hand, now_ns).expect("good"), now_ns).expect("good")
        }));
        let (mut a, mut b) = cores(TWO);
        two_ns = two_ns.min(timed(&mut |hand, state, now_ns| {
            a.note_state(state);
            b.note_state(state);
            b.step(&a.step(hand, now_ns).expect("good"), now_ns).expect("good")
        }));
    }
    let ratio = two_ns as f64 / snake_ns as f64;
    println!("both steps: a snake {} ns, two segments {} ns, {ratio:.2} times", snake_ns / 2000, two_ns / 2000);
    assert!(ratio < MOST_TIMES, "{ratio}");
}

/// 3.0 were measured in a release build (docs/bench/2026-11-25-segments.md).
const MOST_TIMES: f64 = 6.0;
