//! `compensate`: what the actuators are told, that it never jumps, and that the model changes smoothly.

use crate::common::{TICK_NS, chain, compensate, ready_state, setpoint, setpoint_of, update_of, waiting_state};
use krait_bridge::{CompensateConfig, CompensateCore};
use krait_ipc::message::{Command, LearntValue, ModelUpdate, Phase, Setpoint};
use krait_ipc::{Reason, Reasons};
use krait_model::{MachineParameters, Snake};

/// `compensate` with a built-in model, and its setpoints.
fn with_model(name: &str, config: CompensateConfig) -> (CompensateCore, impl Fn(u64, [f64; 2]) -> Setpoint) {
    let chain = chain(name);
    let core = CompensateCore::new(&chain, config).expect("defaults");
    (core, move |sequence, bend_rad| setpoint_of(&chain, sequence, bend_rad))
}

fn off() -> (CompensateCore, impl Fn(u64, [f64; 2]) -> Setpoint) {
    with_model("off", CompensateConfig::default())
}

fn follow(core: &mut CompensateCore, setpoint: Setpoint) -> Command {
    core.note_state(&ready_state(setpoint.sequence));
    core.step(&setpoint, setpoint.sample_ns).expect("a good sample")
}

fn has(command: &Command, reason: Reason) -> bool {
    Reasons::from_bits(command.reasons).contains(reason)
}

fn update(sequence: u64, eta: f64, lambda_m: f64) -> ModelUpdate {
    update_of(&chain("estimated"), sequence, &[eta, lambda_m])
}

fn largest_step(a: &Command, b: &Command) -> f64 {
    (0..3).map(|line| (a.q_tilde_m[line] - b.q_tilde_m[line]).abs()).fold(0.0, f64::max)
}

#[test]
fn off_tells_the_actuators_what_an_inextensible_snake_would_need() {
    let (mut core, setpoint) = off();
    let command = follow(&mut core, setpoint(1, [0.5, 0.2]));
    assert_eq!(command.q_tilde_m, command.q_uncompensated_m);
    let snake = Snake::new(&MachineParameters::default()).expect("defaults");
    let q_m: [f64; 3] = snake.q([0.5, 0.2].into()).into();
    assert_eq!((command.q_tilde_m, command.bend_rad), (krait_ipc::message::lines(q_m), [0.5, 0.2]));
}

#[test]
fn naive_adds_nearly_as_much_as_the_snake_needs_itself() {
    let (mut core, setpoint) = with_model("naive", CompensateConfig::default());
    let command =
        (1..=400).map(|n| follow(&mut core, setpoint(n, [f64::from(n as u32) * 2e-3, 0.0]))).last().expect("steps");
    let added =
        (command.q_tilde_m[0] - command.q_tilde_m[1]) / (command.q_uncompensated_m[0] - command.q_uncompensated_m[1]);
    assert!((added - 1.86).abs() < 0.02, "q~/q differential {added}: eps/q is 0.86 for Table I");
}

#[test]
fn while_the_slave_does_not_follow_the_command_equals_its_setpoint() {
    for mode in ["off", "naive", "estimated"] {
        let (mut core, setpoint) = with_model(mode, CompensateConfig::default());
        let own_m = [0.4e-3, -0.3e-3, 0.1e-3];
        for n in 1..=5 {
            core.note_state(&waiting_state(n, own_m, [0.2, 0.1]));
            let command = core.step(&setpoint(n, [0.2, 0.1]), setpoint(n, [0.0; 2]).sample_ns).expect("good");
            let error = (0..3).map(|i| (command.q_tilde_m[i] - own_m[i]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-15, "{mode:?}: {error}");
        }
        // From here on the slave follows: the difference is let go slowly, and entirely.
        let mut before: Option<Command> = None;
        for n in 6..=2000 {
            let now = follow(&mut core, setpoint(n, [0.2, 0.1]));
            if let Some(before) = before {
                assert!(largest_step(&now, &before) <= 1e-6 + 1e-12, "{mode:?}: at most 1 mm/s");
            }
            before = Some(now);
        }
        let last = before.expect("steps");
        assert!(!has(&last, Reason::EasingIn), "{mode:?}");
        assert!(
            largest_step(&last, &Command { q_tilde_m: krait_ipc::message::lines(own_m), ..last }) > 1e-4,
            "{mode:?}: it has left the slave's old setpoint"
        );
    }
}

#[test]
fn a_model_update_is_blended_in_no_faster_than_allowed() {
    let mut core = compensate(CompensateConfig::default());
    let first = follow(&mut core, setpoint(1, [0.8, 0.0]));
    core.note_update(&update(1, 1.22, 0.089e-3)).expect("in bounds");
    let mut before = first;
    for n in 2..=3000 {
        let now = follow(&mut core, setpoint(n, [0.8, 0.0]));
        assert!(
            now.learnt[0] - before.learnt[0] <= 0.18e-3 + 1e-12 && now.learnt[1] - before.learnt[1] <= 0.06e-6 + 1e-18
        );
        assert!(largest_step(&now, &before) < 2e-6, "nothing jumps");
        assert_eq!(now.model_update_sequence, 1, "the update in force is named");
        assert_eq!(has(&now, Reason::ModelBlending), now.learnt() != before.learnt());
        before = now;
    }
    assert_eq!(before.learnt(), [1.22, 0.089e-3]);
    assert_eq!(first.learnt(), [1.0, 0.0]);
}

#[test]
fn a_model_that_learns_nothing_takes_no_update_of_another() {
    for mode in ["off", "naive"] {
        let (mut core, setpoint) = with_model(mode, CompensateConfig::default());
        assert_eq!(core.note_update(&update(1, 1.5, 0.1e-3)).expect_err("of estimated").reason, Reason::OtherModel);
        let last = (1..=100).map(|n| follow(&mut core, setpoint(n, [0.3, 0.0]))).last().expect("steps");
        assert_eq!((last.learnt(), last.model_update_sequence), (&[][..], 0));
    }
}

#[test]
fn a_setpoint_of_another_machine_is_refused() {
    let (mut core, own) = off();
    let refused = core.step(&setpoint(1, [0.1, 0.0]), setpoint(1, [0.1, 0.0]).sample_ns).expect_err("of estimated");
    assert_eq!(refused.reason, Reason::OtherModel);
    assert_eq!(follow(&mut core, own(2, [0.1, 0.0])).model_hash, chain("off").hash().0);
}

#[test]
fn an_update_that_is_out_of_bounds_is_refused_and_the_old_model_stays() {
    let mut core = compensate(CompensateConfig::default());
    for bad in [update(1, f64::NAN, 0.0), update(2, 9.0, 0.0), update(3, 1.0, -1e-3), update(4, 1.0, f64::INFINITY)] {
        assert_eq!(core.note_update(&bad).expect_err("out of bounds").reason, Reason::ModelUpdateRefused);
    }
    let good = update(5, 1.1, 0.0);
    let mut elsewhere = good;
    elsewhere.learnt[1] = LearntValue { effect: 1, ..good.learnt[1] };
    for bad in [ModelUpdate { n_learnt: 1, ..good }, ModelUpdate { n_learnt: 9, ..good }, elsewhere] {
        assert_eq!(core.note_update(&bad).expect_err("of other parameters").reason, Reason::ModelUpdateRefused);
    }
    let command = follow(&mut core, setpoint(1, [0.3, 0.0]));
    assert_eq!((command.learnt(), command.model_update_sequence), (&[1.0, 0.0][..], 0));
}

#[test]
fn a_stale_setpoint_repeats_the_last_command_and_says_why() {
    let (mut core, setpoint) = off();
    let before = follow(&mut core, setpoint(1, [0.2, 0.0]));
    core.note_state(&ready_state(60));
    let late = setpoint(2, [0.201, 0.0]);
    let after = core.step(&late, late.sample_ns + 51 * TICK_NS).expect("good numbers");
    assert_eq!(after.q_tilde_m, before.q_tilde_m);
    assert!(has(&after, Reason::SetpointStale));
}

#[test]
fn a_slave_that_fell_silent_stops_the_commands_where_they_are() {
    let (mut core, setpoint) = off();
    let before = follow(&mut core, setpoint(1, [0.2, 0.0]));
    let later = setpoint(200, [0.21, 0.0]);
    let after = core.step(&later, later.sample_ns).expect("good numbers");
    assert_eq!(after.q_tilde_m, before.q_tilde_m);
    assert!(has(&after, Reason::StateStale));
}

/// The root of less than nothing from 20 s on; a model file is checked within the first 16 s.
#[test]
fn a_formula_without_a_value_holds_the_commands_where_they_are_and_is_named() {
    let text = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"formula\"\nname = \"ends\"\nhook = \"eps\"\n\
                formula = \"1e-4 * sqrt(20 - time_s)\"\n";
    let chain = crate::common::chain_of(text);
    let mut core = CompensateCore::new(&chain, CompensateConfig::default()).expect("defaults");
    let setpoint = |sequence| setpoint_of(&chain, sequence, [0.2, 0.0]);
    let before = follow(&mut core, setpoint(1));
    let last = follow(&mut core, setpoint(19_000));
    assert!(!has(&before, Reason::FormulaFault) && !has(&last, Reason::FormulaFault), "{last:?}");
    let after = follow(&mut core, setpoint(21_000));
    assert!(has(&after, Reason::FormulaFault) && after.phase == Phase::Holding as u32, "{after:?}");
    assert_eq!(after.q_tilde_m, last.q_tilde_m);
}

#[test]
fn the_actuators_rate_is_limited_by_one_common_scale() {
    let (mut core, setpoint) = off();
    let before = follow(&mut core, setpoint(1, [0.0, 0.0]));
    let after = follow(&mut core, setpoint(2, [0.3, 0.1]));
    assert!(has(&after, Reason::ActuatorRateLimit));
    assert!((largest_step(&after, &before) - 20e-6).abs() < 1e-12, "20 mm/s for a millisecond");
    let scales: Vec<f64> = (0..3).map(|i| after.q_tilde_m[i] / after.q_uncompensated_m[i]).collect();
    assert!(scales.iter().all(|s| (s - scales[0]).abs() < 1e-12), "direction is kept: {scales:?}");
}

#[test]
fn stroke_and_load_limits_hold_the_outward_motion_only() {
    let cases = [
        (CompensateConfig { max_stroke_m: 1e-3, ..CompensateConfig::default() }, Reason::StrokeLimit),
        (CompensateConfig { max_load_n: 10.0, ..CompensateConfig::default() }, Reason::ForceLimit),
    ];
    for (config, reason) in cases {
        let (mut core, setpoint) = with_model("off", config);
        let out = (1..=1000).map(|n| follow(&mut core, setpoint(n, [n as f64 * 1e-3, 0.0]))).last().expect("steps");
        assert!(has(&out, reason), "{reason:?}");
        assert!(out.q_tilde_m.iter().all(|q| q.abs() <= 1.0e-3), "{reason:?}: {:?}", out.q_tilde_m);
        let back = (1001..=1900).map(|n| follow(&mut core, setpoint(n, [1.0 - (n - 1000) as f64 * 1e-3, 0.0]))).last();
        let back = back.expect("steps");
        assert!(!has(&back, reason) && back.q_tilde_m[0].abs() < 0.3e-3, "{reason:?}: {:?}", back.q_tilde_m);
    }
}

#[test]
fn bad_setpoints_are_refused_and_leave_no_trace() {
    let (mut core, setpoint) = off();
    let before = follow(&mut core, setpoint(5, [0.1, 0.0]));
    let refused = |core: &mut CompensateCore, s: Setpoint| core.step(&s, s.sample_ns).expect_err("bad").reason;
    assert_eq!(refused(&mut core, setpoint(6, [f64::NAN, 0.0])), Reason::NotFinite);
    assert_eq!(refused(&mut core, setpoint(6, [2.0, 0.0])), Reason::OutOfRange);
    assert_eq!(refused(&mut core, setpoint(4, [0.1, 0.0])), Reason::OutOfOrder);
    let after = follow(&mut core, setpoint(6, [0.1, 0.0]));
    assert_eq!((after.sequence, after.q_tilde_m), (before.sequence + 1, before.q_tilde_m));
}
