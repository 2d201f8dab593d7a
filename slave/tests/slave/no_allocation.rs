//! The control steps of the slave and of the simulated snake must not touch the heap: a counting allocator watches them.

use crate::allocations::allocations_of;
use krait_ipc::message::{Command, HopStamps, Phase, Transition};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Actuators, Drive, SlaveConfig, SlaveCore, lines};

#[test]
fn writing_reading_and_looking_at_the_simulated_snake_allocates_nothing() {
    let mut hidden = Truth::default();
    (hidden.lines.rub_n, hidden.lines.creep_part, hidden.lines.drag_n_s_per_m) = (1.0, 0.1, 100.0);
    (hidden.bending.friction_n_m, hidden.bending.softening) = (5e-4, 0.3);
    (hidden.encoders.screw_m, hidden.sight.clock_error_s, hidden.sight.plane_slip_per_rad) = (1e-5, 0.3, 0.1);
    for truth in [Truth::default(), hidden] {
        let mut snake = SimulatedSnake::new(&truth);
        snake.set_power(0, true).unwrap();
        let mut n_frames = 0;
        let n = allocations_of(|| {
            for k in 0..2000_i64 {
                let q = 2e-3 * (k as f64 * 5e-3).sin();
                snake.write(k * 1_000_000, lines([q, -0.5 * q, -0.5 * q])).unwrap();
                snake.read(k * 1_000_000).unwrap();
                n_frames += u64::from(snake.shape(k * 1_000_000).is_some());
            }
        });
        assert_eq!((n, n_frames), (0, 119));
    }
}

#[test]
fn commands_refusals_ticks_and_reports_of_the_slave_allocate_nothing() {
    let mut core = SlaveCore::new(SimulatedSnake::new(&Truth::default()), &SlaveConfig::default());
    let n = allocations_of(|| {
        core.transition(Transition::Enable, 0).unwrap();
        for k in 1..2000_i64 {
            let now_ns = k * 1_000_000;
            let q = if k % 100 == 0 { f64::NAN } else { 1e-3 * (k as f64 * 5e-3).sin() };
            if k % 500 < 400 {
                let mut command = command(k as u64, now_ns, lines([q, -0.5 * q, -0.5 * q]));
                // The operator takes hold after the first five of each run.
                command.reasons = u64::from(k % 500 < 5) << krait_ipc::Reason::OperatorAbsent as u32;
                core.on_command(&command, now_ns);
            }
            core.on_tick(now_ns);
            core.report(now_ns);
        }
    });
    assert_eq!(n, 0);
    let state = core.report(2_000_000_000);
    assert!(state.n_refused > 10 && state.command_sequence > 100, "both paths were taken: {state:?}");
}

fn command(sequence: u64, sample_ns: i64, q_tilde_m: Actuators) -> Command {
    Command {
        sequence,
        sample_ns,
        stamps: HopStamps::default(),
        setpoint_sequence: sequence,
        state_sequence: 0,
        model_update_sequence: 0,
        bend_rad: [0.0; 2],
        q_uncompensated_m: q_tilde_m,
        q_tilde_m,
        n_actuators: 3,
        model_hash: 1,
        learnt: [f64::NAN; 8],
        n_learnt: 0,
        phase: Phase::Following as u32,
        reasons: 0,
        ..Command::default()
    }
}
