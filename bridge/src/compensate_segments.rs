//! Actuation compensation of segments in series: wanted bends become positions of all lines, within the limits, and never with a
//! jump.
//!
//! Problem: q~ = q + eps(b; memory of the model's effects) for each line, by [`krait_model::segments::SegmentCompensator`].
//!
//! Failure: stale or foreign samples, and bends that no loads within the lines' bounds hold. The command then repeats the last one,
//! with the reasons named.

use crate::blend::Blend;
use crate::config::CompensateConfig;
use crate::live_model::SegmentModel;
use crate::mismatch::{Mismatch, Seen};
use crate::reach::{Reach, Wish};
use crate::resolve_segments::{bend_of, of_lanes};
use crate::step::{
    BridgeError, Refused, Step, check_age, check_joints, check_model, stamps_begun, step_s, tell_compensate_ages,
};
use krait_ipc::message::{Command, Health, MAX_ACTUATORS, ModelUpdate, Phase, Setpoint, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::ModelHash;
use krait_model::segments::{MAX_LINES, SegmentCompensator, SegmentStatus, Segments};

const _: () = assert!(MAX_LINES == MAX_ACTUATORS);

/// The pure step of `compensate` for segments.
#[derive(Clone, Debug)]
pub struct SegmentCompensateCore {
    machine: Segments,
    lines: SegmentCompensator,
    blend: Blend,
    model: ModelHash,
    config: CompensateConfig,
    state: Option<SlaveState>,
    mismatch: Mismatch,
    memory: Memory,
}

/// What one step leaves to the next, beside the lines' own memory.
#[derive(Clone, Copy, Debug, Default)]
struct Memory {
    reach: Reach<MAX_ACTUATORS>,
    sequence: u64,
    before_ns: Option<i64>,
    mismatch: Seen,
}

impl SegmentCompensateCore {
    /// A compensator in the straight pose, with the values that the model file begins with.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range.
    pub fn new(model: &SegmentModel, config: CompensateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        Ok(Self {
            machine: model.chain().machine().clone(),
            lines: model.chain().compensator(),
            blend: Blend::new(model.chain().learnt()),
            model: model.hash(),
            config,
            state: None,
            mismatch: Mismatch::of_segments(model, &config),
            memory: Memory::default(),
        })
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
        self.blend.note(self.model, update)
    }

    /// One step for one setpoint.
    ///
    /// # Errors
    /// [`Refused`] for numbers that are not finite, for another model or number of bends, for a bend beyond the strain limit, and for
    /// a stamp that does not follow the one before.
    ///
    /// # Real-time
    /// No allocation, no clock (`begun_ns` is an argument); loops over lines and segments, and a bounded search for the loads.
    pub fn step(&mut self, setpoint: &Setpoint, begun_ns: i64) -> Result<Command, Refused> {
        let (n_bends, n_lines) = (self.machine.n_bends(), self.machine.n_lines());
        check_model(self.model, setpoint.model_hash)?;
        check_joints(self.memory.before_ns, setpoint, n_bends)?;
        let bends = of_lanes(&setpoint.joints_rad, n_bends);
        for segment in 0..self.machine.n() {
            let (found, limit) = (bend_of(&bends, segment).norm(), self.machine.max_bend_rad(segment));
            if found > limit {
                return Err(Refused { reason: Reason::OutOfRange, found, limit });
            }
        }
        let step_s = step_s(self.memory.before_ns, setpoint.sample_ns);
        self.memory.before_ns = Some(setpoint.sample_ns);

        let mut reasons = Reasons::from_bits(setpoint.reasons);
        if let Some(values) = self.blend.next(self.lines.learnt(), self.config.blend_sds_per_s, step_s) {
            self.lines.set_learnt(&values);
            reasons.insert(Reason::ModelBlending);
        }
        let is_fresh = check_age(&self.config, self.state.as_ref(), setpoint, begun_ns, &mut reasons);
        let found_rad = self.blend.innovation_rms_rad();
        let trips = self.mismatch.trips(&mut self.memory.mismatch, found_rad, setpoint.sample_ns, &mut reasons);
        let lines = self.lines.step(&bends);
        reasons.insert_if(Reason::ForceLimit, matches!(lines.status, SegmentStatus::Held(_)));
        let wish =
            Wish { raw_m: lines.q_tilde_m, load_n: lines.tau_n.amax(), state: self.state.as_ref(), is_fresh, step_s };
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
            q_uncompensated_m: self.machine.q_m(&bends).into(),
            q_tilde_m: q_tilde_m.into(),
            q_tilde_vel_m_per_s: setpoint.q_tilde_vel_m_per_s,
            n_actuators: n_lines as u32,
            n_joints: n_bends as u32,
            model_hash: self.model.0,
            learnt: *self.lines.learnt(),
            n_learnt: self.blend.n_learnt(),
            phase: if is_fresh && !trips { setpoint.phase } else { Phase::Holding as u32 },
            reasons: reasons.bits(),
        })
    }

    /// Does what [`SegmentCompensateCore::step`] does and forgets it. No step comes out differently for it.
    pub fn warm_up(&mut self, setpoint: &Setpoint, begun_ns: i64) {
        let (memory, lines) = (self.memory, self.lines.memory());
        let _forgotten = core::hint::black_box(self.step(setpoint, begun_ns));
        self.memory = memory;
        self.lines.restore(&lines);
    }
}

impl Step for SegmentCompensateCore {
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
