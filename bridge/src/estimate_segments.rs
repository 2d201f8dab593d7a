//! Learning while segments in series move: measured bend vectors and the drives' readings become parameters of the model of segments.
//!
//! Problem: as in `estimate` of a snake, with the bend vectors of all segments for the shape.
//!
//! Failure: shapes of another number of segments, without a state near their exposure, or with numbers that are not finite. Such a
//! shape is left out and counted.
//!
//! Beside it each segment is watched for changes of the machine (`watch_segments`), also where nothing is learnt.

use crate::changes::Changes;
use crate::config::EstimateConfig;
use crate::estimate_joints::{KNOWN_AFTER_M, REST_TRAVEL_M};
use crate::learning::EstimatorCore;
use crate::ledger::Ledger;
use crate::live_model::SegmentModel;
use crate::pairing::Sighted;
use crate::step::BridgeError;
use crate::watch_segments::SegmentWatch;
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
    watch: SegmentWatch,
    changes: Changes,
}

impl SegmentEstimateCore {
    /// An estimator that starts from the values of the model file, at rest in the straight pose.
    ///
    /// # Errors
    /// [`BridgeError::Config`] or [`BridgeError::Watch`] for values out of range.
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
            watch: SegmentWatch::new(machine, config.false_alarms_per_hour, config.learn_s)?,
            changes: Changes::default(),
        })
    }

    fn learn(&mut self, shape: &Shape) -> Option<Learning> {
        let bends_rad = shape.valid_joints_rad().filter(|bends_rad| bends_rad.len() == self.n_bends)?;
        let (seen, dt_s) = self.ledger.pair(shape)?;
        // Where the maker states no variance, the configuration's standard deviation counts.
        let stated = |k: usize| Some(shape.joint_variances_rad2[k].sqrt()).filter(|sigma_rad| *sigma_rad > 0.0);
        let sigma_rad: [f64; MAX_BENDS] = core::array::from_fn(|k| stated(k).unwrap_or(self.config.sigma_bend_rad));
        let taken = self.learner.take(bends_rad, &sigma_rad[..self.n_bends], &seen.sight, dt_s);
        let seen = Sighted { stamp_ns: shape.sample_ns, ..seen };
        let change = self.learner.innovation().and_then(|innovation| self.watch.observe(&innovation, seen));
        if let Some((segment, change)) = change {
            self.changes.note(change, segment, shape.sample_ns);
        }
        Some(taken)
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
        let learnt = |lane| learner.learnt(lane);
        let update = self.ledger.update(shape, taken, self.model, rms_rad, learner.parameters(), learnt);
        self.changes.told(self.watch.is_watching(), update)
    }

    fn reasons(&self, now_ns: i64) -> Reasons {
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::ShapeStale, self.ledger.is_silent(now_ns));
        reasons.insert_if(Reason::ModelChanged, self.changes.newest().is_some());
        reasons
    }

    fn change(&self) -> Option<Change> {
        self.changes.newest()
    }
}
