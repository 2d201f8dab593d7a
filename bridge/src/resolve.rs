//! Resolved-rate motion: the operator's tip velocity becomes a bend-vector setpoint, smooth through the straight pose.
//!
//! Problem: find b_dot with J_v(b) b_dot = v, where v is the tip velocity in the base frame, 3x1, and J_v the linear rows of
//! the tip's Jacobian in the bend vector, 3x2, in the least-squares sense of the configured weights; integrate to b; give the actuator rates q~_dot = (J_q_b + alpha_b) b_dot,
//! which is the right inverse of J~ = (I + J alpha)^-1 J, Eq. (26).
//!
//! Intuition: in the bend vector nothing is singular at the straight pose; far out, where the tip moves mostly along
//! itself, damping keeps the rates small. What the snake cannot do (twist, advance) is left out, not approximated.
//!
//! Failure: no operator, no slave, stale samples. The setpoint then stands at once, as it does in the slave, which brakes the actuators
//! by itself: a setpoint that braked here and came back would turn the lines within their play, which they never did.

use crate::config::{GripperConfig, JointsConfig, ResolveConfig};
use crate::resolve_jaw::JawMotion;
use crate::step::{
    BridgeError, MAX_TIP_VEL_M_PER_S, Refused, Step, check_hand, check_order_and_numbers, reasons_to_hold,
    seconds_between, stamps_begun, step_s, tell_resolve_ages,
};
use crate::{Feed, JointMachine, JointResolveCore, LiveModel, SegmentResolveCore, feed};
use core::sync::atomic::AtomicBool;
use krait_ipc::message::{Health, MAX_JOINTS, OperatorInput, Phase, Setpoint, SlaveState, lines as three_lines};
use krait_ipc::{Bus, Process, Reason, Reasons};
use krait_model::{Chain, ChainCompensator, Circumstances, ModelHash, Snake};
use nalgebra::{Rotation3, Vector2, Vector3};

/// The setpoint takes over the slave's own when they are further apart than this, rad (0.1 deg).
pub(crate) const RESEED_RAD: f64 = 1.7e-3;
/// A setpoint that moves slower than this has come to rest, rad/s.
pub(crate) const REST_RAD_PER_S: f64 = 1e-6;

/// The pure step of `resolve`.
#[derive(Clone, Debug)]
pub struct ResolveCore {
    snake: Snake,
    lines: ChainCompensator,
    model: ModelHash,
    config: ResolveConfig,
    base_from_view: Rotation3<f64>,
    state: Option<SlaveState>,
    memory: Memory,
    jaw: Option<JawMotion>,
}

/// What one step leaves to the next, beside the lines' own memory.
#[derive(Clone, Copy, Debug)]
struct Memory {
    bend: Vector2<f64>,
    bend_vel: Vector2<f64>,
    phase: Phase,
    sequence: u64,
    first_ns: Option<i64>,
    before_ns: Option<i64>,
}

impl ResolveCore {
    /// A setpoint at rest in the straight pose. The chain says how fast the actuators will have to move, with the values
    /// that its model file begins with (for the velocity forecast only; positions are `compensate`'s).
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range, [`BridgeError::Chain`] for a chain that cannot be inverted.
    pub fn new(chain: &Chain, config: ResolveConfig) -> Result<Self, BridgeError> {
        config.check()?;
        Ok(Self {
            snake: Snake::new(chain.machine())?,
            lines: chain.compensator()?,
            model: chain.hash(),
            config,
            base_from_view: Rotation3::from_axis_angle(&Vector3::z_axis(), config.view_roll_rad),
            state: None,
            memory: Memory {
                bend: Vector2::zeros(),
                bend_vel: Vector2::zeros(),
                phase: Phase::Holding,
                sequence: 0,
                first_ns: None,
                before_ns: None,
            },
            jaw: chain.gripper().map(|gripper| JawMotion::new(gripper, GripperConfig::default())),
        })
    }

    /// The same with a gripper that is driven so; without one nothing changes.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range.
    pub fn with_gripper(self, chain: &Chain, config: GripperConfig) -> Result<Self, BridgeError> {
        config.check()?;
        Ok(Self { jaw: chain.gripper().map(|gripper| JawMotion::new(gripper, config)), ..self })
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
    /// No allocation, no clock (`begun_ns` is an argument), no loop longer than three lines of a snake.
    pub fn step(&mut self, input: &OperatorInput, begun_ns: i64) -> Result<Setpoint, Refused> {
        let velocity = Vector3::from(input.tip_vel_in_view_m_per_s);
        check_order_and_numbers(self.memory.before_ns, input.sample_ns, velocity.as_slice())?;
        if velocity.amax() > MAX_TIP_VEL_M_PER_S {
            return Err(Refused { reason: Reason::OutOfRange, found: velocity.amax(), limit: MAX_TIP_VEL_M_PER_S });
        }
        if self.jaw.is_some() {
            check_hand(self.memory.before_ns, input)?;
        }
        let step_s = step_s(self.memory.before_ns, input.sample_ns);
        self.memory.before_ns = Some(input.sample_ns);

        let mut reasons = reasons_to_hold(&self.config, self.state.as_ref(), input, begun_ns);
        self.memory.phase = if reasons.is_empty() { Phase::Following } else { Phase::Holding };
        if self.memory.phase == Phase::Holding {
            self.memory.bend_vel = Vector2::zeros();
        }
        self.reseed_at_rest();
        let (wanted, motion_scale) = match self.memory.phase {
            Phase::Following => self.limited(self.base_from_view * velocity, &mut reasons),
            Phase::Holding => (Vector2::zeros(), 0.0),
        };
        self.advance(wanted, step_s);
        if let Some(jaw) = &mut self.jaw {
            jaw.step(input, self.state.as_ref(), self.memory.phase == Phase::Following, step_s, &mut reasons);
        }
        let mut setpoint = self.setpoint(input, begun_ns, motion_scale, reasons);
        if let Some(jaw) = &self.jaw {
            jaw.add_to(&mut setpoint);
        }
        Ok(setpoint)
    }

    /// Does what [`ResolveCore::step`] does and forgets it, so that the processor has at hand what the next step needs.
    pub fn warm_up(&mut self, input: &OperatorInput, begun_ns: i64) {
        let (memory, lines) = (self.memory, self.lines.memory());
        let jaw = self.jaw.as_ref().map(JawMotion::memory);
        let _forgotten = core::hint::black_box(self.step(input, begun_ns));
        self.memory = memory;
        if let (Some(own), Some(jaw)) = (&mut self.jaw, jaw) {
            own.restore(jaw);
        }
        self.lines.restore(&lines);
    }

    /// At rest, the setpoint is the slave's own: after a restart, a fault or a stop that the slave made by itself, the first
    /// motion starts from where the actuators were told to be.
    fn reseed_at_rest(&mut self) {
        let Some(state) = &self.state else { return };
        let slave_bend = Vector2::from(state.setpoint_bend_rad);
        let at_rest = self.memory.bend_vel.norm() < REST_RAD_PER_S;
        let not_ours = state.flags & SlaveState::FOLLOWING == 0;
        if at_rest
            && not_ours
            && slave_bend.norm() <= self.config.max_bend_rad
            && (slave_bend - self.memory.bend).norm() > RESEED_RAD
        {
            self.memory.bend = slave_bend;
        }
    }

    /// The bend rate for a tip velocity, within the limits; the second value is the common scale that they asked for.
    fn limited(&self, tip_vel_in_base: Vector3<f64>, reasons: &mut Reasons) -> (Vector2<f64>, f64) {
        let rate = self.snake.bend_rate_for_tip_velocity(
            self.memory.bend,
            tip_vel_in_base,
            self.config.axial_weight,
            self.config.damping_m_per_rad,
        );
        reasons.insert_if(
            Reason::NearSingular,
            rate.smallest_singular_value_m_per_rad < 4.0 * self.config.damping_m_per_rad,
        );
        let mut bend_vel = rate.bend_vel_rad_per_s;
        let mut scale = 1.0;
        let speed = bend_vel.norm();
        if speed > self.config.max_bend_vel_rad_per_s {
            scale = self.config.max_bend_vel_rad_per_s / speed;
            bend_vel *= scale;
            reasons.insert(Reason::BendRateLimit);
        }
        let config = &self.config;
        let slid = slid_along_bend_limit(self.memory.bend, bend_vel, config.max_bend_rad, config.bend_margin_rad);
        reasons.insert_if(Reason::BendLimit, slid.is_some());
        (slid.unwrap_or(bend_vel), scale)
    }

    fn advance(&mut self, wanted: Vector2<f64>, step_s: f64) {
        let change = wanted - self.memory.bend_vel;
        let largest = self.config.max_bend_accel_rad_per_s2 * step_s;
        self.memory.bend_vel += if change.norm() > largest { change * (largest / change.norm()) } else { change };
        self.memory.bend += self.memory.bend_vel * step_s;
        let bend_rad = self.memory.bend.norm();
        if bend_rad > self.config.max_bend_rad {
            self.memory.bend *= self.config.max_bend_rad / bend_rad;
        }
    }

    fn setpoint(&mut self, input: &OperatorInput, begun_ns: i64, motion_scale: f64, reasons: Reasons) -> Setpoint {
        self.memory.sequence += 1;
        let first_ns = *self.memory.first_ns.get_or_insert(input.sample_ns);
        let at = Circumstances::at(seconds_between(first_ns, input.sample_ns));
        let lines = self.lines.step(self.memory.bend, &at);
        let q_tilde_vel: Vector3<f64> = (self.snake.j_q_bend() + lines.alpha_m_per_rad) * self.memory.bend_vel;
        Setpoint {
            sequence: self.memory.sequence,
            sample_ns: input.sample_ns,
            stamps: stamps_begun(&input.stamps, |s| s.resolve_begun_ns = begun_ns),
            input_sequence: input.sequence,
            state_sequence: self.state.map_or(0, |s| s.sequence),
            bend_rad: self.memory.bend.into(),
            bend_vel_rad_per_s: self.memory.bend_vel.into(),
            joints_rad: [0.0; MAX_JOINTS],
            joints_vel_rad_per_s: [0.0; MAX_JOINTS],
            q_tilde_vel_m_per_s: three_lines(q_tilde_vel.into()),
            n_actuators: 0,
            n_joints: 0,
            tip_pos_in_base_m: self.snake.tip_pos_in_base_m(self.memory.bend).into(),
            motion_scale,
            model_hash: self.model.0,
            phase: self.memory.phase as u32,
            reserved: 0,
            reasons: reasons.bits(),
        }
    }
}

/// A bend's rate with its outward part faded out near the bend limit, rad/s; turning the plane and coming back stay free. `None`: as it
/// was.
pub(crate) fn slid_along_bend_limit(
    bend_rad: Vector2<f64>,
    bend_vel: Vector2<f64>,
    limit_rad: f64,
    margin_rad: f64,
) -> Option<Vector2<f64>> {
    let outward = bend_rad.try_normalize(1e-9)?;
    let outward_vel = bend_vel.dot(&outward);
    let room = ((limit_rad - bend_rad.norm()) / margin_rad).clamp(0.0, 1.0);
    (outward_vel > 0.0 && room < 1.0).then(|| bend_vel - outward * (outward_vel * (1.0 - room)))
}

impl Step for ResolveCore {
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

/// The process `krait resolve`: runs until told to stop.
///
/// # Errors
/// [`BridgeError::NoCue`] or [`BridgeError::NotThere`] when a replay contradicts itself.
/// [`BridgeError`] when a channel fails, the configuration is out of range or does not fit the model.
pub fn run_resolve(
    bus: &Bus,
    model: &LiveModel,
    config: ResolveConfig,
    joints: &JointsConfig,
    gripper: GripperConfig,
    feed: Feed,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    match model {
        LiveModel::Snake(chain) => {
            let core = ResolveCore::new(chain, config)?.with_gripper(chain, gripper)?;
            feed::run(feed, bus, Process::Resolve, config.wait, core, stop)
        }
        LiveModel::Joints(model) => {
            let machine = JointMachine::new(model, joints)?;
            feed::run(feed, bus, Process::Resolve, config.wait, JointResolveCore::new(&machine, config)?, stop)
        }
        LiveModel::Segments(model) => {
            feed::run(feed, bus, Process::Resolve, config.wait, SegmentResolveCore::new(model, config)?, stop)
        }
    }
}
