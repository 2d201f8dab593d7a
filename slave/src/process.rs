//! The slave as a process: a thin loop that takes commands from shared memory, writes the drives first and reports after.

use crate::bus_cycles::BusCycles;
use crate::latency::LatencyWatch;
use crate::shapes::Shapes;
use crate::slave_core::GAP_NS;
use crate::{ConfigError, Drive, SlaveConfig, SlaveCore, Stops, TransitionRefused};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Command, OperatingState, SlaveState, StateCommand, Transition};
use krait_ipc::{Bus, HealthReporter, IpcError, ReadOptions, Reader, Writer};

/// Housekeeping, and reports while no commands come: 1 kHz.
const TICK_NS: i64 = 1_000_000;
/// A stop is over within the watchdog's time; a little more, and the power goes off whatever moves.
const STOP_PATIENCE_NS: i64 = 1_000_000_000;
/// Refusals come a thousand a second; the log gets one a second.
const REFUSAL_LOG_NS: i64 = 1_000_000_000;

/// The slave could not start or go on. It has stopped the drives and taken their power away.
#[derive(Debug, thiserror::Error)]
pub enum SlaveError {
    /// The configuration was refused.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// Another program publishes shapes.
    #[error(
        "another program already publishes measured shapes in instance {instance:?}, and the drive's own camera would be the second; use that program's with --shape external, or end it"
    )]
    ShapeTaken {
        /// The instance.
        instance: String,
    },
}

/// Runs the slave on a drive until `stop`: publishes `SlaveState` at 1 kHz or with every command, `Shape` at the rate of the
/// drive's camera, and health ten times a second, the first of which says that it is ready.
///
/// # Errors
/// [`SlaveError`]; whatever happens the drives are stopped smoothly and disabled first.
pub fn run_with_drive<D: Drive>(
    bus: &Bus,
    config: &SlaveConfig,
    drive: D,
    stop: &AtomicBool,
) -> Result<(), SlaveError> {
    config.check()?;
    drive.traits().check(config)?;
    let mut process = Process::open(bus, config, drive)?;
    process.health.publish(monotonic_ns())?;
    tracing::info!("the slave is ready");
    let served = process.serve(stop);
    let ended = process.end();
    served.and(ended)?;
    Ok(())
}

struct Process<D> {
    core: SlaveCore<D>,
    commands: Reader<Command>,
    state_commands: Reader<StateCommand>,
    stops: Stops,
    states: Writer<SlaveState>,
    shapes: Shapes,
    bus_cycles: BusCycles,
    health: HealthReporter,
    started_ns: i64,
    n_writers: u64,
    tick_due_ns: i64,
    report_due_ns: i64,
    latency: LatencyWatch,
    log: TransitionLog,
}

impl<D: Drive> Process<D> {
    fn open(bus: &Bus, config: &SlaveConfig, drive: D) -> Result<Self, SlaveError> {
        Ok(Self {
            shapes: Shapes::open(bus, &drive, config.shape)?,
            bus_cycles: BusCycles::open(bus, &drive)?,
            core: SlaveCore::new(drive, config),
            commands: bus.reader(ReadOptions::waking().with_mode(config.wait).of(krait_ipc::Process::Slave))?,
            state_commands: bus.reader(ReadOptions::glancing())?,
            stops: Stops::new(bus.stop_switch()?),
            states: bus.writer()?,
            health: HealthReporter::open(bus, krait_ipc::Process::Slave)?,
            started_ns: monotonic_ns(),
            n_writers: 0,
            tick_due_ns: 0,
            report_due_ns: 0,
            latency: LatencyWatch::new(config.latency_limits),
            log: TransitionLog::default(),
        })
    }

    fn serve(&mut self, stop: &AtomicBool) -> Result<(), IpcError> {
        while !stop.load(Ordering::Relaxed) {
            let until_due_ns = self.tick_due_ns.min(self.report_due_ns).saturating_sub(monotonic_ns()).max(0);
            self.commands.wait(Duration::from_nanos(until_due_ns.unsigned_abs()))?;
            while let Some(command) = self.commands.take()? {
                self.take_stops();
                if core::mem::replace(&mut self.n_writers, self.commands.n_writers()) != self.commands.n_writers() {
                    self.core.on_new_writer();
                }
                // The drives come first: everything else in this loop can wait.
                self.core.on_command(&command, monotonic_ns());
                drop(command);
                self.report(GAP_NS)?;
                // A slave that follows has nothing to do until a command is missing: braking begins exactly then.
                if self.core.is_following() {
                    self.tick_due_ns = self.report_due_ns;
                }
            }
            // A stop ends what was under way, also lines that are being relaxed; what is asked for now begins behind it.
            self.take_stops();
            self.take_state_commands()?;
            self.take_stops();
            self.keep_house(monotonic_ns())?;
        }
        Ok(())
    }

    /// Behind the state commands: a stop wins over whatever was asked for at the same time.
    fn take_stops(&mut self) {
        if self.stops.look() {
            self.core.stop(monotonic_ns());
            tracing::warn!("a stop was asked for");
            self.report_due_ns = 0;
        }
        if self.core.is_still() {
            self.stops.obey();
        }
    }

    fn take_state_commands(&mut self) -> Result<(), IpcError> {
        while let Some(command) = self.state_commands.take()? {
            // A late reader is handed the newest message from before it joined; that wish was for the slave before this one.
            if command.sample_ns < self.started_ns {
                continue;
            }
            if command.transition().is_some_and(|own| own.is_late(command.sample_ns, monotonic_ns())) {
                tracing::warn!(
                    sender_pid = command.sender_pid,
                    "a command on the state came too late and was not done"
                );
                continue;
            }
            let result = self.core.on_state_command(&command, monotonic_ns());
            match result {
                // The report below says it once, with what becomes of the others.
                Ok(()) | Err(TransitionRefused::Drive(_)) => {}
                Err(refused) => tracing::warn!(sender_pid = command.sender_pid, "{refused}"),
            }
            drop(command);
            self.report(TICK_NS)?;
        }
        Ok(())
    }

    /// What happens with commands or without.
    fn keep_house(&mut self, now_ns: i64) -> Result<(), IpcError> {
        if now_ns >= self.tick_due_ns {
            let seen = |core: &SlaveCore<D>| (core.gate.written_ns(), core.is_letting_go());
            let before = seen(&self.core);
            self.core.on_tick(now_ns);
            self.tick_due_ns = now_ns + TICK_NS;
            // Every write is reported, so that a recording shows each, and that power went.
            if seen(&self.core) != before {
                self.report_due_ns = now_ns;
            }
        }
        if now_ns >= self.report_due_ns {
            self.report(TICK_NS)?;
        }
        if let Some(shape) = self.core.drive_mut().shape(now_ns) {
            self.shapes.put(now_ns, &shape)?;
            self.shapes.wake()?;
        }
        self.bus_cycles.publish(self.core.drive_mut())?;
        self.count();
        self.health.publish_if_due(now_ns)
    }

    /// Publishes the slave's state; the next report without a command is due after `quiet_ns`.
    fn report(&mut self, quiet_ns: i64) -> Result<(), IpcError> {
        let now_ns = monotonic_ns();
        let state = self.core.report(now_ns);
        self.states.send(&state)?;
        let mut findings = self.core.findings(now_ns);
        self.latency.look(&state, &mut findings);
        findings.tell(self.health.health_mut());
        self.report_due_ns = now_ns + quiet_ns;
        self.log.look(&self.core, &state);
        Ok(())
    }

    fn count(&mut self) {
        self.health.count_readers(&[self.commands.counts(), self.state_commands.counts()]);
        let health = self.health.health_mut();
        health.n_sent = self.states.n_sent() + self.shapes.n_sent() + self.bus_cycles.n_sent();
        health.n_refused = self.core.n_refused + self.commands.n_out_of_order();
    }

    fn publish_last_cycles(&mut self) -> Result<(), IpcError> {
        while !self.bus_cycles.publish(self.core.drive_mut())? {}
        Ok(())
    }

    /// Brings the motion to rest, removes power, publishes the last health. Goes on where a channel fails: the drives matter more.
    fn end(&mut self) -> Result<(), IpcError> {
        self.core.hold();
        self.core.stop_relaxing();
        let mut result = Ok(());
        let give_up_ns = monotonic_ns() + STOP_PATIENCE_NS;
        while !self.core.is_still() && monotonic_ns() < give_up_ns {
            std::thread::sleep(Duration::from_millis(1));
            self.core.on_tick(monotonic_ns());
            result = result.and(self.report(TICK_NS));
        }
        if let Err(refused) = self.core.transition(Transition::Disable, monotonic_ns()) {
            tracing::error!("{refused}");
        }
        result = result.and(self.report(TICK_NS));
        result = result.and(self.publish_last_cycles());
        self.count();
        tracing::info!("the slave has stopped and is disabled");
        result.and(self.health.publish(monotonic_ns()))
    }
}

/// Remembers what was logged last, so that the log gets transitions and not samples.
#[derive(Default)]
struct TransitionLog {
    state: Option<OperatingState>,
    homed: bool,
    following: bool,
    engaged: bool,
    letting_go: bool,
    n_refused: u64,
    refusal_due_ns: i64,
}

impl TransitionLog {
    fn look<D: Drive>(&mut self, core: &SlaveCore<D>, report: &SlaveState) {
        let state = core.machine.state();
        if self.state.replace(state) != Some(state) {
            match core.failure_sentence() {
                Some(sentence) if state == OperatingState::Fault => {
                    tracing::error!("the slave is in FAULT: {sentence}");
                }
                _ => tracing::info!("the slave is {}", state.name()),
            }
        }
        let homed = core.machine.is_homed();
        if core::mem::replace(&mut self.homed, homed) != homed {
            let in_place = report.flags & SlaveState::HOMES_IN_PLACE != 0;
            tracing::info!(
                "the drives {}",
                match (homed, in_place) {
                    (true, true) => "stand within their travel of zero; nothing was moved, and no stop was looked for",
                    (true, false) => "found their zero",
                    (false, _) => "forgot their zero",
                }
            );
        }
        if core::mem::replace(&mut self.letting_go, core.is_letting_go()) != core.is_letting_go() {
            let largest_n = core.largest_load_n();
            if core.is_letting_go() {
                tracing::info!(
                    "power was asked off: the lines are relaxed first, the largest load is {largest_n:.1} N"
                );
            } else {
                tracing::info!("the lines were relaxed, the largest load was {largest_n:.1} N when the power went");
            }
        }
        let following = core.is_following();
        if core::mem::replace(&mut self.following, following) != following {
            tracing::info!("the slave {}", if following { "follows" } else { "holds" });
        }
        if core::mem::replace(&mut self.engaged, core.is_engaged()) != core.is_engaged() {
            if core.is_engaged() {
                tracing::info!("the operator has engaged");
            } else {
                let reasons = core.findings(report.sample_ns).reasons();
                let why: Vec<_> = reasons.iter().map(krait_ipc::Reason::sentence).collect();
                // A state that somebody asked for is no surprise.
                if state == OperatingState::Enabled {
                    tracing::warn!("the engagement has ended: {}", why.join("; "));
                } else {
                    tracing::info!("the engagement has ended: {}", why.join("; "));
                }
            }
        }
        if core.n_refused > self.n_refused && report.sample_ns >= self.refusal_due_ns {
            let findings = core.findings(report.sample_ns);
            for reason in findings.reasons().iter() {
                tracing::warn!(note = ?findings.note_of(reason), "{}", reason.sentence());
            }
            self.n_refused = core.n_refused;
            self.refusal_due_ns = report.sample_ns + REFUSAL_LOG_NS;
        }
    }
}
