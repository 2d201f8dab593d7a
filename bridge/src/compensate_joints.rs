//! Actuation compensation of joints: wanted positions become lengths of cable, within the limits, and never with a jump.
//!
//! Problem: u such that y(u; memory of the model's effects) is what is wanted; q~ = u in metres of cable.
//!
//! Failure: stale or foreign samples. The command then repeats the last one, with the reasons named.

use crate::JointMachine;
use crate::blend::Blend;
use crate::config::CompensateConfig;
use crate::mismatch::{Mismatch, Seen};
use crate::reach::{Reach, Wish};
use crate::step::{
    BridgeError, Refused, Step, check_age, check_joints, check_model, seconds_between, stamps_begun, step_s,
    tell_compensate_ages,
};
use krait_ipc::message::{Command, Health, MAX_ACTUATORS, ModelUpdate, Phase, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::Circumstances;
use krait_model::joints::{JointCompensator, JointInverseSettings};
use nalgebra::SVector;

/// The pure step of `compensate` for joints.
#[derive(Clone, Debug)]
pub struct JointCompensateCore {
    machine: JointMachine,
    joints: JointCompensator,
    /// Where a warm-up step keeps what the joints remember.
    spare: JointCompensator,
    blend: Blend,
    config: CompensateConfig,
    state: Option<SlaveState>,
    mismatch: Mismatch,
    memory: Memory,
}

/// What one step leaves to the next, beside the joints' own memory.
#[derive(Clone, Copy, Debug, Default)]
struct Memory {
    reach: Reach<MAX_ACTUATORS>,
    sequence: u64,
    first_ns: Option<i64>,
    before_ns: Option<i64>,
    mismatch: Seen,
}

impl JointCompensateCore {
    /// A compensator at rest.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range, [`BridgeError::Chain`] for a chain that cannot be inverted.
    pub fn new(machine: &JointMachine, config: CompensateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        let joints = machine.model.chain.compensator(JointInverseSettings::default())?;
        let (spare, machine) = (joints.clone(), machine.clone());
        let blend = Blend::new(machine.model.chain.learnt());
        let mismatch = Mismatch::of_joints(&machine, &config);
        Ok(Self { machine, joints, spare, blend, config, state: None, mismatch, memory: Memory::default() })
    }

    /// Notes the newest slave state; it counts from the next step on, and that step names it.
    pub fn note_state(&mut self, state: &SlaveState) {
        self.state = Some(*state);
    }

    /// Notes a model update; it is blended in from the next step on, and every step names the newest.
    ///
    /// # Errors
    /// As [`crate::CompensateCore::note_update`].
    pub fn note_update(&mut self, update: &ModelUpdate) -> Result<(), Refused> {
        self.blend.note(self.machine.model.hash(), update)
    }

    /// One step for one setpoint.
    ///
    /// # Errors
    /// [`Refused`] for numbers that are not finite, for another model or number of joints, and for a stamp that does not
    /// follow the one before.
    ///
    /// # Real-time
    /// No allocation, no clock (`begun_ns` is an argument); the joints' inverse has a largest number of rounds.
    pub fn step(&mut self, setpoint: &Setpoint, begun_ns: i64) -> Result<Command, Refused> {
        let n = self.machine.model.n();
        check_model(self.machine.model.hash(), setpoint.model_hash)?;
        check_joints(self.memory.before_ns, setpoint, n)?;
        let step_s = step_s(self.memory.before_ns, setpoint.sample_ns);
        self.memory.before_ns = Some(setpoint.sample_ns);

        let mut reasons = Reasons::from_bits(setpoint.reasons);
        if let Some(values) = self.blend.next(self.joints.learnt(), self.config.blend_sds_per_s, step_s) {
            self.joints.set_learnt(&values);
            reasons.insert(Reason::ModelBlending);
        }
        let is_fresh = check_age(&self.config, self.state.as_ref(), setpoint, begun_ns, &mut reasons);
        let found = self.blend.innovation_rms_rad();
        let trips = self.mismatch.trips(&mut self.memory.mismatch, found, setpoint.sample_ns, &mut reasons);
        let first_ns = *self.memory.first_ns.get_or_insert(setpoint.sample_ns);
        let at = Circumstances::at(seconds_between(first_ns, setpoint.sample_ns));
        let wanted = self.machine.of_model(&setpoint.joints_rad);
        let wanted = &wanted[..n];
        let n_faults = self.joints.n_formula_faults();
        let found = self.joints.step(wanted, &at);
        let is_finite = self.joints.n_formula_faults() == n_faults;
        reasons.insert_if(Reason::FormulaFault, !is_finite);
        reasons.insert_if(Reason::JointUnreachable, !found.is_reachable);
        let wish = Wish {
            raw_m: SVector::from(self.machine.cable_m(&found.u)),
            load_n: 0.0,
            state: self.state.as_ref(),
            is_fresh: is_fresh && is_finite,
            step_s,
        };
        let q_tilde_m = self.memory.reach.command(&wish, &self.config, &mut reasons);
        self.memory.sequence += 1;
        Ok(Command {
            sequence: self.memory.sequence,
            sample_ns: setpoint.sample_ns,
            stamps: stamps_begun(&setpoint.stamps, |s| s.compensate_begun_ns = begun_ns),
            setpoint_sequence: setpoint.sequence,
            input_sequence: setpoint.input_sequence,
            state_sequence: self.state.map_or(0, |s| s.sequence),
            model_update_sequence: self.blend.update_sequence(),
            bend_rad: [f64::NAN; 2],
            joints_rad: setpoint.joints_rad,
            q_uncompensated_m: self.machine.cable_m(&self.joints.without_effects(wanted)),
            q_tilde_m: q_tilde_m.into(),
            q_tilde_vel_m_per_s: setpoint.q_tilde_vel_m_per_s,
            n_actuators: n as u32,
            n_joints: n as u32,
            model_hash: self.machine.model.hash().0,
            learnt: *self.joints.learnt(),
            n_learnt: self.blend.n_learnt(),
            phase: if is_fresh && is_finite && !trips { setpoint.phase } else { Phase::Holding as u32 },
            reasons: reasons.bits(),
        })
    }

    /// Does what [`JointCompensateCore::step`] does and forgets it. No step comes out differently for it.
    pub fn warm_up(&mut self, setpoint: &Setpoint, begun_ns: i64) {
        let memory = self.memory;
        self.spare.remember_as(&self.joints);
        let _forgotten = core::hint::black_box(self.step(setpoint, begun_ns));
        self.memory = memory;
        self.joints.remember_as(&self.spare);
    }
}

impl Step for JointCompensateCore {
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
