//! The bridge's processes in a replay: the same steps as ever, but what they depend on besides their input is told by cues.
//!
//! A live stage reads the clock and takes the newest state. A replay cannot leave either to chance: the clock would judge
//! recorded samples to be stale, and which state is the newest depends on who is scheduled first. So a cue says both, and
//! the stage waits for what it names. Nothing here may ever drive hardware: a stage without a clock cannot notice that its
//! samples are late, and only the simulated snake in recorded time listens to it.

use crate::hop::{Arriving, Departing, Moment};
use crate::step::{BridgeError, Step};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{Cue, Message, ModelUpdate, SlaveState};
use krait_ipc::{Bus, HealthReporter, IpcError, Process, ReadCounts, ReadOptions, Reader, Writer, clock};

/// How long a stage sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);

/// The channels that do not wake the stage, taken message by message.
struct Beside {
    states: UpTo<SlaveState>,
    updates: Option<UpTo<ModelUpdate>>,
    n_updates_refused: u64,
}

impl Beside {
    fn open(bus: &Bus, takes_updates: bool) -> Result<Self, IpcError> {
        let updates = if takes_updates { Some(UpTo::new(bus.reader(ReadOptions::waking())?)) } else { None };
        Ok(Self { states: UpTo::new(bus.reader(ReadOptions::waking())?), updates, n_updates_refused: 0 })
    }

    /// Takes note of the states and updates up to those named, as far as they are there. Returns whether all are.
    fn glance_until(&mut self, core: &mut impl Step, moment: &Moment) -> Result<bool, BridgeError> {
        let has_states = self.states.take(moment.state_sequence, |state| core.note_state(state))?;
        let Some(updates) = &mut self.updates else { return Ok(has_states) };
        let n_refused = &mut self.n_updates_refused;
        let has_updates = updates.take(moment.update_sequence, |update| {
            *n_refused += u64::from(core.note_update(update).is_err());
        })?;
        Ok(has_states && has_updates)
    }

    /// Sleeps until there may be more to take note of.
    fn wait(&mut self, moment: &Moment) -> Result<(), IpcError> {
        match &mut self.updates {
            Some(updates) if !self.states.is_behind(moment.state_sequence) => updates.wait(),
            _ => self.states.wait(),
        }
    }

    fn counts(&self) -> [ReadCounts; 2] {
        let none = ReadCounts { n_received: 0, n_lost: 0 };
        [self.states.counts(), self.updates.as_ref().map_or(none, UpTo::counts)]
    }
}

/// Runs a stage by its cues until it is told to stop: every sample in order, as fast as samples and states come.
pub(crate) fn run<S: Step>(bus: &Bus, process: Process, mut core: S, stop: &AtomicBool) -> Result<(), BridgeError> {
    let mut inputs = bus.reader::<S::In>(ReadOptions::waking())?;
    let mut beside = Beside::open(bus, S::TAKES_UPDATES)?;
    let mut cues = Cues::open(bus)?;
    let mut outputs = bus.writer::<S::Out>()?;
    let mut health = HealthReporter::open(bus, process)?;
    health.publish(clock::monotonic_ns())?;
    tracing::info!(process = process.name(), "ready for a replay");
    while !stop.load(Ordering::Relaxed) {
        inputs.wait(PATIENCE)?;
        while let Some(input) = inputs.take()? {
            let moment = S::Out::moment(&cues.of(input.input_sequence())?);
            if moment.begun_ns == 0 {
                continue;
            }
            if !glance(&mut core, &mut beside, &moment, &mut outputs, stop)? {
                break;
            }
            match core.step(&input, moment.begun_ns) {
                Ok(mut out) => {
                    *out.sent_stamp() = moment.sent_ns;
                    outputs.put(&out)?;
                    health.set_now(out.reasons());
                }
                Err(refused) => {
                    health.health_mut().n_refused += 1;
                    health.health_mut().note(refused.reason, refused.found, refused.limit);
                    health.set_now(krait_ipc::Reasons::NONE.with(refused.reason));
                    // At once: the replay waits for an output that will not come.
                    health.publish(clock::monotonic_ns())?;
                }
            }
        }
        outputs.wake()?;
        let [states, updates] = beside.counts();
        health.count_readers(&[inputs.counts(), states, updates]);
        health.health_mut().n_sent = outputs.n_sent();
        health.publish_if_due(clock::monotonic_ns())?;
    }
    health.publish(clock::monotonic_ns())?;
    if beside.n_updates_refused > 0 {
        tracing::warn!(process = process.name(), n_refused = beside.n_updates_refused, "model updates were refused");
    }
    tracing::info!(process = process.name(), n_sent = outputs.n_sent(), n_lost = inputs.n_lost(), "stopped");
    Ok(())
}

/// Waits for what a step rests on. Before it sleeps, the stages behind are woken: what they make of the samples so far may
/// be just what this stage waits for. Returns whether all is there; it is not when a stop was asked for.
fn glance<S: Step>(
    core: &mut S,
    beside: &mut Beside,
    moment: &Moment,
    outputs: &mut Writer<S::Out>,
    stop: &AtomicBool,
) -> Result<bool, BridgeError> {
    while !beside.glance_until(core, moment)? {
        if stop.load(Ordering::Relaxed) {
            return Ok(false);
        }
        outputs.wake()?;
        beside.wait(moment)?;
    }
    Ok(true)
}

/// The cues, found by the input that they are for.
struct Cues {
    reader: Reader<Cue>,
}

impl Cues {
    fn open(bus: &Bus) -> Result<Self, IpcError> {
        Ok(Self { reader: bus.reader(ReadOptions::glancing())? })
    }

    /// The next cue for an input; those of samples that the stage before left out are passed over. Each is used once, because
    /// the numbers of inputs begin anew with a new writer.
    fn of(&mut self, input_sequence: u64) -> Result<Cue, BridgeError> {
        loop {
            let Some(cue) = self.reader.take()? else { return Err(BridgeError::NoCue { input_sequence }) };
            if cue.input_sequence == input_sequence {
                return Ok(*cue);
            }
        }
    }
}

/// Messages of a channel that are taken one by one, up to a named one.
struct UpTo<M: Message> {
    reader: Reader<M>,
    next: Option<M>,
    newest: u64,
}

impl<M: Message> UpTo<M> {
    fn new(reader: Reader<M>) -> Self {
        Self { reader, next: None, newest: 0 }
    }

    /// Hands over every message up to the one with a sequence number. Returns whether that one has come. A number below the
    /// newest is one of a new writer.
    fn take(&mut self, sequence: u64, mut into: impl FnMut(&M)) -> Result<bool, BridgeError> {
        while self.newest != sequence {
            if self.next.is_none() {
                self.next = self.reader.take()?.map(|message| *message);
            }
            let Some(message) = self.next else { return Ok(false) };
            if message.sequence() > sequence {
                return Err(BridgeError::NotThere { channel: M::CHANNEL, sequence, found: message.sequence() });
            }
            into(&message);
            self.newest = message.sequence();
            self.next = None;
        }
        Ok(true)
    }

    fn is_behind(&self, sequence: u64) -> bool {
        self.newest != sequence
    }

    fn wait(&mut self) -> Result<(), IpcError> {
        self.reader.wait(PATIENCE).map(|_| ())
    }

    fn counts(&self) -> ReadCounts {
        self.reader.counts()
    }
}
