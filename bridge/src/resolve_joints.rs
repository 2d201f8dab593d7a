//! Resolved motion of joints: the operator's axes become joint rates, and these joint positions, within the joints' limits.
//!
//! Problem: integrate y_dot = R v, where v are the operator's six axes in the view frame, 6x1, and R the configured rates,
//! n x 6, with y between the limits, and rates and their changes bounded.
//!
//! Intuition: one common factor shortens all joints where one is too fast, so that the direction of the motion stays; a joint
//! near its limit slows down by itself, so that the others go on.
//!
//! Failure: as in `resolve` of a snake; the setpoint then stands at once, as the slave does.

use crate::JointMachine;
use crate::config::ResolveConfig;
use crate::step::{BridgeError, Refused, Step, check_hand, reasons_to_hold, stamps_begun, step_s, tell_resolve_ages};
use krait_ipc::message::{Health, JointValues, MAX_JOINTS, OperatorInput, Phase, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::joints::{JointCompensator, JointInverseSettings};

/// The setpoint takes over the slave's own when a joint of them is further apart than this, part of its range.
const RESEED: f64 = 1e-3;
/// A setpoint whose joints all move slower than this part of the fastest has come to rest.
const REST: f64 = 1e-6;

/// The pure step of `resolve` for joints.
#[derive(Clone, Debug)]
pub struct JointResolveCore {
    machine: JointMachine,
    /// Only for the rates of the actuators.
    joints: JointCompensator,
    config: ResolveConfig,
    state: Option<SlaveState>,
    memory: Memory,
}

/// What one step leaves to the next.
#[derive(Clone, Copy, Debug)]
struct Memory {
    y_rad: JointValues,
    vel_rad_per_s: JointValues,
    phase: Phase,
    sequence: u64,
    before_ns: Option<i64>,
}

impl JointResolveCore {
    /// A setpoint at rest at zero.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range, [`BridgeError::Chain`] for a chain that cannot be inverted.
    pub fn new(machine: &JointMachine, config: ResolveConfig) -> Result<Self, BridgeError> {
        config.check()?;
        Ok(Self {
            joints: machine.model.chain.compensator(JointInverseSettings::default())?,
            machine: machine.clone(),
            config,
            state: None,
            memory: Memory {
                y_rad: [0.0; MAX_JOINTS],
                vel_rad_per_s: [0.0; MAX_JOINTS],
                phase: Phase::Holding,
                sequence: 0,
                before_ns: None,
            },
        })
    }

    /// Notes the newest slave state; it counts from the next step on, and that step names it.
    pub fn note_state(&mut self, state: &SlaveState) {
        self.state = Some(*state);
    }

    /// One step for one operator input.
    ///
    /// # Errors
    /// [`Refused`] for numbers that are not finite or out of range, and for a stamp that does not follow the one before.
    ///
    /// # Real-time
    /// No allocation, no clock (`begun_ns` is an argument), no loop longer than the joints.
    pub fn step(&mut self, input: &OperatorInput, begun_ns: i64) -> Result<Setpoint, Refused> {
        let axes = check_hand(self.memory.before_ns, input)?;
        let step_s = step_s(self.memory.before_ns, input.sample_ns);
        self.memory.before_ns = Some(input.sample_ns);

        let mut reasons = reasons_to_hold(&self.config, self.state.as_ref(), input, begun_ns);
        self.memory.phase = if reasons.is_empty() { Phase::Following } else { Phase::Holding };
        if self.memory.phase == Phase::Holding {
            self.memory.vel_rad_per_s = [0.0; MAX_JOINTS];
        }
        self.reseed_at_rest();
        let (wanted, motion_scale) = match self.memory.phase {
            Phase::Following => self.limited(&axes, &mut reasons),
            Phase::Holding => ([0.0; MAX_JOINTS], 0.0),
        };
        self.advance(&wanted, step_s);
        Ok(self.setpoint(input, begun_ns, motion_scale, reasons))
    }

    /// Does what [`JointResolveCore::step`] does and forgets it.
    pub fn warm_up(&mut self, input: &OperatorInput, begun_ns: i64) {
        let memory = self.memory;
        let _forgotten = core::hint::black_box(self.step(input, begun_ns));
        self.memory = memory;
    }

    /// At rest, the setpoint is the slave's own, as with a snake.
    fn reseed_at_rest(&mut self) {
        let Some(state) = &self.state else { return };
        let machine = &self.machine;
        let is_at_rest = self.memory.vel_rad_per_s.iter().all(|v| v.abs() < REST * machine.max_vel_rad_per_s);
        let is_ours = state.flags & SlaveState::FOLLOWING != 0;
        if !is_at_rest || is_ours {
            return;
        }
        let own = &state.setpoint_joints_rad;
        let ranges = machine.low_rad.iter().zip(&machine.high_rad);
        let is_allowed = own.iter().zip(ranges.clone()).all(|(y, (low, high))| (low..=high).contains(&y));
        let is_far = own.iter().zip(&self.memory.y_rad).zip(ranges);
        let is_far = is_far.into_iter().any(|((own, y), (low, high))| (own - y).abs() > RESEED * (high - low));
        if is_allowed && is_far {
            self.memory.y_rad = *own;
        }
    }

    /// The joint rates for the operator's axes, within the limits; the second value is the common scale that they asked for.
    fn limited(&self, axes: &[f64; 6], reasons: &mut Reasons) -> (JointValues, f64) {
        let mut vel: JointValues = self.machine.rates.map(|row| row.iter().zip(axes).map(|(rate, v)| rate * v).sum());
        let fastest = vel.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let mut scale = 1.0;
        if fastest > self.machine.max_vel_rad_per_s {
            scale = self.machine.max_vel_rad_per_s / fastest;
            vel = vel.map(|v| v * scale);
            reasons.insert(Reason::JointRateLimit);
        }
        for (k, v) in vel.iter_mut().enumerate() {
            let range = [self.machine.low_rad[k], self.machine.high_rad[k]];
            let room = room(*v, self.memory.y_rad[k], range, self.machine.margin_rad);
            if *v != 0.0 && room < 1.0 {
                reasons.insert(Reason::JointLimit);
                *v *= room;
            }
        }
        (vel, scale)
    }

    fn advance(&mut self, wanted: &JointValues, step_s: f64) {
        let now = self.memory.vel_rad_per_s;
        let change: JointValues = core::array::from_fn(|k| wanted[k] - now[k]);
        let sharpest = change.iter().fold(0.0_f64, |most, change| most.max(change.abs()));
        let largest = self.machine.max_accel_rad_per_s2 * step_s;
        let part = if sharpest > largest { largest / sharpest } else { 1.0 };
        for k in 0..self.machine.model.n() {
            let vel = now[k] + part * change[k];
            let y = self.memory.y_rad[k] + vel * step_s;
            self.memory.vel_rad_per_s[k] = vel;
            self.memory.y_rad[k] = y.clamp(self.machine.low_rad[k], self.machine.high_rad[k]);
        }
    }

    fn setpoint(&mut self, input: &OperatorInput, begun_ns: i64, motion_scale: f64, reasons: Reasons) -> Setpoint {
        self.memory.sequence += 1;
        let vel = self.machine.of_model(&self.memory.vel_rad_per_s);
        let n = self.machine.model.n();
        Setpoint {
            sequence: self.memory.sequence,
            sample_ns: input.sample_ns,
            stamps: stamps_begun(&input.stamps, |s| s.resolve_begun_ns = begun_ns),
            input_sequence: input.sequence,
            state_sequence: self.state.map_or(0, |s| s.sequence),
            bend_rad: [f64::NAN; 2],
            bend_vel_rad_per_s: [f64::NAN; 2],
            joints_rad: self.memory.y_rad,
            joints_vel_rad_per_s: self.memory.vel_rad_per_s,
            q_tilde_vel_m_per_s: self.machine.cable_m(&self.joints.rates_without_effects(&vel[..n])),
            tip_pos_in_base_m: [f64::NAN; 3],
            motion_scale,
            model_hash: self.machine.model.hash().0,
            phase: self.memory.phase as u32,
            reserved: 0,
            n_actuators: n as u32,
            n_joints: n as u32,
            reasons: reasons.bits(),
        }
    }
}

/// How much of a rate is left near the end of a range that it goes to, 0 to 1.
pub(crate) fn room(vel: f64, y: f64, [low, high]: [f64; 2], margin: f64) -> f64 {
    let left = if vel > 0.0 { high - y } else { y - low };
    (left / margin).clamp(0.0, 1.0)
}

impl Step for JointResolveCore {
    type In = OperatorInput;
    type Out = Setpoint;
    const TAKES_UPDATES: bool = false;

    fn note_state(&mut self, state: &SlaveState) {
        Self::note_state(self, state);
    }

    fn step(&mut self, input: &OperatorInput, begun_ns: i64) -> Result<Setpoint, Refused> {
        Self::step(self, input, begun_ns)
    }

    fn tell(&self, input: &OperatorInput, begun_ns: i64, reasons: Reasons, health: &mut Health) {
        tell_resolve_ages(&self.config, self.state.as_ref(), input, begun_ns, reasons, health);
    }

    fn warm_up(&mut self, input: &OperatorInput, now_ns: i64) {
        Self::warm_up(self, input, now_ns);
    }
}
