//! `krait verify FILE`: does recorded input still give the same setpoints and commands, bit for bit?

use crate::cli::{Common, MasterKind, VerifyArgs};
use crate::config::Config;
use crate::supervisor::{Cast, ChainOptions, Supervisor};
use crate::{print, recorded, signals};
use anyhow::{Context, bail};
use krait_ipc::{Process, clock};
use krait_record::Recording;
use krait_replay::{
    Compensate, Difference, LearningVerifier, Repetition, Resolve, Restart, Stage, Survey, Turn, Verifier, Window,
};
use krait_schema::Channel;
use serde::Serialize;
use std::path::{Path, PathBuf};
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
    /// Setpoints that no command answers: `compensate` refused them, or was not there.
    setpoints_unanswered: u64,
    /// Processes that were started again while the others ran on. Each begins from nothing: its numbers at 1, its memory empty,
    /// at rest in the straight pose, with the values of the model file. So it was repeated by a process of its own.
    restarts: Vec<Restart>,
    /// Length of what was repeated, s.
    recorded_s: f64,
    /// Time that the samples took through the processes, s.
    took_s: f64,
    /// Version and git revision that made the recording.
    recorded_with: String,
    /// Version and git revision of this program.
    verified_with: String,
    /// Setpoints, commands and model updates of the recording that were not repeated.
    not_repeated: u64,
    /// Those at the end of a cut recording that rest on what is behind the cut; they could not be repeated.
    behind_cut: u64,
    /// What the recording is known to lack, in its own order: a file that is cut holds less than was run.
    missing: Vec<String>,
    /// The first output that differs, if any does.
    first_difference: Option<Difference>,
}

/// Repeats every step of a recording in freshly started processes, one for each run of a process, and says whether all came
/// out the same, or shows the first that did not.
pub fn run(common: &Common, args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    let of_recording = || format!("recording {}", args.recording.display());
    let parts = Recording::open_parts(&args.recording)?;
    let recording = &parts[0];
    let count = |channel| {
        let counts = parts.iter().filter_map(|part| part.contents().channels.get(&channel));
        counts.map(|counts| counts.n_messages).sum::<u64>()
    };
    let (n_setpoints, n_commands, n_updates) =
        (count(Channel::Setpoint), count(Channel::Command), count(Channel::ModelUpdate));
    let missing = recorded::missing(&parts);
    if n_setpoints == 0 {
        let why = missing.first().map_or_else(String::new, |sentence| format!(" ({sentence})"));
        bail!("{}: it holds no setpoint{why}, so there is nothing to repeat", of_recording());
    }
    let has_inputs = count(Channel::Input) > 0;
    let mut supervisor = Supervisor::new(&recorded::instance_of(&common.instance, "verify"), &stop)?;
    let folder = supervisor.bus().instance().folder();
    let config = recorded::config_of(recording, &folder).with_context(of_recording)?;
    let survey = Survey::of(&args.recording)?;
    let mut verdict = Verdict {
        parts: parts.len(),
        passes: survey.n_passes,
        restarts: survey.restarts,
        recorded_s: survey.recorded_s,
        setpoints_unanswered: n_setpoints.saturating_sub(n_commands),
        missing,
        recorded_with: recorded::made_with(recording),
        verified_with: recorded::this_program(),
        ..Verdict::default()
    };
    let mut work = Work { path: &args.recording, recording, config, folder, stop: &stop, supervisor: &mut supervisor };
    // Without operator input, setpoints are what was sent.
    if has_inputs {
        work.stage::<Resolve>(&mut verdict).with_context(of_recording)?;
    }
    work.stage::<Compensate>(&mut verdict).with_context(of_recording)?;
    work.learning(&mut verdict).with_context(of_recording)?;
    supervisor.end();
    if verdict.first_difference.is_none() {
        let n_recorded = n_commands + n_updates + if has_inputs { n_setpoints } else { 0 };
        // Where nothing is known to lack, the end of a channel is no cut.
        if verdict.missing.is_empty() {
            verdict.behind_cut = 0;
        }
        let Verdict { setpoints_identical, commands_identical, updates_identical, behind_cut, .. } = verdict;
        let n_accounted = setpoints_identical + commands_identical + updates_identical + behind_cut;
        verdict.not_repeated = n_recorded.saturating_sub(n_accounted);
    }
    if args.json {
        print::json(&verdict)?;
    } else {
        print::out(&sentence(&verdict))?;
    }
    let is_good = verdict.first_difference.is_none() && verdict.not_repeated == 0;
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What every repetition needs.
struct Work<'a> {
    path: &'a Path,
    recording: &'a Recording,
    config: Config,
    folder: PathBuf,
    stop: &'a AtomicBool,
    supervisor: &'a mut Supervisor,
}

impl Work<'_> {
    /// Every run of a stage, each by a process of its own.
    fn stage<S: Stage>(&mut self, verdict: &mut Verdict) -> anyhow::Result<()> {
        let mut window = Window::open(self.path, S::CHANNELS)?;
        for run in 1.. {
            if verdict.first_difference.is_some() {
                break;
            }
            let Some(verifier) = Verifier::<S>::open(self.supervisor.bus(), &mut window, run)? else { break };
            self.repeat(verifier, Some(0), verdict)?;
        }
        Ok(())
    }

    /// Every run of `estimate`, on the clock of this machine: its updates do not look at it.
    fn learning(&mut self, verdict: &mut Verdict) -> anyhow::Result<()> {
        let mut window = Window::open(self.path, LearningVerifier::CHANNELS)?;
        for run in 1.. {
            if verdict.first_difference.is_some() {
                break;
            }
            let Some(verifier) = LearningVerifier::open(self.supervisor.bus(), &mut window, run)? else { break };
            self.repeat(verifier, None, verdict)?;
        }
        Ok(())
    }

    fn repeat(
        &mut self,
        mut repetition: impl Repetition,
        recorded_time_ns: Option<i64>,
        verdict: &mut Verdict,
    ) -> anyhow::Result<()> {
        let process = repetition.process();
        let model = repetition.model().with_context(|| {
            format!(
                "what `{process}` published does not say which model it rests on, because an earlier version made it; its \
                 inputs can be played with `krait replay`, its steps cannot be compared"
            )
        })?;
        let config = recorded::config_of_pass(self.recording, &self.config, Some(model), &self.folder)?;
        let cast = Cast { processes: vec![process], recorded_time_ns, comes_back: false };
        let options =
            ChainOptions { config, master: MasterKind::Replay, input: None, looped: false, engage: None, cast };
        self.supervisor.start_chain(&options, self.stop)?;
        let start_ns = clock::monotonic_ns();
        let mut look_ns = start_ns;
        while repetition.turn(self.supervisor.bus())? == Turn::Going {
            let now_ns = clock::monotonic_ns();
            if now_ns >= look_ns {
                look_ns = now_ns + LOOK_EVERY_NS;
                self.supervisor.look()?;
                anyhow::ensure!(!self.stop.load(Ordering::Relaxed), "stopped before the end of the recording");
            }
        }
        verdict.took_s += (clock::monotonic_ns() - start_ns) as f64 * 1e-9;
        *match process {
            Process::Resolve => &mut verdict.setpoints_identical,
            Process::Compensate => &mut verdict.commands_identical,
            _ => &mut verdict.updates_identical,
        } += repetition.n_identical();
        verdict.behind_cut += repetition.n_behind_end();
        verdict.bytes_identical += repetition.n_bytes();
        verdict.first_difference = repetition.difference().cloned();
        self.supervisor.end_chain();
        Ok(())
    }
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
         ({bytes_identical} bytes) in {passes} {}",
        if *passes == 1 { "pass" } else { "passes" }
    );
    let missing: String = verdict.missing.iter().map(|what| format!("not whole: {what}\n")).collect();
    let restarts: String = verdict.restarts.iter().map(restart_line).collect();
    let behind_cut = match verdict.behind_cut {
        0 => String::new(),
        n => format!("not compared: {n} messages at the end, which rest on what is behind the cut\n"),
    };
    let not_repeated = match verdict.not_repeated {
        0 => String::new(),
        n => format!(
            "not repeated: {n} messages that the recording holds twice, out of order, or without what they rest on\n"
        ),
    };
    missing
        + &restarts
        + &behind_cut
        + &not_repeated
        + &match &verdict.first_difference {
            None => format!(
                "identical: {counts} came out of freshly started processes byte for byte as they were recorded; \
             {recorded_s:.1} s in {took_s:.2} s\n"
            ),
            Some(d) => format!(
                "different: after {counts}, `{}` gives another {} in output {} of its run {}: recorded {}, now {} \
             (recorded with krait {}, verified with krait {})\n",
                d.process,
                d.field,
                d.sequence,
                d.run,
                d.recorded,
                d.repeated,
                verdict.recorded_with,
                verdict.verified_with
            ),
        }
}

fn restart_line(restart: &Restart) -> String {
    let Restart { process, pass, at_s, n_before } = restart;
    format!(
        "`{process}` was started again {at_s:.3} s after the beginning of pass {pass}, after {n_before} messages: its numbers and \
         its memory begin anew there, and so did the process that repeated it\n"
    )
}
