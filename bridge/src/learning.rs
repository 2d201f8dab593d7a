//! The process that learns: what the estimators of all machines have in common, and the loops that feed them.

use crate::config::{EstimateConfig, JointsConfig};
use crate::step::BridgeError;
use crate::{EstimateCore, Feed, JointEstimateCore, JointMachine, LiveModel, SegmentEstimateCore};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{LearningState, LearntValue, MAX_LEARNT, Message, ModelUpdate, Shape, SlaveState};
use krait_ipc::{Bus, HealthReporter, Process, ReadOptions, Reason, Reasons, clock};
use krait_model::{Change, Learnt, LearntParameter};

/// How long the process sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

/// A core that learns: it follows the slave's states, and makes an update of each shape.
pub trait EstimatorCore {
    /// Takes a state, also between two shapes. No allocation, no clock.
    fn note_state(&mut self, state: &SlaveState);
    /// Takes a shape and proposes the parameters as they are after it. No allocation, no clock.
    fn step(&mut self, shape: &Shape) -> ModelUpdate;
    /// What holds at an instant.
    fn reasons(&self, now_ns: i64) -> Reasons;
    /// The newest change of the machine that was seen.
    fn change(&self) -> Option<Change>;
}

/// What is learnt, as an update carries it.
pub(crate) fn learnt_values(
    parameters: &[LearntParameter],
    learnt: impl Fn(usize) -> Option<Learnt>,
) -> [LearntValue; MAX_LEARNT] {
    const _: () = assert!(MAX_LEARNT == krait_model::MAX_LEARNT);
    core::array::from_fn(|lane| {
        let Some((own, now)) = parameters.get(lane).zip(learnt(lane)) else { return LearntValue::default() };
        let state = match (now.is_observable, now.is_at_bound) {
            (false, _) => LearningState::NotObservable,
            (true, false) => LearningState::Learning,
            (true, true) => LearningState::AtBound,
        };
        LearntValue {
            value: now.value,
            sd: now.sd,
            // A chain has at most 32 effects of 10 parameters.
            effect: own.effect as u16,
            parameter: own.parameter as u16,
            state: state as u16,
            tied_to: now.tied_to.map_or(0, |other| other as u16 + 1),
        }
    })
}

/// The process `krait estimate`: runs until told to stop.
///
/// # Errors
/// [`BridgeError`] when a channel fails or the configuration is out of range.
pub fn run_estimate(
    bus: &Bus,
    model: &LiveModel,
    config: EstimateConfig,
    joints: &JointsConfig,
    feed: Feed,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    match model {
        LiveModel::Snake(chain) => run(feed, bus, EstimateCore::new(chain, config)?, stop),
        LiveModel::Joints(model) => {
            run(feed, bus, JointEstimateCore::new(&JointMachine::new(model, joints)?, config)?, stop)
        }
        LiveModel::Segments(model) => run(feed, bus, SegmentEstimateCore::new(model, config)?, stop),
    }
}

fn run(feed: Feed, bus: &Bus, core: impl EstimatorCore, stop: &AtomicBool) -> Result<(), BridgeError> {
    match feed {
        Feed::Live => live(bus, core, stop),
        Feed::Cued => cued(bus, core, stop),
    }
}

fn live(bus: &Bus, mut core: impl EstimatorCore, stop: &AtomicBool) -> Result<(), BridgeError> {
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

/// In a replay each shape counts after the state of the instant at which it became available, and before the next state.
fn cued(bus: &Bus, mut core: impl EstimatorCore, stop: &AtomicBool) -> Result<(), BridgeError> {
    let mut states = bus.reader::<SlaveState>(ReadOptions::following())?;
    let mut shapes = bus.reader::<Shape>(ReadOptions::glancing())?;
    let mut updates = bus.writer::<ModelUpdate>()?;
    let mut health = HealthReporter::open(bus, Process::Estimate)?;
    health.publish(clock::monotonic_ns())?;
    let mut next: Option<Shape> = None;
    while !stop.load(Ordering::Relaxed) {
        states.wait(PATIENCE)?;
        while let Some(state) = states.take()? {
            core.note_state(&state);
            // The slave publishes a shape before the state of the same instant, so it is here already.
            loop {
                next = match next {
                    Some(shape) => Some(shape),
                    None => shapes.take()?.map(|shape| *shape),
                };
                let Some(shape) = next.filter(|shape| shape.available_ns <= state.sample_ns) else { break };
                updates.send(&core.step(&shape))?;
                next = None;
            }
        }
        health.count_readers(&[states.counts(), shapes.counts()]);
        health.health_mut().n_sent = updates.n_sent();
        health.publish_if_due(clock::monotonic_ns())?;
    }
    health.publish(clock::monotonic_ns())?;
    Ok(())
}
