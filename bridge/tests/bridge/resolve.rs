//! `resolve`: what moves the setpoint, what holds it, and that it never jumps.

use crate::common::{T0_NS, TICK_NS, input, length, ready_state, resolve, waiting_state};
use krait_bridge::{ResolveConfig, ResolveCore};
use krait_ipc::message::{DeviceState, OperatingState, OperatorInput, Phase, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};

/// One step with a fresh, ready slave, taken the moment it was sent.
fn follow(core: &mut ResolveCore, input: OperatorInput) -> Setpoint {
    core.note_state(&ready_state(input.sequence));
    core.step(&input, input.sample_ns).expect("a good sample")
}

fn reasons(setpoint: &Setpoint) -> Vec<Reason> {
    Reasons::from_bits(setpoint.reasons).iter().collect()
}

#[test]
fn the_tip_goes_where_the_hand_points_in_the_view_frame() {
    let mut core = resolve(ResolveConfig::default());
    let last = (1..=400).map(|n| follow(&mut core, input(n, [0.02, 0.01, 0.0]))).last().expect("steps");
    assert_eq!(last.phase(), Some(Phase::Following));
    let [x, y, z] = last.tip_pos_in_base_m;
    // 8 mm and 4 mm, less what getting up to speed took: 20 mm/s at 40 rad/s^2 on half of L is some 38 ms.
    assert!((0.0074..0.008).contains(&x) && (0.0037..0.004).contains(&y) && z < 0.026, "tip at {x} {y} {z}");
    let ratio = y / x;
    assert!((ratio - 0.5).abs() < 1e-3, "direction is kept, {ratio}");
}

#[test]
fn with_axial_weight_the_tip_gives_way_sideways_to_stay_at_its_height() {
    let mut core = resolve(ResolveConfig { axial_weight: 1.0, ..ResolveConfig::default() });
    let last = (1..=400).map(|n| follow(&mut core, input(n, [0.02, 0.0, 0.0]))).last().expect("steps");
    let mut plain = resolve(ResolveConfig::default());
    let sideways = (1..=400).map(|n| follow(&mut plain, input(n, [0.02, 0.0, 0.0]))).last().expect("steps");
    let lost_m = sideways.tip_pos_in_base_m[0] - last.tip_pos_in_base_m[0];
    let kept_m = last.tip_pos_in_base_m[2] - sideways.tip_pos_in_base_m[2];
    assert!(lost_m > 1e-4 && kept_m > 1e-4, "{lost_m} {kept_m}");
}

#[test]
fn the_view_may_be_rolled_about_the_straight_axis() {
    let roll = ResolveConfig { view_roll_rad: core::f64::consts::FRAC_PI_2, ..ResolveConfig::default() };
    let mut core = resolve(roll);
    let last = (1..=300).map(|n| follow(&mut core, input(n, [0.02, 0.0, 0.0]))).last().expect("steps");
    let [x, y, _] = last.tip_pos_in_base_m;
    assert!(x.abs() < 1e-6 && y > 0.005, "right in the view is +y in the base: {x} {y}");
}

#[test]
fn the_setpoint_passes_the_straight_pose_without_a_step_in_speed() {
    let mut core = resolve(ResolveConfig::default());
    let mut before: Option<Setpoint> = None;
    let mut straightest = f64::MAX;
    for n in 1..=1200 {
        let velocity = if n < 300 { -0.02 } else { 0.02 };
        let now = follow(&mut core, input(n, [velocity, 0.0, 0.0]));
        if n > 350 {
            straightest = straightest.min(length(now.bend_rad));
        }
        if let Some(before) = before {
            let change = (now.bend_vel_rad_per_s[0] - before.bend_vel_rad_per_s[0])
                .hypot(now.bend_vel_rad_per_s[1] - before.bend_vel_rad_per_s[1]);
            assert!(change <= 40.0 * 1e-3 + 1e-12, "sample {n}: the rate changed by {change} rad/s in a millisecond");
            assert!(now.q_tilde_vel_m_per_s.iter().all(|v| v.is_finite()));
        }
        before = Some(now);
    }
    assert!(straightest < 2e-3, "the path went through the straight pose: {straightest}");
}

#[test]
fn each_reason_to_hold_holds_alone_and_is_named() {
    type Spoil = fn(&mut OperatorInput, &mut SlaveState, &mut i64);
    let cases: [(Reason, Spoil); 9] = [
        (Reason::OperatorAbsent, |i, _, _| i.flags = 0),
        (Reason::Clutched, |i, _, _| i.flags |= OperatorInput::CLUTCH),
        (Reason::DeviceLost, |i, _, _| i.device_state = DeviceState::Lost as u32),
        (Reason::InputEnded, |i, _, _| i.device_state = DeviceState::Ended as u32),
        (Reason::HandJumped, |i, _, _| i.flags |= OperatorInput::HAND_JUMPED),
        (Reason::InputStale, |i, _, begun_ns| *begun_ns = i.sample_ns + 51 * TICK_NS),
        (Reason::StateStale, |i, s, _| s.sample_ns = i.sample_ns - 101 * TICK_NS),
        (Reason::SlaveNotHomed, |_, s, _| s.flags &= !SlaveState::IS_HOMED),
        (Reason::SlaveNotEnabled, |_, s, _| s.operating_state = OperatingState::Paused as u32),
    ];
    for (reason, spoil) in cases {
        let mut core = resolve(ResolveConfig::default());
        let (mut spoilt, mut state) = (input(1, [0.02, 0.0, 0.0]), ready_state(1));
        let mut begun_ns = spoilt.sample_ns;
        spoil(&mut spoilt, &mut state, &mut begun_ns);
        core.note_state(&state);
        let setpoint = core.step(&spoilt, begun_ns).expect("a good sample");
        assert_eq!((reasons(&setpoint), setpoint.phase()), (vec![reason], Some(Phase::Holding)));
        assert_eq!(setpoint.bend_vel_rad_per_s, [0.0; 2], "{reason:?}");
    }
    let mut core = resolve(ResolveConfig::default());
    let setpoint = core.step(&input(1, [0.02, 0.0, 0.0]), T0_NS).expect("a good sample");
    assert_eq!(reasons(&setpoint), [Reason::StateStale], "no slave has spoken yet");
}

#[test]
fn the_bend_never_passes_its_limit_and_the_plane_can_still_turn() {
    let config = ResolveConfig { max_bend_rad: 0.6, ..ResolveConfig::default() };
    let mut core = resolve(config);
    for n in 1..=2000 {
        let setpoint = follow(&mut core, input(n, [0.03, 0.0, 0.0]));
        assert!(length(setpoint.bend_rad) <= 0.6 + 1e-12);
    }
    let at_limit = follow(&mut core, input(2001, [0.03, 0.0, 0.0]));
    assert!(reasons(&at_limit).contains(&Reason::BendLimit) && length(at_limit.bend_rad) > 0.59);
    let turned = (2002..=2400).map(|n| follow(&mut core, input(n, [0.01, 0.02, 0.0]))).last().expect("steps");
    let plane_rad = turned.tip_pos_in_base_m[1].atan2(turned.tip_pos_in_base_m[0]);
    assert!(plane_rad > 0.5 && length(turned.bend_rad) <= 0.6 + 1e-12, "turned by {plane_rad}");
}

#[test]
fn a_hand_that_is_too_fast_is_slowed_by_one_common_scale() {
    let config = ResolveConfig { max_bend_vel_rad_per_s: 0.5, ..ResolveConfig::default() };
    let mut core = resolve(config);
    let last = (1..=100).map(|n| follow(&mut core, input(n, [0.04, 0.03, 0.0]))).last().expect("steps");
    assert!(reasons(&last).contains(&Reason::BendRateLimit) && last.motion_scale < 0.3);
    assert!((length(last.bend_vel_rad_per_s) - 0.5).abs() < 1e-9);
    let ratio = last.tip_pos_in_base_m[1] / last.tip_pos_in_base_m[0];
    assert!((ratio - 0.75).abs() < 1e-3, "direction is kept, {ratio}");
}

#[test]
fn after_a_restart_the_first_setpoint_is_the_slaves_own() {
    let mut core = resolve(ResolveConfig::default());
    let bend_rad = [0.3, -0.4];
    core.note_state(&waiting_state(1, [0.0; 3], bend_rad));
    let first = core.step(&input(1, [0.0; 3]), T0_NS + TICK_NS).expect("a good sample");
    assert_eq!(first.bend_rad, bend_rad);
}

#[test]
fn numbers_that_are_not_finite_samples_out_of_order_and_absurd_speeds_are_refused() {
    let mut core = resolve(ResolveConfig::default());
    let before = follow(&mut core, input(5, [0.0; 3]));
    let refused =
        |core: &mut ResolveCore, input: OperatorInput| core.step(&input, input.sample_ns).expect_err("bad").reason;
    assert_eq!(refused(&mut core, input(6, [f64::NAN, 0.0, 0.0])), Reason::NotFinite);
    assert_eq!(refused(&mut core, input(6, [0.0, f64::INFINITY, 0.0])), Reason::NotFinite);
    assert_eq!(refused(&mut core, input(5, [0.0; 3])), Reason::OutOfOrder);
    assert_eq!(refused(&mut core, input(6, [0.0, 5.0, 0.0])), Reason::OutOfRange);
    let after = follow(&mut core, input(6, [0.0; 3]));
    assert_eq!((after.sequence, after.bend_rad), (before.sequence + 1, before.bend_rad), "a refusal leaves no trace");
}

#[test]
fn a_gap_in_the_input_never_becomes_a_jump() {
    let mut core = resolve(ResolveConfig::default());
    for n in 1..=100 {
        follow(&mut core, input(n, [0.02, 0.0, 0.0]));
    }
    let before = follow(&mut core, input(101, [0.02, 0.0, 0.0]));
    let after = follow(&mut core, input(5101, [0.02, 0.0, 0.0]));
    let step = length([after.bend_rad[0] - before.bend_rad[0], after.bend_rad[1] - before.bend_rad[1]]);
    assert!(step < 0.02, "five seconds without input moved the setpoint by {step} rad");
}
