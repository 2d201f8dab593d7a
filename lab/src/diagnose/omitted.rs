//! What an effect that is not in a list may hide in the values of those that are: a scale of the picture.
//!
//! Problem: three scales of encoders have a common part, which a wrong pitch radius, stiffness or camera makes as well. The shorter list is
//! named, and its values are then those of both; standard errors, given the names, do not say so.
//! Intuition: every snake has a scale that is off by a few percent. Where a list names none, one of that size may be there, as far as the
//! data, and the smallest effect that a list is made longer for, leave it room; values move with it.

use super::accept::SMALLEST_OF_FLOOR;
use super::search::{Search, Trial};
use crate::fit::{dot, inverse};
use crate::machine::Candidate;
use crate::{LabError, Term};
use krait_model::effects::Class;
use nalgebra::{DMatrix, DVector};

/// What stands for every scale of the picture; the size at which it is looked for is a usual one.
const SCALE: &str = "camera-scale";

/// Whether an effect scales every bend.
pub(super) fn is_scale(candidate: &Candidate) -> bool {
    candidate.class == Class::Proportional.label()
}

/// By how much a usual scale that the list does not hold may have moved each variable of its fit, a standard deviation in the
/// parameter's unit; zero where the machine has no such scale.
///
/// # Errors
/// [`LabError::Chain`] where the scale makes no chain.
pub(super) fn moved_by_scale(search: &Search, chosen: &Trial) -> Result<Vec<f64>, LabError> {
    let (problem, fit) = (search.problem, &chosen.fit);
    let n = fit.variables.len();
    let Some(scale) = search.candidates.iter().find(|own| own.name == SCALE) else { return Ok(vec![0.0; n]) };
    let is_held = |term: &Term| search.candidates.iter().any(|own| own.name == term.name && is_scale(own));
    if n == 0 || fit.effects.iter().any(is_held) {
        return Ok(vec![0.0; n]);
    }
    let mut effects = fit.effects.clone();
    effects.push(Term::new(scale.name, scale.starts[0].clone()));
    let there = problem.residual(&effects)?;
    let column: Vec<f64> = there.iter().zip(&fit.residual).map(|(a, b)| a - b).collect();
    let (pull, _) = fit.pulls(problem);
    let gram = DMatrix::from_fn(n, n, |i, j| dot(&fit.slopes[i], &fit.slopes[j])) + DMatrix::from_diagonal(&pull);
    let along = DVector::from_fn(n, |k, _| dot(&fit.slopes[k], &column));
    let shift = inverse(&gram) * &along;
    let own = (dot(&column, &column) - along.dot(&shift)).max(0.0);
    let room = SMALLEST_OF_FLOOR * dot(&fit.residual, &fit.residual) / ERRORS_OF_ROOM;
    let deviation = if room > 0.0 { (room / (own + room)).sqrt() } else { 0.0 };
    let unit = |k: usize| fit.variables[k].unit_step(&fit.effects).abs();
    Ok((0..n).map(|k| shift[k].abs() * deviation * unit(k)).collect())
}

/// What is left out takes at most the smallest share that counts: two standard deviations of it, squared.
const ERRORS_OF_ROOM: f64 = 4.0;

/// A sentence on the effects of whose standard errors this is the most.
pub(super) fn caution(names: &[&str]) -> Option<String> {
    (!names.is_empty()).then(|| {
        format!(
            "a scale of the picture (camera, pitch radius, stiffness) would hide in the values of {}: their standard errors allow for a \
             usual one, and ratios and differences of these values are known better; a measured radius or a camera that is calibrated \
             for itself decides",
            names.join(" and ")
        )
    })
}
