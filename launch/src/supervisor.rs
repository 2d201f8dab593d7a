//! Starts the chain's processes, watches them, and ends them in order: nothing stays behind, whatever happens.
//!
//! Invariant: whoever dies or hangs, the slave stops by itself. In a chain of `krait run` the lost process is started again
//! and nobody else is, not engaged; every other chain is whole or it ends. What ends does so in an order that lets the
//! recorder write the last message of every other process.

mod companion;
mod effective;
mod ending;
mod exchange;
mod hand;
mod handover;
mod slave_again;

use crate::authority::Authority;
use crate::budget::BudgetWatch;
use crate::cli::{EngageKind, MasterKind};
use crate::commands;
use crate::config::{Config, STANDARD_INPUT};
use crate::silence::{HANGS_NS, Silence};
use anyhow::{Context, bail};
use core::time::Duration;
pub use effective::KeptConfig;
use exchange::{Exchanged, ModelDesk};
use hand::LastHand;
use handover::arguments_of;
use handover::in_memory;
pub use handover::own_program;
use krait_ipc::message::{Health, OperatingState, SlaveState, Transition};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, WhenLost, clock, health_channel};
use slave_again::{Decision, SlaveAgain};
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Environment variable that tells a process who its supervisor is.
pub const SUPERVISOR_PID: &str = "KRAIT_SUPERVISOR_PID";
/// A process that is not ready by then will not be: opening shared memory takes milliseconds, a busy machine seconds, and a
/// program that a busy disk has yet to read longer. One that ends is noticed at once.
const READY_PATIENCE: Duration = Duration::from_secs(60);
/// A process that has not ended by then is killed; a recorder may have seconds of samples to write.
const END_PATIENCE: Duration = Duration::from_secs(10);
/// A process that is lost this often within [`LOSSES_WITHIN_NS`] will not come right by itself.
const MOST_LOSSES: usize = 5;
/// The time that losses are counted over, ns.
const LOSSES_WITHIN_NS: i64 = 60_000_000_000;
/// How often children and channels are looked at while nothing else happens.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// One instance's processes: a recorder that stays, and the chain, which may be started several times in a row.
pub struct Supervisor {
    instance: String,
    children: Vec<Running>,
    healths: Vec<(Process, Reader<Health>, Option<Health>)>,
    states: Reader<SlaveState>,
    newest_state: Option<SlaveState>,
    n_engagements: u64,
    hand: LastHand,
    budget: Option<BudgetWatch>,
    authority: Authority,
    silence: Silence,
    /// What the chain was started with, if a process of it that is lost shall come back.
    comes_back: Option<ChainOptions>,
    /// What becomes of a slave that was started again.
    slave_again: SlaveAgain,
    losses: Vec<Loss>,
    n_forced: u32,
    /// The page beside the chain, if one was asked for.
    console: Option<Child>,
    n_consoles_lost: u32,
    /// Requests for another model, where the chain takes them.
    models: Option<ModelDesk>,
    n_exchanges: u32,
    exchanged: Option<Exchanged>,
    // Last: the instance's files go when its last member goes.
    bus: Bus,
}

/// A process of the chain ended and has said why in its own sentence; there is nothing to add.
#[derive(Debug, thiserror::Error)]
#[error("a process of the chain has said why it ended")]
pub struct AlreadyTold;

/// A process of a live chain that was lost.
struct Loss {
    process: Process,
    at_ns: i64,
}

struct Running {
    process: Process,
    child: Child,
    ended: bool,
    /// Whether it was killed because it said nothing.
    hung: bool,
}

/// What the chain shall run with.
#[derive(Clone, Debug)]
pub struct ChainOptions {
    /// The configuration, complete.
    pub config: Config,
    /// Where the operator's motion comes from.
    pub master: MasterKind,
    /// Recording or script to play; nothing means the shipped recording.
    pub input: Option<PathBuf>,
    /// Whether the input begins anew when it ends.
    pub looped: bool,
    /// How often a recording or script engages, if it was asked to.
    pub engage: Option<EngageKind>,
    /// Which processes take part, and whose time they keep.
    pub cast: Cast,
}

/// The processes of a chain besides the recorder, and the time that they keep.
#[derive(Clone, Debug)]
pub struct Cast {
    /// Who takes part.
    pub processes: Vec<Process>,
    /// A replay's own time, ns: where it begins. Without it the processes keep the machine's clock.
    pub recorded_time_ns: Option<i64>,
    /// Whether a process that is lost is started again, as [`Process::when_lost`] says; otherwise the chain ends with it.
    pub comes_back: bool,
}

impl Cast {
    /// Every process of a live chain, on the machine's clock.
    pub fn live() -> Self {
        Self {
            processes: Process::START_ORDER.into_iter().filter(|process| *process != Process::Record).collect(),
            recorded_time_ns: None,
            comes_back: false,
        }
    }

    /// The same for a chain that an operator drives: what is lost comes back.
    pub fn driven() -> Self {
        Self { comes_back: true, ..Self::live() }
    }
}

/// Refuses an instance in which a chain runs, or whatever else may move its drives.
///
/// # Errors
/// One sentence that says which.
pub fn refuse_company(bus: &Bus) -> anyhow::Result<()> {
    let is_of_a_chain =
        |(name, pid): &(String, u32)| *pid != std::process::id() && !commands::TOOLS.contains(&name.as_str());
    if let Some((name, pid)) = bus.members().into_iter().find(is_of_a_chain) {
        bail!(
            "instance {:?} is already running (its process `{name}` has pid {pid}); \
             stop that chain or choose another name with --instance",
            bus.instance().as_str()
        );
    }
    Ok(())
}

impl Supervisor {
    /// Joins an instance that nobody else runs.
    ///
    /// # Errors
    /// One sentence when the instance is taken or shared memory cannot be used.
    pub fn new(instance: &str, stop: &AtomicBool) -> anyhow::Result<Self> {
        let bus = Bus::open_unless(instance, "launch", stop)?;
        refuse_company(&bus)?;
        // A chain that was killed has left its own, where somebody is in the instance still.
        effective::remove(&bus);
        let mut healths = Vec::new();
        for process in Process::ALL {
            healths.push((process, bus.reader_on(&health_channel(process), ReadOptions::glancing())?, None));
        }
        Ok(Self {
            instance: instance.to_owned(),
            children: Vec::new(),
            healths,
            states: bus.reader(ReadOptions::observing())?,
            newest_state: None,
            n_engagements: 0,
            hand: LastHand::open(&bus)?,
            budget: None,
            authority: Authority::open(&bus)?,
            silence: Silence::default(),
            comes_back: None,
            slave_again: SlaveAgain::open(&bus)?,
            losses: Vec::new(),
            n_forced: 0,
            console: None,
            n_consoles_lost: 0,
            models: None,
            n_exchanges: 0,
            exchanged: None,
            bus,
        })
    }

    /// Starts the recorder and waits until it hears every channel.
    ///
    /// # Errors
    /// One sentence: it ended (it has said why), or a stop was asked for.
    pub fn start_recorder(&mut self, config: &Config, stop: &AtomicBool) -> anyhow::Result<()> {
        self.spawn(Process::Record, &config.with_model_text()?, &[])?;
        self.wait_until("the recorder is ready", stop, |s| s.is_ready(Process::Record))
    }

    /// Starts the chain, waits until each process is ready, then homes and enables the slave.
    ///
    /// # Errors
    /// One sentence: a process ended (it has said why) or did not become ready, or a stop was asked for.
    pub fn start_chain(&mut self, options: &ChainOptions, stop: &AtomicBool) -> anyhow::Result<()> {
        let options = &ChainOptions { config: options.config.with_model_text()?, ..options.clone() };
        self.children.retain(|running| !running.ended);
        self.newest_state = None;
        effective::keep(&self.bus, &options.config);
        if self.budget.is_none() {
            self.budget = Some(BudgetWatch::new(options.config.budget)?);
        }
        let is_live = options.cast.recorded_time_ns.is_none();
        let learns = options.config.model()?.machine.needs_estimate();
        let takes_part =
            |process: &Process| options.cast.processes.contains(process) && (learns || *process != Process::Estimate);
        let cast = || Process::START_ORDER.into_iter().filter(takes_part);
        for process in cast() {
            let arguments = arguments_of(process, options);
            self.spawn(process, &options.config, &arguments)?;
            // One after the other: whoever speaks is heard by everyone from its first word. In a replay all are silent
            // until the last is ready.
            if is_live {
                self.wait_until_ready(process, stop)?;
            }
        }
        for process in cast().filter(|_| !is_live) {
            self.wait_until_ready(process, stop)?;
        }
        if !options.cast.processes.contains(&Process::Slave) {
            return Ok(());
        }
        self.authority.command(Transition::Enable)?;
        self.wait_until("the slave is enabled", stop, |s| {
            s.newest_state.is_some_and(|state| state.operating() == Some(OperatingState::Enabled))
        })?;
        // With `home_on_start` the slave homes by itself when it is first enabled.
        if !options.config.slave.home_on_start {
            self.authority.command(Transition::Home)?;
        }
        self.wait_until("the slave is homed", stop, |s| s.newest_state.is_some_and(|state| state.is_ready()))?;
        self.comes_back = options.cast.comes_back.then(|| options.clone());
        self.models = self.comes_back.is_some().then(|| ModelDesk::open(&self.bus)).transpose()?;
        Ok(())
    }

    /// The bus of the instance, to look at its channels.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// What runs now, with process ids.
    pub fn processes(&self) -> Vec<(Process, u32)> {
        self.children
            .iter()
            .filter(|running| !running.ended)
            .map(|running| (running.process, running.child.id()))
            .collect()
    }

    /// The newest health of a process, if it has said anything.
    pub fn health(&self, process: Process) -> Option<&Health> {
        self.healths.iter().find(|(known, ..)| *known == process).and_then(|(_, _, health)| health.as_ref())
    }

    /// How often the operator has engaged, over every chain that this supervisor has started.
    pub fn n_engagements(&self) -> u64 {
        self.n_engagements
    }

    /// The newest slave state of the chain that runs or has just ended.
    pub fn newest_state(&self) -> Option<&SlaveState> {
        self.newest_state.as_ref()
    }

    /// Latency against the budget, over every chain that this supervisor has started.
    pub fn budget(&self) -> Option<&BudgetWatch> {
        self.budget.as_ref()
    }

    /// Whether every process that runs has said that it is ready.
    pub fn are_ready(&self) -> bool {
        self.processes().into_iter().all(|(process, _)| self.is_ready(process))
    }

    /// Whether every process lived until it was told to end, and then ended by itself.
    pub fn is_unscathed(&self) -> bool {
        self.losses.is_empty() && self.n_forced == 0 && self.n_consoles_lost == 0
    }

    /// Looks at every channel and every process once; a process that is lost is started again where that is the rule.
    ///
    /// # Errors
    /// One sentence that names the process that died or hangs.
    pub fn look(&mut self) -> anyhow::Result<()> {
        self.take_messages()?;
        self.authority.serve(self.newest_state.as_ref())?;
        self.kill_what_hangs()?;
        self.look_at_console();
        for position in 0..self.children.len() {
            let running = &mut self.children[position];
            if running.ended {
                continue;
            }
            if let Some(status) = running.child.try_wait().context("a process could not be watched")? {
                running.ended = true;
                let (process, pid) = (running.process, running.child.id());
                self.silence.forget(process);
                let how = match running.hung {
                    true => format!("said nothing for {} s and was killed", HANGS_NS / 1_000_000_000),
                    false => format!("ended: {status}"),
                };
                if self.comes_back.is_none() && status.code() == Some(i32::from(crate::COULD_NOT_RUN)) {
                    return Err(AlreadyTold.into());
                }
                self.lost(process, pid, &how)?;
            }
        }
        self.enable_new_slave()
    }

    /// Kills what is there but says nothing: stopped, swapped out or in an endless loop.
    fn kill_what_hangs(&mut self) -> anyhow::Result<()> {
        self.silence.look(clock::monotonic_ns());
        for running in self.children.iter_mut().filter(|running| !running.ended) {
            let health = self.healths.iter().find(|(known, ..)| *known == running.process);
            let newest = health.and_then(|(_, _, health)| health.as_ref());
            if let Some(health) = newest.filter(|health| health.pid == running.child.id()) {
                self.silence.heard(running.process, health.sequence);
            }
            if self.silence.hangs(running.process) && !running.hung {
                running.hung = true;
                self.n_forced += 1;
                running.child.kill().with_context(|| format!("process `{}` hangs", running.process))?;
            }
        }
        Ok(())
    }

    /// What becomes of the chain without a process.
    fn lost(&mut self, process: Process, pid: u32, how: &str) -> anyhow::Result<()> {
        let Some(options) = self.comes_back.clone() else {
            bail!("the chain was ended because its process `{process}` (pid {pid}) {how}");
        };
        let now_ns = clock::monotonic_ns();
        self.losses.push(Loss { process, at_ns: now_ns });
        let is_recent = |loss: &&Loss| loss.process == process && now_ns - loss.at_ns < LOSSES_WITHIN_NS;
        if self.losses.iter().filter(is_recent).count() >= MOST_LOSSES {
            bail!(
                "the chain was ended because its process `{process}` was lost {MOST_LOSSES} times within {} s; \
                 the last one (pid {pid}) {how}",
                LOSSES_WITHIN_NS / 1_000_000_000
            );
        }
        tracing::error!("process `{process}` (pid {pid}) {how}; {}", process.loss());
        if process.when_lost() == WhenLost::GoOn {
            return Ok(());
        }
        if process == Process::Slave {
            self.slave_again.lost(self.newest_state.take(), now_ns);
        }
        if process == Process::Compensate && self.has_tripped() {
            bail!(
                "the chain was ended because its process `compensate` (pid {pid}) {how} after the measured shape had left the model; \
                 look at the machine, then start the chain anew"
            );
        }
        // A recording or script that engages once has done so; its edge from the beginning must not be another.
        let engage = options.engage.filter(|engage| *engage == EngageKind::Again);
        let mut arguments = arguments_of(process, &ChainOptions { engage, ..options.clone() });
        arguments.extend(self.hand.arguments_of(process));
        self.spawn(process, &options.config, &arguments)?;
        self.silence.expect(process);
        Ok(())
    }

    /// A slave that was started again is enabled and homed if the one before was, and nobody has asked for less since; that
    /// engages nobody.
    fn enable_new_slave(&mut self) -> anyhow::Result<()> {
        self.slave_again.look(clock::monotonic_ns());
        if !self.slave_again.is_awaited() || !self.is_ready(Process::Slave) {
            return Ok(());
        }
        match self.slave_again.decide(self.authority.held_back_ns()) {
            Some(Decision::Enable { home }) => {
                self.authority.command(Transition::Enable)?;
                // With `home_on_start` the slave homes by itself when it is first enabled.
                if home && self.comes_back.as_ref().is_some_and(|options| !options.config.slave.home_on_start) {
                    self.authority.command(Transition::Home)?;
                }
            }
            Some(Decision::StayDisabled(why)) => {
                tracing::warn!(
                    "the slave was started again and stays DISABLED, because {why}; `krait state enable` enables it"
                );
            }
            None => {}
        }
        Ok(())
    }

    /// Whether `compensate` has ended the motion because the measured shape left the model, which its memory alone knows.
    fn has_tripped(&self) -> bool {
        let has = |health: &Health| Reasons::from_bits(health.reasons_ever).contains(Reason::MismatchTrip);
        self.health(Process::Compensate).is_some_and(has)
    }

    fn spawn(&mut self, process: Process, config: &Config, arguments: &[OsString]) -> anyhow::Result<()> {
        let mut command = self.command_of(process.name(), config)?;
        command.args(arguments).stdout(Stdio::null());
        let child = command.spawn().with_context(|| format!("process `{process}` could not be started"))?;
        tracing::info!(process = process.name(), pid = child.id(), "started");
        // What the one before had said last, and when, is no word of this one.
        self.silence.forget(process);
        self.children.push(Running { process, child, ended: false, hung: false });
        Ok(())
    }

    /// The start of a command line of this program in the instance, with its configuration as an open file.
    fn command_of(&self, verb: &str, config: &Config) -> anyhow::Result<Command> {
        let mut command = Command::new(own_program()?);
        command.args([verb, "--config", STANDARD_INPUT, "--instance", &self.instance]).stdin(in_memory(config)?);
        // A group of its own: Ctrl-C reaches the supervisor alone, which then ends the processes in order.
        command.process_group(0).env(SUPERVISOR_PID, std::process::id().to_string());
        Ok(command)
    }

    fn is_ready(&self, process: Process) -> bool {
        let running = self.children.iter().find(|running| running.process == process && !running.ended);
        running.is_some_and(|running| self.health(process).is_some_and(|health| health.pid == running.child.id()))
    }

    fn wait_until_ready(&mut self, process: Process, stop: &AtomicBool) -> anyhow::Result<()> {
        self.wait_until(&format!("process `{process}` is ready"), stop, |s| s.is_ready(process))
    }

    fn wait_until(&mut self, what: &str, stop: &AtomicBool, done: impl Fn(&Self) -> bool) -> anyhow::Result<()> {
        let deadline_ns = clock::monotonic_ns() + READY_PATIENCE.as_nanos() as i64;
        while !done(self) {
            self.look()?;
            if stop.load(Ordering::Relaxed) {
                bail!("stopped before {what}");
            }
            if clock::monotonic_ns() > deadline_ns {
                bail!(
                    "{what}: that did not come about within {} s; KRAIT_LOG=info shows why",
                    READY_PATIENCE.as_secs()
                );
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Ok(())
    }

    fn take_messages(&mut self) -> anyhow::Result<()> {
        self.hand.look()?;
        while let Some(state) = self.states.take()? {
            if let Some(budget) = &mut self.budget {
                budget.state(&state);
            }
            let was_engaged = self.newest_state.is_some_and(|before| before.is_engaged());
            self.n_engagements += u64::from(state.is_engaged() && !was_engaged);
            self.newest_state = Some(*state);
        }
        for (_, reader, newest) in &mut self.healths {
            if let Some(health) = reader.take_newest()? {
                *newest = Some(*health);
            }
        }
        Ok(())
    }
}
