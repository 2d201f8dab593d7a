//! What simpler methods would have said of the same data.
//!
//! - Raw BIC: the refined single effect with the smallest N ln RSS + p ln N, added if that is smaller than without; then the
//!   next effect by the same rule, to first order. What most tools do.
//! - Effective BIC: the same with N / tau, tau the autocorrelation time of the residual.
//! - Generic ceiling: what a dictionary of shapes without names explains on data left out.
//! - Oracle: the true effect, fitted.

use krait_lab::diagnose::search::{Search, Trial};
use krait_lab::diagnose::structure::structure;
use krait_lab::machine::{Candidate, MachineUnderTest};
use krait_lab::noise::autocorrelation_time;
use krait_lab::{AddOptions, LabError, Measurements, Problem, Term, add};
use serde::{Deserialize, Serialize};

/// What they say.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Baselines {
    /// Effects that raw BIC adds, at most two.
    pub bic: Vec<String>,
    /// Effects that BIC with the effective number of rows adds.
    pub bic_effective: Vec<String>,
    /// Error that the dictionary without names would leave, degrees.
    pub generic_deg: f64,
    /// Held-out error of the true effect's fit, degrees; none where no single known effect is the truth.
    pub oracle_deg: Option<f64>,
}

/// Rows that they work on.
const WORKING_ROWS: usize = 4000;
const BLOCK_S: f64 = 5.0;

/// Asks the baselines; `truth` is the true effect's name, if one is.
pub(super) fn ask(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    truth: Option<&str>,
) -> Result<Baselines, LabError> {
    let stride = data.n_rows().div_ceil(WORKING_ROWS).max(1);
    let rows: Vec<usize> = (0..data.n_rows()).step_by(stride).collect();
    let problem = Problem::new(machine, data.select(&rows), &[], BLOCK_S);
    let candidates = machine.candidates(data);
    let search =
        Search { problem: &problem, candidates: &candidates, base: machine.effects(), base_variables: &[], seed: 1 };
    let start = search.start()?;
    let singles = search.singles(&start, &search.look(&start).0);
    let n = problem.n_scored as f64;
    let left = singles.first().map_or(&start.fit.residual, |best| &best.fit.residual);
    let effective = n / autocorrelation_time(left, problem.data.n_outputs);
    let predicted = machine.predict(machine.effects(), &problem.data)?;
    let explained = structure(&problem, &start.fit.residual, &[], &predicted, 1).explained.clamp(0.0, 1.0);
    let (_, scale) = machine.error_unit();
    Ok(Baselines {
        bic: forward(&search, &start, &singles, n),
        bic_effective: forward(&search, &start, &singles, effective),
        generic_deg: problem.rms(start.fit.sum_of_squares * (1.0 - explained)) * scale,
        oracle_deg: truth.map(|name| oracle(machine, data, name)).transpose()?,
    })
}

/// Forward selection by BIC with this number of rows.
fn forward(search: &Search, start: &Trial, singles: &[Trial], n: f64) -> Vec<String> {
    let candidates = search.candidates;
    let badness = |trial: &Trial| {
        let p: usize = trial.found.iter().map(|&k| candidates[k].free.len()).sum();
        criterion(trial.fit.sum_of_squares, p, n)
    };
    let Some(best) = singles.iter().min_by(|a, b| badness(a).total_cmp(&badness(b))) else { return Vec::new() };
    if badness(best) >= badness(start) {
        return Vec::new();
    }
    let mut names: Vec<String> = best.found.iter().map(|&k| candidates[k].name.to_owned()).collect();
    let p_before: usize = best.found.iter().map(|&k| candidates[k].free.len()).sum();
    let next = |candidate: &Candidate, sum: f64| criterion(sum, p_before + candidate.free.len(), n);
    let (cells, _) = search.look(best);
    let second = cells
        .iter()
        .map(|cell| (next(&candidates[cell.candidate], cell.sum_of_squares), cell.candidate))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((_, k)) = second.filter(|(value, _)| *value < badness(best)) {
        names.push(candidates[k].name.to_owned());
    }
    names
}

fn criterion(sum_of_squares: f64, p: usize, n: f64) -> f64 {
    n * sum_of_squares.max(f64::MIN_POSITIVE).ln() + p as f64 * n.ln()
}

fn oracle(machine: &dyn MachineUnderTest, data: &Measurements, name: &str) -> Result<f64, LabError> {
    let mut term = Term::new(name, Vec::new());
    term.values = machine.parameters(&term)?.iter().map(|parameter| parameter.default).collect();
    Ok(add(
        machine,
        data,
        &AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() },
    )?
    .after)
}
