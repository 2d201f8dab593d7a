//! Learning while segments in series move: measured bend vectors and the drives' readings become parameters of the model of segments.
//!
//! Problem: as in `estimate` of a snake, with the bend vectors of all segments for the shape.
//!
//! Failure: shapes of another number of segments, without a state near their exposure, or with numbers that are not finite. Such a
//! shape is left out and counted. Nothing watches for changes of the machine here.

use crate::config::EstimateConfig;
use crate::estimate_joints::{KNOWN_AFTER_M, REST_TRAVEL_M};
use crate::learning::EstimatorCore;
use crate::ledger::Ledger;
use crate::live_model::SegmentModel;
use crate::step::BridgeError;
use krait_ipc::message::{ModelUpdate, Shape, SlaveState};
use krait_ipc::{Reason, Reasons};
use krait_model::segments::{MAX_BENDS, SegmentLearner, SegmentSight};
use krait_model::{Change, Learning, ModelHash, VectorLearnerParameters};

/// The pure step of `estimate` for segments.
#[derive(Clone, Debug)]
pub struct SegmentEstimateCore {
    learner: SegmentLearner,
    model: ModelHash,
    n_bends: usize,
    n_lines: usize,
    config: EstimateConfig,
    ledger: Ledger<SegmentSight>,
}

impl SegmentEstimateCore {
    /// An estimator that starts from the values of the model file, at rest in the straight pose.
    ///
    /// # Errors
    /// [`BridgeError::Config`] for values out of range.
    pub fn new(model: &SegmentModel, config: EstimateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        let machine = model.chain().machine();
        let parameters = VectorLearnerParameters {
            outlier_sigmas: config.outlier_sigmas,
            known_after: KNOWN_AFTER_M,
            // As many as there are bends: a segment that has not moved may be anywhere within its play.
            n_known: machine.n_bends(),
            rest_travel: REST_TRAVEL_M,
        };
        Ok(Self {
            learner: model.chain().learner(parameters),
            model: model.hash(),
            n_bends: machine.n_bends(),
            n_lines: machine.n_lines(),
            config,
            ledger: Ledger::new(config.max_state_gap_ms),
        })
    }

    fn learn(&mut self, shape: &Shape) -> Option<Learning> {
        let bends_rad = shape.valid_joints_rad().filter(|bends_rad| bends_rad.len() == self.n_bends)?;
        let (seen, dt_s) = self.ledger.pair(shape)?;
        // Where the maker states no variance, the configuration's standard deviation counts.
        let stated = |k: usize| Some(shape.joint_variances_rad2[k].sqrt()).filter(|sigma_rad| *sigma_rad > 0.0);
        let sigma_rad: [f64; MAX_BENDS] = core::array::from_fn(|k| stated(k).unwrap_or(self.config.sigma_bend_rad));
        Some(self.learner.take(bends_rad, &sigma_rad[..self.n_bends], &seen.sight, dt_s))
    }
}

impl EstimatorCore for SegmentEstimateCore {
    fn note_state(&mut self, state: &SlaveState) {
        let q_tilde_m = &state.measured_q_m[..self.n_lines];
        self.ledger.note_state(state, q_tilde_m, |at| self.learner.follow(q_tilde_m, at));
    }

    fn step(&mut self, shape: &Shape) -> ModelUpdate {
        let taken = self.learn(shape);
        let (learner, rms_rad) = (&self.learner, self.learner.innovation_rms());
        self.ledger.update(shape, taken, self.model, rms_rad, learner.parameters(), |lane| learner.learnt(lane))
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
