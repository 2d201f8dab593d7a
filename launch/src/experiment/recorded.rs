//! An experiment's recording as its outcome: the models and the simulated snake that it embeds go into the bench beside it.

use crate::commands::process::{BUILT_IN_ATTACHMENT, TRUTH_ATTACHMENT};
use crate::in_force::OWN_MODEL;
use anyhow::{Context, bail};
use krait_bridge::LiveModel;
use krait_model::Snake;
use krait_model::model_file::ModelFile;
use krait_paper::experiment::{FigureKind, FigureOutcome, PassModel, announced};
use krait_record::{MODEL_ATTACHMENT, Recording, attachment};
use krait_sim::Truth;
use std::path::Path;

/// Computes the outcome, with the snake that it is of.
///
/// # Errors
/// One sentence that names the recording.
pub fn outcome_of(path: &Path) -> anyhow::Result<(FigureOutcome, Snake)> {
    let recording = Recording::open_beginning(path)?;
    let named = || format!("recording {}", path.display());
    let truth = match attachment(&recording, TRUTH_ATTACHMENT) {
        Some(text) => Truth::parse(text, TRUTH_ATTACHMENT).with_context(named)?,
        None => Truth::default(),
    };
    let model_of = |name: &str| model_of(&recording, name);
    let outcome = FigureOutcome::of(path, &truth, model_of)?;
    let Some(first) = outcome.passes.first() else { bail!("{}: it holds no pass", named()) };
    let snake = Snake::new(model_of(&first.compensation).with_context(named)?.chain.machine())?;
    Ok((outcome, snake))
}

/// Refuses a recording of another experiment than was asked for.
///
/// # Errors
/// One sentence: it is of none, or of another.
pub fn refuse_other(path: &Path, wanted: FigureKind) -> anyhow::Result<()> {
    let named = || format!("recording {}", path.display());
    let found = announced(&Recording::open_beginning(path)?).with_context(named)?.protocol.figure;
    let name = |figure| match figure {
        FigureKind::Fig10 => "fig10",
        FigureKind::Fig11 => "fig11",
        FigureKind::Poses => "poses",
    };
    if found != wanted {
        let (path, found, wanted) = (path.display(), name(found), name(wanted));
        bail!(
            "recording {path}: it is of the experiment {found}, and {wanted} was asked for; use `krait experiment {found} --from {path}`"
        );
    }
    Ok(())
}

fn model_of(recording: &Recording, name: &str) -> anyhow::Result<PassModel> {
    let file =
        if name == OWN_MODEL { MODEL_ATTACHMENT.to_owned() } else { format!("{BUILT_IN_ATTACHMENT}{name}.toml") };
    let text =
        attachment(recording, &file).with_context(|| format!("it embeds no {file}, the model of its pass {name}"))?;
    let model = LiveModel::of(&ModelFile::parse(text)?)?;
    let chain =
        model.snake().with_context(|| format!("its pass {name} is of joints or segments, expected a snake"))?.clone();
    Ok(PassModel { chain, learnt: model.learnt().to_vec() })
}
