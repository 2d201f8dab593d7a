//! `krait model save-learnt`: what a chain has learnt while it moved, from its recording into a model file.

use crate::cli_model::SaveLearntArgs;
use crate::commands::overwrite::{refuse_existing, write_whole};
use crate::commands::today;
use crate::print;
use crate::recorded::{model_text, settings_of};
use anyhow::{Context, bail};
use krait_bridge::{
    EstimateConfig, EstimateCore, EstimatorCore, JointEstimateCore, JointMachine, LiveModel, SegmentEstimateCore,
};
use krait_ipc::input;
use krait_ipc::message::{LearningState, LearntValue, ModelUpdate, Shape, SlaveState};
use krait_model::model_file::{FileEffect, HeldOutRms, HistoryEntry, ModelFile, Origin};
use krait_model::{LearntParameter, ModelHash};
use krait_record::Recording;
use krait_report::LearntReport;
use krait_schema::Sample;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::path::Path;
use std::process::ExitCode;

/// What was saved, as `--json` prints it.
#[derive(Serialize)]
struct Saved {
    out: String,
    recording: String,
    learnt: Vec<LearntReport>,
    /// What the model did not explain of the newest shapes before they were used: with the values that the file began with,
    /// and with those that were learnt by then.
    unexplained: [f64; 2],
    unexplained_unit: &'static str,
}

/// Writes the model file of the recording's last chain with the values that it ended with.
pub fn run(args: &SaveLearntArgs) -> anyhow::Result<ExitCode> {
    refuse_existing(&args.out, "toml", args.force)?;
    let of_recording = || format!("recording {}", args.recording.display());
    let parts = Recording::open_parts(&args.recording)?;
    let Some(first) = parts.first() else { bail!("{}: it holds nothing", of_recording()) };
    let last = last_chain(&parts).with_context(of_recording)?;
    let Some(update) = last.update else { bail!("{}: nothing was learnt in it", of_recording()) };
    let file = ModelFile::parse(&model_text(first, ModelHash(update.model_hash)).with_context(of_recording)?)?;
    let model = LiveModel::of(&file)?;
    let names = model.learnt().to_vec();
    if names.is_empty() {
        bail!("{}: its model learns nothing; say what it shall learn with `learn = {{ sd = ... }}`", of_recording());
    }
    let date = today();
    let source = args.recording.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let unit = Unit::of_errors(&model);
    let before = unit.of(last.without_learning(&file, first).with_context(of_recording)?);
    let after = unit.of(update.innovation_rms_rad);
    let effects = with_values(&file, &names, &update, &source, &date)?;
    let learnt = LearntReport::of(&update, &names);
    let mut history = file.history().to_vec();
    history.push(HistoryEntry {
        effect: format!(
            "learnt while moving: {}",
            names.iter().map(|n| n.name.as_str()).collect::<Vec<_>>().join(", ")
        ),
        data: source,
        data_sha256: sha256(&args.recording)?,
        date: Some(date),
        heldout_rms: HeldOutRms { before, after, noise_floor: None },
        unit: unit.name.to_owned(),
    });
    let saved = ModelFile::new(file.machine().clone(), effects, history)?;
    write_whole(&args.out, saved.to_toml())
        .with_context(|| format!("the model file {} could not be written", args.out.display()))?;
    let (out, recording) = (args.out.display().to_string(), args.recording.display().to_string());
    let answer = Saved { out, recording, learnt, unexplained: [before, after], unexplained_unit: unit.name };
    if args.json {
        print::json(&answer)?
    } else {
        print::out(&text(&answer))?
    }
    Ok(ExitCode::SUCCESS)
}

fn text(saved: &Saved) -> String {
    let mut text = format!("{} holds what {} had learnt at its end:\n", saved.out, saved.recording);
    for own in &saved.learnt {
        text += &format!("  {}\n", own.sentence());
    }
    let ([before, after], unit) = (saved.unexplained, saved.unexplained_unit);
    text + &format!(
        "Not explained of the newest shapes: {before:.3} {unit} with the values at the start, {after:.3} {unit} with these, \
         each before the shape was used\n"
    )
}

/// The file's effects with the learnt values; what the motion said nothing about stays as it was.
fn with_values(
    file: &ModelFile,
    names: &[LearntParameter],
    update: &ModelUpdate,
    source: &str,
    date: &str,
) -> anyhow::Result<Vec<FileEffect>> {
    let learnt = |name: &str, place: usize| -> Option<LearntValue> {
        let is_it = |(own, _): &(&LearntParameter, &LearntValue)| {
            own.effect == place && own.name.rsplit_once('.').is_some_and(|(_, parameter)| parameter == name)
        };
        let (_, value) = names.iter().zip(update.learnt()).find(is_it)?;
        (value.state() != Some(LearningState::NotObservable)).then_some(*value)
    };
    let mut effects = Vec::new();
    for (place, old) in file.effects().iter().enumerate() {
        let mut setting = old.setting().clone();
        let parameters: Vec<String> = setting.parameter_names().map(str::to_owned).collect();
        for name in &parameters {
            if let Some(value) = learnt(name, place) {
                setting = setting.with(name, value.value)?;
            }
        }
        let mut effect = FileEffect::new(setting);
        for name in &parameters {
            let origin = match learnt(name, place) {
                Some(value) => Some(Origin {
                    parameter: name.clone(),
                    se: Some(value.sd),
                    from: Some(source.to_owned()),
                    date: Some(date.to_owned()),
                }),
                None => old.origin(name).cloned(),
            };
            if let Some(origin) = origin {
                effect = effect.with_origin(origin)?;
            }
        }
        effects.push(effect);
    }
    Ok(effects)
}

/// The states, shapes and updates of the last chain in a recording.
#[derive(Default)]
struct LastChain {
    states: VecDeque<SlaveState>,
    shapes: Vec<Shape>,
    updates: Vec<(u64, u64)>,
    update: Option<ModelUpdate>,
}

fn last_chain(parts: &[Recording]) -> anyhow::Result<LastChain> {
    let mut last = LastChain::default();
    for part in parts {
        for recorded in part.samples()? {
            match recorded?.sample {
                Sample::State(state) => {
                    if state.sequence == 1 {
                        last.states.clear();
                    }
                    last.states.push_back(state);
                }
                Sample::Shape(shape) => {
                    if shape.sequence == 1 {
                        last.shapes.clear();
                    }
                    last.shapes.push(shape);
                }
                Sample::ModelUpdate(update) => {
                    if update.sequence == 1 {
                        last.updates.clear();
                    }
                    last.updates.push((update.shape_sequence, update.state_sequence));
                    last.update = Some(update);
                }
                _ => {}
            }
        }
    }
    Ok(last)
}

impl LastChain {
    /// What the same model leaves unexplained where it learns nothing, rad.
    fn without_learning(self, file: &ModelFile, recording: &Recording) -> anyhow::Result<f64> {
        Ok(match LiveModel::of(&file.without_learning())? {
            LiveModel::Snake(chain) => self.unexplained_rad(EstimateCore::new(&chain, EstimateConfig::default())?),
            LiveModel::Joints(model) => {
                let machine = JointMachine::new(&model, &settings_of(recording)?.joints)?;
                self.unexplained_rad(JointEstimateCore::new(&machine, EstimateConfig::default())?)
            }
            LiveModel::Segments(model) => {
                self.unexplained_rad(SegmentEstimateCore::new(&model, EstimateConfig::default())?)
            }
        })
    }

    fn unexplained_rad(mut self, mut core: impl EstimatorCore) -> f64 {
        let mut rms_rad = 0.0;
        for (shape_sequence, state_sequence) in self.updates {
            while self.states.front().is_some_and(|state| state.sequence <= state_sequence) {
                if let Some(state) = self.states.pop_front() {
                    core.note_state(&state);
                }
            }
            let place = self.shapes.binary_search_by_key(&shape_sequence, |shape| shape.sequence);
            if let Some(shape) = place.ok().and_then(|place| self.shapes.get(place)) {
                rms_rad = core.step(shape).innovation_rms_rad;
            }
        }
        rms_rad
    }
}

/// How errors are told: the length of a bend vector's error in degrees, or the error of one joint.
struct Unit {
    name: &'static str,
    /// Of it in one rad (m for a sliding joint) of one number's root mean square.
    per_si: f64,
}

impl Unit {
    fn of_errors(model: &LiveModel) -> Self {
        match model {
            LiveModel::Snake(_) | LiveModel::Segments(_) => Self { name: "deg", per_si: 2f64.sqrt().to_degrees() },
            LiveModel::Joints(joints) => {
                let (name, per_si) = krait_report::joint_unit(joints.slides());
                Self { name, per_si }
            }
        }
    }

    fn of(&self, rms_rad: f64) -> f64 {
        rms_rad * self.per_si
    }
}

fn sha256(path: &Path) -> anyhow::Result<String> {
    let mut file =
        input::regular(path, input::ANY_BYTES).with_context(|| format!("{} could not be read", path.display()))?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        let n = std::io::Read::read(&mut file, &mut buffer)
            .with_context(|| format!("{} could not be read", path.display()))?;
        if n == 0 {
            break;
        }
        hash.update(&buffer[..n]);
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
