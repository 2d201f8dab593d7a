//! One fault on one simulated chain: start it, let it move, break it, see what becomes of it.

use super::command_line::CommandLine;
use super::harm;
use super::judge::Observed;
use super::kind::{Blow, End, Fault, FaultPlace};
use super::moment::StrikeTime;
use super::pauses::Pauses;
use super::relay::Relay;
use super::watch::SceneWatch;
use crate::cli::{EngageKind, MasterKind};
use crate::commands;
use crate::config::Config;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use anyhow::Context;
use core::fmt::Write;
use core::sync::atomic::AtomicBool;
use krait_ipc::message::{Command, Message, OperatingState, Setpoint, SlaveState};
use krait_ipc::{Bus, Cores, InstanceName, Priority, Process, ReadOptions, Realtime, clock, resources_of};
use krait_record::Recording;
use std::fs;
use std::path::{Path, PathBuf};

/// The snake moves for so many states before anything breaks.
const N_BEFORE: usize = 400;
/// A chain that is ready and has commands for so many states, and nobody has engaged, will not move any more.
const N_IN_VAIN: usize = 5000;
/// How long a chain may take to move, or to be whole again, s: a busy machine, and two seconds of silence.
const PATIENCE_S: f64 = 40.0;
/// How long a chain is watched after a fault, s.
const AFTER_S: f64 = 1.0;
/// How long after a fault of the recording, which is written once a second, s.
const AFTER_WRITTEN_S: f64 = 3.0;
/// How long the hand moves, s: longer than any scene.
const SCRIPT_S: f64 = 300.0;
/// Speed of the tip, m/s; one circle takes 2 s and bends the snake to about 20 deg.
const SCRIPT_M_PER_S: f64 = 0.01;
/// Priority of the stages and the relay.
const PRIORITY: u8 = 20;
/// Position of line 1 from which on its encoder sticks, m.
const STICKS_AT_M: f64 = 1e-4;

/// What a scene needs.
struct Scene<'a> {
    fault: Fault,
    folder: &'a Path,
    config: Config,
    moment: StrikeTime,
    stop: &'a AtomicBool,
}

/// Injects a fault into a chain of its own, whose files lie in a folder.
///
/// # Errors
/// One sentence when there is no chain to break, or a stop was asked for.
pub fn play(fault: Fault, moment: StrikeTime, folder: &Path, stop: &AtomicBool) -> anyhow::Result<Observed> {
    let mut config = Config::default();
    config.record.path = Some(recording_in(fault, folder));
    // A busy machine is another fault than the one that is tried. Where that is refused, the chain goes on without.
    config.realtime = Realtime { priority: Priority::Fixed(PRIORITY), cores: Cores::Any, ..config.realtime };
    let (place, end, _) = fault.row();
    if place == FaultPlace::Snake {
        let truth = folder.join("truth.toml");
        write(&truth, &format!("[encoders]\nsticks_at_m = [{STICKS_AT_M}, 0.0, 0.0]\n"))?;
        config.slave.truth = Some(truth);
    }
    // So much more silence ends the motion.
    let allowed_ns = (config.slave.watchdog_ms * 1e6) as i64 - fault.silence_ns();
    let scene = Scene { fault, folder, config, moment, stop };
    let pauses = Pauses::above(PRIORITY)?;
    let seen = match place {
        _ if end == End::Refused => scene.refused(),
        FaultPlace::Command | FaultPlace::Input => scene.relayed(place),
        FaultPlace::Launch(blow) | FaultPlace::Console(blow) => scene.started_by_hand(place, blow),
        _ => scene.whole(place),
    }?;
    let machine_pause_ms = seen.span_ns.map(|span_ns| pauses.longest_ms(span_ns, allowed_ns)).unwrap_or_default();
    let unreadable = fault.leaves_recording().then(|| read_through(&recording_in(fault, folder)).err()).flatten();
    Ok(Observed {
        left: scene.left()?,
        unreadable: unreadable.map(|error| format!("{error:#}")),
        machine_pause_ms,
        ..seen
    })
}

/// Reads every message of a recording.
fn read_through(path: &Path) -> anyhow::Result<()> {
    for recorded in Recording::open(path)?.samples()? {
        recorded?;
    }
    Ok(())
}

/// Where a scene records.
pub fn recording_in(fault: Fault, folder: &Path) -> PathBuf {
    if fault == Fault::FullDisk { folder.join("disk/run.mcap") } else { folder.join("run.mcap") }
}

impl Scene<'_> {
    /// Another program has made the channel of commands before the chain is started.
    fn refused(&self) -> anyhow::Result<Observed> {
        let instance = self.instance("");
        let mut supervisor = Supervisor::new(&instance, self.stop)?;
        let bus = Bus::open(&instance, "foreign")?;
        let _other_payload = bus.reader_on::<Setpoint>(Command::CHANNEL, ReadOptions::observing())?;
        let started = supervisor.start_chain(&self.options(Cast::live())?, self.stop);
        supervisor.end();
        Ok(Observed { did: started.is_err().then_some(End::Refused), ..Observed::default() })
    }

    /// A chain in one instance, and a blow from outside.
    fn whole(&self, place: FaultPlace) -> anyhow::Result<Observed> {
        let instance = self.instance("");
        let mut supervisor = Supervisor::new(&instance, self.stop)?;
        supervisor.start_recorder(&self.config, self.stop)?;
        supervisor.start_chain(&self.options(Cast::driven())?, self.stop)?;
        let mut watch = SceneWatch::open(supervisor, self.stop)?;
        if place != FaultPlace::Snake {
            self.wait_for_motion(&mut watch)?;
        }
        let n_processes = watch.supervisors[0].processes().len();
        let recording = recording_in(self.fault, self.folder);
        let struck_ns = match place {
            FaultPlace::Process(process, blow) => {
                Some(harm::strike_process(&mut watch, process, blow, self.moment.stall_s)?)
            }
            FaultPlace::Machine => Some(harm::strike_machine(self.fault, &instance, &recording)?),
            _ => None,
        };
        match place {
            FaultPlace::Process(Process::Record, _) => watch.run(AFTER_S)?,
            FaultPlace::Process(_, Blow::Kill | Blow::Hang) => {
                let is_whole = |watch: &SceneWatch<'_>| {
                    let supervisor = &watch.supervisors[0];
                    supervisor.processes().len() == n_processes && supervisor.are_ready()
                };
                watch.until(PATIENCE_S, "the process is lost", |watch| !is_whole(watch))?;
                watch.until(PATIENCE_S, "every process runs again", is_whole)?;
                watch.until(PATIENCE_S, "the drives are ready again", |watch| {
                    watch.states.last().is_some_and(SlaveState::is_ready)
                })?;
            }
            FaultPlace::Snake => watch.until(PATIENCE_S, "the drives are in FAULT", |watch| {
                watch.states.last().is_some_and(|state| state.operating() == Some(OperatingState::Fault))
            })?,
            FaultPlace::Machine if self.fault != Fault::ForeignWriter => watch.run(AFTER_WRITTEN_S)?,
            // Killed while it was stopped, if that took long; then it comes back.
            FaultPlace::Process(..) => watch.until(PATIENCE_S, "every process runs again", |watch| {
                let supervisor = &watch.supervisors[0];
                let is_ready = watch.states.last().is_some_and(SlaveState::is_ready);
                supervisor.processes().len() == n_processes && supervisor.are_ready() && is_ready
            })?,
            _ => {}
        }
        watch.run(AFTER_S)?;
        self.see(watch, struck_ns)
    }

    /// A chain in two instances, with a relay between them.
    fn relayed(&self, place: FaultPlace) -> anyhow::Result<Observed> {
        let (front, back) = (self.instance("-front"), self.instance("-back"));
        let in_front =
            |process: Process| process == Process::Master || place == FaultPlace::Command && process != Process::Slave;
        let cast = |is_front: bool| {
            let mut cast = Cast::live();
            cast.processes.retain(|process| in_front(*process) == is_front);
            cast
        };
        let mut behind = Supervisor::new(&back, self.stop)?;
        behind.start_recorder(&self.config, self.stop)?;
        let mut before = Supervisor::new(&front, self.stop)?;
        let start = if place == FaultPlace::Command { Relay::of_commands } else { Relay::of_input };
        let relay =
            start(self.fault, &front, &back, self.config.realtime.clone()).context("the relay could not be started")?;
        let mut watch = SceneWatch::open(behind, self.stop)?;
        watch.until(PATIENCE_S, "the relay is there", |_| relay.is_open())?;
        // The slave last: the script begins when that is ready, and the operator must be seen absent before.
        before.start_chain(&self.options(cast(true))?, self.stop)?;
        let behind = &mut watch.supervisors[0];
        behind.start_chain(&self.options(cast(false))?, self.stop)?;
        watch.supervisors.push(before);
        self.wait_for_motion(&mut watch)?;
        relay.strike();
        watch.until(PATIENCE_S, "the relay breaks messages", |_| relay.struck_ns().is_some())?;
        let struck_ns = relay.struck_ns();
        watch.run(2.0 * AFTER_S)?;
        let seen = self.see(watch, struck_ns)?;
        relay.end()?;
        Ok(seen)
    }

    /// A chain that a command line has started, and a blow to its supervisor or to the console beside it.
    fn started_by_hand(&self, place: FaultPlace, blow: Blow) -> anyhow::Result<Observed> {
        let bus = Bus::open_unless(&self.instance(""), commands::watch::NAME, self.stop)?;
        let mut watch = SceneWatch::beside(&bus, self.stop)?;
        let mut chain = CommandLine::start(&bus, &self.config, &self.script()?, self.folder)?;
        self.wait_for_motion(&mut watch)?;
        let is_console = matches!(place, FaultPlace::Console(_));
        let pid = if is_console { chain.console_pid(&bus)? } else { chain.launch_pid() };
        let struck_ns = harm::strike_pid(&mut watch, pid, blow, self.moment.stall_s)?;
        let is_over = |_: &SceneWatch<'_>| match (is_console, blow) {
            (false, Blow::Kill) => chain.is_gone(&bus),
            _ => chain.is_whole(&bus, !is_console || blow != Blow::Kill),
        };
        watch.until(PATIENCE_S, "what must become of it", is_over)?;
        watch.run(AFTER_S)?;
        let over_ns = clock::monotonic_ns();
        chain.end()?;
        self.observed(&watch, (Some(struck_ns), over_ns))
    }

    /// Ends the chain and looks at what it has left. What became of the fault is judged by what came before this end: the
    /// master is asked first, and on a busy machine the slave misses it before it is asked itself.
    fn see(&self, mut watch: SceneWatch<'_>, struck_ns: Option<i64>) -> anyhow::Result<Observed> {
        let over_ns = clock::monotonic_ns();
        for supervisor in watch.supervisors.iter_mut().rev() {
            supervisor.end();
        }
        self.observed(&watch, (struck_ns, over_ns))
    }

    fn observed(&self, watch: &SceneWatch<'_>, span_ns: (Option<i64>, i64)) -> anyhow::Result<Observed> {
        let recording = self.fault.is_recorded().then(|| recording_in(self.fault, self.folder));
        Observed::of(recording.as_deref(), &watch.states, span_ns, self.config.slave.limits.rate_m_per_s)
    }

    fn options(&self, cast: Cast) -> anyhow::Result<ChainOptions> {
        let script = self.script()?;
        let (config, master, engage) = (self.config.clone(), MasterKind::Script, Some(EngageKind::Once));
        Ok(ChainOptions { config, master, input: Some(script), looped: false, engage, cast })
    }

    fn script(&self) -> anyhow::Result<PathBuf> {
        let script = self.folder.join("circles.csv");
        write(&script, &circles())?;
        Ok(script)
    }

    fn wait_for_motion(&self, watch: &mut SceneWatch<'_>) -> anyhow::Result<()> {
        moves_for_a_while(watch, self.moment.wait_s)
    }

    /// Files of the scene's instances, which have ended, in shared memory and in the private ground.
    fn left(&self) -> anyhow::Result<Vec<PathBuf>> {
        let mut left = Vec::new();
        for side in ["", "-front", "-back"] {
            left.extend(resources_of(&InstanceName::new(&self.instance(side))?));
        }
        Ok(left)
    }

    fn instance(&self, side: &str) -> String {
        format!("fault-{}{side}", std::process::id())
    }
}

/// The chain stood still before the fault: a busy machine, and no fault of the chain's.
#[derive(Debug, thiserror::Error)]
#[error("{NOT_BEGUN}: the chain stood still by itself, so the machine is too busy for this")]
struct NotBegun;

/// How such a scene begins its sentence.
pub const NOT_BEGUN: &str = "the fault was not tried";

/// Waits until the operator has engaged and the drives have moved for a while.
fn moves_for_a_while(watch: &mut SceneWatch<'_>, wait_s: f64) -> anyhow::Result<()> {
    let has_ended = |states: &[SlaveState]| {
        let engaged = states.iter().position(SlaveState::is_engaged);
        engaged.is_some_and(|first| states[first..].iter().any(|state| !state.is_engaged()))
    };
    let moves = |states: &[SlaveState]| {
        let moves = |state: &&SlaveState| state.is_engaged() && state.flags & SlaveState::FOLLOWING != 0;
        states.iter().rev().take(N_BEFORE).filter(moves).count() == N_BEFORE
    };
    // The script takes hold once; a stall at that moment, and it has done so in vain.
    let is_in_vain = |states: &[SlaveState]| {
        let waits = |state: &SlaveState| state.is_ready() && !state.is_engaged() && state.n_commands > 0;
        states.len() >= N_IN_VAIN && states[states.len() - N_IN_VAIN..].iter().all(waits)
    };
    let stands = |states: &[SlaveState]| has_ended(states) || is_in_vain(states);
    watch.until(PATIENCE_S, "the snake moves", |watch| moves(&watch.states) || stands(&watch.states))?;
    watch.run(wait_s)?;
    if stands(&watch.states) { Err(NotBegun.into()) } else { Ok(()) }
}

/// A script in which the tip goes round and round.
fn circles() -> String {
    let mut text = String::from("time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n");
    let mut time_s = 0.0;
    while time_s < SCRIPT_S {
        let (y, x) = (core::f64::consts::PI * time_s).sin_cos();
        let row = writeln!(text, "{time_s},{},{},0", x * SCRIPT_M_PER_S, y * SCRIPT_M_PER_S);
        debug_assert!(row.is_ok(), "a String takes everything");
        time_s += 0.05;
    }
    text
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    fs::write(path, text).with_context(|| format!("{} could not be written", path.display()))
}
