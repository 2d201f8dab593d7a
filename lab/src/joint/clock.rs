//! Measurements of joints that come ahead of the inputs, or whose clock runs at another rate: their clock is what is wrong, and no effect.
//! What is found of it is taken off the measurements, and all is diagnosed anew.

use super::clock_rate::Rate;
use super::decide;
use super::refine::{is_taken_back, swing_late_s};
use crate::clock::ClockOffset;
use crate::diagnose::{Calibration, Clocks, DiagnoseOptions, Diagnosis, FoundEffect, Verdict, badness};
use crate::machine::JointsLab;
use crate::stage::stage;
use crate::{LabError, Measurements};

/// Searches for a clock.
const MOST_SEARCHES: usize = 3;
/// A clock of all joints leaves as much as the delay that was found, or it is no clock: where one joint alone comes ahead, it makes the
/// others late.
const AS_GOOD: f64 = 1.01;

/// An answer, and of each recording the rate of the clock that it shows beside this one.
pub(super) struct Diagnosed {
    pub answer: Diagnosis,
    pub rates: Vec<Option<Rate>>,
}

/// Says what is missing from a machine of joints, by the clock that its measurements have.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(crate) fn diagnose(
    machine: &JointsLab,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    let firsts = options.first_trials();
    let by = |clocks: &[ClockOffset]| decide::diagnose(machine, &data.by_clocks(clocks, &firsts), options);
    let n = firsts.len();
    let mut clocks =
        Clocks { values: vec![ClockOffset::default(); n], errors: vec![[0.0; 2]; n], is_free: vec![[false; 2]; n] };
    let Diagnosed { answer: mut best, mut rates } = decide::diagnose(machine, data, options)?;
    let as_given_rms = best.as_given_rms;
    for _ in 0..MOST_SEARCHES {
        // What grows with the time in another way draws a clock along, and leaves a rest.
        let is_clear = rates.iter().flatten().any(|rate| rate.is_clear);
        if !is_clear && !rates.iter().flatten().any(|rate| rate.may_be_all) {
            break;
        }
        stage("The rate of the measurements' clock");
        let other = |(k, own): (usize, &ClockOffset)| {
            rates[k].map_or(*own, |rate| rate.beside(*own, data.half_s(data.trials_of(k, &firsts))))
        };
        let next: Vec<ClockOffset> = clocks.values.iter().enumerate().map(other).collect();
        let again = by(&next)?;
        let is_all =
            matches!(again.answer.verdict, Verdict::None | Verdict::Missing) && again.answer.noise_floor.is_some();
        if !(is_clear || is_all) || badness(&again.answer, 1) >= badness(&best, usize::from(!clocks.are_one())) {
            break;
        }
        for (k, rate) in rates.iter().enumerate().filter_map(|(k, rate)| Some((k, (*rate)?))) {
            (clocks.errors[k][1], clocks.is_free[k][1]) = (rate.error, true);
        }
        clocks.values = next;
        Diagnosed { answer: best, rates } = again;
    }
    let mut shift_s = 0.0;
    for _ in 0..MOST_SEARCHES {
        let Some((step_s, error)) = weighed(&ahead(&best)) else { break };
        stage("The measurements' clock");
        shift_s += step_s;
        let next: Vec<ClockOffset> =
            clocks.values.iter().map(|own| own.and(ClockOffset { shift_s: step_s, rate: 0.0 })).collect();
        let again = by(&next)?.answer;
        let is_worse = badness(&again, 1) > AS_GOOD * badness(&best, 1);
        if shift_s > ClockOffset::MOST_S || is_worse || takes_back(&again, shift_s) {
            break;
        }
        (best, clocks.values) = (again, next);
        for (errors, is_free) in clocks.errors.iter_mut().zip(&mut clocks.is_free).filter(|(_, free)| !free[0]) {
            (errors[0], is_free[0]) = (error, true);
        }
    }
    if clocks.are_one() {
        return Ok(best);
    }
    clocks.told_in(&mut best, options);
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

/// By how much they do together, s, with its standard error.
fn weighed(found: &[Calibration]) -> Option<(f64, f64)> {
    let weight = |own: &Calibration| own.se.max(1e-9).powi(-2);
    let sum: f64 = found.iter().map(weight).sum();
    (sum > 0.0).then(|| (-found.iter().map(|own| weight(own) * own.value).sum::<f64>() / sum, sum.powf(-0.5)))
}
