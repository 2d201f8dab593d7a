//! Learning the model from what the camera sees: eta and lambda by recursive least squares, Eqs. (18)-(23).
//!
//! Problem: pair every measured shape with the encoders of its instant of exposure, keep the direction of each line's
//! motion from all encoder samples, and hand both to the model's estimator; propose what comes out.
//! Beside it a watch looks whether what the model does not explain is still of the kind that it was, and says when it is
//! not (`krait_model::ChangeWatch`). It judges the model that compensates: a model file's chain where one is given, and
//! else the estimator's own innovations. It proposes to look, and changes nothing.
//!
//! Failure: no encoders near the exposure, a lost view, samples that are not finite. Such a shape is left out and counted.

use crate::config::EstimateConfig;
use crate::stage::{BridgeError, seconds_between};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{Message, ModelUpdate, Shape, SlaveState};
use krait_ipc::{Bus, HealthReporter, Process, ReadOptions, Reason, Reasons, clock};
use krait_model::{
    Chain, Change, ChangeParameters, ChangeWatch, Circumstances, Estimator, EstimatorParameters, Innovation,
    MachineParameters, Predictor, Snake,
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
    estimator: Estimator,
    snake: Snake,
    config: EstimateConfig,
    encoders: [Encoders; N_ENCODERS],
    n_encoders: usize,
    paired_ns: Option<i64>,
    newest_shape_ns: Option<i64>,
    sequence: u64,
    n_unpaired: u64,
    predictor: Option<Predictor>,
    start_ns: Option<i64>,
    watch: ChangeWatch,
    compared: Option<Encoders>,
    n_changes: u64,
    changed_ns: i64,
    change: Option<Change>,
}

/// What the encoders read at an instant, and where the model file's chain then sees the snake.
#[derive(Clone, Copy, Debug)]
struct Encoders {
    stamp_ns: i64,
    q_tilde_m: Vector3<f64>,
    predicted_rad: Vector2<f64>,
}

impl EstimateCore {
    /// An estimator that starts from the configured model; with a chain, the watch judges that one's predictions.
    ///
    /// # Errors
    /// [`BridgeError::Config`] or [`BridgeError::Model`] for values out of range.
    pub fn new(
        machine: &MachineParameters,
        eta: f64,
        lambda_m: f64,
        config: EstimateConfig,
        chain: Option<&Chain>,
    ) -> Result<Self, BridgeError> {
        config.check()?;
        let parameters = EstimatorParameters {
            eta,
            lambda_m,
            sigma_bend_rad: config.sigma_bend_rad,
            memory_s: config.memory_s,
            outlier_sigmas: config.outlier_sigmas,
            ..EstimatorParameters::default()
        };
        let EstimateConfig { false_alarms_per_hour, learn_s, .. } = config;
        let snake = Snake::new(machine)?;
        let nothing = Encoders { stamp_ns: i64::MIN, q_tilde_m: Vector3::zeros(), predicted_rad: Vector2::zeros() };
        Ok(Self {
            estimator: Estimator::new(snake, parameters)?,
            snake,
            config,
            encoders: [nothing; N_ENCODERS],
            n_encoders: 0,
            paired_ns: None,
            newest_shape_ns: None,
            sequence: 0,
            n_unpaired: 0,
            predictor: chain.map(Chain::predictor),
            start_ns: None,
            watch: ChangeWatch::new(ChangeParameters { false_alarms_per_hour, learn_s })?,
            compared: None,
            n_changes: 0,
            changed_ns: 0,
            change: None,
        })
    }

    /// Takes an encoder sample: it keeps the direction of every line's motion, also between two shapes.
    pub fn note_state(&mut self, state: &SlaveState) {
        let q_tilde_m = Vector3::from(state.measured_q_m);
        if q_tilde_m.iter().all(|q| q.is_finite()) {
            let start_ns = *self.start_ns.get_or_insert(state.sample_ns);
            let at = Circumstances::at(seconds_between(start_ns, state.sample_ns));
            let predicted_rad = self
                .predictor
                .as_mut()
                .map_or_else(Vector2::zeros, |chain| chain.step(q_tilde_m, &at).observed_bend_rad);
            self.encoders[self.n_encoders % N_ENCODERS] =
                Encoders { stamp_ns: state.sample_ns, q_tilde_m, predicted_rad };
            self.n_encoders += 1;
            self.estimator.observe_encoders(q_tilde_m);
        }
    }

    /// Takes a shape and proposes the parameters as they are after it.
    ///
    /// # Real-time
    /// No allocation, no clock; at most 256 stamps are compared.
    pub fn step(&mut self, shape: &Shape) -> ModelUpdate {
        self.newest_shape_ns = Some(shape.sample_ns);
        match self.encoders_at(shape.sample_ns) {
            Some(encoders) => {
                let dt_s = self.paired_ns.map_or(0.0, |before_ns| seconds_between(before_ns, shape.sample_ns));
                self.paired_ns = Some(shape.sample_ns);
                self.estimator.observe_shape(Vector2::from(shape.bend_rad), encoders.q_tilde_m, dt_s);
                self.compare(shape, Encoders { stamp_ns: shape.sample_ns, ..encoders });
            }
            None => self.n_unpaired += 1,
        }
        self.sequence += 1;
        let estimate = self.estimator.estimate();
        ModelUpdate {
            sequence: self.sequence,
            sample_ns: shape.sample_ns,
            shape_sequence: shape.sequence,
            eta: estimate.eta,
            lambda_m: estimate.lambda_m,
            eta_sd: estimate.eta_sd,
            lambda_sd_m: estimate.lambda_sd_m,
            innovation_rms_m: estimate.innovation_rms_m,
            n_used: estimate.n_used,
            n_left_out: estimate.n_left_out + self.n_unpaired,
            n_changes: self.n_changes,
            changed_ns: self.changed_ns,
            change_kind: self.change.map_or(0, |change| change.kind.number()),
            is_watching: u32::from(self.watch.is_watching()),
        }
    }

    /// The newest change that was seen.
    pub fn change(&self) -> Option<Change> {
        self.change
    }

    /// Shows the watch what the model does not explain of a shape, if the actuators have moved since the one before.
    fn compare(&mut self, shape: &Shape, encoders: Encoders) {
        let before = *self.compared.get_or_insert(encoders);
        let moved_m = encoders.q_tilde_m - before.q_tilde_m;
        let r = match self.predictor {
            Some(_) => Some((Vector2::from(shape.bend_rad) - encoders.predicted_rad) / self.config.sigma_bend_rad),
            None => self.estimator.innovation(),
        };
        let Some(r) = r.filter(|_| moved_m.amax() >= MOVED_M) else { return };
        self.compared = Some(encoders);
        // J_q^T q~ points where J_q^-1 q~ does: a bend's direction, without the camera's noise.
        let j_t = self.snake.j_q_bend().transpose();
        let seen = Innovation {
            r,
            bend_rad: (j_t * encoders.q_tilde_m) / (1.5 * self.snake.r_m() * self.snake.r_m()),
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
pub fn run_estimate(
    bus: &Bus,
    machine: &MachineParameters,
    eta: f64,
    lambda_m: f64,
    config: EstimateConfig,
    chain: Option<&Chain>,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    let mut core = EstimateCore::new(machine, eta, lambda_m, config, chain)?;
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing())?;
    let mut shapes = bus.reader::<Shape>(ReadOptions::waking())?;
    let mut updates = bus.writer::<ModelUpdate>()?;
    let mut health = HealthReporter::open(bus, Process::Estimate)?;
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = "estimate", "ready");
    while !stop.load(Ordering::Relaxed) {
        shapes.wait(PATIENCE)?;
        while let Some(state) = states.take()? {
            core.note_state(&state);
        }
        while let Some(shape) = shapes.take()? {
            updates.send(&core.step(&shape))?;
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
