//! What a running chain says, taken from every channel without waking a writer: the newest message of each, how far the snake
//! is from where it shall be, where a sample's time goes, and which reasons hold.

use crate::ConsoleError;
use crate::latency::{LiveLatency, LiveLatencyReport};
use crate::snapshot::{self, NewestSamples};
use crate::tracking::LiveTracking;
use crate::words::Shown;
use krait_ipc::message::{Command, Health, Marker, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader, Reason, Reasons, clock, health_channel};

/// A reason that held more shortly than this is shown for this long, so that it can be read.
const READABLE_NS: i64 = 600_000_000;

/// Reads an instance's channels.
pub struct Observer {
    bus: Bus,
    inputs: Reader<OperatorInput>,
    setpoints: Reader<Setpoint>,
    commands: Reader<Command>,
    states: Reader<SlaveState>,
    shapes: Reader<Shape>,
    model_updates: Reader<ModelUpdate>,
    marks: Reader<Marker>,
    healths: Vec<Reader<Health>>,
    newest: NewestSamples,
    tracking: LiveTracking,
    latency: LiveLatency,
    chain_reasons: [Reasons; 3],
    held: Held,
    recording_since_ns: Option<(u32, i64)>,
    marked: Option<(u64, Marker)>,
}

impl Observer {
    /// Becomes a reader of every channel.
    ///
    /// # Errors
    /// [`ConsoleError`] where a channel cannot be read.
    pub fn open(bus: Bus) -> Result<Self, ConsoleError> {
        let options = ReadOptions::observing();
        let health = |process: Process| bus.reader_on(&health_channel(process), options);
        Ok(Self {
            inputs: bus.reader(options)?,
            setpoints: bus.reader(options)?,
            commands: bus.reader(options)?,
            states: bus.reader(options)?,
            shapes: bus.reader(options)?,
            model_updates: bus.reader(options)?,
            marks: bus.reader_on(Marker::RECORDED_CHANNEL, options)?,
            healths: Process::ALL.into_iter().map(health).collect::<Result<_, _>>()?,
            newest: NewestSamples {
                healths: Process::ALL.map(|process| (process, None)).to_vec(),
                ..NewestSamples::default()
            },
            tracking: LiveTracking::default(),
            latency: LiveLatency::new()?,
            chain_reasons: [Reasons::NONE; 3],
            held: Held::default(),
            recording_since_ns: None,
            marked: None,
            bus,
        })
    }

    /// Takes everything that came since the last look; a sample that took longer than `worst_us` counts as late.
    ///
    /// # Errors
    /// [`IpcError`] where a channel is broken.
    pub fn look(&mut self, worst_us: f64) -> Result<(), IpcError> {
        while let Some(input) = self.inputs.take()? {
            self.newest.input = Some(*input);
        }
        let mut since_last = [None; 3];
        while let Some(setpoint) = self.setpoints.take()? {
            self.tracking.setpoint(&setpoint);
            add(&mut since_last[0], setpoint.reasons);
            self.newest.setpoint = Some(*setpoint);
        }
        while let Some(command) = self.commands.take()? {
            add(&mut since_last[1], command.reasons);
            self.newest.command = Some(*command);
        }
        while let Some(state) = self.states.take()? {
            self.latency.state(&state, worst_us);
            add(&mut since_last[2], state.reasons);
            self.newest.loads.note(&state);
            self.newest.state = Some(*state);
        }
        // A channel that said nothing since the last look still means what it said before.
        for (held, since_last) in self.chain_reasons.iter_mut().zip(since_last) {
            *held = since_last.unwrap_or(*held);
        }
        let mut reasons = self.chain_reasons.iter().fold(Reasons::NONE, |all, some| all.union(*some));
        while let Some(shape) = self.shapes.take()? {
            self.tracking.shape(&shape);
            self.newest.shape = Some(*shape);
        }
        if let Some(update) = self.model_updates.take_newest()? {
            self.newest.model_update = Some(*update);
        }
        while let Some(mark) = self.marks.take()? {
            self.marked = Some((self.marked.map_or(1, |(n, _)| n + 1), *mark));
        }
        for (reader, (_, newest)) in self.healths.iter_mut().zip(&mut self.newest.healths) {
            if let Some(health) = reader.take_newest()? {
                *newest = Some(*health);
            }
        }
        let now_ns = clock::monotonic_ns();
        let beside_the_chain = [Process::Estimate, Process::Record];
        for (process, health) in &self.newest.healths {
            let fresh = health.filter(|health| now_ns - health.sample_ns < snapshot::STALE_NS);
            if let Some(health) = fresh.filter(|_| beside_the_chain.contains(process)) {
                reasons = reasons.union(Reasons::from_bits(health.reasons_now));
            }
        }
        self.held.take(reasons, now_ns);
        Ok(())
    }

    /// Names and process ids of who is in the instance.
    pub(crate) fn members(&self) -> Vec<(String, u32)> {
        self.bus.members()
    }

    /// The newest message of each channel.
    pub(crate) fn newest(&self) -> &NewestSamples {
        &self.newest
    }

    /// How far the machine is from where it shall be.
    pub(crate) fn tracking(&self) -> &LiveTracking {
        &self.tracking
    }

    /// Reasons that hold, or held so shortly that nobody could have read them.
    pub(crate) fn reasons(&self, now_ns: i64) -> Reasons {
        self.held.visible(now_ns)
    }

    /// The state to be shown.
    pub(crate) fn shown(&self, now_ns: i64) -> Shown {
        self.newest.shown(now_ns, self.reasons(now_ns))
    }

    /// Where the samples' time went since the observer began.
    pub(crate) fn latency(&self) -> LiveLatencyReport {
        self.latency.report()
    }

    /// A second of the latency's history has passed.
    pub(crate) fn end_second(&mut self) {
        self.latency.end_second();
    }

    /// How many marks the recorder has taken since the observer began, and the last of them.
    pub(crate) fn marks(&self) -> Option<(u64, &str)> {
        self.marked.as_ref().map(|(n, mark)| (*n, mark.text().unwrap_or("?")))
    }

    /// Seconds that the recorder among the members has been at work; nothing where there is none.
    pub(crate) fn recording_s(&mut self, members: &[(String, u32)], now_ns: i64) -> Option<f64> {
        let recorder = members.iter().find(|(name, _)| name == Process::Record.name()).map(|(_, pid)| *pid);
        self.recording_since_ns = match (recorder, self.recording_since_ns) {
            (Some(pid), Some((known, since_ns))) if pid == known => Some((pid, since_ns)),
            (Some(pid), _) => Some((pid, now_ns - age_of_process_ns(pid).unwrap_or_default())),
            (None, _) => None,
        };
        self.recording_since_ns.map(|(_, since_ns)| (now_ns - since_ns) as f64 * 1e-9)
    }

    /// Messages of the chain's channels that this observer has lost.
    pub(crate) fn n_lost_here(&self) -> u64 {
        let counts = [
            self.inputs.n_lost(),
            self.setpoints.n_lost(),
            self.commands.n_lost(),
            self.states.n_lost(),
            self.shapes.n_lost(),
            self.model_updates.n_lost(),
        ];
        counts.iter().sum()
    }
}

/// Adds the reasons of a message to those since the last look.
fn add(reasons: &mut Option<Reasons>, bits: u64) {
    *reasons = Some(reasons.unwrap_or_default().union(Reasons::from_bits(bits)));
}

/// How long a process has been there, ns: its start in ticks of the kernel's clock against the machine's uptime.
fn age_of_process_ns(pid: u32) -> Option<i64> {
    const TICK_NS: f64 = 1e7;
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let start_ticks: f64 = stat.rsplit_once(')')?.1.split_whitespace().nth(19)?.parse().ok()?;
    let uptime_s: f64 = std::fs::read_to_string("/proc/uptime").ok()?.split_whitespace().next()?.parse().ok()?;
    Some((uptime_s * 1e9 - start_ticks * TICK_NS) as i64)
}

/// Since when each reason is shown.
#[derive(Debug)]
struct Held {
    since_ns: [Option<i64>; Reason::ALL.len()],
    now: Reasons,
}

impl Default for Held {
    fn default() -> Self {
        Self { since_ns: [None; Reason::ALL.len()], now: Reasons::NONE }
    }
}

impl Held {
    fn take(&mut self, reasons: Reasons, now_ns: i64) {
        self.now = reasons;
        for reason in Reason::ALL {
            let since_ns = &mut self.since_ns[reason as usize];
            if reasons.contains(reason) {
                since_ns.get_or_insert(now_ns);
            } else if since_ns.is_some_and(|since_ns| now_ns - since_ns >= READABLE_NS) {
                *since_ns = None;
            }
        }
    }

    fn visible(&self, now_ns: i64) -> Reasons {
        let mut visible = self.now;
        for reason in Reason::ALL {
            visible.insert_if(reason, self.since_ns[reason as usize].is_some_and(|since_ns| since_ns <= now_ns));
        }
        visible
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_reason_stays_long_enough_to_be_read_and_a_long_one_goes_when_it_ends() {
        let mut held = Held::default();
        let limit = Reasons::NONE.with(Reason::BendLimit);
        held.take(limit, 0);
        held.take(Reasons::NONE, 50_000_000);
        assert_eq!(held.visible(50_000_000), limit);
        held.take(Reasons::NONE, READABLE_NS);
        assert_eq!(held.visible(READABLE_NS), Reasons::NONE);
        held.take(limit, 1_000_000_000);
        held.take(Reasons::NONE, 2_000_000_000);
        assert_eq!(held.visible(2_000_000_000), Reasons::NONE);
    }
}
