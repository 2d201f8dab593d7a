//! `krait replay FILE --slave recorded`: the slave alone again, on drives that answer what real ones answered then.

use crate::cli::Common;
use crate::cli_replay::{ReplayArgs, Speed};
use crate::config::Config;
use crate::{print, recorded};
use anyhow::{Context, ensure};
use krait_drives::{Repeated, setup_of};
use krait_ipc::{Process, clock};
use krait_record::Recording;
use krait_replay::{SlaveRun, repeat_slave};
use krait_slave::{DriveKind, SlaveConfig};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What a repetition came to.
#[derive(Debug, Serialize)]
struct Figures {
    /// What was repeated.
    played: PathBuf,
    /// Which pass of it, from 1.
    pass: u64,
    /// Cycles of the bus that were run again.
    cycles: u64,
    /// Cycles that the recording does not hold.
    cycles_missing: u64,
    /// Cycles that stand under a failure.
    cycles_failed: u64,
    /// Cycles that the slave did not fetch in time when it was recorded.
    cycles_left_out: u64,
    /// Cycles in which the slave wished for something else.
    wishes_differ: u64,
    /// Cycles in which the bus was told something else.
    goals_differ: u64,
    /// Cycles that were judged otherwise.
    judged_otherwise: u64,
    /// The first cycle that differs.
    first_difference: Option<First>,
    /// Steps of the slave.
    steps: u64,
    /// Steps after which the drives' setpoint was another.
    setpoints_differ: u64,
    /// Steps whose command the recording does not hold.
    steps_without_cause: u64,
    /// Recorded time, s.
    played_s: f64,
    /// Time that this took, s.
    took_s: f64,
}

/// A cycle that came out otherwise.
#[derive(Debug, Serialize)]
struct First {
    cycle: u64,
    field: String,
    recorded: String,
    repeated: String,
}

/// Repeats the slave of a recording and says how its wishes and what its bus was told compare.
pub fn run(common: &Common, args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    check(args)?;
    let named = || format!("recording {}", args.file.display());
    let recording = Recording::open_beginning(&args.file)?;
    let settings = recorded::settings_of(&recording).with_context(named)?;
    let slave = slave_of(common, args, settings.slave).with_context(named)?;
    let begun_ns = clock::monotonic_ns();
    let run = repeated(args, &slave).with_context(named)?;
    let took_s = (clock::monotonic_ns() - begun_ns) as f64 * 1e-9;
    let figures = figures(&args.file, args.pass, run, took_s);
    if args.json {
        print::json(&figures)?;
    } else {
        print::out(&sentence(&figures))?;
    }
    Ok(if is_same(&figures) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What belongs to a chain that is played has no place where nothing is played.
fn check(args: &ReplayArgs) -> anyhow::Result<()> {
    let others = [
        (args.step, "--step"),
        (args.speed != Speed::Times(1.0), "--speed"),
        (args.from != 0.0, "--from"),
        (args.to.is_some(), "--to"),
        (args.loops != 1, "--loops"),
        (args.model.is_some(), "--model"),
        (args.compensation.is_some(), "--compensation"),
        (args.truth.is_some(), "--truth"),
        (args.real_time, "--real-time"),
        (args.engage, "--engage"),
        (args.recording.is_some(), "--recording"),
        (args.replace.iter().any(|stage| *stage != Process::Slave), "--replace of another stage than slave"),
    ];
    for (is_given, option) in others {
        ensure!(
            !is_given,
            "--slave recorded runs the slave alone, each step at its recorded instant, on drives that answer what they answered: \
             {option} has no place there; leave it out"
        );
    }
    Ok(())
}

/// The slave's settings: the recording's, or those of --config for --replace slave. Its drives are those of the recording where that
/// configuration names none.
fn slave_of(common: &Common, args: &ReplayArgs, recorded: SlaveConfig) -> anyhow::Result<SlaveConfig> {
    let slave = match common.config.as_deref() {
        None => recorded,
        Some(path) => {
            ensure!(
                args.replace.contains(&Process::Slave),
                "--config {}: a recording brings its own settings; name the stage that shall have these with --replace slave",
                path.display()
            );
            let other = Config::load(Some(path))?.slave;
            if other.drive.kind == DriveKind::Sim { SlaveConfig { drive: recorded.drive, ..other } } else { other }
        }
    };
    slave.check()?;
    Ok(slave)
}

fn repeated(args: &ReplayArgs, slave: &SlaveConfig) -> anyhow::Result<SlaveRun> {
    // A recording of simulated drives has no cycles, and that is the sentence; its settings have no bus either.
    let setup = match slave.drive.kind {
        DriveKind::Sim => return Err(krait_replay::ReplayError::NoCycles.into()),
        DriveKind::Sts3215 | DriveKind::Xl330 | DriveKind::Cia402 => setup_of(slave)?,
    };
    // What failed then is no news of drives that are here.
    let silence = tracing::subscriber::NoSubscriber::new();
    Ok(tracing::subscriber::with_default(silence, || repeat_slave(&args.file, args.pass, slave, &setup))?)
}

fn figures(path: &Path, pass: u64, run: SlaveRun, took_s: f64) -> Figures {
    let SlaveRun { cycles, n_left_out, n_steps, n_setpoints_differ, n_without_cause, recorded_s } = run;
    let Repeated { n_cycles, n_missing, n_wishes_differ, n_goals_differ, n_judged_otherwise, n_failed, .. } = cycles;
    Figures {
        played: path.to_owned(),
        pass,
        cycles: n_cycles,
        cycles_missing: n_missing,
        cycles_failed: n_failed,
        cycles_left_out: n_left_out,
        wishes_differ: n_wishes_differ,
        goals_differ: n_goals_differ,
        judged_otherwise: n_judged_otherwise,
        first_difference: cycles.first.map(|first| First {
            cycle: first.cycle,
            field: first.field,
            recorded: first.recorded,
            repeated: first.repeated,
        }),
        steps: n_steps,
        setpoints_differ: n_setpoints_differ,
        steps_without_cause: n_without_cause,
        played_s: recorded_s,
        took_s,
    }
}

fn is_same(figures: &Figures) -> bool {
    figures.first_difference.is_none() && figures.cycles > 0 && figures.cycles_missing == 0
}

fn sentence(figures: &Figures) -> String {
    let Figures { cycles, wishes_differ, goals_differ, judged_otherwise, steps, setpoints_differ, .. } = figures;
    let mut text = format!(
        "Repeated {cycles} cycles of the bus and {steps} steps of the slave ({:.1} s) in {:.2} s; {} cycles stand under a failure\n\
         Different: {wishes_differ} wishes, {goals_differ} times what the bus was told, {judged_otherwise} judgements, {setpoints_differ} \
         setpoints of the slave\n",
        figures.played_s, figures.took_s, figures.cycles_failed
    );
    if let Some(First { cycle, field, recorded, repeated }) = &figures.first_difference {
        text += &format!("First in cycle {cycle}: {field}, recorded {recorded}, now {repeated}\n");
    }
    if figures.cycles_missing > 0 || figures.steps_without_cause > 0 {
        text += &format!(
            "Not in the recording: {} cycles ({} of them not fetched in time), the commands of {} steps\n",
            figures.cycles_missing, figures.cycles_left_out, figures.steps_without_cause
        );
    }
    text
}
