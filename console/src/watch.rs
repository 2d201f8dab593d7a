//! The thread that reads shared memory: never woken by a writer, sixty looks a second, one newest frame for all pages.

use crate::facts::Facts;
use crate::latency::LiveLatency;
use crate::pad::PadDesk;
use crate::processes::Processes;
use crate::snapshot::{self, Moment, NewestSamples, Slow};
use crate::tracking::LiveTracking;
use crate::{ConsoleError, PageCounts};
use core::time::Duration;
use krait_ipc::message::{Command, Health, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader, Reason, Reasons, clock, health_channel};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::watch::Sender;

/// Pictures a second.
const RATE_HZ: i64 = 60;
const PERIOD_NS: i64 = 1_000_000_000 / RATE_HZ;
/// Frames between two slow messages.
const SLOW_EVERY: u64 = 30;
/// A reason that held more shortly than this is shown for this long, so that it can be read.
const READABLE_NS: i64 = 600_000_000;

/// What the thread gives to the pages: each slot holds the newest only, so that a slow page loses frames, not freshness.
#[derive(Debug)]
pub struct Slots {
    /// A frame and its number.
    pub frame: Sender<(u64, Arc<str>)>,
    /// The newest slow message.
    pub slow: Sender<Arc<str>>,
}

/// Reads an instance's channels.
pub struct Watch {
    bus: Bus,
    inputs: Reader<OperatorInput>,
    setpoints: Reader<Setpoint>,
    commands: Reader<Command>,
    states: Reader<SlaveState>,
    shapes: Reader<Shape>,
    model_updates: Reader<ModelUpdate>,
    healths: Vec<Reader<Health>>,
    newest: NewestSamples,
    tracking: LiveTracking,
    latency: LiveLatency,
    processes: Processes,
    chain_reasons: [Reasons; 3],
    held: Held,
    recording_since_ns: Option<(u32, i64)>,
}

impl Watch {
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
            healths: Process::ALL.into_iter().map(health).collect::<Result<_, _>>()?,
            newest: NewestSamples {
                healths: Process::ALL.map(|process| (process, None)).to_vec(),
                ..NewestSamples::default()
            },
            tracking: LiveTracking::default(),
            latency: LiveLatency::new()?,
            processes: Processes::default(),
            chain_reasons: [Reasons::NONE; 3],
            held: Held::default(),
            recording_since_ns: None,
            bus,
        })
    }

    /// Reads until it is told to stop.
    ///
    /// # Errors
    /// [`ConsoleError`] where a channel is broken.
    pub fn run(
        mut self,
        slots: &Slots,
        pages: &PageCounts,
        facts: &Facts,
        pad: &PadDesk,
        stop: &AtomicBool,
    ) -> Result<(), ConsoleError> {
        let mut due_ns = clock::monotonic_ns();
        for n in 1.. {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            let now_ns = clock::monotonic_ns();
            if due_ns > now_ns {
                std::thread::sleep(Duration::from_nanos((due_ns - now_ns).unsigned_abs()));
            }
            due_ns = (due_ns + PERIOD_NS).max(now_ns);
            self.take_messages(facts.budgets.last().map_or(f64::INFINITY, |whole| whole.worst_us))?;
            let now_ns = clock::monotonic_ns();
            let input = self.newest.input.filter(|input| now_ns - input.sample_ns < snapshot::STALE_NS);
            pad.offer(facts.is_simulated && input.is_some_and(|input| input.is_from_pad()));
            let moment = Moment {
                n,
                now_ns,
                reasons: self.held.visible(now_ns),
                error_rms_rad: self.tracking.rms_rad(now_ns),
                error_rad: self.tracking.newest_rad(),
                pad: pad.seen(now_ns),
            };
            slots.frame.send_replace((n, snapshot::frame(&self.newest, &moment, facts)?.into()));
            if n % SLOW_EVERY == 0 {
                if n % (2 * SLOW_EVERY) == 0 {
                    self.latency.end_second();
                }
                slots.slow.send_replace(serde_json::to_string(&self.slow(now_ns, pages))?.into());
            }
        }
        Ok(())
    }

    fn take_messages(&mut self, worst_us: f64) -> Result<(), IpcError> {
        while let Some(input) = self.inputs.take()? {
            self.newest.input = Some(*input);
        }
        let mut since_last = [None; 3];
        while let Some(setpoint) = self.setpoints.take()? {
            self.tracking.setpoint(setpoint.sample_ns, setpoint.bend_rad);
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
            self.newest.state = Some(*state);
        }
        // A channel that said nothing since the last look still means what it said before.
        for (held, since_last) in self.chain_reasons.iter_mut().zip(since_last) {
            *held = since_last.unwrap_or(*held);
        }
        let mut reasons = self.chain_reasons.iter().fold(Reasons::NONE, |all, some| all.union(*some));
        while let Some(shape) = self.shapes.take()? {
            self.tracking.shape(shape.sample_ns, shape.bend_rad);
            self.newest.shape = Some(*shape);
        }
        if let Some(update) = self.model_updates.take_newest()? {
            self.newest.model_update = Some(*update);
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

    fn slow(&mut self, now_ns: i64, pages: &PageCounts) -> Slow {
        let usages = self.processes.look(self.bus.members(), now_ns);
        let recorder = usages.iter().find(|usage| usage.name == Process::Record.name()).map(|usage| usage.pid);
        self.recording_since_ns = match (recorder, self.recording_since_ns) {
            (Some(pid), Some((known, since_ns))) if pid == known => Some((pid, since_ns)),
            (Some(pid), _) => Some((pid, now_ns - age_of_process_ns(pid).unwrap_or_default())),
            (None, _) => None,
        };
        let counts = [
            self.inputs.n_lost(),
            self.setpoints.n_lost(),
            self.commands.n_lost(),
            self.states.n_lost(),
            self.shapes.n_lost(),
            self.model_updates.n_lost(),
        ];
        let changed = |health: &Health| Reasons::from_bits(health.reasons_now).contains(Reason::ModelChanged);
        Slow {
            k: "slow",
            latency: self.latency.report(),
            processes: snapshot::processes(usages, &self.newest, now_ns),
            n_lost_here: counts.iter().sum(),
            n_pages: pages.open.load(Ordering::Relaxed),
            n_skipped: pages.skipped.load(Ordering::Relaxed),
            model: self.newest.command.map(|command| format!("{:016x}", command.model_hash)),
            has_changed: self.newest.healths.iter().any(|(_, health)| health.as_ref().is_some_and(changed)),
            recording_s: self.recording_since_ns.map(|(_, since_ns)| (now_ns - since_ns) as f64 * 1e-9),
        }
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
