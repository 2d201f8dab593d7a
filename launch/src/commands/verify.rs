//! `krait verify FILE`: does recorded input still give the same setpoints and commands, bit for bit?

use crate::cli::{Common, MasterKind, VerifyArgs};
use crate::config::Config;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use crate::{print, recorded, signals};
use anyhow::Context;
use krait_ipc::{Process, clock};
use krait_record::Recording;
use krait_replay::{Difference, LearningVerifier, Turn, Verifier, Window};
use krait_schema::Channel;
use serde::Serialize;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the processes are looked at while samples flow, ns.
const LOOK_EVERY_NS: i64 = 50_000_000;

/// What a verification found.
#[derive(Debug, Default, Serialize)]
struct Verdict {
    /// Files that the recording consists of.
    parts: usize,
    /// Chains that ran one after the other in the recording.
    passes: u64,
    /// Setpoints that came out the same.
    setpoints_identical: u64,
    /// Commands that came out the same.
    commands_identical: u64,
    /// Model updates that came out the same: what `estimate` learnt.
    updates_identical: u64,
    /// Bytes of all these.
    bytes_identical: u64,
    /// Setpoints at the end of a pass that no command answers; they are not repeated.
    setpoints_unanswered: usize,
    /// Length of what was repeated, s.
    recorded_s: f64,
    /// Time that the samples took through the processes, s.
    took_s: f64,
    /// Version and git revision that made the recording.
    recorded_with: String,
    /// Version and git revision of this program.
    verified_with: String,
    /// Commands that were not repeated: of a stage that was started again while the others ran on.
    commands_not_repeated: u64,
    /// What the recording is known to lack, in its own order: a file that is cut holds less than was run.
    missing: Vec<String>,
    /// The first output that differs, if any does.
    first_difference: Option<Difference>,
}

/// Repeats every step of a recording in freshly started processes and says whether all came out the same, or shows the
/// first that did not.
pub fn run(common: &Common, args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let of_recording = || format!("recording {}", args.recording.display());
    let parts = Recording::open_parts(&args.recording)?;
    let recording = &parts[0];
    let mut verdict = Verdict {
        parts: parts.len(),
        missing: parts.iter().flat_map(|part| &part.contents().missing).map(ToString::to_string).collect(),
        recorded_with: recorded::made_with(recording),
        verified_with: recorded::this_program(),
        ..Verdict::default()
    };
    let mut supervisor = Supervisor::new(&recorded::instance_of(&common.instance, "verify"), &stop)?;
    let folder = supervisor.bus().instance().folder();
    let config = recorded::config_of(recording, &folder).with_context(of_recording)?;
    let has_inputs = parts.iter().any(|part| part.contents().channels.contains_key(&Channel::Input));
    let mut window = Window::open(&args.recording)?;
    let mut learning = Window::open_for_learning(&args.recording)?;
    for pass in 1.. {
        let verifier = Verifier::open(supervisor.bus(), &mut window, pass, has_inputs).with_context(of_recording)?;
        let Some(verifier) = verifier else { break };
        verdict.passes = pass;
        let model = verifier.model().with_context(|| {
            format!(
                "{}: its commands do not say which model they rest on, because an earlier version made it; its inputs can be \
                 played with `krait replay`, its steps cannot be compared",
                of_recording()
            )
        })?;
        let config = recorded::config_of_pass(recording, &config, Some(model), &folder).with_context(of_recording)?;
        let steps = options(config.clone(), has_inputs);
        verify_pass(&mut supervisor, &steps, verifier, &mut verdict, &stop).with_context(of_recording)?;
        supervisor.end_chain();
        if verdict.first_difference.is_none() {
            let learnt = LearningVerifier::open(supervisor.bus(), &mut learning, pass).with_context(of_recording)?;
            if let Some(learnt) = learnt {
                verify_learning(&mut supervisor, config, learnt, &mut verdict, &stop).with_context(of_recording)?;
            }
            supervisor.end_chain();
        }
        if verdict.first_difference.is_some() {
            break;
        }
    }
    let counted = parts.iter().filter_map(|part| part.contents().channels.get(&Channel::Command));
    let n_commands: u64 = counted.map(|counts| counts.n_messages).sum();
    if verdict.first_difference.is_none() {
        verdict.commands_not_repeated = n_commands.saturating_sub(verdict.commands_identical);
    }
    anyhow::ensure!(verdict.passes > 0, "{}: it holds no setpoint, so there is nothing to repeat", of_recording());
    supervisor.end();
    if args.json {
        print::json(&verdict)?;
    } else {
        print::out(&sentence(&verdict))?;
    }
    Ok(if verdict.first_difference.is_none() && verdict.commands_not_repeated == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn options(config: Config, has_inputs: bool) -> ChainOptions {
    let mut processes = vec![Process::Compensate];
    processes.extend(has_inputs.then_some(Process::Resolve));
    let cast = Cast { processes, recorded_time_ns: Some(0), comes_back: false };
    ChainOptions { config, master: MasterKind::Replay, input: None, looped: false, engage: None, cast }
}

fn verify_pass(
    supervisor: &mut Supervisor,
    options: &ChainOptions,
    mut verifier: Verifier<'_>,
    verdict: &mut Verdict,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    supervisor.start_chain(options, stop)?;
    let start_ns = clock::monotonic_ns();
    let mut look_ns = start_ns;
    while verifier.turn()? == Turn::Going {
        let now_ns = clock::monotonic_ns();
        if now_ns >= look_ns {
            look_ns = now_ns + LOOK_EVERY_NS;
            supervisor.look()?;
            anyhow::ensure!(!stop.load(Ordering::Relaxed), "stopped before the end of the recording");
        }
    }
    verdict.took_s += (clock::monotonic_ns() - start_ns) as f64 * 1e-9;
    verdict.recorded_s += verifier.recorded_s();
    verdict.setpoints_identical += verifier.n_setpoints;
    verdict.commands_identical += verifier.n_commands;
    verdict.bytes_identical += verifier.n_bytes();
    verdict.setpoints_unanswered += verifier.n_unanswered();
    verdict.first_difference = verifier.difference().cloned();
    Ok(())
}

/// What `estimate` learnt in a pass, on the clock of this machine: its updates do not look at it.
fn verify_learning(
    supervisor: &mut Supervisor,
    config: Config,
    mut verifier: LearningVerifier<'_>,
    verdict: &mut Verdict,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    let cast = Cast { processes: vec![Process::Estimate], ..Cast::live() };
    let options = ChainOptions { config, master: MasterKind::Replay, input: None, looped: false, engage: None, cast };
    supervisor.start_chain(&options, stop)?;
    let start_ns = clock::monotonic_ns();
    let mut look_ns = start_ns;
    while verifier.turn()? == Turn::Going {
        let now_ns = clock::monotonic_ns();
        if now_ns >= look_ns {
            look_ns = now_ns + LOOK_EVERY_NS;
            supervisor.look()?;
            anyhow::ensure!(!stop.load(Ordering::Relaxed), "stopped before the end of the recording");
        }
    }
    verdict.took_s += (clock::monotonic_ns() - start_ns) as f64 * 1e-9;
    verdict.updates_identical += verifier.n_updates;
    verdict.bytes_identical += verifier.n_bytes();
    verdict.first_difference = verifier.difference().cloned();
    Ok(())
}

fn sentence(verdict: &Verdict) -> String {
    let Verdict {
        passes,
        setpoints_identical,
        commands_identical,
        updates_identical,
        bytes_identical,
        recorded_s,
        took_s,
        ..
    } = verdict;
    let counts = format!(
        "{setpoints_identical} setpoints, {commands_identical} commands and {updates_identical} model updates \
         ({bytes_identical} bytes) in {passes} passes"
    );
    let missing: String = verdict.missing.iter().map(|what| format!("not whole: {what}\n")).collect();
    let not_repeated = match verdict.commands_not_repeated {
        0 => String::new(),
        n => format!("not repeated: {n} commands; a stage was started again while the others ran on\n"),
    };
    missing
        + &not_repeated
        + &match &verdict.first_difference {
            None => format!(
                "identical: {counts} came out of freshly started processes byte for byte as they were recorded; \
             {recorded_s:.1} s in {took_s:.2} s\n"
            ),
            Some(d) => format!(
                "different: after {counts}, `{}` gives another {} in its output {} of pass {}: recorded {}, now {} \
             (recorded with krait {}, verified with krait {})\n",
                d.process,
                d.field,
                d.sequence,
                d.pass,
                d.recorded,
                d.repeated,
                verdict.recorded_with,
                verdict.verified_with
            ),
        }
}
