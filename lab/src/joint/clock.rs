//! Measurements of joints that come ahead of the inputs: their clock is what is wrong, and no effect. A delay below zero that the
//! search finds is taken off the measurements, and all is diagnosed anew.

use super::decide;
use super::refine::{is_taken_back, swing_late_s};
use crate::clock::ClockOffset;
use crate::diagnose::{Calibration, DiagnoseOptions, Diagnosis, FoundEffect, Verdict, badness};
use crate::machine::JointsLab;
use crate::stage::stage;
use crate::{LabError, Measurements};

/// Searches for a clock.
const MOST_SEARCHES: usize = 3;
/// A clock of all joints leaves as much as the delay that was found, or it is no clock: where one joint alone comes ahead, it makes the
/// others late.
const AS_GOOD: f64 = 1.01;

/// Says what is missing from a machine of joints, by the clock that its measurements have.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(crate) fn diagnose(
    machine: &JointsLab,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    let mut best = decide::diagnose(machine, data, options)?;
    let as_given_rms = best.as_given_rms;
    let firsts = options.first_trials();
    let (mut clock, mut delays) = (ClockOffset::default(), Vec::new());
    for _ in 0..MOST_SEARCHES {
        let found = ahead(&best);
        let Some(shift_s) = weighed(&found) else { break };
        stage("The measurements' clock");
        let next = clock.and(ClockOffset { shift_s, rate: 0.0 });
        let moved = data.by_clocks(&vec![next; firsts.len()], &firsts);
        let again = decide::diagnose(machine, &moved, options)?;
        let is_worse = badness(&again, 1) > AS_GOOD * badness(&best, 1);
        if next.shift_s > ClockOffset::MOST_S || is_worse || takes_back(&again, next.shift_s) {
            break;
        }
        (best, clock) = (again, next);
        delays = if delays.is_empty() { found } else { delays };
    }
    if clock.is_none() {
        return Ok(best);
    }
    best.calibration.extend(delays.into_iter().map(|own| Calibration { value: -clock.shift_s, ..own }));
    best.cautions.push(format!(
        "the measurements come {:.1} ms ahead of the motion: that is calibration and no effect; --clock says it to the other commands",
        1e3 * clock.shift_s
    ));
    best.clocks = vec![clock; firsts.len()];
    best.as_given_rms = as_given_rms;
    best.rows[0] = data.n_rows();
    Ok(best)
}

/// The joints' measurements that come ahead, by an answer that asserts it.
fn ahead(diagnosis: &Diagnosis) -> Vec<Calibration> {
    let is_asserted = matches!(diagnosis.verdict, Verdict::None | Verdict::Missing | Verdict::Partly);
    let own = diagnosis.calibration.iter().filter(|own| is_asserted && own.name == "delay" && own.value < 0.0);
    own.cloned().collect()
}

/// Whether a slow effect is as late as the clock is ahead: both together only smooth a command that was rounded.
fn takes_back(diagnosis: &Diagnosis, shift_s: f64) -> bool {
    let late_s = |own: &FoundEffect| {
        let number = |name: &str| own.parameters.iter().find(|own| own.name == name).map(|own| own.value);
        match own.name.as_str() {
            "first-order-lag" => number("time_s"),
            "second-order" => Some(swing_late_s(number("frequency_rad_per_s")?, number("damping")?)),
            _ => None,
        }
    };
    diagnosis.effects.iter().filter_map(late_s).any(|late_s| is_taken_back(late_s, shift_s))
}

/// By how much they do together, s.
fn weighed(found: &[Calibration]) -> Option<f64> {
    let weight = |own: &Calibration| own.se.max(1e-9).powi(-2);
    let sum: f64 = found.iter().map(weight).sum();
    (sum > 0.0).then(|| -found.iter().map(|own| weight(own) * own.value).sum::<f64>() / sum)
}
