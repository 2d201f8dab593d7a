//! The wire of a gripper beside a snake's lines: its limits hold no line, no line's limits hold it, and what the jaw holds is let be.

use crate::allocations::allocations_of;
use krait_ipc::message::{
    Actuators, Command, GRIPPER_WIRE, JAW, N_LINES, OperatingState, Phase, SlaveState, StateCommand, Transition, lines,
};
use krait_ipc::{Reason, Reasons};
use krait_sim::{GripperTruth, SimulatedSnake, Truth};
use krait_slave::{Drive, Limits, SlaveConfig, SlaveCore};

const MS: i64 = 1_000_000;
/// Metres of wire for one radian of the jaw.
const WIRE: f64 = 2e-3;

struct Bench {
    core: SlaveCore<SimulatedSnake>,
    now_ns: i64,
    sequence: u64,
    q_m: Actuators,
}

impl Bench {
    /// Enabled and engaged, with something hard between the jaws from this angle on.
    fn new(config: &SlaveConfig, object_rad: f64) -> Self {
        let truth = Truth { gripper: GripperTruth { object_rad, ..GripperTruth::default() }, ..Truth::default() };
        let core = SlaveCore::new(SimulatedSnake::with_gripper(&truth, WIRE), config);
        let mut bench = Self { core, now_ns: MS, sequence: 0, q_m: [0.0; 12] };
        bench.core.transition(Transition::Enable, MS).unwrap();
        bench.tick();
        for reasons in [1 << Reason::OperatorAbsent as u32, 0] {
            bench.take(Phase::Holding, reasons);
        }
        assert!(bench.take(Phase::Following, 0).is_engaged());
        bench
    }

    fn tick(&mut self) -> SlaveState {
        self.now_ns += MS;
        self.core.on_tick(self.now_ns);
        let _seen = self.core.drive_mut().shape(self.now_ns);
        self.core.report(self.now_ns)
    }

    fn take(&mut self, phase: Phase, reasons: u64) -> SlaveState {
        self.now_ns += MS;
        self.sequence += 1;
        let mut command = Command {
            sequence: self.sequence,
            sample_ns: self.now_ns,
            q_tilde_m: self.q_m,
            n_actuators: 4,
            model_hash: 1,
            phase: phase as u32,
            reasons,
            ..Command::default()
        };
        command.joints_rad[JAW] = self.q_m[GRIPPER_WIRE] / WIRE;
        self.core.on_command(&command, self.now_ns);
        let _seen = self.core.drive_mut().shape(self.now_ns);
        self.core.report(self.now_ns)
    }

    /// So much further in a millisecond, m: the lines in their plane, and the wire.
    fn go(&mut self, line_m: f64, wire_m: f64) -> SlaveState {
        let by = lines([-line_m, 0.5 * line_m, 0.5 * line_m]);
        self.q_m = core::array::from_fn(|k| self.q_m[k] + if k == GRIPPER_WIRE { wire_m } else { by[k] });
        self.take(Phase::Following, 0)
    }

    fn jaw_rad(&self) -> f64 {
        self.core.drive().jaw_rad().unwrap()
    }
}

fn has(state: &SlaveState, reason: Reason) -> bool {
    Reasons::from_bits(state.reasons).contains(reason)
}

/// Opens the jaw by 40 deg, bends the snake, and closes the jaw onto what is there at 20 deg until its load is at its limit.
fn gripping(config: &SlaveConfig) -> (Bench, SlaveState) {
    let mut bench = Bench::new(config, 20f64.to_radians());
    for _ in 0..700 {
        bench.go(2e-6, 2e-6);
    }
    let mut state = bench.go(0.0, 0.0);
    for _ in 0..800 {
        // As `compensate` does: while the slave does not follow, the wire's command begins where the slave has it.
        if state.flags & SlaveState::JAW_FOLLOWING == 0 {
            bench.q_m[GRIPPER_WIRE] = state.setpoint_q_m[GRIPPER_WIRE];
        }
        state = bench.go(2e-6, -2e-6);
        assert!(state.flags & SlaveState::FOLLOWING != 0 && state.is_engaged(), "the lines go on: {state:?}");
    }
    (bench, state)
}

#[test]
fn a_jaw_that_meets_something_stops_at_its_own_limit_while_the_lines_go_on_and_it_opens_again() {
    let config = SlaveConfig::default();
    let (mut bench, state) = gripping(&config);
    let limit_n = config.limits.jaw_n;
    let load_n = state.measured_tau_n[GRIPPER_WIRE];
    // One write beyond: 2 um of a wire of 20 N/mm.
    assert!(load_n < -0.9 * limit_n && load_n > -limit_n - 0.1, "{load_n} N at a limit of {limit_n}");
    assert!((bench.jaw_rad() - 20f64.to_radians()).abs() < 1e-9, "{}", bench.jaw_rad());
    assert!((state.setpoint_q_m[0] + 1500.0 * 2e-6).abs() < 1e-8, "every step of the lines was made: {state:?}");
    bench.q_m[GRIPPER_WIRE] = state.setpoint_q_m[GRIPPER_WIRE];
    for _ in 0..600 {
        bench.go(0.0, 2e-6);
    }
    assert!(bench.jaw_rad() > 22f64.to_radians(), "{}", bench.jaw_rad());
}

#[test]
fn the_limit_of_a_line_holds_no_jaw() {
    let limits = Limits { pull_n: 5.0, push_n: 5.0, ..Limits::default() };
    let mut bench = Bench::new(&SlaveConfig { limits, ..SlaveConfig::default() }, -4.0);
    let mut state = bench.go(0.0, 0.0);
    for _ in 0..600 {
        if state.flags & SlaveState::FOLLOWING == 0 {
            bench.q_m[..N_LINES].copy_from_slice(&state.setpoint_q_m[..N_LINES]);
        }
        state = bench.go(2e-6, 2e-6);
        assert!(state.flags & SlaveState::JAW_FOLLOWING != 0, "{state:?}");
    }
    assert!(has(&state, Reason::ForceLimit) && state.setpoint_q_m[0] > -600.0 * 2e-6, "the lines were held: {state:?}");
    assert!((state.setpoint_q_m[GRIPPER_WIRE] - 600.0 * 2e-6).abs() < 1e-9, "the wire was not: {state:?}");
}

#[test]
fn a_jump_of_the_wire_is_spread_over_time_by_a_gate_of_its_own_and_changes_no_bit_of_the_lines_way() {
    let config = SlaveConfig::default();
    let (mut with, mut without) = (Bench::new(&config, -4.0), Bench::new(&config, -4.0));
    for k in 0..400 {
        // Within the largest step of a command, and far beyond the largest step of a write.
        let jump_m = if k % 100 == 50 { 3e-4 } else { 0.0 };
        let before = with.core.report(with.now_ns).setpoint_q_m[GRIPPER_WIRE];
        let (jumped, smooth) = (with.go(2e-6, jump_m), without.go(2e-6, 0.0));
        let step_m = jumped.setpoint_q_m[GRIPPER_WIRE] - before;
        assert!(step_m.abs() <= 30e-6 * (1.0 + 1e-6), "{step_m} m in a millisecond");
        let bits = |state: &SlaveState| state.setpoint_q_m[..N_LINES].iter().map(|q| q.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&jumped), bits(&smooth), "step {k}");
    }
    let end = with.go(0.0, 0.0).setpoint_q_m[GRIPPER_WIRE];
    assert!((end - 4.0 * 3e-4).abs() < 1e-9, "{end}");
}

#[test]
fn disable_relaxes_the_lines_and_leaves_the_jaw_where_it_holds() {
    let (mut bench, before) = gripping(&SlaveConfig::default());
    let load_n = before.measured_tau_n[GRIPPER_WIRE];
    let disable = StateCommand {
        sequence: 1,
        sample_ns: bench.now_ns + 1,
        transition: Transition::Disable as u32,
        sender_pid: 1,
    };
    bench.core.on_state_command(&disable, bench.now_ns).unwrap();
    let mut state = bench.tick();
    assert!(state.is_letting_go(), "{state:?}");
    for _ in 0..5000 {
        if state.operating() == Some(OperatingState::Disabled) {
            break;
        }
        assert_eq!(state.setpoint_q_m[GRIPPER_WIRE], before.setpoint_q_m[GRIPPER_WIRE]);
        state = bench.tick();
    }
    assert_eq!(state.operating(), Some(OperatingState::Disabled));
    let eased_n = |k: usize| before.measured_tau_n[k].abs() - state.measured_tau_n[k].abs();
    assert!((0..N_LINES).any(|line| eased_n(line) > 1.0), "the lines gave way: {state:?}");
    assert!((state.measured_tau_n[GRIPPER_WIRE] - load_n).abs() < 0.1, "the jaw did not: {state:?}");
}

#[test]
fn a_load_of_the_jaw_alone_is_nothing_to_relax() {
    let mut bench = Bench::new(&SlaveConfig::default(), 20f64.to_radians());
    for _ in 0..700 {
        bench.go(0.0, 2e-6);
    }
    for _ in 0..650 {
        bench.go(0.0, -2e-6);
    }
    let state = bench.go(0.0, 0.0);
    assert!(state.measured_tau_n[GRIPPER_WIRE] < -5.0 && bench.core.largest_load_n() < 0.5, "{state:?}");
    bench.core.disable(bench.now_ns).unwrap();
    assert_eq!(bench.core.report(bench.now_ns).operating(), Some(OperatingState::Disabled));
}

#[test]
fn a_stop_brakes_the_jaw_like_the_lines_and_it_stays_there() {
    let mut bench = Bench::new(&SlaveConfig::default(), -4.0);
    for _ in 0..300 {
        bench.go(2e-6, 2e-6);
    }
    bench.core.stop(bench.now_ns);
    let mut before = bench.core.report(bench.now_ns);
    for k in 0..60 {
        let state = bench.tick();
        assert!(k < 50 || state.setpoint_q_m == before.setpoint_q_m, "at rest within the watchdog's time");
        before = state;
    }
    assert_eq!(before.operating(), Some(OperatingState::Paused));
    assert!((before.setpoint_q_m[GRIPPER_WIRE] - 600e-6).abs() < 2e-5, "{before:?}");
}

/// What the jaw holds it goes on holding while the lines find their zero, and it moves on from there.
#[test]
fn homing_leaves_the_jaw_where_it_holds_and_commands_for_three_lines_are_refused() {
    let (mut bench, before) = gripping(&SlaveConfig::default());
    let (held_rad, held_n) = (bench.jaw_rad(), before.measured_tau_n[GRIPPER_WIRE]);
    assert!(held_n < -10.0 && before.setpoint_q_m[0].abs() > 1e-3, "it holds, and the snake is bent: {before:?}");
    bench.core.transition(Transition::Home, bench.now_ns).unwrap();
    let mut state = bench.tick();
    for _ in 0..2000 {
        state = bench.tick();
        assert_eq!(state.measured_q_m[GRIPPER_WIRE], before.measured_q_m[GRIPPER_WIRE], "{state:?}");
    }
    assert_eq!((&state.setpoint_q_m[..N_LINES], state.setpoint_bend_rad), (&[0.0; N_LINES][..], [0.0; 2]), "{state:?}");
    let setpoint_m = [&state, &before].map(|state| state.setpoint_q_m[GRIPPER_WIRE]);
    assert!((setpoint_m[0] - setpoint_m[1]).abs() < 1e-9, "{setpoint_m:?} m");
    assert_eq!(state.setpoint_joints_rad, before.setpoint_joints_rad, "the jaw is where it was told to be");
    assert!((bench.jaw_rad() - held_rad).abs() < 1e-9 && (state.measured_tau_n[GRIPPER_WIRE] - held_n).abs() < 0.1);
    assert!(state.flags & SlaveState::IS_BUSY == 0);
    let n_refused = state.n_refused;
    bench.sequence += 1;
    let command = Command { sequence: bench.sequence, sample_ns: bench.now_ns, model_hash: 1, ..Command::default() };
    bench.core.on_command(&command, bench.now_ns);
    let state = bench.core.report(bench.now_ns);
    assert!(state.n_refused == n_refused + 1 && has(&state, Reason::OutOfRange), "{state:?}");
}

#[test]
fn commands_ticks_and_reports_with_a_gripper_allocate_nothing() {
    let mut bench = Bench::new(&SlaveConfig::default(), 20f64.to_radians());
    let n_allocations = allocations_of(|| {
        for k in 0..2000 {
            let way = 2e-6 * (f64::from(k) * 5e-3).sin();
            bench.go(way, way);
            if k % 400 > 350 {
                bench.tick();
            }
        }
        bench.core.stop(bench.now_ns);
        for _ in 0..100 {
            bench.tick();
        }
    });
    assert_eq!(n_allocations, 0);
}
