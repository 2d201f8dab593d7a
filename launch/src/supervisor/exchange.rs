//! Another model in a chain that runs: the stages that rest on it end and begin anew with it, the rest goes on.
//!
//! The slave holds meanwhile and clears the engagement, as for every process that begins anew. The recording ends and another
//! begins, so that each holds the one model that its commands rest on and can be repeated.

use super::{Supervisor, effective};
use crate::config::Config;
use crate::in_force::ModelInForce;
use anyhow::{Context, ensure};
use krait_bridge::{LiveModel, SegmentModel};
use krait_ipc::message::{ModelAnswer, ModelRequest};
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader, Writer, clock};
use krait_model::Chain;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The processes that rest on the model, in the order in which they end; they start in the other.
const RESTING_ON_IT: [Process; 3] = [Process::Resolve, Process::Compensate, Process::Estimate];

/// Takes requests for another model.
pub(super) struct ModelDesk {
    requests: Reader<ModelRequest>,
    answers: Writer<ModelAnswer>,
    opened_ns: i64,
}

impl ModelDesk {
    pub(super) fn open(bus: &Bus) -> Result<Self, IpcError> {
        let requests = bus.reader(ReadOptions::observing())?;
        Ok(Self { requests, answers: bus.writer()?, opened_ns: clock::monotonic_ns() })
    }

    /// The newest request since the desk was opened.
    fn take(&mut self) -> Result<Option<ModelRequest>, IpcError> {
        let newest = self.requests.take_newest()?.map(|request| *request);
        Ok(newest.filter(|request| request.sample_ns >= self.opened_ns))
    }

    fn answer(&mut self, request: &ModelRequest, refusal: Option<&str>) -> Result<(), IpcError> {
        self.answers.send(&ModelAnswer::new(self.answers.n_sent() + 1, request, refusal))
    }
}

/// What a chain goes on with.
#[derive(Clone, Debug)]
pub struct Exchanged {
    /// The configuration with the new model in it.
    pub config: Config,
    /// Since when, CLOCK_MONOTONIC, ns.
    pub since_ns: i64,
}

impl Supervisor {
    /// What the chain has gone on with since it was started, if its model was exchanged.
    pub fn exchanged(&self) -> Option<&Exchanged> {
        self.exchanged.as_ref()
    }

    /// Exchanges the model if somebody has asked for that.
    ///
    /// # Errors
    /// One sentence: a process of the chain did not begin with the model, or a channel is broken. What was asked for wrongly is
    /// answered, and changes nothing.
    pub fn exchange_if_asked(&mut self, stop: &AtomicBool) -> anyhow::Result<()> {
        let Some(request) = self.models.as_mut().map(ModelDesk::take).transpose()?.flatten() else { return Ok(()) };
        let Some(options) = self.comes_back.clone() else { return Ok(()) };
        let is_recording = self.processes().iter().any(|(process, _)| *process == Process::Record);
        let refusal = match checked(&options.config, &request, self.n_exchanges + 2, is_recording) {
            Ok(config) => {
                self.exchange(config, is_recording, stop)?;
                None
            }
            Err(refusal) => Some(format!("{refusal:#}")),
        };
        if let Some(desk) = &mut self.models {
            desk.answer(&request, refusal.as_deref())?;
        }
        Ok(())
    }

    fn exchange(&mut self, config: Config, is_recording: bool, stop: &AtomicBool) -> anyhow::Result<()> {
        let needs_estimate = config.model()?.machine.needs_estimate();
        let is_cast = |process: &Process| *process != Process::Estimate || needs_estimate;
        if let Some(options) = &mut self.comes_back {
            options.config = config.clone();
        }
        for process in RESTING_ON_IT {
            self.end_one(process);
        }
        effective::keep(&self.bus, &config);
        if is_recording {
            self.end_one(Process::Record);
            self.start_recorder(&config, stop)?;
        }
        for process in RESTING_ON_IT.into_iter().rev().filter(is_cast) {
            self.spawn(process, &config, &[])?;
            self.wait_until_ready(process, stop)?;
        }
        self.n_exchanges += 1;
        self.exchanged = Some(Exchanged { config, since_ns: clock::monotonic_ns() });
        Ok(())
    }
}

/// The configuration with the model that was asked for; `n_recording` counts the chain's recordings.
fn checked(before: &Config, request: &ModelRequest, n_recording: u32, is_recording: bool) -> anyhow::Result<Config> {
    let path = PathBuf::from(request.path().context("the request names no path")?);
    ensure!(path.is_absolute(), "the path {} is not absolute", path.display());
    let model = ModelInForce::load(Some(&path), before.compensation)?;
    let hash = model.machine.hash();
    ensure!(
        hash.0 == request.model_hash,
        "the file {} was changed: it is the model {hash} now; ask for it again",
        path.display()
    );
    let old = before.model()?;
    ensure!(
        is_same_machine(&model.machine, &old.machine),
        "it is of another machine than the one that runs; start a chain with it"
    );
    let mut config = Config { model: Some(path), model_text: Some(model.text), ..before.clone() };
    if is_recording {
        let recording = before.record.path.as_deref().context("the recording has no path")?;
        let next = numbered(recording, n_recording)?;
        ensure!(!next.exists(), "{} is there already, and the recording of the new model needs it", next.display());
        config.record.path = Some(next);
    }
    config.record.metadata.insert("compensation".to_owned(), model.label.to_owned());
    config.check()?;
    Ok(config)
}

/// What lines and backbones are made of is the model's to say; how long and how wide the snake is, is not, and neither is how
/// many joints there are and what their numbers mean, nor where the lines of segments run.
fn is_same_machine(new: &LiveModel, old: &LiveModel) -> bool {
    match (new, old) {
        (LiveModel::Snake(new), LiveModel::Snake(old)) => {
            let size = |own: &Chain| (own.machine().l_m, own.machine().r_m, own.gripper().is_some());
            size(new) == size(old)
        }
        (LiveModel::Joints(new), LiveModel::Joints(old)) => {
            (new.n(), new.slides(), new.is_driven_by_lengths()) == (old.n(), old.slides(), old.is_driven_by_lengths())
        }
        (LiveModel::Segments(new), LiveModel::Segments(old)) => {
            let shape = |own: &SegmentModel| {
                let segments = &own.parameters().segments;
                segments.iter().map(|segment| (segment.l_m, segment.lines.clone())).collect::<Vec<_>>()
            };
            shape(new) == shape(old)
        }
        _ => false,
    }
}

/// The recording that follows: run.mcap, run-model2.mcap, run-model3.mcap.
fn numbered(recording: &Path, n: u32) -> anyhow::Result<PathBuf> {
    let stem = recording.file_stem().and_then(|stem| stem.to_str()).context("the recording's name is no text")?;
    let first = stem.rsplit_once("-model").filter(|(_, n)| n.parse::<u32>().is_ok()).map_or(stem, |(first, _)| first);
    Ok(recording.with_file_name(format!("{first}-model{n}.mcap")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_force::Compensation;

    fn refused(text: &str, hash: Option<u64>) -> String {
        let folder = std::env::temp_dir().join(format!("krait-exchange-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("model.toml");
        std::fs::write(&path, text).expect("written");
        let own = ModelInForce::parse(text).map_or(0, |model| model.machine.hash().0);
        let request = ModelRequest::new(1, 0, hash.unwrap_or(own), path.to_str().expect("text")).expect("short");
        let result = checked(&Config::default(), &request, 2, false);
        std::fs::remove_dir_all(&folder).expect("removed");
        result.map_or_else(|refusal| format!("{refusal:#}"), |config| config.model().expect("a model").label.to_owned())
    }

    #[test]
    fn a_model_of_the_same_machine_is_taken_and_anything_else_is_refused_with_its_fault() {
        assert_eq!(refused(Compensation::Naive.text(), None), "naive");
        assert!(refused(Compensation::Naive.text(), Some(7)).contains("was changed"));
        assert!(refused("format = 1\n[machine]\nkind = \"snake\"\nl_m = 0.031\n", None).contains("another machine"));
        assert!(refused("nonsense", None).contains("model.toml"));
    }

    #[test]
    fn each_recording_has_a_name_of_its_own() {
        let name = |path: &str, n| numbered(Path::new(path), n).expect("a name").display().to_string();
        assert_eq!(name("/a/run.mcap", 2), "/a/run-model2.mcap");
        assert_eq!(name("/a/run-model2.mcap", 3), "/a/run-model3.mcap");
        assert_eq!(name("/a/my-model.mcap", 2), "/a/my-model-model2.mcap");
    }
}
