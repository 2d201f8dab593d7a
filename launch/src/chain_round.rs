//! krait's own chain as one of the chains that `krait bench` measures: the real processes on the simulated snake.

use crate::cli::{EngageKind, MasterKind};
use crate::config::Config;
use crate::evidence::SampleFigures;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use anyhow::{Context, bail};
use core::fmt::Write;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_bench::{Plan, RelaySample, Round, Scratch, Usage};
use krait_ipc::message::{HopStamps, SlaveState};
use krait_ipc::{ReadOptions, Reader, clock};
use std::process::Child;

/// How often the slave's states are read; the reader's buffer holds 8192.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Length of the script that moves the operator's hand, over and over, s.
const SCRIPT_S: f64 = 2.0;
/// Speed of the tip in the script, m/s: bends the snake to about 20 deg and back.
const SCRIPT_M_PER_S: f64 = 0.01;

/// Who listens to a chain beside its own processes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Listeners {
    /// Whether a recorder writes every channel to a file.
    pub recorder: bool,
    /// Processes that read every channel as a console does.
    pub n_observers: usize,
}

/// Measures krait's chain once.
///
/// # Errors
/// One sentence when the chain could not be started, ended early, or a stop was asked for.
pub fn run(config: &Config, plan: &Plan, listeners: Listeners, stop: &AtomicBool) -> anyhow::Result<Round> {
    let scratch = Scratch::new()?;
    let instance = scratch.prefix().trim_start_matches("krait-").trim_end_matches('.').to_owned();
    let options = chain_options(config, plan, &scratch)?;
    let mut supervisor = Supervisor::new(&instance, stop)?;
    if listeners.recorder {
        supervisor.start_recorder(&options.config, stop)?;
    }
    let observers = (0..listeners.n_observers).map(|_| super::commands::yardstick::observer(&instance).map(Observer));
    let observers: Vec<Observer> = observers.collect::<Result<_, _>>()?;
    supervisor.start_chain(&options, stop)?;
    let mut pids: Vec<u32> = supervisor.processes().into_iter().map(|(_, pid)| pid).collect();
    pids.extend(observers.iter().map(|observer| observer.0.id()));
    let mut watch = Watch { states: supervisor.bus().reader(ReadOptions::observing())?, round: Round::default() };
    watch.run(&mut supervisor, plan.warm_up_s(), stop)?;
    let before = usage_of(&pids);
    watch.round = Round::default();
    watch.run(&mut supervisor, plan.round_s(), stop)?;
    let mut round = watch.round;
    round.usage = usage_of(&pids) - before;
    drop((observers, watch.states));
    supervisor.end_chain();
    let counts = SampleFigures::of(&supervisor);
    (round.n_sent, round.n_lost) = (counts.sent, counts.lost);
    supervisor.end();
    Ok(round)
}

fn chain_options(config: &Config, plan: &Plan, scratch: &Scratch) -> anyhow::Result<ChainOptions> {
    let mut config = config.clone();
    config.master.rate_hz = plan.rate_hz;
    config.record.path = Some(scratch.folder().join("run.mcap"));
    let script = scratch.folder().join("circle.csv");
    std::fs::write(&script, circle()).with_context(|| format!("{} could not be written", script.display()))?;
    Ok(ChainOptions {
        config,
        master: MasterKind::Script,
        input: Some(script),
        looped: true,
        engage: Some(EngageKind::Again),
        cast: Cast::live(),
    })
}

/// A script whose velocity turns round once: the tip goes out, along a circle and back.
fn circle() -> String {
    let mut text = String::from("time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n");
    for step in 0..=40 {
        let part = f64::from(step) / 40.0;
        let (y, x) = (core::f64::consts::TAU * part).sin_cos();
        let row = writeln!(text, "{},{},{},0", part * SCRIPT_S, x * SCRIPT_M_PER_S, y * SCRIPT_M_PER_S);
        debug_assert!(row.is_ok(), "a String takes everything");
    }
    text
}

fn usage_of(pids: &[u32]) -> Usage {
    pids.iter().fold(Usage::default(), |usage, pid| usage.beside(Usage::of(&pid.to_string())))
}

/// The process that reads every channel; it ends with the round.
struct Observer(Child);

impl Drop for Observer {
    fn drop(&mut self) {
        let _ended_is_fine = self.0.kill();
        let _ended_is_fine = self.0.wait();
    }
}

/// Collects a sample per command from the slave's states.
struct Watch {
    states: Reader<SlaveState>,
    round: Round,
}

impl Watch {
    fn run(&mut self, supervisor: &mut Supervisor, seconds: f64, stop: &AtomicBool) -> anyhow::Result<()> {
        let end_ns = clock::monotonic_ns() + (seconds * 1e9) as i64;
        while clock::monotonic_ns() < end_ns {
            if stop.load(Ordering::Relaxed) {
                bail!("stopped before the measurement was over");
            }
            supervisor.look()?;
            self.take_all()?;
            std::thread::sleep(LOOK_EVERY);
        }
        self.take_all()
    }

    fn take_all(&mut self) -> anyhow::Result<()> {
        while let Some(state) = self.states.take()? {
            let is_known = self.round.samples.last().is_some_and(|last| last.sequence == state.command_sequence);
            if is_known || state.stamps.drive_written_ns == 0 {
                continue;
            }
            let stamps = &state.stamps;
            self.round.samples.push(RelaySample {
                sequence: state.command_sequence,
                source_ns: stamps.device_ns,
                arrived_ns: [stamps.setpoint_sent_ns, stamps.command_sent_ns, stamps.drive_written_ns],
            });
            self.round.own_work_ns.push(u32::try_from(own_work_ns(stamps)).unwrap_or(u32::MAX));
        }
        Ok(())
    }
}

/// What the stages did between having a sample and passing it on, all four together.
fn own_work_ns(stamps: &HopStamps) -> i64 {
    (stamps.input_sent_ns - stamps.device_ns)
        + (stamps.setpoint_sent_ns - stamps.resolve_begun_ns)
        + (stamps.command_sent_ns - stamps.compensate_begun_ns)
        + (stamps.drive_written_ns - stamps.slave_begun_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_work_leaves_out_every_wait_between_two_stages() {
        let stamps = HopStamps {
            device_ns: 1000,
            input_sent_ns: 1001,
            resolve_begun_ns: 2000,
            setpoint_sent_ns: 2020,
            compensate_begun_ns: 3000,
            command_sent_ns: 3300,
            slave_begun_ns: 4000,
            drive_written_ns: 8000,
        };
        assert_eq!(own_work_ns(&stamps), 1 + 20 + 300 + 4000);
    }

    #[test]
    fn the_script_is_one_that_the_master_plays_and_ends_where_it_began() {
        let script = krait_master::Script::parse("circle", circle().as_bytes());
        script.expect("a script");
    }
}
