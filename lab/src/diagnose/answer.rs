//! What a diagnosis says, in the words of its machine-readable answer.

use super::sketch::place;
use super::variation::ParameterVariation;
use super::{LockedError, NextExperiment, Sketch, Structure};
use crate::Term;
use crate::camera::CameraOffset;
use crate::clock::ClockOffset;
use crate::machine::JointsLab;
use crate::noise::NoiseFloor;
use std::collections::BTreeSet;

/// The answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing is missing: the error is the measurement's noise.
    None,
    /// The named effects are missing.
    Missing,
    /// The named effects are missing, and a rest remains that they do not explain.
    Partly,
    /// Something is missing that no known effect explains, nor two together; or the data do not suffice to say.
    Unknown,
    /// The data are too short for a test: of joints what is left remembers too long, of others there are too few blocks of time.
    TooShort,
}

impl Verdict {
    /// The word in the answer.
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Missing => "missing",
            Self::Partly => "partly",
            Self::Unknown => "unknown",
            Self::TooShort => "too-short",
        }
    }

    /// One verdict of all joints.
    pub(crate) fn together(all: &[Self]) -> Self {
        let any = |verdict: Self| all.contains(&verdict);
        if all.iter().all(|own| *own == Self::None) {
            Self::None
        } else if any(Self::Missing) || any(Self::Partly) {
            let is_done = all.iter().all(|own| matches!(own, Self::Missing | Self::None));
            if is_done { Self::Missing } else { Self::Partly }
        } else if any(Self::Unknown) {
            Self::Unknown
        } else {
            Self::TooShort
        }
    }
}

/// A diagnosis. Errors are lengths of the output's error, root mean square, in the machine's unit for errors (degrees).
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The answer.
    pub verdict: Verdict,
    /// One sentence that says it.
    pub sentence: String,
    /// How many seconds of such data a test needs, s; `None` unless they are too short.
    pub needed_s: Option<f64>,
    /// What cannot be said with these data, each a sentence.
    pub cautions: Vec<String>,
    /// Unit of every error.
    pub unit: String,
    /// The measurement's own noise; `None` where the data do not tell.
    pub noise_floor: Option<f64>,
    /// How the floor was found.
    pub floor_source: &'static str,
    /// Its relative standard error.
    pub floor_relative_error: f64,
    /// Its estimates, one output's standard deviation in the outputs' unit.
    pub floors: NoiseFloor,
    /// Error of the model as given, with what it leaves out at its default.
    pub as_given_rms: f64,
    /// Error of the model after calibration, on blocks that the fit did not see.
    pub base_heldout_rms: f64,
    /// Error with the effects of the verdict, on blocks that the fit did not see.
    pub final_heldout_rms: f64,
    /// Error that a fit without a model leaves on blocks that it did not see, a hint and no bound; `None` where nothing remains, or of few
    /// rows.
    pub model_free_rms: Option<f64>,
    /// The error on a part that no choice has seen; `None` where it was not asked for, or the data are too short.
    pub locked: Option<LockedError>,
    /// Share of what there was to explain that the effects explain, 0 to 1; `None` without effects or a known floor.
    pub explained_share: Option<f64>,
    /// What every fit found beside the effects: gains, offsets, delays.
    pub calibration: Vec<Calibration>,
    /// The load cells, line by line, where loads were recorded and count.
    pub loads: Option<Vec<LoadCell>>,
    /// The clock of each recording's measurements that was found beside the effects; empty where it is the commands'.
    pub clocks: Vec<ClockOffset>,
    /// Where each recording's camera was found to stand, beside the first one's; empty where all stand alike.
    pub cameras: Vec<CameraOffset>,
    /// Columns that stand in another order, measured ones of joints and commanded ones of lines: the joint or line, from 0, whose it is, and the
    /// one that it is called by.
    pub order: Vec<(usize, usize)>,
    /// The missing effects, the one that brings most first; empty unless the verdict says missing or partly.
    pub effects: Vec<FoundEffect>,
    /// Hypotheses: effects that help, but do not explain; where the verdict is unknown or too short.
    pub partial: Vec<FoundEffect>,
    /// Every candidate.
    pub candidates: Vec<CandidateAnswer>,
    /// What the effects leave.
    pub remaining: Remaining,
    /// Formulas for what remains, of joints: the term that takes most first; empty where nothing remains or no term pays.
    pub proposals: Vec<FormulaTerm>,
    /// Numbers of effects that depend on a column or differ in a recording; of joints.
    pub variations: Vec<ParameterVariation>,
    /// What to do next.
    pub next_experiment: Option<NextExperiment>,
    /// The model's effects and the missing ones, with fitted values.
    pub terms: Vec<Term>,
    /// The machine with what the calibration found, for pictures; `None` where nothing was calibrated.
    pub calibrated: Option<JointsLab>,
    /// Rows, scored rows, rows left out as outliers, blocks.
    pub rows: [usize; 4],
    /// Seed of all random numbers.
    pub seed: u64,
}

/// How the sentence begins where the columns are probably not what their names say.
const COLUMNS_FIRST: &str = "the columns first";

/// The sentence of columns that are probably not what their names say.
pub(crate) fn columns_first(hint: &str) -> String {
    format!("{COLUMNS_FIRST}: {hint}")
}

impl Diagnosis {
    /// Whether the columns are probably not what their names say: nothing else is worth doing, and no motion mends that.
    pub fn is_of_columns(&self) -> bool {
        self.sentence.starts_with(COLUMNS_FIRST)
    }

    /// Whether something of the machine beside its effects was fitted: errors are then those after calibration.
    pub fn is_calibrated(&self) -> bool {
        self.calibration.iter().any(|own| !own.is_held)
    }

    /// The effects in the order of the chain, not of their size: added in this order they act on one another as they were found.
    pub fn in_chain_order(&self) -> Vec<&FoundEffect> {
        self.chain_order().into_iter().map(|slot| &self.effects[slot]).collect()
    }

    /// Places in `effects` in the order of the chain.
    pub fn chain_order(&self) -> Vec<usize> {
        let base = self.terms.len() - self.effects.len().min(self.terms.len());
        let mut slots: Vec<usize> = (0..self.effects.len()).collect();
        slots.sort_by_key(|slot| place(&self.effects, *slot, &self.terms, base));
        slots
    }

    /// An effect's own term, with fitted values.
    pub fn term_of(&self, effect: &FoundEffect) -> Option<&Term> {
        let slot = self.effects.iter().position(|own| own == effect)?;
        let base = self.terms.len() - self.effects.len().min(self.terms.len());
        place(&self.effects, slot, &self.terms, base).and_then(|place| self.terms.get(place))
    }

    /// What the errors of the candidates are of, where that is another kind than every other error of the answer.
    pub fn candidates_error_is_of(&self) -> Option<&'static str> {
        let with_loads = "the error is of shape and loads together, a load's noise counted as the shape's";
        self.loads.is_some().then_some(with_loads)
    }
}

/// One term of a formula for what the effects leave of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaTerm {
    /// The joint, from 1.
    pub joint: usize,
    /// The term without its gain, as a formula writes it.
    pub term: String,
    /// The column that a name in it stands for: the name and the column's own.
    pub column: Option<(String, String)>,
    /// Its gain, all proposed terms together.
    pub gain: f64,
    /// Standard error of the gain.
    pub se: f64,
    /// Unit of the gain.
    pub unit: String,
    /// Share of the mean square that is left without it which it takes away, on blocks that it was not fitted to.
    pub share: f64,
}

/// A number of the machine that is no effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Its name: gain, offset, delay; of a snake its key in the model file.
    pub name: String,
    /// The joint, from 1; `None` for a snake.
    pub joint: Option<usize>,
    /// The recording whose own it is, where there are several.
    pub recording: Option<String>,
    /// Value.
    pub value: f64,
    /// Standard error; 0 where it is held.
    pub se: f64,
    /// Unit of both.
    pub unit: String,
    /// The fitted value, with its standard error, that the model file draws it to.
    pub prior: Option<(f64, f64)>,
    /// Whether the model file holds it.
    pub is_held: bool,
}

/// A load cell at an actuator: reading = gain x load + offset.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadCell {
    /// The line, from 1.
    pub line: usize,
    /// Newtons read for each newton of the model with the effects.
    pub gain: f64,
    /// Reading without a load in each trial, N.
    pub offset_n: Vec<f64>,
    /// Standard deviation of its noise, N.
    pub noise_n: f64,
    /// What the model as given leaves, root mean square, N.
    pub before_n: f64,
    /// What the effects leave, N.
    pub after_n: f64,
}

impl LoadCell {
    /// What is odd about it, a sentence.
    pub(super) fn caution(&self) -> Option<String> {
        let Self { line, gain, noise_n, after_n, .. } = self;
        if *gain < 0.0 {
            return Some(format!(
                "tau{line}_n reads {gain:.2} N for each newton: it is probably negated (push is positive)"
            ));
        }
        if !PLAUSIBLE_GAIN.contains(gain) {
            return Some(format!("tau{line}_n reads {gain:.3} N for each newton: it is probably in another unit"));
        }
        (*after_n > MUCH_LEFT * noise_n).then(|| {
            format!("{after_n:.2} N of tau{line}_n remain beside a noise of {noise_n:.2} N: the effects do not explain its loads")
        })
    }
}

/// Gains beyond these are no stiffness.
const PLAUSIBLE_GAIN: core::ops::Range<f64> = 0.3..3.0;
/// What leaves more than this of a cell's noise leaves structure.
const MUCH_LEFT: f64 = 1.3;

/// One missing effect.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundEffect {
    /// Its name.
    pub name: String,
    /// Effects that these data cannot tell from it, itself first.
    pub class: Vec<String>,
    /// Error before it was added, the effects before it in place.
    pub before: f64,
    /// Error with it.
    pub after: f64,
    /// Share of resampled data in which it, or one of its class, comes out best.
    pub probability: f64,
    /// Its parameters.
    pub parameters: Vec<FoundParameter>,
    /// The joint that has it, from 1; `None` for a machine that is one.
    pub joint: Option<usize>,
    /// What it alone does, where a slow motion shows it.
    pub sketch: Option<Sketch>,
}

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundParameter {
    /// Key in the model file.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Robust standard error, with half of how far the value moves where a look-alike stands in for another effect of the list, and of
    /// a snake with what a scale of the picture that no effect names may hide in it; zero for one that was not free.
    pub se: f64,
    /// Standard error as if residuals were independent.
    pub se_naive: f64,
    /// Whether the fit freed it.
    pub is_free: bool,
    /// Whether it lies on a bound.
    pub on_bound: bool,
}

/// One candidate, chosen or not.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateAnswer {
    /// Its name.
    pub name: &'static str,
    /// What it looks like.
    pub class: &'static str,
    /// Error with it alone added to the model; `None` if these data cannot show it.
    pub heldout_rms: Option<f64>,
    /// Share of resampled data in which it comes out best.
    pub probability: f64,
    /// Family-wise p-value of its signature in the residual of the model as given.
    pub p_value: f64,
    /// Why it was chosen, not chosen, or cannot be seen.
    pub state: String,
}

impl CandidateAnswer {
    /// One answer for each name, the one that helps most; smallest error first.
    pub(crate) fn best_of_each(mut all: Vec<Self>) -> Vec<Self> {
        let rms = |own: &Self| own.heldout_rms.unwrap_or(f64::INFINITY);
        all.sort_by(|a, b| rms(a).total_cmp(&rms(b)));
        let mut names = BTreeSet::new();
        all.retain(|own| names.insert(own.name));
        all
    }
}

/// What is left after the effects.
#[derive(Clone, Debug, PartialEq)]
pub struct Remaining {
    /// Whether there is structure that noise does not make.
    pub structured: bool,
    /// Probability of that structure by chance.
    pub p_value: f64,
    /// What it depends on most.
    pub looks_like: Option<&'static str>,
    /// Share of the explainable variance that is left, 0 to 1; where the floor is not known noise counts as explainable.
    pub unexplained: f64,
    /// Group by group.
    pub structure: Structure,
}
