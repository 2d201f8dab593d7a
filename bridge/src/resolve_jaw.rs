//! Resolved motion of a gripper's jaw: buttons and turning of the hand become its angle, within its range, whatever the snake does.
//!
//! Problem: integrate y_dot = rate times (open - close) + turning, with y between closed and open, and rate and its change bounded.
//!
//! Failure: as the snake's own; where its setpoint holds, the jaw's stands at once, as the slave's does.

use crate::config::GripperConfig;
use crate::resolve_joints::room;
use krait_ipc::message::{GRIPPER_WIRE, JAW, N_WITH_GRIPPER, OperatorInput, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::gripper::Gripper;

/// The setpoint takes over the slave's own when they are further apart than this, part of the range.
const RESEED: f64 = 1e-3;
/// A jaw that moves slower than this part of its fastest has come to rest.
const REST: f64 = 1e-6;

/// The jaw of a snake's gripper.
#[derive(Clone, Debug)]
pub(crate) struct JawMotion {
    config: GripperConfig,
    range_rad: [f64; 2],
    max_vel_rad_per_s: f64,
    wire_m_per_rad: f64,
    memory: JawMemory,
}

/// What one step leaves to the next.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct JawMemory {
    jaw_rad: f64,
    vel_rad_per_s: f64,
}

impl JawMotion {
    /// A jaw at its zero.
    pub(crate) fn new(gripper: &Gripper, config: GripperConfig) -> Self {
        Self {
            config,
            range_rad: gripper.range_rad(),
            max_vel_rad_per_s: gripper.numbers().max_vel_deg_per_s.to_radians(),
            wire_m_per_rad: gripper.numbers().wire_m_per_rad,
            memory: JawMemory::default(),
        }
    }

    pub(crate) fn memory(&self) -> JawMemory {
        self.memory
    }

    pub(crate) fn restore(&mut self, memory: JawMemory) {
        self.memory = memory;
    }

    /// One step. `input` was checked; `follows`: the operator may move the machine.
    ///
    /// # Real-time
    /// No allocation, no clock, no loop.
    pub(crate) fn step(
        &mut self,
        input: &OperatorInput,
        state: Option<&SlaveState>,
        follows: bool,
        step_s: f64,
        reasons: &mut Reasons,
    ) {
        if !follows {
            self.memory.vel_rad_per_s = 0.0;
        }
        self.reseed_at_rest(state);
        let wanted = if follows { self.limited(input, reasons) } else { 0.0 };
        let largest = self.config.max_accel_rad_per_s2 * step_s;
        let JawMemory { jaw_rad, vel_rad_per_s } = &mut self.memory;
        *vel_rad_per_s += (wanted - *vel_rad_per_s).clamp(-largest, largest);
        let [closed, open] = self.range_rad;
        *jaw_rad = (*jaw_rad + *vel_rad_per_s * step_s).clamp(closed, open);
    }

    /// At rest the setpoint is the slave's own, as with the snake.
    fn reseed_at_rest(&mut self, state: Option<&SlaveState>) {
        let Some(state) = state else { return };
        let [closed, open] = self.range_rad;
        // A jaw that an encoder finds outside its range begins at the end of it.
        let own = state.setpoint_joints_rad[JAW].clamp(closed, open);
        let is_at_rest = self.memory.vel_rad_per_s.abs() < REST * self.max_vel_rad_per_s;
        let is_ours = state.flags & SlaveState::JAW_FOLLOWING != 0;
        let is_far = (own - self.memory.jaw_rad).abs() > RESEED * (open - closed);
        if is_at_rest && !is_ours && is_far && own.is_finite() {
            self.memory.jaw_rad = own;
        }
    }

    fn limited(&self, input: &OperatorInput, reasons: &mut Reasons) -> f64 {
        let turned: f64 = self
            .config
            .open_per_turn
            .iter()
            .zip(input.tip_angular_vel_in_view_rad_per_s)
            .map(|(part, w)| part * w)
            .sum();
        let asked = input.jaw_direction() * self.config.button_rad_per_s + turned;
        let most = self.max_vel_rad_per_s;
        reasons.insert_if(Reason::JointRateLimit, asked.abs() > most);
        let vel = asked.clamp(-most, most);
        // Closed and open are where a jaw usually stands, and nothing to be told.
        vel * room(vel, self.memory.jaw_rad, self.range_rad, self.config.margin_rad)
    }

    /// Puts the jaw beside the snake.
    pub(crate) fn add_to(&self, setpoint: &mut Setpoint) {
        let JawMemory { jaw_rad, vel_rad_per_s } = self.memory;
        (setpoint.joints_rad[JAW], setpoint.joints_vel_rad_per_s[JAW]) = (jaw_rad, vel_rad_per_s);
        setpoint.q_tilde_vel_m_per_s[GRIPPER_WIRE] = self.wire_m_per_rad * vel_rad_per_s;
        setpoint.n_actuators = N_WITH_GRIPPER as u32;
    }
}
