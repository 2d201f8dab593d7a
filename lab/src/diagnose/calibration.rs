//! The numbers of a model that every fit found beside the missing effects: geometry that its file leaves open, and what the user freed.

use super::answer::Calibration;
use super::screen::{orthonormal, remove};
use crate::fit::{Fit, Variable, dot, uncertainty};
use crate::machine::is_geometry;
use crate::{Problem, Term};

/// A number of whose effect the others can make all but this share is not told apart from them.
const OWN_SHARE: f64 = 0.03;

/// The first `n` variables of a fit, which are those of the model's own.
pub(super) fn calibration(problem: &Problem, fit: &Fit, n: usize) -> Vec<Calibration> {
    let known = uncertainty(problem, fit);
    let number = |(k, own): (usize, &Variable)| {
        let entry = &fit.effects[own.effect];
        Calibration {
            name: number_name(entry, &own.name),
            joint: None,
            recording: None,
            value: own.value(&fit.effects),
            se: known.robust[k],
            unit: own.unit.clone(),
            prior: own.prior,
            is_held: false,
        }
    };
    fit.variables.iter().take(n).enumerate().map(number).collect()
}

/// What a number of an entry is called: a machine's own by its key, an effect's with the effect before it.
pub(crate) fn number_name(entry: &Term, name: &str) -> String {
    if is_geometry(entry) { name.to_owned() } else { format!("{}.{name}", entry.label()) }
}

/// A sentence that names those of the first `n` variables whose effect the other variables of the fit can make.
pub(super) fn inseparable(fit: &Fit, n: usize) -> Option<String> {
    let is_free = |k: usize| fit.variables[k].prior.is_none();
    let share = |k: usize| {
        let others: Vec<Vec<f64>> =
            (0..fit.slopes.len()).filter(|&i| i != k && is_free(i)).map(|i| fit.slopes[i].clone()).collect();
        let mut own = fit.slopes[k].clone();
        let whole = dot(&own, &own);
        remove(&orthonormal(&others), &mut own);
        if whole > 0.0 { (dot(&own, &own) / whole).sqrt() } else { 0.0 }
    };
    let names: Vec<&str> =
        (0..n).filter(|&k| is_free(k) && share(k) < OWN_SHARE).map(|k| fit.variables[k].name.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "{} cannot be told apart by these data, from one another or from the effects: take their values together, or measure \
             one and write it into the model file",
            names.join(", ")
        )
    })
}
