//! Learning while joints move: measured positions and the drives' readings become parameters of the model of joints.
//!
//! Problem: as in `estimate` of a snake; each joint is measured, and each drive's reading is its command carried out.
//!
//! Failure: shapes of another number of joints, without a state near their exposure, or with numbers that are not finite. Such
//! a shape is left out and counted. Nothing watches for changes of the machine here.

use crate::JointMachine;
use crate::config::EstimateConfig;
use crate::learning::EstimatorCore;
use crate::ledger::Ledger;
use crate::step::BridgeError;
use krait_ipc::message::{MAX_JOINTS, ModelUpdate, Shape, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::joints::{JointLearner, JointSight};
use krait_model::{Change, Learning, VectorLearnerParameters};

/// Travel of a drive from which on its play is known to be taken up, and from which on a shape says something new, m.
pub(crate) const KNOWN_AFTER_M: f64 = 0.4e-3;
pub(crate) const REST_TRAVEL_M: f64 = 20e-6;

/// The pure step of `estimate` for joints.
#[derive(Clone, Debug)]
pub struct JointEstimateCore {
    machine: JointMachine,
    learner: JointLearner,
    config: EstimateConfig,
    ledger: Ledger<JointSight>,
}

impl JointEstimateCore {
    /// An estimator that starts from the values of the model file.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range.
    pub fn new(machine: &JointMachine, config: EstimateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        let parameters = VectorLearnerParameters {
            outlier_sigmas: config.outlier_sigmas,
            known_after: KNOWN_AFTER_M * machine.u_per_cable_m(),
            n_known: 1,
            rest_travel: REST_TRAVEL_M * machine.u_per_cable_m(),
        };
        Ok(Self {
            learner: machine.model.chain.learner(parameters),
            machine: machine.clone(),
            config,
            ledger: Ledger::new(config.max_state_gap_ms),
        })
    }

    /// Takes the drives' readings: the model follows them, also between two shapes.
    ///
    /// # Real-time
    /// No allocation, no clock.
    pub fn note_state(&mut self, state: &SlaveState) {
        let u = self.machine.u_of_cable(&state.measured_q_m);
        let u = &u[..self.machine.model.n()];
        self.ledger.note_state(state, u, |at| self.learner.follow(u, at));
    }

    /// Takes a shape and proposes the parameters as they are after it.
    ///
    /// # Real-time
    /// No allocation, no clock; at most 256 stamps are compared.
    pub fn step(&mut self, shape: &Shape) -> ModelUpdate {
        let taken = self.learn(shape);
        let rms_rad = self.learner.innovation_rms() * self.machine.model.y.si;
        let (learner, model) = (&self.learner, self.machine.model.hash());
        self.ledger.update(shape, taken, model, rms_rad, learner.parameters(), |lane| learner.learnt(lane))
    }

    fn learn(&mut self, shape: &Shape) -> Option<Learning> {
        let n = self.machine.model.n();
        shape.valid_joints_rad().filter(|joints| joints.len() == n)?;
        let (seen, dt_s) = self.ledger.pair(shape)?;
        // Where the maker states no variance, the configuration's standard deviation counts.
        let usual = self.config.sigma_bend_rad * self.machine.si_per_rad();
        let stated = |variance: f64| if variance > 0.0 { variance.sqrt() } else { usual };
        let y = self.machine.of_model(&shape.joints_rad);
        let sigma: [f64; MAX_JOINTS] = self.machine.of_model(&shape.joint_variances_rad2.map(stated));
        Some(self.learner.take(&y[..n], &sigma[..n], &seen.sight, dt_s))
    }
}

impl EstimatorCore for JointEstimateCore {
    fn note_state(&mut self, state: &SlaveState) {
        Self::note_state(self, state);
    }

    fn step(&mut self, shape: &Shape) -> ModelUpdate {
        Self::step(self, shape)
    }

    fn reasons(&self, now_ns: i64) -> Reasons {
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::ShapeStale, self.ledger.is_silent(now_ns));
        reasons
    }

    fn change(&self) -> Option<Change> {
        None
    }
}
