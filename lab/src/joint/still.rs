//! Joints that do not move: neither a gain nor an effect of theirs can be seen.

use super::numbers::names_and_trials;
use super::signal::Number;
use crate::machine::JointsLab;
use crate::noise::{bounds, is_still};
use crate::{LabError, Measurements, Term};
use krait_model::model_file::Known;

/// Refuses a joint that stands still in every recording while its gain is to be fitted for the model file: the file says `"free"`, or a name
/// freed it. One that the file leaves out stays out of it, and keeps nobody from the other joints.
///
/// # Errors
/// [`LabError::StillGain`].
pub(crate) fn check_gains(
    machine: &JointsLab,
    data: &Measurements,
    recordings: &[(String, usize)],
) -> Result<(), LabError> {
    let is_open = |joint: &usize| machine.joints().gain_known.get(*joint) == Some(&Known::Free);
    let still = (0..data.n_inputs).filter(is_open).find(|joint| !moves(data, *joint, recordings));
    still.map_or(Ok(()), |joint| {
        let (source, joint) = (data.source.clone(), data.names.joint(joint + 1));
        Err(LabError::StillGain { data: source, joint })
    })
}

/// Whether nothing can be said of a joint's gain: it is open, and the joint stands still in every recording.
pub(crate) fn hides_gain(
    machine: &JointsLab,
    data: &Measurements,
    joint: usize,
    recordings: &[(String, usize)],
) -> bool {
    machine.gain_known(joint) == Number::Free && !moves(data, joint, recordings)
}

/// Refuses a new effect on a joint that stands still in every recording. An effect on every joint, and a formula, need one that moves.
///
/// # Errors
/// [`LabError::CannotShow`].
pub(crate) fn check_effect(term: &Term, data: &Measurements, recordings: &[(String, usize)]) -> Result<(), LabError> {
    let joint = term.values.first().filter(|_| term.formula.is_none()).map_or(0, |joint| joint.round() as usize);
    // That there is no such joint the chain says.
    if joint == 0 || joint > data.n_inputs || moves(data, joint - 1, recordings) {
        return Ok(());
    }
    let reason = format!("is on {}, which does not move in {}", data.names.joint(joint), data.source);
    Err(LabError::CannotShow { effect: term.label().to_owned(), reason })
}

/// Whether a joint, from 0, moves in one of the recordings; each has a gain and an offset of its own.
pub(super) fn moves(data: &Measurements, joint: usize, recordings: &[(String, usize)]) -> bool {
    let (_, first_trials) = names_and_trials(recordings);
    (0..first_trials.len()).any(|k| {
        let rows = data.rows_of(data.trials_of(k, &first_trials)).into_iter();
        !is_still(bounds(rows.map(|row| data.input(row)[joint]).filter(|u| u.is_finite())))
    })
}
