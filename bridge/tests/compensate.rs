//! `compensate`: what the actuators are told, that it never jumps, and that the model changes smoothly.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

mod common;

use common::{TICK_NS, compensate, ready_state, setpoint, waiting_state};
use krait_bridge::{CompensateConfig, CompensateCore};
use krait_ipc::message::{Command, Compensation, ModelUpdate, Setpoint};
use krait_ipc::{Reason, Reasons};
use krait_model::model_file::ModelFile;
use krait_model::{Columns, MachineParameters, Snake};

fn with_mode(mode: Compensation) -> CompensateConfig {
    CompensateConfig { mode, ..CompensateConfig::default() }
}

fn follow(core: &mut CompensateCore, setpoint: Setpoint) -> Command {
    core.note_state(&ready_state(setpoint.sequence));
    core.step(&setpoint, setpoint.sample_ns).expect("a good sample")
}

fn has(command: &Command, reason: Reason) -> bool {
    Reasons::from_bits(command.reasons).contains(reason)
}

fn update(sequence: u64, eta: f64, lambda_m: f64) -> ModelUpdate {
    ModelUpdate {
        sequence,
        sample_ns: 0,
        shape_sequence: sequence,
        eta,
        lambda_m,
        eta_sd: 0.01,
        lambda_sd_m: 1e-6,
        innovation_rms_m: 1e-5,
        n_used: 100,
        n_left_out: 0,
        n_changes: 0,
        changed_ns: 0,
        change_kind: 0,
        is_watching: 0,
    }
}

fn largest_step(a: &Command, b: &Command) -> f64 {
    (0..3).map(|line| (a.q_tilde_m[line] - b.q_tilde_m[line]).abs()).fold(0.0, f64::max)
}

#[test]
fn off_tells_the_actuators_what_an_inextensible_snake_would_need() {
    let mut core = compensate(with_mode(Compensation::Off));
    let command = follow(&mut core, setpoint(1, [0.5, 0.2]));
    assert_eq!(command.q_tilde_m, command.q_uncompensated_m);
    let snake = Snake::new(&MachineParameters::default()).expect("defaults");
    let q_m: [f64; 3] = snake.q([0.5, 0.2].into()).into();
    assert_eq!((command.q_tilde_m, command.bend_rad), (q_m, [0.5, 0.2]));
}

#[test]
fn naive_adds_nearly_as_much_as_the_snake_needs_itself() {
    let mut core = compensate(with_mode(Compensation::Naive));
    let command =
        (1..=400).map(|n| follow(&mut core, setpoint(n, [f64::from(n as u32) * 2e-3, 0.0]))).last().expect("steps");
    let added =
        (command.q_tilde_m[0] - command.q_tilde_m[1]) / (command.q_uncompensated_m[0] - command.q_uncompensated_m[1]);
    assert!((added - 1.86).abs() < 0.02, "q~/q differential {added}: eps/q is 0.86 for Table I");
}

#[test]
fn while_the_slave_does_not_follow_the_command_equals_its_setpoint() {
    for mode in [Compensation::Off, Compensation::Naive, Compensation::Estimated] {
        let mut core = compensate(with_mode(mode));
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
            largest_step(&last, &Command { q_tilde_m: own_m, ..last }) > 1e-4,
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
        assert!(now.eta - before.eta <= 0.2e-3 + 1e-12 && now.lambda_m - before.lambda_m <= 0.05e-6 + 1e-18);
        assert_eq!(now.model_update_sequence, 1, "the update in force is named");
        before = now;
    }
    assert!((before.eta - 1.22).abs() < 1e-12 && (before.lambda_m - 0.089e-3).abs() < 1e-15);
    assert!(before.model_version > first.model_version && !has(&before, Reason::ModelBlending));
}

#[test]
fn the_other_modes_ignore_model_updates() {
    for mode in [Compensation::Off, Compensation::Naive] {
        let mut core = compensate(with_mode(mode));
        core.note_update(&update(1, 1.5, 0.1e-3)).expect("in bounds");
        let last = (1..=100).map(|n| follow(&mut core, setpoint(n, [0.3, 0.0]))).last().expect("steps");
        assert_eq!((last.eta, last.lambda_m, last.model_version), (1.0, 0.0, 0));
    }
}

#[test]
fn the_chain_of_a_model_file_compensates_like_the_estimated_mode_with_the_same_numbers() {
    let effects = "[[effect]]\nkind = \"stiffness-scale\"\neta = 1.22\n[[effect]]\nkind = \"cone-friction\"\n\
                   [[effect]]\nkind = \"static-friction\"\n[[effect]]\nkind = \"backlash\"\nhalf_width_m = 0.089e-3\n";
    let text = format!("format = 1\n[machine]\nkind = \"snake\"\n{effects}");
    let file = ModelFile::parse(&text).expect("a model file");
    let chain = file.chain(Columns::default()).expect("a chain").expect("of a snake");
    let machine = MachineParameters::default();
    let config = with_mode(Compensation::Model);
    let mut by_chain = CompensateCore::new(&machine, config, Some(&chain)).expect("invertible");
    let estimated = CompensateConfig { eta: 1.22, lambda_m: 0.089e-3, ..with_mode(Compensation::Estimated) };
    let mut by_paper = compensate(estimated);
    let mut largest_m: f64 = 0.0;
    for n in 1..=6000 {
        let phase = n as f64 * 1e-3;
        let bend_rad = [0.7 * phase.sin(), 0.5 * (0.7 * phase).sin()];
        let (a, b) = (follow(&mut by_chain, setpoint(n, bend_rad)), follow(&mut by_paper, setpoint(n, bend_rad)));
        assert!(a.eta.is_nan() && a.lambda_m.is_nan() && a.compensation == Compensation::Model as u32);
        largest_m = largest_m.max(largest_step(&a, &b));
    }
    // 20 um are 0.7 deg of bend that is not there: the two turn a line's sign of motion within the same travel.
    assert!(largest_m < 20e-6, "{largest_m}");
    let error = CompensateCore::new(&machine, config, None).expect_err("no model file").to_string();
    assert!(error.contains("--model"), "{error}");
}

#[test]
fn an_update_that_is_out_of_bounds_is_refused_and_the_old_model_stays() {
    let mut core = compensate(CompensateConfig::default());
    for bad in [update(1, f64::NAN, 0.0), update(2, 9.0, 0.0), update(3, 1.0, -1e-3), update(4, 1.0, f64::INFINITY)] {
        assert_eq!(core.note_update(&bad).expect_err("out of bounds").reason, Reason::ModelUpdateRefused);
    }
    let command = follow(&mut core, setpoint(1, [0.3, 0.0]));
    assert_eq!((command.eta, command.model_update_sequence), (1.0, 0));
}

#[test]
fn a_stale_setpoint_repeats_the_last_command_and_says_why() {
    let mut core = compensate(with_mode(Compensation::Off));
    let before = follow(&mut core, setpoint(1, [0.2, 0.0]));
    core.note_state(&ready_state(60));
    let late = setpoint(2, [0.201, 0.0]);
    let after = core.step(&late, late.sample_ns + 51 * TICK_NS).expect("good numbers");
    assert_eq!(after.q_tilde_m, before.q_tilde_m);
    assert!(has(&after, Reason::SetpointStale));
}

#[test]
fn a_slave_that_fell_silent_stops_the_commands_where_they_are() {
    let mut core = compensate(with_mode(Compensation::Off));
    let before = follow(&mut core, setpoint(1, [0.2, 0.0]));
    let later = setpoint(200, [0.21, 0.0]);
    let after = core.step(&later, later.sample_ns).expect("good numbers");
    assert_eq!(after.q_tilde_m, before.q_tilde_m);
    assert!(has(&after, Reason::StateStale));
}

#[test]
fn the_actuators_rate_is_limited_by_one_common_scale() {
    let mut core = compensate(with_mode(Compensation::Off));
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
        (CompensateConfig { max_stroke_m: 1e-3, ..with_mode(Compensation::Off) }, Reason::StrokeLimit),
        (CompensateConfig { max_load_n: 10.0, ..with_mode(Compensation::Off) }, Reason::ForceLimit),
    ];
    for (config, reason) in cases {
        let mut core = compensate(config);
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
    let mut core = compensate(with_mode(Compensation::Off));
    let before = follow(&mut core, setpoint(5, [0.1, 0.0]));
    let refused = |core: &mut CompensateCore, s: Setpoint| core.step(&s, s.sample_ns).expect_err("bad").reason;
    assert_eq!(refused(&mut core, setpoint(6, [f64::NAN, 0.0])), Reason::NotFinite);
    assert_eq!(refused(&mut core, setpoint(6, [2.0, 0.0])), Reason::OutOfRange);
    assert_eq!(refused(&mut core, setpoint(4, [0.1, 0.0])), Reason::OutOfOrder);
    let after = follow(&mut core, setpoint(6, [0.1, 0.0]));
    assert_eq!((after.sequence, after.q_tilde_m), (before.sequence + 1, before.q_tilde_m));
}
