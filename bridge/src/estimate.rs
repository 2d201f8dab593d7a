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

use crate::config::EstimateConfig;
use crate::step::{BridgeError, seconds_between};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{LearningState, LearntValue, MAX_LEARNT, Message, ModelUpdate, Shape, SlaveState, three};
use krait_ipc::{Bus, HealthReporter, Process, ReadOptions, Reason, Reasons, clock};
use krait_model::{
    Chain, Change, ChangeParameters, ChangeWatch, Circumstances, Innovation, Learner, LearnerParameters, Learning,
    ModelHash, Sight, Snake,
};
use nalgebra::{Vector2, Vector3};

/// Encoder samples kept for pairing: a quarter of a second at 1 kHz covers the latency of a camera.
const N_ENCODERS: usize = 256;
/// A camera that gave nothing for this long is named as silent: fifteen frames at 60 Hz, ms.
const SHAPE_STALE_MS: f64 = 250.0;
/// Actuators that moved less than this between two shapes stand still for the watch: it asks about motion, m.
const MOVED_M: f64 = 5e-6;
/// How long the process sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

/// The pure step of `estimate`.
#[derive(Clone, Debug)]
pub struct EstimateCore {
    learner: Learner,
    model: ModelHash,
    snake: Snake,
    config: EstimateConfig,
    encoders: Box<[Encoders; N_ENCODERS]>,
    n_encoders: usize,
    paired_ns: Option<i64>,
    newest_shape_ns: Option<i64>,
    sequence: u64,
    state_sequence: u64,
    n_states: u64,
    n_used: u64,
    n_left_out: u64,
    start_ns: Option<i64>,
    watch: ChangeWatch,
    compared: Option<Encoders>,
    n_changes: u64,
    changed_ns: i64,
    change: Option<Change>,
}

/// An instant, and what the model saw then.
#[derive(Clone, Copy, Debug)]
struct Encoders {
    stamp_ns: i64,
    sight: Sight,
}

impl EstimateCore {
    /// An estimator that starts from the values of the model file.
    ///
    /// # Errors
    /// [`BridgeError::Config`] or [`BridgeError::Watch`] for values out of range.
    pub fn new(chain: &Chain, config: EstimateConfig) -> Result<Self, BridgeError> {
        config.check()?;
        let EstimateConfig { false_alarms_per_hour, learn_s, sigma_bend_rad, outlier_sigmas, .. } = config;
        let nothing = Encoders { stamp_ns: i64::MIN, sight: Sight::default() };
        Ok(Self {
            learner: Learner::new(chain, LearnerParameters { sigma_bend_rad, outlier_sigmas })?,
            model: chain.hash(),
            snake: Snake::new(chain.machine())?,
            config,
            encoders: Box::new([nothing; N_ENCODERS]),
            n_encoders: 0,
            paired_ns: None,
            newest_shape_ns: None,
            sequence: 0,
            state_sequence: 0,
            n_states: 0,
            n_used: 0,
            n_left_out: 0,
            start_ns: None,
            watch: ChangeWatch::new(ChangeParameters { false_alarms_per_hour, learn_s })?,
            compared: None,
            n_changes: 0,
            changed_ns: 0,
            change: None,
        })
    }

    /// Takes an encoder sample: the model follows it, also between two shapes.
    ///
    /// # Real-time
    /// No allocation, no clock.
    pub fn note_state(&mut self, state: &SlaveState) {
        (self.state_sequence, self.n_states) = (state.sequence, self.n_states + 1);
        let q_tilde_m = Vector3::from(three(&state.measured_q_m));
        if q_tilde_m.iter().all(|q| q.is_finite()) {
            let start_ns = *self.start_ns.get_or_insert(state.sample_ns);
            let at = Circumstances::at(seconds_between(start_ns, state.sample_ns));
            let sight = self.learner.follow(q_tilde_m, &at);
            self.encoders[self.n_encoders % N_ENCODERS] = Encoders { stamp_ns: state.sample_ns, sight };
            self.n_encoders += 1;
        }
    }

    /// Takes a shape and proposes the parameters as they are after it.
    ///
    /// # Real-time
    /// No allocation, no clock; at most 256 stamps are compared.
    pub fn step(&mut self, shape: &Shape) -> ModelUpdate {
        self.newest_shape_ns = Some(shape.sample_ns);
        let is_next = self.paired_ns.is_none_or(|before_ns| shape.sample_ns > before_ns);
        let seen = shape.valid_bend_rad().filter(|_| is_next).zip(self.encoders_at(shape.sample_ns));
        let taken = seen.map(|(bend_rad, encoders)| {
            let dt_s = self.paired_ns.map_or(0.0, |before_ns| seconds_between(before_ns, shape.sample_ns));
            self.paired_ns = Some(shape.sample_ns);
            let taken = self.learner.take(Vector2::from(bend_rad), &encoders.sight, dt_s);
            self.compare(shape, Encoders { stamp_ns: shape.sample_ns, ..encoders });
            taken
        });
        if taken == Some(Learning::Used) {
            self.n_used += 1
        } else {
            self.n_left_out += 1
        }
        self.sequence += 1;
        ModelUpdate {
            sequence: self.sequence,
            sample_ns: shape.sample_ns,
            shape_sequence: shape.sequence,
            state_sequence: self.state_sequence,
            n_states: self.n_states,
            model_hash: self.model.0,
            innovation_rms_rad: self.learner.innovation_rms_rad(),
            n_used: self.n_used,
            n_left_out: self.n_left_out,
            n_changes: self.n_changes,
            changed_ns: self.changed_ns,
            change_kind: self.change.map_or(0, |change| change.kind.number()),
            is_watching: u32::from(self.watch.is_watching()),
            n_learnt: self.learner.parameters().len() as u32,
            reserved: 0,
            learnt: core::array::from_fn(|lane| self.learnt(lane)),
        }
    }

    fn learnt(&self, lane: usize) -> LearntValue {
        const _: () = assert!(MAX_LEARNT == krait_model::MAX_LEARNT);
        let parameters = self.learner.parameters();
        let Some((own, now)) = parameters.get(lane).zip(self.learner.learnt(lane)) else {
            return LearntValue::default();
        };
        let state = match (now.is_observable, now.is_at_bound) {
            (false, _) => LearningState::NotObservable,
            (true, false) => LearningState::Learning,
            (true, true) => LearningState::AtBound,
        };
        LearntValue {
            value: now.value,
            sd: now.sd,
            // A chain has at most 16 effects of 10 parameters.
            effect: own.effect as u16,
            parameter: own.parameter as u16,
            state: state as u16,
            tied_to: now.tied_to.map_or(0, |other| other as u16 + 1),
        }
    }

    /// The newest change that was seen.
    pub fn change(&self) -> Option<Change> {
        self.change
    }

    /// Shows the watch what the model does not explain of a shape, if the actuators have moved since the one before.
    fn compare(&mut self, shape: &Shape, encoders: Encoders) {
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
            self.n_changes += 1;
            self.changed_ns = shape.sample_ns;
            self.change = Some(change);
        }
    }

    /// What holds at an instant: whether the camera has fallen silent, whether the machine has changed since the start.
    pub fn reasons(&self, now_ns: i64) -> Reasons {
        let silent = |newest_ns: i64| seconds_between(newest_ns, now_ns) * 1e3 > SHAPE_STALE_MS;
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::ShapeStale, self.newest_shape_ns.is_some_and(silent));
        reasons.insert_if(Reason::ModelChanged, self.n_changes > 0);
        reasons
    }

    /// The encoders nearest to an instant, if any are near enough.
    fn encoders_at(&self, sample_ns: i64) -> Option<Encoders> {
        let kept = &self.encoders[..self.n_encoders.min(N_ENCODERS)];
        let nearest = kept.iter().min_by_key(|encoders| encoders.stamp_ns.abs_diff(sample_ns))?;
        let gap_ms = seconds_between(nearest.stamp_ns, sample_ns).abs() * 1e3;
        (gap_ms <= self.config.max_state_gap_ms).then_some(*nearest)
    }
}

/// The process `krait estimate`: runs until told to stop.
///
/// # Errors
/// [`BridgeError`] when a channel fails or the configuration is out of range.
pub fn run_estimate(bus: &Bus, chain: &Chain, config: EstimateConfig, stop: &AtomicBool) -> Result<(), BridgeError> {
    let mut core = EstimateCore::new(chain, config)?;
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing())?;
    let mut shapes = bus.reader::<Shape>(ReadOptions::waking())?;
    let mut updates = bus.writer::<ModelUpdate>()?;
    let mut health = HealthReporter::open(bus, Process::Estimate)?;
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = "estimate", "ready");
    while !stop.load(Ordering::Relaxed) {
        shapes.wait(PATIENCE)?;
        while let Some(shape) = shapes.take()? {
            // Every state that was published before the shape is here by now.
            while let Some(state) = states.take()? {
                core.note_state(&state);
            }
            updates.send(&core.step(&shape))?;
        }
        while let Some(state) = states.take()? {
            core.note_state(&state);
        }
        health.set_now(core.reasons(clock::monotonic_ns()));
        if let Some(change) = core.change() {
            health.health_mut().note(Reason::ModelChanged, change.statistic, change.limit);
        }
        health.count_readers(&[states.counts(), shapes.counts()]);
        health.health_mut().n_sent = updates.n_sent();
        health.publish_if_due(clock::monotonic_ns())?;
    }
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = "estimate", channel = Shape::CHANNEL, n_shapes = shapes.n_received(), "stopped");
    Ok(())
}
