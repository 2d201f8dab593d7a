//! Joints through the cores of `resolve` and `compensate`, on simulated joints that share no physics with the model.

use crate::allocations::allocations_of;
use krait_bridge::{
    CompensateConfig, EstimateConfig, JointCompensateCore, JointEstimateCore, JointMachine, JointResolveCore,
    JointsConfig, LiveModel, ResolveConfig,
};
use krait_ipc::message::{
    Command, DeviceState, HopStamps, LearningState, ModelUpdate, OperatingState, OperatorInput, Phase, Setpoint, Shape,
    SlaveState,
};
use krait_ipc::{Reason, Reasons};
use krait_model::model_file::ModelFile;
use krait_sim::{JointsTruth, SimulatedJoints};
use krait_slave::{Drive, SeenShape};

const MS: i64 = 1_000_000;
const T0_NS: i64 = 1_000_000_000;
const WRIST: &str = include_str!("../../../docs/joints/wrist.toml");
const OFF: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 3\ngain = [1.0, 1.0, 1.0]\noffset = [0.0, 0.0, 0.0]\n";

fn machine(text: &str, config: &JointsConfig) -> JointMachine {
    let model = LiveModel::of(&ModelFile::parse(text).expect("a model")).expect("it can be driven");
    JointMachine::new(model.joints().expect("joints"), config).expect("the configuration fits")
}

fn input(sequence: i64, tip_vel_in_view_m_per_s: [f64; 3]) -> OperatorInput {
    OperatorInput {
        sequence: sequence as u64,
        sample_ns: T0_NS + sequence * MS,
        stamps: HopStamps::default(),
        tip_vel_in_view_m_per_s,
        tip_angular_vel_in_view_rad_per_s: [0.0; 3],
        raw_axes: [0; 6],
        flags: OperatorInput::OPERATOR_PRESENT,
        buttons: 0,
        device_state: DeviceState::Live as u32,
        scale_permille: 1000,
        n_reports: 0,
        n_drained: 0,
        n_refused: 0,
    }
}

fn state(sequence: i64, command: Option<&Command>) -> SlaveState {
    let following = if command.is_some() { SlaveState::FOLLOWING } else { 0 };
    SlaveState {
        sequence: sequence as u64,
        sample_ns: T0_NS + sequence * MS,
        operating_state: OperatingState::Enabled as u32,
        flags: SlaveState::IS_HOMED | SlaveState::ENGAGED | following,
        setpoint_q_m: command.map_or([0.0; 12], |command| command.q_tilde_m),
        setpoint_joints_rad: command.map_or([0.0; 8], |command| command.joints_rad),
        ..SlaveState::default()
    }
}

/// Hands that move three joints to and fro, at three speeds.
fn hand(k: i64) -> [f64; 3] {
    let t_s = k as f64 * 1e-3;
    [(0.025, 5.0), (0.02, 4.0), (0.016, 6.0)].map(|(v, period_s)| v * (core::f64::consts::TAU * t_s / period_s).cos())
}

/// Root mean square of true position less setpoint over the last 10 of 16 s, rad, and the last setpoint and command.
fn tracked(text: &str) -> (f64, Setpoint, Command) {
    let machine = machine(text, &JointsConfig::default());
    let mut resolve = JointResolveCore::new(&machine, ResolveConfig::default()).expect("defaults");
    let mut compensate = JointCompensateCore::new(&machine, CompensateConfig::default()).expect("defaults");
    let mut joints = SimulatedJoints::new(&JointsTruth::of(3));
    joints.set_power(T0_NS, true).expect("power");
    let (mut squares, mut n, mut last) = (0.0, 0, None);
    for k in 1..=16_000 {
        let (now_ns, state) = (T0_NS + k * MS, state(k, last.as_ref().map(|(_, command)| command)));
        resolve.note_state(&state);
        compensate.note_state(&state);
        let setpoint = resolve.step(&input(k, hand(k)), now_ns).expect("a good input");
        let command = compensate.step(&setpoint, now_ns).expect("a good setpoint");
        joints.write(now_ns, command.q_tilde_m).expect("within the travel");
        joints.shape(now_ns + MS / 2);
        if k > 6000 {
            squares +=
                joints.positions_rad().zip(setpoint.joints_rad).map(|(y, wanted)| (y - wanted).powi(2)).sum::<f64>();
            n += 3;
        }
        last = Some((setpoint, command));
    }
    let (setpoint, command) = last.expect("steps");
    ((squares / f64::from(n)).sqrt(), setpoint, command)
}

#[test]
fn the_shipped_wrist_follows_where_uncompensated_joints_lag() {
    let (off_rad, _, off) = tracked(OFF);
    let (wrist_rad, setpoint, command) = tracked(WRIST);
    assert!(off_rad > 2f64.to_radians(), "uncompensated joints miss by {} deg", off_rad.to_degrees());
    assert!(wrist_rad < 0.1 * off_rad, "{} deg of {} deg are left", wrist_rad.to_degrees(), off_rad.to_degrees());
    assert_eq!(off.q_tilde_m, off.q_uncompensated_m, "a model without effects asks for nothing more");
    assert_eq!((setpoint.n_joints, command.n_actuators, command.n_joints), (3, 3, 3));
    assert!(setpoint.bend_rad[0].is_nan() && command.q_tilde_m[3..].iter().all(|q| *q == 0.0));
}

#[test]
fn steps_allocate_nothing_and_a_warm_up_step_leaves_no_trace() {
    let machine = machine(WRIST, &JointsConfig::default());
    let mut resolve = JointResolveCore::new(&machine, ResolveConfig::default()).expect("defaults");
    let mut compensate = JointCompensateCore::new(&machine, CompensateConfig::default()).expect("defaults");
    let (mut resolve_b, mut compensate_b) = (resolve.clone(), compensate.clone());
    let mut n_steps = 0;
    let n = allocations_of(|| {
        let mut last: Option<Command> = None;
        for k in 1..=3000 {
            let (now_ns, state) = (T0_NS + k * MS, state(k, last.as_ref()));
            for core in [&mut resolve, &mut resolve_b] {
                core.note_state(&state);
            }
            for core in [&mut compensate, &mut compensate_b] {
                core.note_state(&state);
            }
            let input = input(k, hand(k));
            resolve_b.warm_up(&OperatorInput { sample_ns: now_ns - MS / 2, ..input }, now_ns);
            let (a, b) = (resolve.step(&input, now_ns).expect("good"), resolve_b.step(&input, now_ns).expect("good"));
            compensate_b.warm_up(&Setpoint { sample_ns: now_ns - MS / 2, ..a }, now_ns);
            let (c, d) = (compensate.step(&a, now_ns).expect("good"), compensate_b.step(&b, now_ns).expect("good"));
            n_steps += u32::from(a.joints_rad == b.joints_rad && c.q_tilde_m == d.q_tilde_m);
            last = Some(c);
        }
    });
    assert_eq!((n, n_steps), (0, 3000));
}

#[test]
fn a_joint_slows_down_at_its_limit_and_the_others_go_on() {
    let config =
        JointsConfig { low_rad: vec![-0.1, -0.8, -0.8], high_rad: vec![0.1, 0.8, 0.8], ..JointsConfig::default() };
    let machine = machine(WRIST, &config);
    let mut resolve = JointResolveCore::new(&machine, ResolveConfig::default()).expect("defaults");
    let mut last = None;
    for k in 1..=1500 {
        resolve.note_state(&SlaveState { flags: SlaveState::FOLLOWING | state(k, None).flags, ..state(k, None) });
        last = Some(resolve.step(&input(k, [0.016, 0.016, 0.0]), T0_NS + k * MS).expect("good"));
    }
    let last = last.expect("steps");
    assert!(Reasons::from_bits(last.reasons).contains(Reason::JointLimit));
    assert!((0.095..=0.1).contains(&last.joints_rad[0]) && last.joints_rad[1] > 0.5, "{:?}", last.joints_rad);
    resolve.note_state(&SlaveState { flags: SlaveState::FOLLOWING | state(1501, None).flags, ..state(1501, None) });
    let fast = resolve.step(&input(1501, [0.0, -0.5, 0.0]), T0_NS + 1501 * MS).expect("good");
    assert!(Reasons::from_bits(fast.reasons).contains(Reason::JointRateLimit) && fast.motion_scale < 0.2);
}

/// The wrist with a play, a gain and a zero that are wrong, and learnt.
const WRONG: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 3\ngain = [0.8884, 0.8884, 0.8884]\n\
    offset = [0.02, 0.02, 0.0]\n\
    [[effect]]\nkind = \"scale\"\nscale = { value = 0.04, learn = { sd = 0.05, memory_s = 1e6 } }\n\
    [[effect]]\nkind = \"backlash\"\nhalf_width = { value = 0.02, learn = { sd = 0.02, memory_s = 1e6 } }\n\
    [[effect]]\nkind = \"offset\"\njoint = 3\noffset = { value = 0.0, learn = { sd = 0.02, memory_s = 1e6 } }\n";

/// The loop of the three cores: root mean square of true position less setpoint over the last 10 of 30 s, rad, how many steps
/// allocated, and the newest update. With `warms_up`, every step is taken once more before, for nothing.
fn learning(learns: bool, warms_up: bool) -> (f64, u64, ModelUpdate, Command) {
    let machine = machine(WRONG, &JointsConfig::default());
    let mut resolve = JointResolveCore::new(&machine, ResolveConfig::default()).expect("defaults");
    let mut compensate = JointCompensateCore::new(&machine, CompensateConfig::default()).expect("defaults");
    let mut estimate = JointEstimateCore::new(&machine, EstimateConfig::default()).expect("defaults");
    let mut joints = SimulatedJoints::new(&JointsTruth::of(3));
    joints.set_power(T0_NS, true).expect("power");
    let (mut squares, mut n, mut n_shapes, mut n_allocations) = (0.0, 0, 0, 0);
    let (mut last, mut newest) = (None::<Command>, None);
    for k in 1..=30_000 {
        let now_ns = T0_NS + k * MS;
        let measured_q_m = joints.read(now_ns).expect("encoders").q_tilde_m;
        let state = SlaveState { measured_q_m, ..state(k, last.as_ref()) };
        resolve.note_state(&state);
        compensate.note_state(&state);
        let setpoint = resolve.step(&input(k, hand(k)), now_ns).expect("a good input");
        n_allocations += allocations_of(|| {
            estimate.note_state(&state);
            if warms_up {
                compensate.warm_up(&setpoint, now_ns);
            }
            last = compensate.step(&setpoint, now_ns).ok();
        });
        joints.write(now_ns, last.expect("a good setpoint").q_tilde_m).expect("within the travel");
        if let Some(seen) = joints.shape(now_ns) {
            let SeenShape::Joints(positions_rad, n_joints) = seen.seen else { panic!("joints are seen") };
            n_shapes += 1;
            let mut shape = Shape::of_joints(n_shapes, seen.exposure_ns, now_ns, &positions_rad[..n_joints]);
            shape.joint_variances_rad2 = [seen.sigma_rad * seen.sigma_rad; 8];
            n_allocations += allocations_of(|| newest = Some(estimate.step(&shape)));
            if learns {
                compensate.note_update(&newest.expect("an update")).expect("of this model");
            }
        }
        if k > 20_000 {
            let positions = joints.positions_rad().zip(setpoint.joints_rad);
            squares += positions.map(|(y, wanted)| (y - wanted).powi(2)).sum::<f64>();
            n += 3;
        }
    }
    ((squares / f64::from(n)).sqrt(), n_allocations, newest.expect("shapes"), last.expect("steps"))
}

#[test]
fn parameters_of_joints_are_learnt_while_they_move_and_the_error_falls() {
    let (fixed_rad, _, _, still) = learning(false, false);
    let (learnt_rad, n_allocations, update, command) = learning(true, false);
    let (known_rad, ..) = tracked(WRIST);
    let deg = |rad: f64| rad.to_degrees();
    println!(
        "without {:.3}, learning {:.3}, known {:.3} deg: {:?}",
        deg(fixed_rad),
        deg(learnt_rad),
        deg(known_rad),
        update.learnt()
    );
    assert!(learnt_rad < 0.05 * fixed_rad && learnt_rad < 2.5 * known_rad, "{learnt_rad} {fixed_rad} {known_rad}");
    assert!(update.learnt().iter().all(|own| own.state() == Some(LearningState::Learning)), "{update:?}");
    let values: Vec<f64> = update.learnt().iter().map(|own| own.value).collect();
    // The simulated joints: 0.25 mm of play on a capstan of 5 mm, and a third joint that is mounted 0.02 rad off.
    assert!((values[1] - 0.05).abs() < 0.005 && (values[2] - 0.02).abs() < 0.004, "{values:?}");
    assert_eq!((still.learnt()[1], still.model_update_sequence), (0.02, 0));
    assert!((command.learnt()[1] - values[1]).abs() < 1e-3 && command.model_update_sequence > 1500, "{command:?}");
    assert_eq!(n_allocations, 0, "steps allocate nothing");
}

#[test]
fn a_warm_up_step_during_a_blend_of_joints_leaves_no_trace() {
    let [without, with] = [false, true].map(|warms_up| learning(true, warms_up).3);
    assert_eq!((without.q_tilde_m, without.learnt()), (with.q_tilde_m, with.learnt()));
    assert!(without.learnt()[1] > 0.04, "something was blended in: {:?}", without.learnt());
}

#[test]
fn what_cannot_be_driven_is_refused_in_one_sentence_that_names_it() {
    let refused = |text: &str| {
        let file = ModelFile::parse(text).expect("a model");
        LiveModel::of(&file).expect_err(text).to_string()
    };
    let joints = |n: usize, units: &str, effect: &str| {
        format!("format = 1\n[machine]\nkind = \"joints\"\nn = {n}\n{units}{effect}")
    };
    for (text, words) in [
        (joints(9, "", ""), "9 joints, expected 1 to 8"),
        (joints(2, "u_unit = \"steps\"\n", ""), "u_unit = \"steps\": expected rad"),
        (joints(2, "", "[[effect]]\nkind = \"saturation\"\n"), "saturation"),
        (joints(2, "gain = [1.0, 1.0]\noffset = \"free\"\n", ""), "offset of [machine] is not known"),
    ] {
        let sentence = refused(&text);
        assert!(sentence.contains(words) && !sentence.contains('\n'), "{sentence}");
    }
    let model = LiveModel::of(&ModelFile::parse(WRIST).expect("a model")).expect("it can be driven");
    for (config, words) in [
        (JointsConfig { rates: vec![[0.0; 6]; 2], ..JointsConfig::default() }, "rates has 2 entries, expected 3"),
        (JointsConfig { low_rad: vec![-0.5], ..JointsConfig::default() }, "low_rad has 1 entries, expected 3"),
        (JointsConfig { high_rad: vec![0.5, f64::NAN, 0.5], ..JointsConfig::default() }, "high_rad of joint 2 is NaN"),
    ] {
        let sentence = JointMachine::new(model.joints().expect("joints"), &config).expect_err(words).to_string();
        assert!(sentence.contains(words), "{sentence}");
    }
}

/// y = x - x^2 has its largest value at x = 0.5: 0.25 rad.
#[test]
fn a_position_that_no_command_reaches_is_named_and_gets_the_nearest_command() {
    let text = format!("{OFF}[[effect]]\nkind = \"quadratic\"\njoint = 1\nquadratic = -1.0\n");
    let machine = machine(&text, &JointsConfig::default());
    let mut compensate = JointCompensateCore::new(&machine, CompensateConfig::default()).expect("defaults");
    let mut resolve = JointResolveCore::new(&machine, ResolveConfig::default()).expect("defaults");
    let mut command_at = |k: i64, wanted_rad: f64| {
        compensate.note_state(&state(k, None));
        let mut joints_rad = [0.0; 8];
        joints_rad[0] = wanted_rad;
        let still = resolve.step(&input(k, [0.0; 3]), T0_NS + k * MS).expect("a good input");
        compensate.step(&Setpoint { joints_rad, ..still }, T0_NS + k * MS).expect("a good setpoint")
    };
    let unreachable = |command: &Command| Reasons::from_bits(command.reasons).contains(Reason::JointUnreachable);
    assert!((1..=200).all(|k| !unreachable(&command_at(k, 1e-3 * k as f64))));
    let beyond = (201..=400).map(|k| command_at(k, 1e-3 * k as f64)).last().expect("200 steps");
    assert!(unreachable(&beyond) && beyond.q_tilde_m.iter().all(|q_m| q_m.is_finite()), "{beyond:?}");
    let back = (401..=800).map(|k| command_at(k, 0.4 - 1e-3 * (k - 400) as f64)).last().expect("400 steps");
    assert!(!unreachable(&back), "{back:?}");
}

/// The root of less than nothing from 20 s on.
#[test]
fn a_formula_of_joints_without_a_value_holds_the_commands_where_they_are_and_is_named() {
    let text = format!(
        "{OFF}[[effect]]\nkind = \"formula\"\nname = \"ends\"\nhook = \"joint\"\nformula = \"1e-2 * sqrt(20 - time_s)\"\n"
    );
    let machine = machine(&text, &JointsConfig::default());
    let mut compensate = JointCompensateCore::new(&machine, CompensateConfig::default()).expect("defaults");
    let mut resolve = JointResolveCore::new(&machine, ResolveConfig::default()).expect("defaults");
    let mut command_at = |k: i64| {
        compensate.note_state(&state(k, None));
        let still = resolve.step(&input(k, [0.0; 3]), T0_NS + k * MS).expect("a good input");
        compensate.step(&still, T0_NS + k * MS).expect("a good setpoint")
    };
    let has_fault = |command: &Command| Reasons::from_bits(command.reasons).contains(Reason::FormulaFault);
    let [first, last, after] = [1, 19_000, 21_000].map(&mut command_at);
    assert!(!has_fault(&first) && !has_fault(&last), "{last:?}");
    assert!(has_fault(&after) && after.phase == Phase::Holding as u32, "{after:?}");
    assert_eq!(after.q_tilde_m, last.q_tilde_m);
}
