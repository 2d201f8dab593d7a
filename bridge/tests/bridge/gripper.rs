//! A gripper through the cores of `resolve` and `compensate`: it follows the hand within its range, is compensated, allocates nothing,
//! and changes no bit of what the snake's lines are told.

use crate::allocations::allocations_of;
use crate::common::{T0_NS, TICK_NS, chain_of, input, ready_state};
use krait_bridge::{CompensateConfig, CompensateCore, GripperConfig, ResolveConfig, ResolveCore};
use krait_ipc::message::{Command, GRIPPER_WIRE, JAW, N_LINES, OperatorInput, Phase, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::Chain;
use krait_sim::{GripperTruth, SimulatedSnake, Truth};
use krait_slave::Drive;

const SHIPPED: &str = include_str!("../../../docs/gripper/snake.toml");

/// The shipped snake, with what of its file is behind a word left out.
fn shipped_until(word: &str) -> Chain {
    chain_of(SHIPPED.split_once(word).map_or(SHIPPED, |(before, _)| before))
}

fn without_gripper() -> Chain {
    shipped_until("[gripper]")
}

fn without_effects_of_its_wire() -> Chain {
    shipped_until("[[gripper.effect]]")
}

fn shipped() -> Chain {
    chain_of(SHIPPED)
}

/// A hand that bends the snake to and fro and opens and closes the jaw, a second each.
fn hand(n: u64) -> OperatorInput {
    let phase = n as f64 * 2e-3;
    let mut input = input(n, [0.012 * phase.cos(), 0.009 * (1.3 * phase).sin(), 0.0]);
    input.flags |= if (n / 1000).is_multiple_of(2) { OperatorInput::JAW_OPENS } else { OperatorInput::JAW_CLOSES };
    input
}

/// A slave that follows whatever it was told.
fn state(n: u64, command: Option<&Command>) -> SlaveState {
    let Some(command) = command else { return ready_state(n) };
    let mut state = ready_state(n);
    state.flags |= SlaveState::JAW_FOLLOWING;
    (state.setpoint_q_m, state.setpoint_bend_rad) = (command.q_tilde_m, command.bend_rad);
    (state.setpoint_joints_rad, state.n_actuators) = (command.joints_rad, command.n_actuators);
    state
}

struct Cores {
    resolve: ResolveCore,
    compensate: CompensateCore,
    last: Option<Command>,
}

impl Cores {
    fn new(chain: &Chain) -> Self {
        Self {
            resolve: ResolveCore::new(chain, ResolveConfig::default()).expect("defaults"),
            compensate: CompensateCore::new(chain, CompensateConfig::default()).expect("defaults"),
            last: None,
        }
    }

    fn step(&mut self, n: u64, input: &OperatorInput) -> (Setpoint, Command) {
        let state = state(n, self.last.as_ref());
        self.resolve.note_state(&state);
        self.compensate.note_state(&state);
        let setpoint = self.resolve.step(input, input.sample_ns).expect("a good input");
        let command = self.compensate.step(&setpoint, input.sample_ns).expect("a good setpoint");
        self.last = Some(command);
        (setpoint, command)
    }
}

#[test]
fn the_snakes_lines_are_told_the_same_bits_with_a_gripper_and_without() {
    let (mut with, mut without) = (Cores::new(&shipped()), Cores::new(&without_gripper()));
    for n in 1..=6000 {
        let ((setpoint, command), (bare_setpoint, bare)) = (with.step(n, &hand(n)), without.step(n, &hand(n)));
        assert_eq!((setpoint.n_actuators, command.n_actuators, command.n_joints), (4, 4, 0));
        assert_eq!((bare.n_actuators, bare.n_joints, bare.joints_rad), (0, 0, [0.0; 8]));
        assert_eq!(setpoint.jaw_rad(), Some(command.joints_rad[JAW]));
        assert_eq!((bare_setpoint.jaw_rad(), bare_setpoint.joints_vel_rad_per_s), (None, [0.0; 8]));
        for (own, other) in [
            (&command.q_tilde_m[..N_LINES], &bare.q_tilde_m[..N_LINES]),
            (&command.q_uncompensated_m[..N_LINES], &bare.q_uncompensated_m[..N_LINES]),
            (&command.q_tilde_vel_m_per_s[..N_LINES], &bare.q_tilde_vel_m_per_s[..N_LINES]),
            (&command.bend_rad[..], &bare.bend_rad[..]),
        ] {
            assert!(own.iter().zip(other).all(|(a, b)| a.to_bits() == b.to_bits()), "{n}: {own:?} {other:?}");
        }
        assert!(bare.q_tilde_m[N_LINES..].iter().all(|q| q.to_bits() == 0));
    }
}

#[test]
fn the_jaw_goes_as_its_buttons_say_within_its_range_and_only_for_a_present_operator() {
    let mut cores = Cores::new(&shipped());
    let asked = |n, flags| OperatorInput { flags, ..input(n, [0.0; 3]) };
    let (present, opens) = (OperatorInput::OPERATOR_PRESENT, OperatorInput::JAW_OPENS);
    let mut n = 0;
    let mut hold = |cores: &mut Cores, flags, n_ms: u64| {
        let mut last = None;
        for _ in 0..n_ms {
            n += 1;
            last = Some(cores.step(n, &asked(n, flags)).0);
        }
        last.expect("a step")
    };
    let nobody = hold(&mut cores, opens, 500);
    assert_eq!((nobody.jaw_rad(), nobody.phase), (Some(0.0), Phase::Holding as u32));
    let open = hold(&mut cores, present | opens, 500);
    let rate = GripperConfig::default().button_rad_per_s;
    assert!((open.joints_vel_rad_per_s[JAW] - rate).abs() < 1e-12 && open.jaw_rad() > Some(0.35), "{open:?}");
    assert!((open.q_tilde_vel_m_per_s[GRIPPER_WIRE] - 0.002 * rate).abs() < 1e-12);
    let let_go = hold(&mut cores, opens, 200);
    let clutched = hold(&mut cores, present | OperatorInput::CLUTCH | opens, 200);
    assert_eq!((let_go.joints_vel_rad_per_s[JAW], clutched.jaw_rad()), (0.0, let_go.jaw_rad()));
    let both = hold(&mut cores, present | opens | OperatorInput::JAW_CLOSES, 200);
    assert_eq!(both.jaw_rad(), let_go.jaw_rad());
    let wide = hold(&mut cores, present | opens, 4000);
    let range = 60f64.to_radians();
    assert!(wide.jaw_rad() <= Some(range) && wide.jaw_rad() > Some(range - 1e-3), "{wide:?}");
    assert!(Reasons::from_bits(wide.reasons).is_empty(), "an open jaw is no limit");
    assert_eq!(wide.phase, Phase::Following as u32, "the snake is not held by it");
    let shut = hold(&mut cores, present | OperatorInput::JAW_CLOSES, 4000);
    assert!(shut.jaw_rad() >= Some(0.0) && shut.jaw_rad() < Some(1e-3), "{shut:?}");
}

/// A slave that holds at once, where it was last told to follow: what `resolve` brakes through meanwhile nobody carries out.
fn holding_state(n: u64, followed: Option<&Command>, is_held: bool) -> SlaveState {
    let state = state(n, followed);
    SlaveState { flags: if is_held { state.flags & !SlaveState::JAW_FOLLOWING } else { state.flags }, ..state }
}

#[test]
fn taken_hold_of_again_and_again_the_wire_stays_within_its_play_of_the_jaw() {
    let mut cores = Cores::new(&shipped());
    let mut followed: Option<Command> = None;
    let (mut n, mut is_held) = (0, false);
    // Opened wide, and closed in short pulls with the hand off between them.
    let pulls = core::iter::once((OperatorInput::JAW_OPENS, 1000)).chain([(OperatorInput::JAW_CLOSES, 60); 12]);
    for (jaw, n_ms) in pulls {
        for (flags, n_ms) in [(OperatorInput::OPERATOR_PRESENT | jaw, n_ms), (0, 150)] {
            for _ in 0..n_ms {
                n += 1;
                let state = holding_state(n, followed.as_ref(), is_held);
                cores.resolve.note_state(&state);
                cores.compensate.note_state(&state);
                let input = OperatorInput { flags, ..input(n, [0.0; 3]) };
                let setpoint = cores.resolve.step(&input, input.sample_ns).expect("a good input");
                let command = cores.compensate.step(&setpoint, input.sample_ns).expect("a good setpoint");
                is_held = command.phase != Phase::Following as u32;
                if !is_held {
                    followed = Some(command);
                }
                let (wire_m, jaw_rad) =
                    (followed.map_or(0.0, |own| own.q_tilde_m[GRIPPER_WIRE]), command.joints_rad[JAW]);
                let off_m = wire_m - 0.002 * jaw_rad;
                // Half of the play, and what is crossed before a new hold has eased in.
                assert!(off_m.abs() < 2.5e-4, "{n}: the wire stands {:.3} mm off a jaw at {jaw_rad} rad", 1e3 * off_m);
            }
        }
    }
    let jaw_rad = followed.expect("it followed").joints_rad[JAW];
    assert!(jaw_rad > 0.1, "still open: {jaw_rad}");
}

#[test]
fn turning_the_hand_moves_the_jaw_where_the_configuration_says_so_and_is_checked() {
    let chain = shipped();
    let config = GripperConfig { open_per_turn: [0.0, 0.0, 2.0], ..GripperConfig::default() };
    let core = ResolveCore::new(&chain, ResolveConfig::default()).expect("defaults");
    let mut core = core.with_gripper(&chain, config).expect("in range");
    let turned = |n, w| OperatorInput { tip_angular_vel_in_view_rad_per_s: [0.0, 0.0, w], ..input(n, [0.0; 3]) };
    let mut newest = None;
    for n in 1..=1000 {
        core.note_state(&state(n, None));
        newest = Some(core.step(&turned(n, 0.25), T0_NS + n as i64 * TICK_NS).expect("a good input"));
    }
    let vel = newest.expect("steps").joints_vel_rad_per_s[JAW];
    assert!((vel - 0.5).abs() < 1e-12, "{vel}");
    let refused = core.step(&turned(1001, f64::NAN), T0_NS + 1001 * TICK_NS).expect_err("not a number");
    assert_eq!(refused.reason, Reason::NotFinite);
    let fast = core.step(&turned(1002, 5.0), T0_NS + 1002 * TICK_NS).expect("a fast hand");
    assert!(Reasons::from_bits(fast.reasons).contains(Reason::JointRateLimit), "{fast:?}");
}

#[test]
fn a_setpoint_for_another_gripper_than_the_models_is_refused() {
    let (mut with, mut without) = (Cores::new(&shipped()), Cores::new(&without_gripper()));
    let (setpoint, _) = with.step(1, &hand(1));
    let (bare, _) = without.step(1, &hand(1));
    let refused = |core: &mut CompensateCore, setpoint: &Setpoint| {
        let later = Setpoint { sample_ns: setpoint.sample_ns + TICK_NS, ..*setpoint };
        core.step(&later, later.sample_ns).expect_err("of another machine").reason
    };
    let (hash, bare_hash) = (setpoint.model_hash, bare.model_hash);
    assert_ne!(hash, bare_hash);
    assert_eq!(refused(&mut with.compensate, &bare), Reason::OtherModel);
    assert_eq!(refused(&mut with.compensate, &Setpoint { model_hash: hash, ..bare }), Reason::OutOfRange);
    assert_eq!(refused(&mut without.compensate, &Setpoint { model_hash: bare_hash, ..setpoint }), Reason::OutOfRange);
    let mut spoilt = setpoint;
    spoilt.joints_rad[JAW] = f64::NAN;
    assert_eq!(refused(&mut with.compensate, &spoilt), Reason::NotFinite);
}

/// Root mean square of the simulated jaw less its setpoint from the third second on, rad.
fn jaw_error_rad(chain: &Chain) -> f64 {
    let mut cores = Cores::new(chain);
    let truth = Truth { gripper: GripperTruth::default(), ..Truth::default() };
    let mut snake = SimulatedSnake::with_gripper(&truth, 0.002);
    snake.set_power(T0_NS, true).expect("power");
    let (mut squares, mut n_scored) = (0.0, 0);
    for n in 1..=9000 {
        let (setpoint, command) = cores.step(n, &hand(n));
        let reasons = Reasons::from_bits(command.reasons);
        assert!(!reasons.contains(Reason::ActuatorRateLimit), "{n}: a play that is crossed is no limit");
        snake.write(setpoint.sample_ns, command.q_tilde_m).expect("within the travel");
        snake.shape(setpoint.sample_ns + TICK_NS / 2);
        if n > 3000 {
            let off = snake.jaw_rad().expect("a jaw") - setpoint.jaw_rad().expect("a jaw");
            (squares, n_scored) = (squares + off * off, n_scored + 1);
        }
    }
    (squares / f64::from(n_scored)).sqrt()
}

#[test]
fn a_compensated_jaw_follows_where_one_that_is_not_lags_behind_its_backlash() {
    let (off_rad, full_rad) = (jaw_error_rad(&without_effects_of_its_wire()), jaw_error_rad(&shipped()));
    assert!(off_rad > 2f64.to_radians(), "uncompensated it misses by {} deg", off_rad.to_degrees());
    assert!(full_rad < 0.2 * off_rad, "{} of {} deg are left", full_rad.to_degrees(), off_rad.to_degrees());
}

#[test]
fn steps_with_a_gripper_allocate_nothing_and_a_warm_up_step_leaves_no_trace() {
    let chain = shipped();
    let commands = |warms_up: bool| -> Vec<String> {
        let mut cores = Cores::new(&chain);
        let step = |n: u64| {
            let input = hand(n);
            if warms_up && n > 1 {
                let early = OperatorInput { sample_ns: input.sample_ns - 200_000, ..hand(n + 700) };
                cores.resolve.warm_up(&early, early.sample_ns);
                let mut setpoint =
                    Setpoint { sample_ns: early.sample_ns, ..crate::common::setpoint_of(&chain, n, [0.3, 0.1]) };
                (setpoint.n_actuators, setpoint.joints_rad[JAW]) = (4, 0.9);
                cores.compensate.warm_up(&setpoint, early.sample_ns);
            }
            format!("{:?}", cores.step(n, &input))
        };
        (1..=4000).map(step).collect()
    };
    assert_eq!(commands(true), commands(false));
    let mut cores = Cores::new(&chain);
    let n_allocations = allocations_of(|| {
        for n in 1..=8000 {
            let input = hand(n);
            cores.resolve.warm_up(&input, input.sample_ns);
            let (setpoint, _) = cores.step(n, &input);
            cores.compensate.warm_up(&setpoint, setpoint.sample_ns);
        }
    });
    assert_eq!(n_allocations, 0);
}

#[test]
fn the_first_command_after_a_hold_is_where_the_slave_has_the_jaws_wire_and_is_eased_out_from_there() {
    let mut cores = Cores::new(&shipped());
    for n in 1..=500 {
        cores.step(n, &hand(n));
    }
    let mut held = state(501, cores.last.as_ref());
    // The lines follow; the wire was held elsewhere, as by the limit of its load.
    held.flags &= !SlaveState::JAW_FOLLOWING;
    held.setpoint_q_m[GRIPPER_WIRE] += 2e-4;
    cores.compensate.note_state(&held);
    cores.resolve.note_state(&held);
    let before = cores.last.expect("steps").q_tilde_m;
    let setpoint = cores.resolve.step(&hand(501), hand(501).sample_ns).expect("a good input");
    let command = cores.compensate.step(&setpoint, setpoint.sample_ns).expect("a good setpoint");
    assert_eq!(command.q_tilde_m[GRIPPER_WIRE], held.setpoint_q_m[GRIPPER_WIRE]);
    let ways_m = command.q_tilde_m.iter().zip(before).take(N_LINES).map(|(now, before)| (now - before).abs());
    assert!(ways_m.into_iter().all(|way_m| way_m > 0.0 && way_m < 5e-5), "the lines go on: {command:?}");
}
