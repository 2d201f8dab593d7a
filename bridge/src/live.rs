//! A stage on the machine's clock: every sample in order, with the newest state and every model update that there is.

use crate::step::{BridgeError, Step};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{ModelUpdate, SlaveState};
use krait_ipc::{Bus, HealthReporter, Process, ReadCounts, ReadOptions, Reader, WaitMode, clock};

/// How long a stage sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

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

/// The environment variable that holds back every output of a process: `resolve=500` for 500 us. For tests of the budgets.
const LATE_US: &str = "KRAIT_FAULT_LATE_US";

/// Runs a stage until it is told to stop: every sample in order, published at once, health ten times a second.
pub(crate) fn run<S: Step>(
    bus: &Bus,
    process: Process,
    wait: WaitMode,
    mut core: S,
    stop: &AtomicBool,
) -> Result<(), BridgeError> {
    let mut inputs = bus.reader::<S::In>(ReadOptions::waking().with_mode(wait))?;
    let mut beside = Beside::open(bus, S::TAKES_UPDATES)?;
    let mut outputs = bus.writer::<S::Out>()?;
    let mut health = HealthReporter::open(bus, process)?;
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), "ready");
    let late_ns = fault_late_ns(process);
    let mut last = None;
    while !stop.load(Ordering::Relaxed) {
        let may_have = inputs.wait(PATIENCE)?;
        while let Some(input) = inputs.take()? {
            let begun_ns = clock::monotonic_ns();
            beside.glance(&mut core, &mut health)?;
            match core.step(&input, begun_ns) {
                Ok(mut out) => {
                    hold_back(begun_ns, late_ns);
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
        beside.glance(&mut core, &mut health)?;
        if let (false, Some(last)) = (may_have, &last) {
            core.warm_up(last, clock::monotonic_ns());
        }
        let [states, updates] = beside.counts();
        health.count_readers(&[inputs.counts(), states, updates]);
        health.health_mut().n_sent = outputs.n_sent();
        health.publish_if_due(clock::monotonic_ns())?;
    }
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), n_sent = outputs.n_sent(), n_lost = inputs.n_lost(), "stopped");
    Ok(())
}

/// A fault to inject, ns; none unless somebody asks for it.
fn fault_late_ns(process: Process) -> i64 {
    let asked = std::env::var(LATE_US).ok();
    let late_us = asked.as_deref().and_then(|text| text.split_once('=')).filter(|(name, _)| *name == process.name());
    let Some(late_us) = late_us.and_then(|(_, late_us)| late_us.parse::<u32>().ok()) else { return 0 };
    tracing::warn!(process = process.name(), late_us, "a fault is injected: every output is held back");
    i64::from(late_us) * 1000
}

/// Spends time as a stage that computes too long would: awake.
fn hold_back(begun_ns: i64, late_ns: i64) {
    while late_ns > 0 && clock::monotonic_ns() - begun_ns < late_ns {
        core::hint::spin_loop();
    }
}
