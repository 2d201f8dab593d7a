//! Learning the model from what the camera sees: the parameters that the model file names, whatever effects they are of.
//!
//! Problem: follow the encoders with the chain's prediction, pair every measured shape with the prediction of its instant of
//! exposure, and hand both to the model's learner (`krait_model::Learner`); propose what comes out.
//! Beside it a watch looks whether what the model does not explain is still of the kind that it was, and says when it is
//! not (`krait_model::ChangeWatch`). It judges the values in force. It proposes to look, and changes nothing.
//!
//! A process that starts begins from the values of the model file, at rest in the straight pose.
//!
//! Failure: no encoders near the exposure, a lost view, samples that are not finite. Such a shape is left out and counted.

use crate::changes::Changes;
use crate::config::EstimateConfig;
use crate::learning::EstimatorCore;
use crate::ledger::Ledger;
use crate::pairing::Sighted;
use crate::step::{BridgeError, seconds_between};
use krait_ipc::message::{ModelUpdate, Shape, SlaveState, three};
use krait_ipc::{Reason, Reasons};
use krait_model::{
    Chain, Change, ChangeParameters, ChangeWatch, Innovation, Learner, LearnerParameters, ModelHash, Sight, Snake,
};
use nalgebra::{Vector2, Vector3};

/// Actuators that moved less than this between two shapes stand still for the watch: it asks about motion, m.
pub(crate) const MOVED_M: f64 = 5e-6;

/// The pure step of `estimate`.
#[derive(Clone, Debug)]
pub struct EstimateCore {
    learner: Learner,
    model: ModelHash,
    snake: Snake,
    ledger: Ledger<Sight>,
    watch: ChangeWatch,
    compared: Option<Sighted<Sight>>,
    changes: Changes,
}

impl EstimateCore {
    /// An estimator that starts from the values of the model file.
    ///
    /// # Errors
    /// [`BridgeError::Config`] or [`BridgeError::Watch`] for values out of range.
    pub fn new(chain: &Chain, config: EstimateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        let EstimateConfig { false_alarms_per_hour, learn_s, sigma_bend_rad, outlier_sigmas, .. } = config;
        Ok(Self {
            learner: Learner::new(chain, LearnerParameters { sigma_bend_rad, outlier_sigmas })?,
            model: chain.hash(),
            snake: Snake::new(chain.machine())?,
            ledger: Ledger::new(config.max_state_gap_ms),
            watch: ChangeWatch::new(ChangeParameters { false_alarms_per_hour, learn_s })?,
            compared: None,
            changes: Changes::default(),
        })
    }

    /// Takes an encoder sample: the model follows it, also between two shapes.
    ///
    /// # Real-time
    /// No allocation, no clock.
    pub fn note_state(&mut self, state: &SlaveState) {
        let q_tilde_m = three(&state.measured_q_m);
        self.ledger.note_state(state, &q_tilde_m, |at| self.learner.follow(Vector3::from(q_tilde_m), at));
    }

    /// Takes a shape and proposes the parameters as they are after it.
    ///
    /// # Real-time
    /// No allocation, no clock; at most 256 stamps are compared.
    pub fn step(&mut self, shape: &Shape) -> ModelUpdate {
        let seen = shape.valid_bend_rad().and_then(|bend_rad| Some((bend_rad, self.ledger.pair(shape)?)));
        let taken = seen.map(|(bend_rad, (encoders, dt_s))| {
            let taken = self.learner.take(Vector2::from(bend_rad), &encoders.sight, dt_s);
            self.compare(shape, Sighted { stamp_ns: shape.sample_ns, ..encoders });
            taken
        });
        let (learner, rms_rad) = (&self.learner, self.learner.innovation_rms_rad());
        let learnt = |lane| learner.learnt(lane);
        let update = self.ledger.update(shape, taken, self.model, rms_rad, learner.parameters(), learnt);
        self.changes.told(self.watch.is_watching(), update)
    }

    /// The newest change that was seen.
    pub fn change(&self) -> Option<Change> {
        self.changes.newest()
    }

    /// Shows the watch what the model does not explain of a shape, if the actuators have moved since the one before.
    fn compare(&mut self, shape: &Shape, encoders: Sighted<Sight>) {
        let before = *self.compared.get_or_insert(encoders);
        let q_tilde_m = encoders.sight.q_tilde_m;
        let moved_m = q_tilde_m - before.sight.q_tilde_m;
        let Some(r) = self.learner.innovation().filter(|_| moved_m.amax() >= MOVED_M) else { return };
        self.compared = Some(encoders);
        // J_q^T q~ points where J_q^-1 q~ does: a bend's direction, without the camera's noise.
        let j_t = self.snake.j_q_bend().transpose();
        let seen = Innovation {
            r,
            bend_rad: (j_t * q_tilde_m) / (1.5 * self.snake.r_m() * self.snake.r_m()),
            motion_rad: j_t * moved_m,
            dt_s: seconds_between(before.stamp_ns, encoders.stamp_ns),
        };
        if let Some(change) = self.watch.observe(&seen) {
            self.changes.note(change, 0, shape.sample_ns);
        }
    }

    /// What holds at an instant: whether the camera has fallen silent, whether the machine has changed since the start.
    pub fn reasons(&self, now_ns: i64) -> Reasons {
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::ShapeStale, self.ledger.is_silent(now_ns));
        reasons.insert_if(Reason::ModelChanged, self.changes.newest().is_some());
        reasons
    }
}

impl EstimatorCore for EstimateCore {
    fn note_state(&mut self, state: &SlaveState) {
        Self::note_state(self, state);
    }

    fn step(&mut self, shape: &Shape) -> ModelUpdate {
        Self::step(self, shape)
    }

    fn reasons(&self, now_ns: i64) -> Reasons {
        Self::reasons(self, now_ns)
    }

    fn change(&self) -> Option<Change> {
        self.changes.newest()
    }
}
