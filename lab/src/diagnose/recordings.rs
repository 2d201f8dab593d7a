//! The last word of several recordings of one machine: each is judged by what the others say, and one that contradicts them is named.
//!
//! Three recordings or more: of two that disagree nobody knows which one is the odd one.

use super::accept::FOLDS;
use super::verdict::Case;
use crate::fit::{Fit, held_out_output_squares, held_out_parts};
use crate::noise::median;
use crate::{Measurements, Problem};

/// Fewer recordings are judged on blocks of time, as one is.
pub(crate) const FEWEST_RECORDINGS: usize = 3;
/// A recording is odd where so many times the share of its squares is left that is left of a typical one, and at least half of them; and
/// where that is more than this ratio of a typical rest, so that one in which nothing was to be seen is none.
const ODD: f64 = 3.0;
const LEAST_ODD: f64 = 0.5;
const MORE_THAN_TYPICAL: f64 = 1.25;

impl Case<'_> {
    /// Squares of the outputs under parameters that have not seen them: of each recording where there are three or more, else of blocks
    /// of time.
    pub(super) fn held_out_squares(&self, problem: &Problem, fit: &Fit) -> Vec<f64> {
        match self.are_judged() {
            true => held_out_parts(problem, fit, &first_rows(self.recordings, &problem.data)),
            false => held_out_output_squares(problem, fit, FOLDS),
        }
    }

    /// Whether recordings that were left out are explained no better by a list of effects than without, all together; and a sentence
    /// on each that contradicts the others. The squares are those of [`Case::held_out_squares`] on all rows.
    pub(super) fn by_recordings(&self, before: &[f64], after: &[f64]) -> (bool, Vec<String>) {
        if !self.are_judged() {
            return (false, Vec::new());
        }
        let is_denied = after.iter().sum::<f64>() >= before.iter().sum::<f64>();
        let pairs: Vec<(f64, f64)> = before.iter().copied().zip(after.iter().copied()).collect();
        let mut said = disagreements(&pairs, self.recordings, &self.alone[0].problem.data, "");
        if is_denied {
            said.push(
                "what some recordings show makes the error of those left out no smaller: nothing is asserted of all"
                    .to_owned(),
            );
        }
        (is_denied, said)
    }

    fn are_judged(&self) -> bool {
        self.recordings.len() >= FEWEST_RECORDINGS
    }
}

/// Where each recording begins.
fn first_rows(recordings: &[(String, usize)], data: &Measurements) -> Vec<usize> {
    recordings.iter().map(|(_, trial)| data.first_row_of(*trial)).collect()
}

/// Recordings in which effects explain little of what they explain in the others, a sentence each; of each its squares before and after.
pub(crate) fn disagreements(
    pairs: &[(f64, f64)],
    recordings: &[(String, usize)],
    data: &Measurements,
    place: &str,
) -> Vec<String> {
    let mut bounds = first_rows(recordings, data);
    bounds.push(data.n_rows());
    let n_rows = bounds.windows(2).map(|ends| (ends[1] - ends[0]).max(1) as f64);
    let rests: Vec<f64> = pairs.iter().zip(n_rows).map(|((_, after), n)| after / n).collect();
    let shares: Vec<f64> = pairs.iter().map(|(before, after)| after / before.max(1e-300)).collect();
    let (Some(typical_rest), Some(typical)) = (median(rests.clone()), median(shares.clone())) else {
        return Vec::new();
    };
    let is_odd =
        |k: &usize| shares[*k] > (ODD * typical).max(LEAST_ODD) && rests[*k] > MORE_THAN_TYPICAL * typical_rest;
    (0..pairs.len())
        .filter(is_odd)
        .map(|k| {
            format!(
                "{} disagrees with the other recordings: {place}the effects leave {:.0} % of its error there, {:.0} % in a typical one",
                recordings[k].0,
                100.0 * shares[k].sqrt(),
                100.0 * typical.sqrt()
            )
        })
        .collect()
}
