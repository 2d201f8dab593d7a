//! Actuation compensation: the setpoint's q becomes the actuators' q~ = q + eps, within the limits, and never with a jump.
//!
//! Problem: q~ = q + eps(b; memory and values of the model file's chain); with every change of a learnt value, every
//! engagement and every restart spread over time.
//!
//! Failure: stale or foreign samples. The command then repeats the last one, with the reasons named.

use crate::blend::Blend;
use crate::compensate_jaw::{JawStep, JawWire};
use crate::config::{CompensateConfig, JointsConfig};
use crate::mismatch::{Mismatch, Seen};
use crate::reach::{Reach, Wish};
use crate::step::{
    BridgeError, Refused, Step, check_age, check_model, check_order_and_numbers, seconds_between, stamps_begun, step_s,
    tell_compensate_ages,
};
use crate::{Feed, JointCompensateCore, JointMachine, LiveModel, SegmentCompensateCore, feed};
use core::sync::atomic::AtomicBool;
use krait_ipc::message::{
    Command, Health, JAW, MAX_JOINTS, ModelUpdate, N_LINES, Phase, Setpoint, SlaveState, lines as three_lines,
    n_actuators, n_of_snake,
};
use krait_ipc::{Bus, Process, Reason, Reasons};
use krait_model::{Chain, ChainCompensator, Circumstances, ModelHash};
use nalgebra::Vector2;

/// Largest bend that a setpoint may ask for, rad: the model holds to 90 deg and a little.
const MAX_BEND_RAD: f64 = 1.65;

/// The pure step of `compensate`.
#[derive(Clone, Debug)]
pub struct CompensateCore {
    lines: ChainCompensator,
    blend: Blend,
    model: ModelHash,
    config: CompensateConfig,
    state: Option<SlaveState>,
    mismatch: Mismatch,
    memory: Memory,
    jaw: Option<JawWire>,
    n_actuators: usize,
}

/// What one step leaves to the next, beside the lines' own memory.
#[derive(Clone, Copy, Debug, Default)]
struct Memory {
    reach: Reach<N_LINES>,
    sequence: u64,
    first_ns: Option<i64>,
    before_ns: Option<i64>,
    mismatch: Seen,
}

impl CompensateCore {
    /// A compensator in the straight pose, with the values that the model file begins with.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range, [`BridgeError::Chain`] for a chain that cannot be inverted.
    pub fn new(chain: &Chain, config: CompensateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        Ok(Self {
            lines: chain.compensator()?,
            blend: Blend::new(chain.learnt()),
            model: chain.hash(),
            config,
            state: None,
            mismatch: Mismatch::of_snake(chain, &config),
            memory: Memory::default(),
            jaw: chain.gripper().map(|gripper| JawWire::new(gripper, &config)).transpose()?,
            n_actuators: n_of_snake(chain.gripper().is_some()),
        })
    }

    /// Notes the newest slave state; it counts from the next step on, and that step names it.
    pub fn note_state(&mut self, state: &SlaveState) {
        self.state = Some(*state);
    }

    /// Notes a model update; it is blended in from the next step on, and every step names the newest.
    ///
    /// # Errors
    /// [`Refused`] for an update of another model, and for numbers that are not finite or out of bounds; the update before
    /// stays in force.
    pub fn note_update(&mut self, update: &ModelUpdate) -> Result<(), Refused> {
        self.blend.note(self.model, update)
    }

    /// One step for one setpoint.
    ///
    /// # Errors
    /// [`Refused`] for numbers that are not finite or out of range, and for a stamp that does not follow the one before.
    ///
    /// # Real-time
    /// No allocation, no clock (`begun_ns` is an argument), no loop longer than the three lines.
    pub fn step(&mut self, setpoint: &Setpoint, begun_ns: i64) -> Result<Command, Refused> {
        check_model(self.model, setpoint.model_hash)?;
        check_order_and_numbers(self.memory.before_ns, setpoint.sample_ns, &setpoint.bend_rad)?;
        let bend = Vector2::from(setpoint.bend_rad);
        if bend.norm() > MAX_BEND_RAD {
            return Err(Refused { reason: Reason::OutOfRange, found: bend.norm(), limit: MAX_BEND_RAD });
        }
        self.check_gripper(setpoint)?;
        let step_s = step_s(self.memory.before_ns, setpoint.sample_ns);
        self.memory.before_ns = Some(setpoint.sample_ns);

        let mut reasons = Reasons::from_bits(setpoint.reasons);
        if let Some(values) = self.blend.next(self.lines.learnt(), self.config.blend_sds_per_s, step_s) {
            self.lines.set_learnt(&values);
            reasons.insert(Reason::ModelBlending);
        }
        let fresh = check_age(&self.config, self.state.as_ref(), setpoint, begun_ns, &mut reasons);
        let found_rad = self.blend.innovation_rms_rad();
        let trips = self.mismatch.trips(&mut self.memory.mismatch, found_rad, setpoint.sample_ns, &mut reasons);
        let first_ns = *self.memory.first_ns.get_or_insert(setpoint.sample_ns);
        let at = Circumstances::at(seconds_between(first_ns, setpoint.sample_ns));
        let n_faults = self.lines.n_formula_faults();
        let lines = self.lines.step(bend, &at);
        let mut is_finite = self.lines.n_formula_faults() == n_faults;
        if let Some(jaw) = &mut self.jaw {
            let step = JawStep { at: &at, state: self.state.as_ref(), is_fresh: fresh && is_finite, step_s };
            is_finite &= jaw.step(setpoint, &step, &self.config, &mut reasons);
        }
        reasons.insert_if(Reason::FormulaFault, !is_finite);
        let wish = Wish {
            raw_m: lines.q_tilde_m,
            load_n: lines.tau_n.amax(),
            state: self.state.as_ref(),
            is_fresh: fresh && is_finite,
            step_s,
        };
        let q_tilde_m = self.memory.reach.command(&wish, &self.config, &mut reasons);
        self.memory.sequence += 1;
        let mut command = Command {
            sequence: self.memory.sequence,
            sample_ns: setpoint.sample_ns,
            stamps: stamps_begun(&setpoint.stamps, |s| s.compensate_begun_ns = begun_ns),
            setpoint_sequence: setpoint.sequence,
            input_sequence: setpoint.input_sequence,
            state_sequence: self.state.map_or(0, |s| s.sequence),
            model_update_sequence: self.blend.update_sequence(),
            bend_rad: setpoint.bend_rad,
            joints_rad: [0.0; MAX_JOINTS],
            q_uncompensated_m: three_lines(lines.q_m.into()),
            q_tilde_m: three_lines(q_tilde_m.into()),
            n_actuators: 0,
            n_joints: 0,
            q_tilde_vel_m_per_s: setpoint.q_tilde_vel_m_per_s,
            model_hash: self.model.0,
            learnt: *self.lines.learnt(),
            n_learnt: self.blend.n_learnt(),
            phase: if fresh && is_finite && !trips { setpoint.phase } else { Phase::Holding as u32 },
            reasons: reasons.bits(),
        };
        if let Some(jaw) = &self.jaw {
            jaw.add_to(setpoint, &mut command);
        }
        Ok(command)
    }

    /// A setpoint for a gripper that the model has not, or without the one that it has, is of another machine.
    fn check_gripper(&self, setpoint: &Setpoint) -> Result<(), Refused> {
        let found = n_actuators(setpoint.n_actuators);
        if found != self.n_actuators {
            return Err(Refused { reason: Reason::OutOfRange, found: found as f64, limit: self.n_actuators as f64 });
        }
        let jaw_rad = setpoint.joints_rad[JAW];
        if jaw_rad.is_finite() {
            Ok(())
        } else {
            Err(Refused { reason: Reason::NotFinite, found: jaw_rad, limit: f64::MAX })
        }
    }

    /// Does what [`CompensateCore::step`] does and forgets it, so that the processor has at hand what the next step needs.
    /// No step comes out differently for it.
    pub fn warm_up(&mut self, setpoint: &Setpoint, begun_ns: i64) {
        let (memory, lines) = (self.memory, self.lines.memory());
        self.jaw.iter_mut().for_each(JawWire::keep);
        let _forgotten = core::hint::black_box(self.step(setpoint, begun_ns));
        self.memory = memory;
        self.jaw.iter_mut().for_each(JawWire::forget);
        self.lines.restore(&lines);
    }
}

impl Step for CompensateCore {
    type In = Setpoint;
    type Out = Command;
    const TAKES_UPDATES: bool = true;

    fn note_state(&mut self, state: &SlaveState) {
        Self::note_state(self, state);
    }

    fn note_update(&mut self, update: &ModelUpdate) -> Result<(), Refused> {
        Self::note_update(self, update)
    }

    fn step(&mut self, setpoint: &Setpoint, begun_ns: i64) -> Result<Command, Refused> {
        Self::step(self, setpoint, begun_ns)
    }

    fn tell(&self, setpoint: &Setpoint, begun_ns: i64, reasons: Reasons, health: &mut Health) {
        tell_compensate_ages(&self.config, self.state.as_ref(), setpoint, begun_ns, reasons, health);
        self.mismatch.tell(self.blend.innovation_rms_rad(), reasons, health);
    }

    fn warm_up(&mut self, setpoint: &Setpoint, now_ns: i64) {
        Self::warm_up(self, setpoint, now_ns);
    }
}

/// The process `krait compensate`: runs until told to stop.
///
/// # Errors
/// [`BridgeError::NoCue`] or [`BridgeError::NotThere`] when a replay contradicts itself.
/// [`BridgeError`] when a channel fails, the configuration is out of range or does not fit the model, or the model cannot be
/// inverted.
pub fn run_compensate(
    bus: &Bus,
    model: &LiveModel,
    config: CompensateConfig,
    joints: &JointsConfig,
    feed: Feed,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    match model {
        LiveModel::Snake(chain) => {
            feed::run(feed, bus, Process::Compensate, config.wait, CompensateCore::new(chain, config)?, stop)
        }
        LiveModel::Joints(model) => {
            let machine = JointMachine::new(model, joints)?;
            feed::run(feed, bus, Process::Compensate, config.wait, JointCompensateCore::new(&machine, config)?, stop)
        }
        LiveModel::Segments(model) => {
            feed::run(feed, bus, Process::Compensate, config.wait, SegmentCompensateCore::new(model, config)?, stop)
        }
    }
}
