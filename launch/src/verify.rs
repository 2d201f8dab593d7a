//! Recorded input through the same steps again: are the setpoints and commands the same, bit for bit?
//!
//! Every output names what its step depended on by sequence number, and its stamps say which instant it took for now. So the
//! steps can be repeated from the recording alone; the stamps themselves say when, not what, and are not compared.

use crate::commands::process::MODEL_ATTACHMENT;
use crate::config::{Config, chain_of};
use anyhow::Context;
use krait_bridge::{CompensateCore, Refused, ResolveCore};
use krait_ipc::message::{Command, HopStamps, ModelUpdate, OperatorInput, Setpoint, SlaveState};
use krait_model::Chain;
use krait_record::{Recording, Sample};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::path::Path;

/// What a verification found.
#[derive(Debug, Default, Serialize)]
pub struct Verdict {
    /// Chains that ran one after the other in the recording.
    pub passes: usize,
    /// Setpoints that came out the same.
    pub setpoints_identical: u64,
    /// Commands that came out the same.
    pub commands_identical: u64,
    /// Version and git revision that made the recording.
    pub recorded_with: String,
    /// Version of this program.
    pub verified_with: String,
    /// The first one that differs, if any does.
    pub first_difference: Option<Difference>,
}

/// Where a recording and its repetition part.
#[derive(Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The process whose output differs.
    pub process: &'static str,
    /// The pass, from 1.
    pub pass: usize,
    /// Sequence number of the output.
    pub sequence: u64,
    /// The field.
    pub field: String,
    /// Its value in the recording.
    pub recorded: String,
    /// Its value now.
    pub repeated: String,
}

/// The messages of one chain, by sequence number.
#[derive(Default)]
struct Pass {
    inputs: BTreeMap<u64, OperatorInput>,
    setpoints: BTreeMap<u64, Setpoint>,
    commands: BTreeMap<u64, Command>,
    states: BTreeMap<u64, SlaveState>,
    updates: BTreeMap<u64, ModelUpdate>,
}

/// Repeats every step of a recording.
///
/// # Errors
/// One sentence when the recording cannot be read, holds no configuration, or lacks a message that a step depended on.
pub fn verify(path: &Path) -> anyhow::Result<Verdict> {
    let recording = Recording::open(path)?;
    let config = config_of(&recording).with_context(|| format!("recording {}", path.display()))?;
    let about = recording.contents().metadata.get("krait");
    let word = |key: &str| about.and_then(|a| a.get(key)).map_or("unknown", String::as_str);
    let mut verdict = Verdict {
        recorded_with: format!("{} ({})", word("krait_version"), word("git_revision")),
        verified_with: env!("CARGO_PKG_VERSION").to_owned(),
        ..Verdict::default()
    };
    let chain = chain_of_recording(&recording).with_context(|| format!("recording {}", path.display()))?;
    for (idx, pass) in passes_of(&recording)?.iter().enumerate() {
        verdict.passes += 1;
        let found = pass.repeat(&config, chain.as_ref(), idx + 1, &mut verdict);
        verdict.first_difference = found.with_context(|| format!("recording {}", path.display()))?;
        if verdict.first_difference.is_some() {
            break;
        }
    }
    Ok(verdict)
}

fn config_of(recording: &Recording) -> anyhow::Result<Config> {
    let text = attachment(recording, "krait.toml")?;
    let text = text.context("it holds no attachment krait.toml, so the steps cannot be repeated")?;
    Config::parse(text).context("its attachment krait.toml is of another version")
}

fn chain_of_recording(recording: &Recording) -> anyhow::Result<Option<Chain>> {
    attachment(recording, MODEL_ATTACHMENT)?.map(chain_of).transpose().context("its attachment model.toml")
}

fn attachment<'a>(recording: &'a Recording, name: &str) -> anyhow::Result<Option<&'a str>> {
    let found = recording.contents().attachments.iter().find(|attachment| attachment.name == name);
    let text = found.map(|attachment| std::str::from_utf8(&attachment.data)).transpose();
    text.with_context(|| format!("its attachment {name} is no text"))
}

/// A channel whose sequence numbers begin anew at 1 begins its next pass.
fn passes_of(recording: &Recording) -> anyhow::Result<Vec<Pass>> {
    let mut passes = Passes::default();
    for recorded in recording.samples()? {
        match recorded?.sample {
            Sample::State(m) => drop(passes.of(0, m.sequence).states.insert(m.sequence, m)),
            Sample::Input(m) => drop(passes.of(1, m.sequence).inputs.insert(m.sequence, m)),
            Sample::Setpoint(m) => drop(passes.of(2, m.sequence).setpoints.insert(m.sequence, m)),
            Sample::Command(m) => drop(passes.of(3, m.sequence).commands.insert(m.sequence, m)),
            Sample::ModelUpdate(m) => drop(passes.of(4, m.sequence).updates.insert(m.sequence, m)),
            _ => {}
        }
    }
    Ok(passes.all)
}

/// Passes under construction. Each channel counts its own, because the recorder takes the channels in turn.
#[derive(Default)]
struct Passes {
    all: Vec<Pass>,
    n_of_channel: [usize; 5],
}

impl Passes {
    /// The pass that a message belongs to.
    fn of(&mut self, channel: usize, sequence: u64) -> &mut Pass {
        let n = &mut self.n_of_channel[channel];
        if sequence == 1 || *n == 0 {
            *n += 1;
        }
        let idx = *n - 1;
        if self.all.len() <= idx {
            self.all.resize_with(idx + 1, Pass::default);
        }
        &mut self.all[idx]
    }
}

impl Pass {
    fn repeat(
        &self,
        config: &Config,
        chain: Option<&Chain>,
        number: usize,
        verdict: &mut Verdict,
    ) -> anyhow::Result<Option<Difference>> {
        let mut config = config.clone();
        // A demo changes the mode from pass to pass; the commands say which it was.
        if let Some(mode) = self.commands.values().next().and_then(Command::compensation) {
            config.compensate.mode = mode;
        }
        let at = |process, sequence| Place { process, pass: number, sequence };
        let mut resolve = ResolveCore::new(&config.machine, config.compensate.lines(), config.resolve)?;
        for recorded in self.setpoints.values() {
            let again = self.setpoint_again(&mut resolve, recorded)?;
            if let Some(difference) = at("resolve", recorded.sequence).compare(&without_stamps(*recorded), &again) {
                return Ok(Some(difference));
            }
            verdict.setpoints_identical += 1;
        }
        let mut compensate = CompensateCore::new(&config.machine, config.compensate, chain)?;
        let mut newest_update = 0;
        for recorded in self.commands.values() {
            let again = self.command_again(&mut compensate, recorded, &mut newest_update)?;
            let recorded = Command { stamps: HopStamps::default(), ..*recorded };
            if let Some(difference) = at("compensate", recorded.sequence).compare(&recorded, &again) {
                return Ok(Some(difference));
            }
            verdict.commands_identical += 1;
        }
        Ok(None)
    }

    fn setpoint_again(&self, resolve: &mut ResolveCore, recorded: &Setpoint) -> anyhow::Result<Setpoint> {
        if recorded.state_sequence > 0 {
            resolve.note_state(needed(&self.states, recorded.state_sequence, "state")?);
        }
        let input = needed(&self.inputs, recorded.input_sequence, "input")?;
        let again = resolve.step(input, recorded.stamps.resolve_begun_ns);
        Ok(without_stamps(again.map_err(|refused| refusal("setpoint", recorded.sequence, &refused))?))
    }

    fn command_again(
        &self,
        compensate: &mut CompensateCore,
        recorded: &Command,
        newest_update: &mut u64,
    ) -> anyhow::Result<Command> {
        if recorded.state_sequence > 0 {
            compensate.note_state(needed(&self.states, recorded.state_sequence, "state")?);
        }
        if recorded.model_update_sequence > *newest_update {
            *newest_update = recorded.model_update_sequence;
            let update = needed(&self.updates, *newest_update, "model_update")?;
            compensate.note_update(update).map_err(|refused| refusal("model update", *newest_update, &refused))?;
        }
        let setpoint = needed(&self.setpoints, recorded.setpoint_sequence, "setpoint")?;
        let again = compensate.step(setpoint, recorded.stamps.compensate_begun_ns);
        let again = again.map_err(|refused| refusal("command", recorded.sequence, &refused))?;
        Ok(Command { stamps: HopStamps::default(), ..again })
    }
}

fn without_stamps(setpoint: Setpoint) -> Setpoint {
    Setpoint { stamps: HopStamps::default(), ..setpoint }
}

fn needed<'a, M>(messages: &'a BTreeMap<u64, M>, sequence: u64, channel: &str) -> anyhow::Result<&'a M> {
    messages.get(&sequence).with_context(|| {
        format!("message {sequence} of channel {channel:?} is not in it, so what depended on it cannot be repeated")
    })
}

fn refusal(what: &str, sequence: u64, refused: &Refused) -> anyhow::Error {
    let sentence = refused.reason.sentence();
    anyhow::anyhow!(
        "{what} {sequence} was accepted when it was recorded and is refused now: {sentence} ({})",
        refused.found
    )
}

struct Place {
    process: &'static str,
    pass: usize,
    sequence: u64,
}

impl Place {
    /// The first field that differs. The debug format shows every bit of a float, the sign of zero included.
    fn compare<M: Debug>(&self, recorded: &M, repeated: &M) -> Option<Difference> {
        if format!("{recorded:?}") == format!("{repeated:?}") {
            return None;
        }
        let (recorded, repeated) = (format!("{recorded:#?}"), format!("{repeated:#?}"));
        let mut field = String::new();
        for (was, is) in recorded.lines().zip(repeated.lines()) {
            if let Some((name, _)) = was.trim().split_once(": ") {
                field = name.to_owned();
            }
            if was != is {
                let value =
                    |line: &str| line.trim().trim_start_matches(&format!("{field}: ")).trim_end_matches(',').to_owned();
                return Some(Difference {
                    process: self.process,
                    pass: self.pass,
                    sequence: self.sequence,
                    recorded: value(was),
                    repeated: value(is),
                    field,
                });
            }
        }
        None
    }
}
