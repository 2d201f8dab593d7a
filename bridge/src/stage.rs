//! What every stage of the bridge has in common: how it refuses, and the loop that feeds it.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{HopStamps, Message};
use krait_ipc::{Bus, HealthReporter, IpcError, Process, ReadCounts, ReadOptions, Reason, Reasons, WaitMode, clock};

/// How long a stage sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

/// A bridge process could not go on.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The machine's parameters make no snake.
    #[error(transparent)]
    Model(#[from] krait_model::ParameterError),
    /// The chain of a model file cannot be built or inverted.
    #[error(transparent)]
    Chain(#[from] krait_model::ChainError),
    /// The mode `model` without a model file.
    #[error("compensation \"model\" needs a model file: name it with --model FILE or with the setting `model`")]
    NoModelFile,
    /// A replay sent a sample and not what its steps depend on.
    #[error(
        "input {input_sequence} came without a cue, expected one before it; the replay that sends them has failed, so start it again"
    )]
    NoCue {
        /// The sample.
        input_sequence: u64,
    },
    /// A cue names a message that was never published.
    #[error(
        "a cue names message {sequence} of channel {channel:?}, found {found} there; the replay that sends them has failed, so start it again"
    )]
    NotThere {
        /// The channel.
        channel: &'static str,
        /// What is named.
        sequence: u64,
        /// What came in its place.
        found: u64,
    },
    /// A value of the configuration is out of range.
    #[error(transparent)]
    Config(#[from] crate::ConfigError),
}

/// A sample that was refused; nothing is published for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refused {
    /// Why.
    pub reason: Reason,
    /// The value that was out of bounds, in the reason's unit.
    pub found: f64,
    /// The bound.
    pub limit: f64,
}

/// One stage between two channels.
pub(crate) trait Stage {
    /// What wakes the stage.
    type In: Message;
    /// What it publishes.
    type Out: Message;

    /// Looks at the channels that do not wake the stage.
    fn glance(&mut self) -> Result<(), IpcError>;
    /// One step. Allocates nothing, reads no clock.
    fn step(&mut self, input: &Self::In, begun_ns: i64) -> Result<Self::Out, Refused>;
    /// Does what a step would do now if this input came again, and forgets it: the next step then finds at hand what it
    /// needs. Changes nothing, allocates nothing. A replay has no time to be ahead of, and does not.
    fn rehearse(&mut self, _input: &Self::In, _now_ns: i64) {}
    /// The stamps of an output, so that the loop can enter when it was sent.
    fn sent_stamp(out: &mut Self::Out) -> &mut i64;
    /// The reasons that an output carries.
    fn reasons(out: &Self::Out) -> Reasons;
    /// How long an output is held back, ns: a fault to inject, none by default.
    fn late_ns(&self) -> i64 {
        0
    }
    /// What the readers of `glance` have counted.
    fn counts(&self) -> ReadCounts;
}

/// Runs a stage until it is told to stop: every sample in order, published at once, health ten times a second.
pub(crate) fn run<S: Stage>(
    bus: &Bus,
    process: Process,
    wait: WaitMode,
    stage: &mut S,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    let mut inputs = bus.reader::<S::In>(ReadOptions::waking().with_mode(wait))?;
    let mut outputs = bus.writer::<S::Out>()?;
    let mut health = HealthReporter::open(bus, process)?;
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), "ready");
    let mut last = None;
    while !stop.load(Ordering::Relaxed) {
        let may_have = inputs.wait(PATIENCE)?;
        while let Some(input) = inputs.take()? {
            let begun_ns = clock::monotonic_ns();
            stage.glance()?;
            match stage.step(&input, begun_ns) {
                Ok(mut out) => {
                    hold_back(begun_ns, stage.late_ns());
                    *S::sent_stamp(&mut out) = clock::monotonic_ns();
                    outputs.send(&out)?;
                    health.set_now(S::reasons(&out));
                }
                Err(refused) => {
                    health.health_mut().n_refused += 1;
                    health.health_mut().note(refused.reason, refused.found, refused.limit);
                }
            }
            last = Some(*input);
        }
        // Behind the samples, not before them: it keeps the other channels from overflowing while no input comes.
        stage.glance()?;
        if let (false, Some(last)) = (may_have, &last) {
            stage.rehearse(last, clock::monotonic_ns());
        }
        health.count_readers(&[inputs.counts(), stage.counts()]);
        health.health_mut().n_sent = outputs.n_sent();
        health.publish_if_due(clock::monotonic_ns())?;
    }
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), n_sent = outputs.n_sent(), n_lost = inputs.n_lost(), "stopped");
    Ok(())
}

/// Spends time as a stage that computes too long would: awake.
fn hold_back(begun_ns: i64, late_ns: i64) {
    while late_ns > 0 && clock::monotonic_ns() - begun_ns < late_ns {
        core::hint::spin_loop();
    }
}

/// Time since the sample before, s, by the samples' own stamps: at most [`MAX_STEP_S`], so that a gap never becomes a jump.
pub(crate) fn step_s(before_ns: Option<i64>, now_ns: i64) -> f64 {
    let Some(before_ns) = before_ns else { return 0.0 };
    (seconds_between(before_ns, now_ns)).clamp(0.0, MAX_STEP_S)
}

/// Longest time that one sample may stand for, s.
pub(crate) const MAX_STEP_S: f64 = 10e-3;

/// Seconds from one stamp to another.
pub(crate) fn seconds_between(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// Refuses a sample whose numbers are not finite or whose stamp does not follow the one before.
pub(crate) fn check_order_and_numbers(before_ns: Option<i64>, sample_ns: i64, numbers: &[f64]) -> Result<(), Refused> {
    if let Some(found) = numbers.iter().copied().find(|n| !n.is_finite()) {
        return Err(Refused { reason: Reason::NotFinite, found, limit: f64::MAX });
    }
    match before_ns {
        Some(before_ns) if sample_ns <= before_ns => {
            Err(Refused { reason: Reason::OutOfOrder, found: seconds_between(before_ns, sample_ns), limit: 0.0 })
        }
        _ => Ok(()),
    }
}

/// The stamps of a step's output: those of its input, and when this stage had it in hand.
pub(crate) fn stamps_begun(input: &HopStamps, enter: impl FnOnce(&mut HopStamps)) -> HopStamps {
    let mut stamps = *input;
    enter(&mut stamps);
    stamps
}
