//! What came of one cell: the diagnosis beside the truth, as one line of the results.

use super::baseline::{self, Baselines};
use super::{GridCell, Group, Labs, Task};
use crate::HiddenTruth;
use crate::force::force;
use crate::generate::generate;
use crate::joints::joints;
use crate::segments::segments;
use krait_lab::Measurements;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, FoundEffect, Verdict, diagnose};
use krait_lab::machine::{MachineUnderTest, SegmentsLab};
use krait_model::model_file::ModelFile;
use serde::{Deserialize, Serialize};

/// One finished cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The cell's name.
    pub id: String,
    /// Its group's word.
    pub group: String,
    /// Why there is no result, if there is none: data of such a recipe cannot be made, or not be diagnosed.
    pub refused: Option<String>,
    /// What was hidden.
    pub truth: Option<HiddenTruth>,
    /// What the lab said.
    pub said: Option<Said>,
    /// What the baselines said.
    pub baselines: Option<Baselines>,
}

/// A diagnosis in short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// none, missing or unknown.
    pub verdict: String,
    /// Effects named, or that help without explaining, first first.
    pub named: Vec<String>,
    /// Look-alikes of each.
    pub classes: Vec<Vec<String>>,
    /// The three best candidates by themselves.
    pub best: Vec<String>,
    /// Error with the effects on data left out, in the truth's unit.
    pub final_error: f64,
    /// The noise floor as found, in the same.
    pub floor: Option<f64>,
    /// Whether structure remains.
    pub structured: bool,
    /// The next experiment.
    pub next: Option<String>,
    /// Parameters whose truth is known: name, truth, value, standard error.
    pub known: Vec<(String, f64, f64, f64)>,
}

impl Outcome {
    /// Works a cell out.
    pub fn of(cell: &GridCell, labs: &Labs, with_baselines: bool) -> Self {
        let mut outcome = Self {
            id: cell.id.clone(),
            group: cell.group.word().to_owned(),
            refused: None,
            truth: None,
            said: None,
            baselines: None,
        };
        if let Err(reason) = outcome.fill(cell, labs, with_baselines) {
            outcome.refused = Some(reason);
        }
        outcome
    }

    fn fill(&mut self, cell: &GridCell, labs: &Labs, with_baselines: bool) -> Result<(), String> {
        let of_segments: SegmentsLab;
        let (machine, data, truth): (&dyn MachineUnderTest, _, _) = match &cell.task {
            Task::Snake(recipe) => {
                let made = generate(recipe).map_err(|e| e.to_string())?;
                let own = if recipe.perturbation > 0.0 { &labs.open_snake } else { &labs.snake };
                // Both components of the bend.
                (own, made.measurements, HiddenTruth::of_answer(made.answer, core::f64::consts::SQRT_2))
            }
            Task::Joints(recipe) => {
                let (data, answer) = joints(recipe).ok_or("an effect of this kind cannot be made as large")?;
                (&labs.joints, data, HiddenTruth::of_answer(answer, 1.0))
            }
            Task::Force(recipe) => {
                let (data, truth, noise) = force(recipe).ok_or("the others make this part in this motion")?;
                let filtered = |data| labs.force.filtered(data).map_err(|e| e.to_string());
                let noise_rms = scored_rms(&filtered(noise)?);
                (&labs.force, filtered(data)?, HiddenTruth { noise_rms, ..truth })
            }
            Task::Segments(recipe) => {
                let made = segments(recipe).map_err(|e| e.to_string())?;
                let file = ModelFile::parse(&made.model).map_err(|e| e.to_string())?;
                of_segments = SegmentsLab::new(&file).ok_or("the model is of no segments")?;
                // All components of all bends.
                let deviations = (made.measurements.n_outputs as f64).sqrt();
                (&of_segments, made.measurements, HiddenTruth::of_answer(made.answer, deviations))
            }
        };
        let data = &data;
        let truth = self.truth.insert(truth);
        let options = DiagnoseOptions { seed: cell.task.seed() % 1_000_003, ..DiagnoseOptions::default() };
        let diagnosis = diagnose(machine, data, &options).map_err(|e| e.to_string())?;
        self.said = Some(said(&diagnosis, truth));
        if with_baselines && matches!(cell.task, Task::Snake(_)) {
            let single = truth.right.first().and_then(|names| names.first()).filter(|_| cell.group == Group::Single);
            let asked = baseline::ask(machine, data, single.map(String::as_str));
            self.baselines = Some(asked.map_err(|e| e.to_string())?);
        }
        Ok(())
    }

    /// Whether the first name is right.
    pub fn is_top_1(&self) -> bool {
        self.is_right_first(|said| said.named.iter().take(1).collect())
    }

    /// Whether one of the first effect's look-alikes is right.
    pub fn is_in_class(&self) -> bool {
        self.is_right_first(|said| said.classes.iter().take(1).flatten().collect())
    }

    /// Whether one of the three best candidates is right.
    pub fn is_top_3(&self) -> bool {
        self.is_right_first(|said| said.named.iter().take(1).chain(&said.best).collect())
    }

    /// Whether the verdict is that the effects explain everything.
    pub fn is_claimed(&self) -> bool {
        self.is_said(Verdict::Missing)
    }

    /// Whether effects were asserted, alone or beside a rest; what is shown under other verdicts is a hypothesis.
    pub fn is_asserted(&self) -> bool {
        self.is_said(Verdict::Missing) || self.is_said(Verdict::Partly)
    }

    /// Whether this is the verdict.
    pub fn is_said(&self, verdict: Verdict) -> bool {
        self.said.as_ref().is_some_and(|said| said.verdict == verdict.word())
    }

    /// Names that are asserted and right, names asserted, names that are right: what recall and precision are made of.
    pub fn hits(&self) -> (usize, usize, usize) {
        let (Some(truth), Some(said)) = (&self.truth, &self.said) else { return (0, 0, 0) };
        let known: Vec<&Vec<String>> =
            truth.right.iter().filter(|names| !matches!(names[0].as_str(), "none" | "unknown")).collect();
        let named: &[String] = if self.is_asserted() { &said.named } else { &[] };
        (matched(&known, named), named.len(), known.len())
    }

    /// Whether a wrong effect is asserted.
    pub fn asserts_wrongly(&self) -> bool {
        let (hits, named, _) = self.hits();
        hits < named
    }

    /// Whether the names are those of the truth, each once and no others.
    pub fn is_exact(&self) -> bool {
        let (Some(truth), Some(said)) = (&self.truth, &self.said) else { return false };
        is_exact(&truth.right, &said.named) && self.is_asserted()
    }

    /// Held-out error in units of the noise that was really added.
    pub fn over_floor(&self) -> Option<f64> {
        let (truth, said) = (self.truth.as_ref()?, self.said.as_ref()?);
        Some(said.final_error / truth.noise_rms)
    }

    fn is_right_first<'a>(&'a self, names: impl Fn(&'a Said) -> Vec<&'a String>) -> bool {
        let (Some(truth), Some(said)) = (&self.truth, &self.said) else { return false };
        names(said).into_iter().any(|name| truth.right.first().is_some_and(|right| right.contains(name)))
    }
}

/// Root mean square over the rows that are compared.
fn scored_rms(data: &Measurements) -> f64 {
    let rows = (0..data.n_rows()).filter(|row| data.is_scored(*row));
    let (sum, n) = rows.fold((0.0, 0.0), |(sum, n), row| (sum + data.outputs[row].powi(2), n + 1.0));
    (sum / n).sqrt()
}

/// Whether each truth has a name of its own and no name is left over.
pub(super) fn is_exact(right: &[Vec<String>], named: &[String]) -> bool {
    right.len() == named.len() && matched(&right.iter().collect::<Vec<_>>(), named) == named.len()
}

/// How many names find a truth of their own, at most.
fn matched(right: &[&Vec<String>], named: &[String]) -> usize {
    let Some((first, others)) = named.split_first() else { return 0 };
    let with = (0..right.len()).filter(|&k| right[k].contains(first)).map(|k| {
        let rest: Vec<&Vec<String>> = right.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, own)| *own).collect();
        1 + matched(&rest, others)
    });
    with.max().unwrap_or(0).max(matched(right, others))
}

fn said(diagnosis: &Diagnosis, truth: &HiddenTruth) -> Said {
    let found = if diagnosis.effects.is_empty() { &diagnosis.partial } else { &diagnosis.effects };
    Said {
        verdict: diagnosis.verdict.word().to_owned(),
        named: found.iter().map(|effect| effect.name.clone()).collect(),
        classes: found.iter().map(|effect| effect.class.clone()).collect(),
        best: diagnosis.candidates.iter().take(3).map(|candidate| candidate.name.to_owned()).collect(),
        final_error: diagnosis.final_heldout_rms,
        floor: diagnosis.noise_floor,
        structured: diagnosis.remaining.structured,
        next: diagnosis.next_experiment.as_ref().map(|next| next.instruction.clone()),
        known: found.iter().flat_map(|effect| known(effect, truth)).collect(),
    }
}

fn known(effect: &FoundEffect, truth: &HiddenTruth) -> Vec<(String, f64, f64, f64)> {
    let Some(values) = truth.known.get(&effect.name) else { return Vec::new() };
    let row = |own: &krait_lab::diagnose::FoundParameter| {
        let truth = *values.get(&own.name)?;
        own.is_free.then(|| (format!("{}.{}", effect.name, own.name), truth, own.value, own.se))
    };
    effect.parameters.iter().filter_map(row).collect()
}
