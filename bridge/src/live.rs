//! A stage on the machine's clock: every sample in order, with the newest state and every model update that there is.

use crate::hop::{Arriving, Departing};
use crate::step::{BridgeError, Step};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{ModelUpdate, SlaveState};
use krait_ipc::{Bus, HealthReporter, Process, ReadCounts, ReadOptions, Reader, WaitMode, clock};

/// How long a stage sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

/// A look at the other channels is good for so long: from waking ahead of a sample until it comes, ns.
const FRESH_NS: i64 = 500_000;

/// The channels that do not wake the stage.
struct Beside {
    states: Reader<SlaveState>,
    updates: Option<Reader<ModelUpdate>>,
}

impl Beside {
    fn open(bus: &Bus, takes_updates: bool) -> Result<Self, BridgeError> {
        let updates = if takes_updates { Some(bus.reader(ReadOptions::glancing())?) } else { None };
        Ok(Self { states: bus.reader(ReadOptions::glancing())?, updates })
    }

    /// Looks at what has come; what is refused is counted and named.
    fn glance(&mut self, core: &mut impl Step, health: &mut HealthReporter) -> Result<(), BridgeError> {
        if let Some(state) = self.states.take_newest()? {
            core.note_state(&state);
        }
        while let Some(updates) = &mut self.updates
            && let Some(update) = updates.take()?
        {
            if let Err(refused) = core.note_update(&update) {
                health.health_mut().n_refused += 1;
                health.health_mut().note(refused.reason, refused.found, refused.limit);
            }
        }
        Ok(())
    }

    fn counts(&self) -> [ReadCounts; 2] {
        let none = ReadCounts { n_received: 0, n_lost: 0 };
        [self.states.counts(), self.updates.as_ref().map_or(none, Reader::counts)]
    }
}

/// Runs a stage until it is told to stop: every sample in order, published at once, health ten times a second.
pub(crate) fn run<S: Step>(
    bus: &Bus,
    process: Process,
    wait: WaitMode,
    mut core: S,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    let mut inputs = bus.reader::<S::In>(ReadOptions::waking().with_mode(wait).of(process))?;
    let mut beside = Beside::open(bus, S::TAKES_UPDATES)?;
    let mut outputs = bus.writer::<S::Out>()?;
    let mut health = HealthReporter::open(bus, process)?;
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), "ready");
    // The newest input, and when the other channels were looked at.
    let (mut last, mut glanced_ns) = (None, i64::MIN);
    while !stop.load(Ordering::Relaxed) {
        let may_have = inputs.wait(PATIENCE)?;
        while let Some(input) = inputs.take()? {
            let begun_ns = clock::monotonic_ns();
            if begun_ns.saturating_sub(glanced_ns) > FRESH_NS {
                beside.glance(&mut core, &mut health)?;
            }
            match core.step(&input, begun_ns) {
                Ok(mut out) => {
                    *out.sent_stamp() = clock::monotonic_ns();
                    outputs.send(&out)?;
                    health.set_now(out.reasons());
                    core.tell(&input, begun_ns, out.reasons(), health.health_mut());
                }
                Err(refused) => {
                    health.health_mut().n_refused += 1;
                    health.health_mut().note(refused.reason, refused.found, refused.limit);
                }
            }
            last = Some(*input);
        }
        // On a shared core the next stage waits until this one sleeps, so all else is done when no sample is on its way.
        let now_ns = clock::monotonic_ns();
        if may_have && !health.is_due(now_ns) {
            continue;
        }
        beside.glance(&mut core, &mut health)?;
        glanced_ns = now_ns;
        if let (false, Some(last)) = (may_have, &last) {
            core.warm_up(&last.at(now_ns), now_ns);
        }
        let [states, updates] = beside.counts();
        health.count_readers(&[inputs.counts(), states, updates]);
        health.health_mut().n_sent = outputs.n_sent();
        health.publish_if_due(now_ns)?;
    }
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), n_sent = outputs.n_sent(), n_lost = inputs.n_lost(), "stopped");
    Ok(())
}
