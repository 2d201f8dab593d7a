//! Learning the model from what the camera sees: eta and lambda by recursive least squares, Eqs. (18)-(23).
//!
//! Problem: pair every measured shape with the encoders of its instant of exposure, keep the direction of each line's
//! motion from all encoder samples, and hand both to the model's estimator; propose what comes out.
//!
//! Failure: no encoders near the exposure, a lost view, samples that are not finite. Such a shape is left out and counted.

use crate::config::EstimateConfig;
use crate::stage::{BridgeError, seconds_between};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{Message, ModelUpdate, Shape, SlaveState};
use krait_ipc::{Bus, HealthReporter, ReadOptions, Reason, Reasons, clock};
use krait_model::{Estimator, EstimatorParameters, MachineParameters, Snake};
use nalgebra::{Vector2, Vector3};

/// Encoder samples kept for pairing: a quarter of a second at 1 kHz covers the latency of a camera.
const N_ENCODERS: usize = 256;
/// A camera that gave nothing for this long is named as silent: fifteen frames at 60 Hz, ms.
const SHAPE_STALE_MS: f64 = 250.0;
/// How long the process sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

/// The pure step of `estimate`.
#[derive(Clone, Debug)]
pub struct EstimateCore {
    estimator: Estimator,
    config: EstimateConfig,
    encoders: [(i64, Vector3<f64>); N_ENCODERS],
    n_encoders: usize,
    paired_ns: Option<i64>,
    newest_shape_ns: Option<i64>,
    sequence: u64,
    n_unpaired: u64,
}

impl EstimateCore {
    /// An estimator that starts from the configured model.
    ///
    /// # Errors
    /// [`BridgeError::Config`] or [`BridgeError::Model`] for values out of range.
    pub fn new(
        machine: &MachineParameters,
        eta: f64,
        lambda_m: f64,
        config: EstimateConfig,
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
        Ok(Self {
            estimator: Estimator::new(Snake::new(machine)?, parameters)?,
            config,
            encoders: [(i64::MIN, Vector3::zeros()); N_ENCODERS],
            n_encoders: 0,
            paired_ns: None,
            newest_shape_ns: None,
            sequence: 0,
            n_unpaired: 0,
        })
    }

    /// Takes an encoder sample: it keeps the direction of every line's motion, also between two shapes.
    pub fn note_state(&mut self, state: &SlaveState) {
        let q_tilde_m = Vector3::from(state.measured_q_m);
        if q_tilde_m.iter().all(|q| q.is_finite()) {
            self.encoders[self.n_encoders % N_ENCODERS] = (state.sample_ns, q_tilde_m);
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
            Some(q_tilde_m) => {
                let dt_s = self.paired_ns.map_or(0.0, |before_ns| seconds_between(before_ns, shape.sample_ns));
                self.paired_ns = Some(shape.sample_ns);
                self.estimator.observe_shape(Vector2::from(shape.bend_rad), q_tilde_m, dt_s);
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
        }
    }

    /// What holds at an instant: whether the camera has fallen silent.
    pub fn reasons(&self, now_ns: i64) -> Reasons {
        let silent = |newest_ns: i64| seconds_between(newest_ns, now_ns) * 1e3 > SHAPE_STALE_MS;
        let mut reasons = Reasons::NONE;
        reasons.insert_if(Reason::ShapeStale, self.newest_shape_ns.is_some_and(silent));
        reasons
    }

    /// The encoders nearest to an instant, if any are near enough.
    fn encoders_at(&self, sample_ns: i64) -> Option<Vector3<f64>> {
        let kept = &self.encoders[..self.n_encoders.min(N_ENCODERS)];
        let (stamp_ns, q_tilde_m) = kept.iter().min_by_key(|(stamp_ns, _)| stamp_ns.abs_diff(sample_ns))?;
        let gap_ms = seconds_between(*stamp_ns, sample_ns).abs() * 1e3;
        (gap_ms <= self.config.max_state_gap_ms).then_some(*q_tilde_m)
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
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    let mut core = EstimateCore::new(machine, eta, lambda_m, config)?;
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing())?;
    let mut shapes = bus.reader::<Shape>(ReadOptions::waking())?;
    let mut updates = bus.writer::<ModelUpdate>()?;
    let mut health = HealthReporter::open(bus, "estimate")?;
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
        health.count_readers(&[states.counts(), shapes.counts()]);
        health.health_mut().n_sent = updates.n_sent();
        health.publish_if_due(clock::monotonic_ns())?;
    }
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = "estimate", channel = Shape::CHANNEL, n_shapes = shapes.n_received(), "stopped");
    Ok(())
}
