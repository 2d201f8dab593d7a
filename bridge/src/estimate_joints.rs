//! Learning while joints move: measured positions and the drives' readings become parameters of the model of joints.
//!
//! Problem: as in `estimate` of a snake; each joint is measured, and each drive's reading is its command carried out.
//!
//! Failure: shapes of another number of joints, without a state near their exposure, or with numbers that are not finite. Such
//! a shape is left out and counted. Nothing watches for changes of the machine here.

use crate::JointMachine;
use crate::config::EstimateConfig;
use crate::learning::{Estimator, is_silent, learnt_values};
use crate::pairing::Pairing;
use crate::step::{BridgeError, seconds_between};
use krait_ipc::message::{MAX_JOINTS, ModelUpdate, Shape, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::joints::{JointLearner, JointLearnerParameters, JointSight};
use krait_model::{Change, Circumstances, Learning};

/// Travel of a drive from which on its play is known to be taken up, and from which on a shape says something new, m.
const KNOWN_AFTER_M: f64 = 0.4e-3;
const REST_TRAVEL_M: f64 = 20e-6;

/// The pure step of `estimate` for joints.
#[derive(Clone, Debug)]
pub struct JointEstimateCore {
    machine: JointMachine,
    learner: JointLearner,
    config: EstimateConfig,
    seen: Pairing<JointSight>,
    paired_ns: Option<i64>,
    newest_shape_ns: Option<i64>,
    start_ns: Option<i64>,
    sequence: u64,
    state_sequence: u64,
    n_states: u64,
    n_used: u64,
    n_left_out: u64,
}

impl JointEstimateCore {
    /// An estimator that starts from the values of the model file.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range.
    pub fn new(machine: &JointMachine, config: EstimateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        let parameters = JointLearnerParameters {
            outlier_sigmas: config.outlier_sigmas,
            known_after: KNOWN_AFTER_M * machine.u_per_cable_m(),
            rest_travel: REST_TRAVEL_M * machine.u_per_cable_m(),
        };
        Ok(Self {
            learner: JointLearner::new(&machine.model.chain, parameters),
            machine: machine.clone(),
            config,
            seen: Pairing::new(),
            paired_ns: None,
            newest_shape_ns: None,
            start_ns: None,
            sequence: 0,
            state_sequence: 0,
            n_states: 0,
            n_used: 0,
            n_left_out: 0,
        })
    }

    /// Takes the drives' readings: the model follows them, also between two shapes.
    ///
    /// # Real-time
    /// No allocation, no clock.
    pub fn note_state(&mut self, state: &SlaveState) {
        (self.state_sequence, self.n_states) = (state.sequence, self.n_states + 1);
        let u = self.machine.u_of_cable(&state.measured_q_m);
        let u = &u[..self.machine.model.n()];
        if u.iter().all(|u| u.is_finite()) {
            let start_ns = *self.start_ns.get_or_insert(state.sample_ns);
            let at = Circumstances::at(seconds_between(start_ns, state.sample_ns));
            self.seen.note(state.sample_ns, self.learner.follow(u, &at));
        }
    }

    /// Takes a shape and proposes the parameters as they are after it.
    ///
    /// # Real-time
    /// No allocation, no clock; at most 256 stamps are compared.
    pub fn step(&mut self, shape: &Shape) -> ModelUpdate {
        self.newest_shape_ns = Some(shape.sample_ns);
        if self.learn(shape) == Some(Learning::Used) {
            self.n_used += 1;
        } else {
            self.n_left_out += 1;
        }
        self.sequence += 1;
        ModelUpdate {
            sequence: self.sequence,
            sample_ns: shape.sample_ns,
            shape_sequence: shape.sequence,
            state_sequence: self.state_sequence,
            n_states: self.n_states,
            model_hash: self.machine.model.hash().0,
            innovation_rms_rad: self.learner.innovation_rms() * self.machine.model.y.si,
            n_used: self.n_used,
            n_left_out: self.n_left_out,
            n_changes: 0,
            changed_ns: 0,
            change_kind: 0,
            is_watching: 0,
            n_learnt: self.learner.parameters().len() as u32,
            reserved: 0,
            learnt: learnt_values(self.learner.parameters(), |lane| self.learner.learnt(lane)),
        }
    }

    fn learn(&mut self, shape: &Shape) -> Option<Learning> {
        let is_next = self.paired_ns.is_none_or(|before_ns| shape.sample_ns > before_ns);
        let n = self.machine.model.n();
        shape.valid_joints_rad().filter(|joints| is_next && joints.len() == n)?;
        let seen = self.seen.at(shape.sample_ns, self.config.max_state_gap_ms)?;
        let dt_s = self.paired_ns.map_or(0.0, |before_ns| seconds_between(before_ns, shape.sample_ns));
        self.paired_ns = Some(shape.sample_ns);
        // Where the maker states no variance, the configuration's standard deviation counts.
        let usual = self.config.sigma_bend_rad * self.machine.si_per_rad();
        let stated = |variance: f64| if variance > 0.0 { variance.sqrt() } else { usual };
        let y = self.machine.of_model(&shape.joints_rad);
        let sigma: [f64; MAX_JOINTS] = self.machine.of_model(&shape.joint_variances_rad2.map(stated));
        Some(self.learner.take(&y[..n], &sigma[..n], &seen.sight, dt_s))
    }
}

impl Estimator for JointEstimateCore {
    fn note_state(&mut self, state: &SlaveState) {
        Self::note_state(self, state);
    }

    fn step(&mut self, shape: &Shape) -> ModelUpdate {
        Self::step(self, shape)
    }

    fn reasons(&self, now_ns: i64) -> Reasons {
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::ShapeStale, is_silent(self.newest_shape_ns, now_ns));
        reasons
    }

    fn change(&self) -> Option<Change> {
        None
    }
}
