//! Letting go and taking hold again: the lines go on from where they stand, as if nobody had let go.

use crate::common::{chain, input, ready_state};
use krait_bridge::{CompensateConfig, CompensateCore, ResolveConfig, ResolveCore};
use krait_ipc::message::{Command, OperatorInput, Phase, Setpoint, SlaveState};

/// A slave that executes what follows the operator and otherwise stands where it was last told to be, at once.
struct Loop {
    resolve: ResolveCore,
    compensate: CompensateCore,
    n: u64,
    followed: Option<(Setpoint, Command)>,
    follows: bool,
}

impl Loop {
    fn new() -> Self {
        let chain = chain("estimated");
        Self {
            resolve: ResolveCore::new(&chain, ResolveConfig::default()).expect("defaults"),
            compensate: CompensateCore::new(&chain, CompensateConfig::default()).expect("defaults"),
            n: 0,
            followed: None,
            follows: true,
        }
    }

    /// One millisecond; the states that the cores see are of the millisecond before.
    fn step(&mut self, flags: u32) -> (Setpoint, Command) {
        self.n += 1;
        let ready = ready_state(self.n);
        let flags_of_state = if self.follows { ready.flags } else { ready.flags & !SlaveState::FOLLOWING };
        let mut state = SlaveState { flags: flags_of_state, ..ready };
        if let Some((setpoint, command)) = &self.followed {
            (state.setpoint_bend_rad, state.setpoint_q_m) = (setpoint.bend_rad, command.q_tilde_m);
        }
        self.resolve.note_state(&state);
        self.compensate.note_state(&state);
        let input = OperatorInput { flags, ..input(self.n, [0.02, 0.005, 0.0]) };
        let setpoint = self.resolve.step(&input, input.sample_ns).expect("a good input");
        let command = self.compensate.step(&setpoint, input.sample_ns).expect("a good setpoint");
        self.follows = command.phase == Phase::Following as u32;
        if self.follows {
            self.followed = Some((setpoint, command));
        }
        (setpoint, command)
    }
}

#[test]
fn the_setpoint_stands_at_once_and_sets_off_again_within_its_acceleration() {
    let mut hand = Loop::new();
    let moving = (0..200).map(|_| hand.step(OperatorInput::OPERATOR_PRESENT)).last().expect("steps").0;
    assert!(moving.bend_vel_rad_per_s[0] > 1.0, "{moving:?}");
    for _ in 0..200 {
        let held = hand.step(0).0;
        assert_eq!((held.bend_rad, held.bend_vel_rad_per_s), (moving.bend_rad, [0.0; 2]));
    }
    let again = hand.step(OperatorInput::OPERATOR_PRESENT).0;
    let largest = ResolveConfig::default().max_bend_accel_rad_per_s2 * 1e-3;
    let speed = again.bend_vel_rad_per_s[0].hypot(again.bend_vel_rad_per_s[1]);
    assert!(speed > 0.0 && speed <= largest * (1.0 + 1e-12), "{speed} rad/s after a millisecond");
}

/// The lines have play: a setpoint that braked on its own and came back would turn them, and leave the commands one play off.
#[test]
fn the_lines_are_told_what_a_hand_that_never_let_go_would_tell_them() {
    let (mut steady, mut other) = (Loop::new(), Loop::new());
    let wanted: Vec<_> = (0..400).map(|_| steady.step(OperatorInput::OPERATOR_PRESENT)).collect();
    let mut largest_m = 0.0_f64;
    for n in 0..520 {
        let (setpoint, command) = other.step(if n % 100 < 60 { OperatorInput::OPERATOR_PRESENT } else { 0 });
        // The hand that never let go passes the same bends, at other times.
        let bend = |setpoint: &Setpoint| setpoint.bend_rad[0].hypot(setpoint.bend_rad[1]);
        let Some(after) = wanted.iter().position(|(own, _)| bend(own) > bend(&setpoint)) else { continue };
        let Some((before, own)) = after.checked_sub(1).map(|before| &wanted[before]) else { continue };
        let (next, following) = &wanted[after];
        let part = (bend(&setpoint) - bend(before)) / (bend(next) - bend(before));
        for k in 0..3 {
            let own_m = own.q_tilde_m[k] + part * (following.q_tilde_m[k] - own.q_tilde_m[k]);
            largest_m = largest_m.max((command.q_tilde_m[k] - own_m).abs());
        }
    }
    assert!(largest_m < 5e-6, "the lines were told {:.4} mm off", 1e3 * largest_m);
}
