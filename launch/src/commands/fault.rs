//! `krait fault`: breaks a simulated chain on purpose and says whether it ends as it must.

use crate::cli::{Common, DEFAULT_INSTANCE};
use crate::cli_bench::{FaultArgs, SceneArgs};
use crate::commands::yardstick;
use crate::fault::{Fault, FaultOutcome, NOT_BEGUN, Observed, StrikeTime, TinyDisk, judge, play};
use crate::{print, signals};
use anyhow::{Context, bail, ensure};
use clap::ValueEnum;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_bench::Scratch;
use krait_ipc::clock;
use rustix::process::{Pid, Signal, kill_process};
use std::fs::{self, File};
use std::io::{Write, stderr};
use std::path::Path;
use std::process::{Child, ExitCode, Stdio};

/// A scene that has not ended by then will not, ns.
const PATIENCE_NS: i64 = 150_000_000_000;
/// How often a scene is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Lines of a scene's log that are shown when it ended otherwise than it must.
const N_SHOWN: usize = 12;
/// How often a scene is begun again that a busy machine has ended before its fault, or has stood still in.
const N_MORE: usize = 4;
/// Room for the recording on a disk that is filled up, and for the memory of a chain, megabytes.
const DISK_MB: u32 = 16;
const MEMORY_MB: u32 = 160;

/// Tries the faults that were asked for, one after the other.
pub fn run(common: &Common, args: &FaultArgs) -> anyhow::Result<ExitCode> {
    ensure!(
        common.config.is_none() && common.instance == DEFAULT_INSTANCE,
        "`krait fault` breaks simulated chains of its own with their own configuration; leave out --config and --instance"
    );
    let stop = signals::stop_flag()?;
    let faults = if args.all { Fault::value_variants() } else { &args.faults[..] };
    if !args.json {
        print::out(&header())?;
    }
    let mut outcomes = Vec::new();
    let plays = faults.iter().flat_map(|fault| (0..args.repeat).map(|n| (*fault, StrikeTime::of(n))));
    for (fault, moment) in plays {
        let (mut outcome, mut said) = try_one(fault, moment, &stop)?;
        let mut n_more = N_MORE;
        while n_more > 0 && (said.contains(NOT_BEGUN) || outcome.is_disturbed) {
            n_more -= 1;
            if outcome.is_disturbed {
                tracing::warn!(
                    "{}: the machine itself stood still for {:.0} ms, so the fault is tried again",
                    fault.name(),
                    outcome.machine_pause_ms
                );
            }
            (outcome, said) = try_one(fault, moment, &stop)?;
        }
        if !args.json {
            print::out(&row(&outcome))?;
        }
        if outcome.wrong.is_some() {
            let lines: Vec<&str> = said.lines().collect();
            for line in &lines[lines.len().saturating_sub(N_SHOWN)..] {
                let _closed_is_fine = writeln!(stderr(), "  {}: {line}", fault.name());
            }
        }
        outcomes.push(outcome);
    }
    let n_wrong = outcomes.iter().filter(|outcome| outcome.wrong.is_some()).count();
    let n_skipped = outcomes.iter().filter(|outcome| outcome.skipped.is_some()).count();
    if args.json {
        print::json(&outcomes)?;
    } else {
        let n_right = outcomes.len() - n_wrong - n_skipped;
        print::out(&format!(
            "\n{n_right} of {} end as they must; {n_wrong} do not; {n_skipped} skipped\n",
            outcomes.len()
        ))?;
    }
    Ok(if n_wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Becomes the process that plays one scene.
pub fn scene(args: &SceneArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let moment = StrikeTime { wait_s: args.wait_s, stall_s: args.stall_s };
    print::json(&play(args.fault, moment, &args.folder, &stop)?)?;
    Ok(ExitCode::SUCCESS)
}

/// A fault in a process of its own, with a ground of its own where that is filled up; also gives what it said.
fn try_one(fault: Fault, moment: StrikeTime, stop: &AtomicBool) -> anyhow::Result<(FaultOutcome, String)> {
    let scratch = Scratch::new()?;
    let tiny = match fault {
        Fault::FullDisk => Some(TinyDisk::mount(&scratch.folder().join("disk"), DISK_MB)?),
        Fault::FullMemory => Some(TinyDisk::mount(&scratch.folder().join("ground"), MEMORY_MB)?),
        _ => None,
    };
    if let Some(None) = tiny {
        let skipped = Some("only root can mount a file system to fill it up".to_owned());
        let outcome = FaultOutcome { wrong: None, skipped, ..judge(fault, moment, &Observed::default(), "") };
        return Ok((outcome, String::new()));
    }
    let (out, said) = (scratch.folder().join("seen.json"), scratch.folder().join("said.txt"));
    let mut command = yardstick::scene_command(fault, moment, scratch.folder())?;
    if fault == Fault::FullMemory {
        command.env("XDG_RUNTIME_DIR", scratch.folder().join("ground"));
    }
    let file = |path: &Path| File::create(path).with_context(|| format!("{} could not be made", path.display()));
    command.stdin(Stdio::null()).stdout(file(&out)?).stderr(file(&said)?);
    let is_done = wait(command.spawn().context("a scene could not be started")?, stop)?;
    let said = String::from_utf8_lossy(&fs::read(&said).context("what a scene has said")?).into_owned();
    let outcome = match serde_json::from_slice::<Observed>(&fs::read(&out).context("what a scene has seen")?) {
        Ok(seen) if is_done => judge(fault, moment, &seen, &said),
        _ => FaultOutcome { wrong: Some("no end".to_owned()), ..judge(fault, moment, &Observed::default(), &said) },
    };
    Ok((outcome, said))
}

/// Waits until a scene has ended; whether it did so by itself.
fn wait(mut child: Child, stop: &AtomicBool) -> anyhow::Result<bool> {
    let give_up_ns = clock::monotonic_ns() + PATIENCE_NS;
    let mut is_told = false;
    loop {
        if let Some(status) = child.try_wait().context("a scene could not be watched")? {
            if stop.load(Ordering::Relaxed) {
                bail!("stopped before every fault had been tried");
            }
            return Ok(status.success());
        }
        let is_late = clock::monotonic_ns() > give_up_ns;
        if !is_told && (is_late || stop.load(Ordering::Relaxed)) {
            // It ends its chain in order.
            let told = Pid::from_raw(child.id().cast_signed()).map(|pid| kill_process(pid, Signal::TERM));
            is_told = matches!(told, Some(Ok(())));
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

fn header() -> String {
    format!("{:18} {:7} {:7} {:>5} {:>7} named by\n", "fault", "must", "did", "step", "rest ms")
}

/// A row of 80 columns at most, unless there is something wrong.
fn row(outcome: &FaultOutcome) -> String {
    let FaultOutcome { must, did, largest_step, rest_ms, named, wrong, skipped, .. } = outcome;
    let name = outcome.fault.name();
    if let Some(why) = skipped {
        return format!("{name:18} {:7} SKIPPED: {why}\n", must.word());
    }
    let did = did.map_or("neither", |did| did.word());
    let rest = rest_ms.map_or_else(|| "-".to_owned(), |rest_ms| format!("{rest_ms:.1}"));
    let named = named.as_deref().unwrap_or("nothing");
    let wrong = wrong.as_ref().map_or_else(String::new, |wrong| format!("  WRONG: {wrong}"));
    format!("{name:18} {:7} {did:7} {largest_step:>5.2} {rest:>7} {named}{wrong}\n", must.word())
}
