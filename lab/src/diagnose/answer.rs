//! What a diagnosis says, in the words of its machine-readable answer.

use super::{NextExperiment, Structure};
use crate::Term;
use crate::noise::NoiseFloor;

/// The three answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing is missing: the error is the measurement's noise.
    None,
    /// The named effects are missing.
    Missing,
    /// Something is missing that no known effect explains, nor two together; or the data do not suffice to say.
    Unknown,
}

impl Verdict {
    /// The word in the answer.
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Missing => "missing",
            Self::Unknown => "unknown",
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
    /// What cannot be said with these data, each a sentence.
    pub cautions: Vec<String>,
    /// The measurement's own noise; `None` where the data do not tell.
    pub noise_floor: Option<f64>,
    /// How the floor was found.
    pub floor_source: &'static str,
    /// Its estimates, one output's standard deviation in the outputs' unit.
    pub floors: NoiseFloor,
    /// Error of the model as given.
    pub base_heldout_rms: f64,
    /// Error with the effects of the verdict, on blocks that the fit did not see.
    pub final_heldout_rms: f64,
    /// The missing effects in the order found; empty unless the verdict says so.
    pub effects: Vec<FoundEffect>,
    /// Effects that help, but do not explain: only where the verdict is unknown.
    pub partial: Vec<FoundEffect>,
    /// Every candidate.
    pub candidates: Vec<CandidateAnswer>,
    /// What the effects leave.
    pub remaining: Remaining,
    /// What to do next.
    pub next_experiment: Option<NextExperiment>,
    /// The model's effects and the missing ones, with fitted values.
    pub terms: Vec<Term>,
    /// Rows, scored rows, rows left out as outliers, blocks.
    pub rows: [usize; 4],
    /// Seed of all random numbers.
    pub seed: u64,
}

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
    /// Robust standard error, with half of how far the value moves where a look-alike stands in for another effect of a pair;
    /// zero for one that was not free.
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

/// What is left after the effects.
#[derive(Clone, Debug, PartialEq)]
pub struct Remaining {
    /// Whether there is structure that noise does not make.
    pub structured: bool,
    /// Probability of that structure by chance.
    pub p_value: f64,
    /// What it depends on most.
    pub looks_like: Option<&'static str>,
    /// Share of the explainable variance that is left, 0 to 1.
    pub unexplained: f64,
    /// Group by group.
    pub structure: Structure,
}
