//! Resolved-rate motion of segments in series: the operator's twist becomes the rates of all bends, and these the setpoint.
//!
//! Problem: find bend rates b_dot with J_x(b) b_dot = v, where v is the tip's twist in the base frame, 6x1, and J_x its Jacobian,
//! 6x(2 segments), in the damped least squares of [`krait_model::segments::Segments::bend_rates`]; integrate within every segment's
//! largest bend; give the actuator rates q~_dot = (J + alpha) b_dot.
//!
//! Intuition: a hand that pushes sideways gets that, and what freedom is left turns the tip as the hand turns. Bends that no loads
//! within the lines' bounds hold are not gone to: the setpoint stands at their border, and every way back is free.
//!
//! Failure: as in `resolve` of a snake; the setpoint then stands at once, as the slave does.

use crate::config::ResolveConfig;
use crate::live_model::SegmentModel;
use crate::resolve::{RESEED_RAD, REST_RAD_PER_S, slid_along_bend_limit};
use crate::step::{BridgeError, Refused, Step, check_hand, reasons_to_hold, stamps_begun, step_s, tell_resolve_ages};
use krait_ipc::message::{Health, JointValues, MAX_JOINTS, OperatorInput, Phase, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::ModelHash;
use krait_model::segments::{
    Bends, MAX_BENDS, MAX_SEGMENTS, SegmentChain, SegmentCompensator, SegmentRateWeights, SegmentStatus, TwistByBends,
};
use nalgebra::{Rotation3, Vector2, Vector3, Vector6};

/// The pure step of `resolve` for segments.
#[derive(Clone, Debug)]
pub struct SegmentResolveCore {
    chain: SegmentChain,
    lines: SegmentCompensator,
    model: ModelHash,
    config: ResolveConfig,
    weights: SegmentRateWeights,
    base_from_view: Rotation3<f64>,
    /// Largest bend of each segment, rad.
    max_bend_rad: [f64; MAX_SEGMENTS],
    state: Option<SlaveState>,
    memory: Memory,
}

/// What one step leaves to the next, beside the lines' own memory.
#[derive(Clone, Copy, Debug)]
struct Memory {
    bends: Bends,
    /// Tip position in the base frame, m, and Jacobian at the bends.
    tip: (Vector3<f64>, TwistByBends),
    bends_vel: Bends,
    phase: Phase,
    sequence: u64,
    before_ns: Option<i64>,
}

impl SegmentResolveCore {
    /// A setpoint at rest in the straight pose.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range.
    pub fn new(model: &SegmentModel, config: ResolveConfig) -> Result<Self, BridgeError> {
        config.check()?;
        Ok(Self {
            chain: model.chain().clone(),
            lines: model.chain().compensator(),
            model: model.hash(),
            weights: SegmentRateWeights {
                axial: config.axial_weight,
                turn_m_per_rad: config.turn_m_per_rad,
                damping_m_per_rad: config.damping_m_per_rad,
            },
            base_from_view: Rotation3::from_axis_angle(&Vector3::z_axis(), config.view_roll_rad),
            max_bend_rad: model.max_bend_rad(&config),
            config,
            state: None,
            memory: Memory {
                bends: Bends::zeros(),
                tip: model.chain().machine().tip(&Bends::zeros()),
                bends_vel: Bends::zeros(),
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
    /// No allocation, no clock (`begun_ns` is an argument), loops over lines and segments and bounded searches.
    pub fn step(&mut self, input: &OperatorInput, begun_ns: i64) -> Result<Setpoint, Refused> {
        let [vx, vy, vz, wx, wy, wz] = check_hand(self.memory.before_ns, input)?;
        let step_s = step_s(self.memory.before_ns, input.sample_ns);
        self.memory.before_ns = Some(input.sample_ns);

        let mut reasons = reasons_to_hold(&self.config, self.state.as_ref(), input, begun_ns);
        self.memory.phase = if reasons.is_empty() { Phase::Following } else { Phase::Holding };
        if self.memory.phase == Phase::Holding {
            self.memory.bends_vel = Bends::zeros();
        }
        self.reseed_at_rest();
        let (wanted, motion_scale) = match self.memory.phase {
            Phase::Following => {
                let v = self.base_from_view * Vector3::new(vx, vy, vz);
                let w = self.base_from_view * Vector3::new(wx, wy, wz);
                self.limited(&Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z), &mut reasons)
            }
            Phase::Holding => (Bends::zeros(), 0.0),
        };
        self.advance(&wanted, step_s, &mut reasons);
        Ok(self.setpoint(input, begun_ns, motion_scale, reasons))
    }

    /// Does what [`SegmentResolveCore::step`] does and forgets it.
    pub fn warm_up(&mut self, input: &OperatorInput, begun_ns: i64) {
        let (memory, lines) = (self.memory, self.lines.memory());
        let _forgotten = core::hint::black_box(self.step(input, begun_ns));
        self.memory = memory;
        self.lines.restore(&lines);
    }

    /// At rest, the setpoint is the slave's own, as with a snake.
    fn reseed_at_rest(&mut self) {
        let Some(state) = &self.state else { return };
        let is_at_rest = self.memory.bends_vel.amax() < REST_RAD_PER_S;
        let is_ours = state.flags & SlaveState::FOLLOWING != 0;
        if !is_at_rest || is_ours {
            return;
        }
        let own = of_lanes(&state.setpoint_joints_rad, self.chain.machine().n_bends());
        let is_allowed = (0..MAX_SEGMENTS).all(|segment| bend_of(&own, segment).norm() <= self.max_bend_rad[segment]);
        if is_allowed && (own - self.memory.bends).amax() > RESEED_RAD {
            self.memory.bends = own;
            self.memory.tip = self.chain.machine().tip(&own);
        }
    }

    /// The rates of all bends for a twist of the tip, within the limits; the second value is the common scale that they asked for.
    fn limited(&self, twist_in_base: &Vector6<f64>, reasons: &mut Reasons) -> (Bends, f64) {
        let rate = self.chain.machine().bend_rates(&self.memory.tip.1, twist_in_base, &self.weights);
        reasons.insert_if(Reason::NearSingular, rate.is_near_singular);
        let mut vel = rate.bends_vel_rad_per_s;
        let fastest = fastest(&vel);
        let mut scale = 1.0;
        if fastest > self.config.max_bend_vel_rad_per_s {
            scale = self.config.max_bend_vel_rad_per_s / fastest;
            vel *= scale;
            reasons.insert(Reason::BendRateLimit);
        }
        for segment in 0..self.chain.machine().n() {
            let (bend, own) = (bend_of(&self.memory.bends, segment), bend_of(&vel, segment));
            let (limit_rad, margin_rad) = (self.max_bend_rad[segment], self.config.bend_margin_rad);
            if let Some(slid) = slid_along_bend_limit(bend, own, limit_rad, margin_rad) {
                reasons.insert(Reason::BendLimit);
                vel.fixed_rows_mut::<2>(2 * segment).copy_from(&slid);
            }
        }
        (vel, scale)
    }

    /// Moves the setpoint on, unless no loads within the lines' bounds hold the segments there.
    fn advance(&mut self, wanted: &Bends, step_s: f64, reasons: &mut Reasons) {
        let before = self.memory.bends;
        let change = wanted - self.memory.bends_vel;
        let (sharpest, largest) = (fastest(&change), self.config.max_bend_accel_rad_per_s2 * step_s);
        self.memory.bends_vel += if sharpest > largest { change * (largest / sharpest) } else { change };
        self.memory.bends += self.memory.bends_vel * step_s;
        for segment in 0..self.chain.machine().n() {
            let (bend_rad, limit_rad) = (bend_of(&self.memory.bends, segment).norm(), self.max_bend_rad[segment]);
            if bend_rad > limit_rad {
                let mut own = self.memory.bends.fixed_rows_mut::<2>(2 * segment);
                own *= limit_rad / bend_rad;
            }
        }
        if matches!(self.lines.step(&self.memory.bends).status, SegmentStatus::Held(_)) {
            reasons.insert(Reason::ForceLimit);
            (self.memory.bends, self.memory.bends_vel) = (before, Bends::zeros());
        }
    }

    fn setpoint(&mut self, input: &OperatorInput, begun_ns: i64, motion_scale: f64, reasons: Reasons) -> Setpoint {
        self.memory.sequence += 1;
        let machine = self.chain.machine();
        let (bends, bends_vel) = (self.memory.bends, self.memory.bends_vel);
        self.memory.tip = machine.tip(&bends);
        let q_tilde_vel = self.lines.rates_m_per_s(&bends_vel);
        Setpoint {
            sequence: self.memory.sequence,
            sample_ns: input.sample_ns,
            stamps: stamps_begun(&input.stamps, |s| s.resolve_begun_ns = begun_ns),
            input_sequence: input.sequence,
            state_sequence: self.state.map_or(0, |s| s.sequence),
            bend_rad: [f64::NAN; 2],
            bend_vel_rad_per_s: [f64::NAN; 2],
            joints_rad: in_lanes(&bends),
            joints_vel_rad_per_s: in_lanes(&bends_vel),
            q_tilde_vel_m_per_s: q_tilde_vel.into(),
            tip_pos_in_base_m: self.memory.tip.0.into(),
            motion_scale,
            model_hash: self.model.0,
            phase: self.memory.phase as u32,
            reserved: 0,
            n_actuators: machine.n_lines() as u32,
            n_joints: machine.n_bends() as u32,
            reasons: reasons.bits(),
        }
    }
}

const _: () = assert!(MAX_BENDS <= MAX_JOINTS);

/// So many bends of a message, where joints stand; zeros behind the last.
pub(crate) fn of_lanes(values: &JointValues, n_bends: usize) -> Bends {
    Bends::from_fn(|k, _| if k < n_bends { values[k] } else { 0.0 })
}

/// Bends as the messages carry them.
fn in_lanes(bends: &Bends) -> JointValues {
    let mut lanes = [0.0; MAX_JOINTS];
    lanes[..MAX_BENDS].copy_from_slice(bends.as_slice());
    lanes
}

/// The bend vector of a segment, from 0.
pub(crate) fn bend_of(bends: &Bends, segment: usize) -> Vector2<f64> {
    bends.fixed_rows::<2>(2 * segment).into_owned()
}

/// The largest of all segments' vectors.
fn fastest(vectors: &Bends) -> f64 {
    (0..MAX_SEGMENTS).fold(0.0, |most, segment| bend_of(vectors, segment).norm().max(most))
}

impl Step for SegmentResolveCore {
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
