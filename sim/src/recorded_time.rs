//! A simulated machine in a replay's own time: now is what the newest command says, so an hour can pass in a minute.
//!
//! Only the simulation can be had here: a real drive's watchdog, limits and brakes stay on the machine's clock.
//! Everything else is the slave as ever: the same core, limiter, watchdog and braking, told another time.

use crate::process::{SimError, Simulation, simulated, simulated_joints, simulated_segments};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{Command, SlaveState, StateCommand, Transition};
use krait_ipc::{Bus, HealthReporter, IpcError, Process, ReadOptions, Reader, Writer, clock};
use krait_slave::{Drive, ShapeSource, Shapes, SlaveConfig, SlaveCore, Stops};

/// One tick of the slave's time, ns.
const TICK_NS: i64 = 1_000_000;
/// How long the process sleeps at most before it looks whether it shall stop.
const PATIENCE: Duration = Duration::from_millis(20);
/// Ticks that a gap between two commands is worth at most: after a second the slave has long come to rest.
const MOST_TICKS: i64 = 1_000;
/// Ticks that homing may take: longer than any travel at the slowest homing speed, and not for ever.
const MOST_HOMING_TICKS: i64 = 100_000;

/// Runs the slave on a simulated machine in the time of its commands, which begins at `start_ns`, until `stop`. Publishes
/// exactly one state for each command, after the shapes of the same instant.
///
/// # Errors
/// [`SimError`] when the configuration is refused or a channel fails.
pub fn run_in_recorded_time(
    bus: &Bus,
    config: &SlaveConfig,
    machine: Simulation,
    start_ns: i64,
    stop: &AtomicBool,
) -> Result<(), SimError> {
    match machine {
        Simulation::Snake(gripper) => run_drive(bus, config, simulated(config, gripper)?, start_ns, stop),
        Simulation::Joints(n) => run_drive(bus, config, simulated_joints(config, n)?, start_ns, stop),
        Simulation::Segments(own) => run_drive(bus, config, simulated_segments(config, &own)?, start_ns, stop),
    }
}

fn run_drive<D: Drive>(
    bus: &Bus,
    config: &SlaveConfig,
    drive: D,
    start_ns: i64,
    stop: &AtomicBool,
) -> Result<(), SimError> {
    let mut slave = Slave {
        // The simulated machine's own camera, whoever measured when it was recorded: the machine of a replay is another.
        shapes: Shapes::open(bus, &drive, ShapeSource::Camera)?,
        core: SlaveCore::new(drive, config),
        commands: bus.reader(ReadOptions::waking())?,
        state_commands: bus.reader(ReadOptions::glancing())?,
        stops: Stops::new(bus.stop_switch()?),
        states: bus.writer()?,
        health: HealthReporter::open(bus, Process::Slave)?,
        started_ns: clock::monotonic_ns(),
        now_ns: start_ns,
    };
    slave.health.publish(clock::monotonic_ns())?;
    while !stop.load(Ordering::Relaxed) {
        slave.commands.wait(PATIENCE)?;
        slave.take_commands()?;
        slave.take_state_commands()?;
        slave.take_stops();
        slave.count();
        slave.health.publish_if_due(clock::monotonic_ns())?;
    }
    Ok(slave.end()?)
}

struct Slave<D> {
    core: SlaveCore<D>,
    commands: Reader<Command>,
    state_commands: Reader<StateCommand>,
    stops: Stops,
    states: Writer<SlaveState>,
    shapes: Shapes,
    health: HealthReporter,
    // On the machine's clock, like the state commands.
    started_ns: i64,
    // In the replay's time.
    now_ns: i64,
}

impl<D: Drive> Slave<D> {
    fn take_commands(&mut self) -> Result<(), IpcError> {
        while let Some(command) = self.commands.take()? {
            let due_ns = command.stamps.command_sent_ns.max(self.now_ns);
            self.pass_time(due_ns);
            self.core.on_command(&command, due_ns);
            drop(command);
            self.core.on_tick(due_ns);
            self.tell()?;
        }
        self.shapes.wake()?;
        self.states.wake()
    }

    /// The ticks that lie between the newest one and an instant: watchdog and braking as in any slave.
    fn pass_time(&mut self, due_ns: i64) {
        self.now_ns = self.now_ns.max(due_ns - MOST_TICKS * TICK_NS);
        while self.now_ns + TICK_NS < due_ns {
            self.now_ns += TICK_NS;
            self.core.on_tick(self.now_ns);
        }
        self.now_ns = due_ns;
    }

    fn take_stops(&mut self) {
        if self.stops.look() {
            self.core.stop(clock::monotonic_ns());
        }
        // The replay's time passes with the samples, so nothing moves before the next one.
        self.stops.obey();
    }

    fn take_state_commands(&mut self) -> Result<(), IpcError> {
        while let Some(command) = self.state_commands.take()? {
            if command.sample_ns < self.started_ns {
                continue;
            }
            if let Err(refused) = self.core.on_state_command(&command, self.now_ns) {
                tracing::warn!(sender_pid = command.sender_pid, "{refused}");
            }
            let mut n_ticks = 0;
            while (self.core.is_busy() || self.core.is_letting_go()) && n_ticks < MOST_HOMING_TICKS {
                self.now_ns += TICK_NS;
                self.core.on_tick(self.now_ns);
                n_ticks += 1;
            }
            self.tell()?;
            self.shapes.wake()?;
            self.states.wake()?;
        }
        Ok(())
    }

    /// Publishes what is to be said at this instant: first the shapes, then the state.
    fn tell(&mut self) -> Result<(), IpcError> {
        while let Some(shape) = self.core.drive_mut().shape(self.now_ns) {
            self.shapes.put(self.now_ns, &shape)?;
        }
        self.states.put(&self.core.report(self.now_ns))?;
        self.core.findings(self.now_ns).tell(self.health.health_mut());
        Ok(())
    }

    fn count(&mut self) {
        self.health.count_readers(&[self.commands.counts(), self.state_commands.counts()]);
        let health = self.health.health_mut();
        health.n_sent = self.states.n_sent() + self.shapes.n_sent();
        health.n_refused = self.core.n_refused() + self.commands.n_out_of_order();
    }

    fn end(&mut self) -> Result<(), IpcError> {
        self.core.hold();
        self.pass_time(self.now_ns + MOST_TICKS * TICK_NS);
        if let Err(refused) = self.core.transition(Transition::Disable, self.now_ns) {
            tracing::error!("{refused}");
        }
        self.tell()?;
        self.states.wake()?;
        self.count();
        self.health.publish(clock::monotonic_ns())
    }
}
