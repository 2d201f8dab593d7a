//! Whether a chain made of its hand's reports what the same reports make out of a file: the operator's inputs through the same core, and
//! setpoints and commands through `krait verify`.

use crate::chain::{Journal, User, VmChain, VmEnded};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_ipc::message::{HopStamps, OperatorInput};
use krait_master::{Engage, HidRecording, MasterConfig, MasterCore, Plug, RecordedEvent};
use std::path::Path;

/// A chain that follows bends the snake at least so far, deg.
const MOVED_DEG: f64 = 2.0;

/// Runs a chain on a hand, whose arguments are given, for longer than the scene takes, while a scene is played on that, and judges it as [`judge`] does.
///
/// # Errors
/// As [`judge`], and what `play` says.
pub fn chain(
    verdict: &mut PartVerdict,
    name: &str,
    (hand, seconds): (&[&str], f64),
    play: impl FnOnce() -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let [config, reports] = [format!("/tmp/{name}-repeated.toml"), format!("/tmp/{name}-repeated.krr")];
    std::fs::write(&config, format!("[master]\nrecord_reports = \"{reports}\"\n")).context("a configuration")?;
    let more = [hand, &["--config", &config]].concat();
    let chain = VmChain::start_with(&format!("repeated-{name}"), User::Root, seconds, &more)?;
    let begun_ns = clock::monotonic_ns();
    play()?;
    let played_ns = clock::monotonic_ns();
    let (ended, journal, recording) = chain.end_with_recording()?;
    let moved_deg = journal.moved_deg(begun_ns, played_ns);
    verdict.check("moved_deg", moved_deg > MOVED_DEG, format!("{moved_deg:.1}"));
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    judge(verdict, &journal, Path::new(&reports), &recording)
}

/// Judges a chain by its own recording and by the file of its reports, with a control: without one report it must not hold.
///
/// # Errors
/// A file cannot be read, or no report had come.
pub fn judge(verdict: &mut PartVerdict, journal: &Journal, reports: &Path, recording: &Path) -> anyhow::Result<()> {
    judge_inputs(verdict, &journal.inputs, &MasterConfig::default(), reports)?;
    judge_commands(verdict, recording)
}

/// The first half: inputs of a master of these settings.
///
/// # Errors
/// As [`judge`].
pub fn judge_inputs(
    verdict: &mut PartVerdict,
    inputs: &[OperatorInput],
    config: &MasterConfig,
    reports: &Path,
) -> anyhow::Result<()> {
    let file = HidRecording::load(reports)?;
    let events: Vec<(i64, usize, RecordedEvent)> = file.events().collect();
    let n_inputs = inputs.len();
    let n_equal = n_equal_inputs(inputs, config, &events)?;
    verdict.check("inputs_equal", n_inputs > 1000 && n_equal == n_inputs, format!("{n_equal}/{n_inputs}"));
    let n_carried = inputs.last().map_or(0, |input| input.n_reports as usize);
    let is_report = |event: &RecordedEvent| matches!(event, RecordedEvent::Report(_));
    let reports = events.iter().enumerate().filter(|(_, (.., event))| is_report(event)).map(|(place, _)| place);
    let middle = reports.take(n_carried / 2 + 1).last().context("the file holds no report")?;
    let mut spoiled = events;
    spoiled.remove(middle);
    let n_spoiled = n_equal_inputs(inputs, config, &spoiled)?;
    verdict.check("control_differs", n_spoiled < n_inputs, format!("{n_spoiled}/{n_inputs}"));
    Ok(())
}

/// The other half: commands by `krait verify`. The recording is removed.
///
/// # Errors
/// As [`judge`].
pub fn judge_commands(verdict: &mut PartVerdict, recording: &Path) -> anyhow::Result<()> {
    let verified = VmEnded::of(User::Root, &["verify", &recording.display().to_string(), "--json"])?;
    let figures = verified.json()?;
    let n_commands = figures["commands_identical"].as_u64().unwrap_or(0);
    let is_same = verified.code == Some(0) && figures["first_difference"].is_null() && n_commands > 1000;
    verdict.check("commands_equal", is_same, format!("{n_commands}in{}B", figures["bytes_identical"]));
    std::fs::remove_file(recording).context("removing a recording")
}

/// The instant from which a file counts, CLOCK_MONOTONIC, ns: it begins with its first report, and the input that carries the first says when
/// that was.
///
/// # Errors
/// No report had come.
pub fn zero_ns(inputs: &[OperatorInput], events: &[(i64, usize, RecordedEvent)]) -> anyhow::Result<i64> {
    let first = inputs.iter().find(|input| input.n_reports > 0).context("no report has come")?;
    let mut reports = events.iter().filter(|(.., event)| matches!(event, RecordedEvent::Report(_)));
    let newest = reports.nth(first.n_reports as usize - 1).context("the file lacks reports")?;
    Ok(first.stamps.device_ns - newest.0)
}

/// How many inputs come out the same, byte for byte, but for the stamps of when they were sent.
fn n_equal_inputs(
    inputs: &[OperatorInput],
    config: &MasterConfig,
    events: &[(i64, usize, RecordedEvent)],
) -> anyhow::Result<usize> {
    let zero_ns = zero_ns(inputs, events)?;
    let mut core = MasterCore::new(&MasterConfig { engage: Engage::Once, ..config.clone() })?;
    let mut left = events.iter().peekable();
    let mut n_equal = 0;
    for input in inputs {
        while let Some((stamp_ns, device, event)) = left.peek() {
            let stamp_ns = zero_ns + stamp_ns;
            match event {
                // A refusal is counted, and the count is part of the input.
                RecordedEvent::Report(report) if core.counts().n_decoded < input.n_reports => {
                    let _counted = core.on_report_of(*device, report.as_bytes(), stamp_ns);
                }
                RecordedEvent::Plug(Plug::Out) if stamp_ns <= input.sample_ns => core.on_unplugged_of(*device),
                RecordedEvent::Plug(Plug::In) if stamp_ns <= input.sample_ns => core.on_plugged_of(*device),
                RecordedEvent::Report(_) | RecordedEvent::Plug(_) => break,
            }
            left.next();
        }
        let again = core.on_tick(input.sample_ns);
        let bare = |input: &OperatorInput| OperatorInput { stamps: HopStamps::default(), ..*input };
        n_equal += usize::from(bare(&again) == bare(input));
    }
    Ok(n_equal)
}
