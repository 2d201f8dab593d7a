//! Where the hysteresis of a model begins in each trial: no file can know it, so that it is fitted, as a gain that nobody measured is.
//!
//! What a play remembers is gone once the joint has been to both ends of its range. So only the rows up to there are asked, for
//! every effect and joint by itself: five places first, then ever smaller steps around the best.

use super::signal::Number;
use crate::diagnose::Calibration;
use crate::machine::{FreeJoints, JointsLab, MachineUnderTest};
use crate::noise::bounds;
use crate::{LabError, Measurements, Term};
use std::collections::BTreeMap;

/// Effects whose memory may begin anywhere within a play.
const WITH_START: [&str; 4] = ["backlash", "bouc-wen", "prandtl-ishlinskii", "generalised-prandtl-ishlinskii"];
/// Travel of a joint, in ranges of it, after which nothing is left of where it began.
const FORGOTTEN: f64 = 2.5;
/// Places that are tried first, and steps around the best.
const PLACES: [f64; 5] = [0.0, -1.0, -0.5, 0.5, 1.0];
const STEPS: [f64; 3] = [0.25, 0.125, 0.0625];
/// Turns of a search over several effects of one joint.
const TURNS: usize = 2;

/// Where hysteresis begins: by place in the list of effects and joint, from 0, and number of the trial; -1 to 1 of its play.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Starts(BTreeMap<(usize, usize, u32), f64>);

impl Starts {
    /// Those of one trial: effect, joint, and where it begins.
    pub fn of_trial(&self, trial: u32) -> impl Iterator<Item = (usize, usize, f64)> {
        let own = self.0.iter().filter(move |((.., own), _)| *own == trial);
        own.map(|(&(effect, joint, _), &start)| (effect, joint, start))
    }

    /// Sets one.
    pub fn set(&mut self, effect: usize, joint: usize, trial: u32, start: f64) {
        self.0.insert((effect, joint, trial), start);
    }

    fn get(&self, effect: usize, joint: usize, trial: u32) -> f64 {
        self.0.get(&(effect, joint, trial)).copied().unwrap_or(0.0)
    }
}

/// The joints with the starts that suit the data best, for a list of effects that begins with the model's own, and a calibration.
///
/// # Errors
/// [`LabError::Chain`] where the effects make no chain.
pub(crate) fn with_starts(
    joints: &JointsLab,
    terms: &[Term],
    data: &Measurements,
    calibration: &[Calibration],
    recordings: &[(String, usize)],
) -> Result<JointsLab, LabError> {
    if !has_starts(terms, data.n_inputs) {
        return Ok(joints.clone());
    }
    let slots = slots(terms, data.n_inputs);
    let data = data.select(&until_forgotten(data));
    let search = Search { joints, terms, data: &data, calibration, recordings };
    let mut best = joints.starts().clone();
    let mut here = search.sums(&best)?;
    let deepest = slots.iter().map(Vec::len).max().unwrap_or(0);
    let turns = if deepest > 1 { TURNS } else { 1 };
    for level in (0..turns * deepest).map(|k| k % deepest) {
        let steps = STEPS.into_iter().flat_map(|step| [(step, true), (-step, true)]);
        let (mut centre, mut last_step) = (best.clone(), f64::INFINITY);
        for (value, is_step) in PLACES.map(|place| (place, false)).into_iter().chain(steps) {
            // Both steps of a size start from the same place.
            if is_step && value.abs() < last_step {
                (centre, last_step) = (best.clone(), value.abs());
            }
            let mut other = best.clone();
            for &(joint, trial) in here.keys() {
                let Some(&effect) = slots[joint].get(level) else { continue };
                let from = if is_step { centre.get(effect, joint, trial) } else { 0.0 };
                other.set(effect, joint, trial, (from + value).clamp(-1.0, 1.0));
            }
            let there = search.sums(&other)?;
            let places: Vec<(usize, u32)> = here.keys().copied().collect();
            for (joint, trial) in places {
                let (Some(&effect), Some(new)) = (slots[joint].get(level), there.get(&(joint, trial))) else {
                    continue;
                };
                let old = here.insert((joint, trial), *new);
                let (Some(old), after) = (old, search.left(&here, joint, trial)) else { continue };
                here.insert((joint, trial), old);
                if after < search.left(&here, joint, trial) {
                    here.insert((joint, trial), *new);
                    best.set(effect, joint, trial, other.get(effect, joint, trial));
                }
            }
        }
    }
    Ok(joints.with_starts(best))
}

/// The joints with starts, and what else a fit of these effects begins with: the calibration that goes with them.
///
/// # Errors
/// As [`with_starts`].
pub(crate) fn settled(
    joints: &JointsLab,
    data: &Measurements,
    recordings: &[(String, usize)],
) -> Result<(JointsLab, Vec<Calibration>), LabError> {
    let mut joints = joints.clone();
    let mut calibration = super::numbers::calibration(&joints, data, recordings)?;
    if has_starts(joints.effects(), data.n_inputs) {
        // A start that is wrong draws the gain, and the gain the start.
        for _ in 0..TURNS {
            joints = with_starts(&joints, joints.effects(), data, &calibration, recordings)?;
            calibration = super::numbers::calibration(&joints, data, recordings)?;
        }
    }
    Ok((joints, calibration))
}

/// Whether a list has hysteresis that may begin anywhere.
pub(crate) fn has_starts(terms: &[Term], n_joints: usize) -> bool {
    slots(terms, n_joints).iter().any(|own| !own.is_empty())
}

/// Places in the list of the effects that may begin anywhere, joint by joint.
fn slots(terms: &[Term], n_joints: usize) -> Vec<Vec<usize>> {
    let acts_on = |term: &Term, joint: usize| {
        let own = term.values.first().map_or(0, |own| own.round() as usize);
        own == 0 || own == joint + 1
    };
    let of = |joint: usize| {
        let own = terms.iter().enumerate().filter(|(_, term)| WITH_START.contains(&term.name.as_str()));
        own.filter(|(_, term)| acts_on(term, joint)).map(|(place, _)| place).collect()
    };
    (0..n_joints).map(of).collect()
}

/// Rows of each trial until every joint that moves has been to and fro.
fn until_forgotten(data: &Measurements) -> Vec<usize> {
    let n = data.n_inputs;
    let ranges: Vec<f64> = (0..n)
        .map(|k| bounds(data.inputs.iter().skip(k).step_by(n).copied()))
        .map(|(low, high)| (high - low).max(0.0))
        .collect();
    let mut travelled = vec![0.0; n];
    let mut rows = Vec::new();
    for row in 0..data.n_rows() {
        if data.starts_trial(row) {
            travelled.fill(0.0);
        } else {
            let change = data.input(row).iter().zip(data.input(row - 1)).map(|(now, before)| (now - before).abs());
            travelled.iter_mut().zip(change).for_each(|(sum, change)| *sum += change);
        }
        if travelled.iter().zip(&ranges).any(|(own, range)| *own < FORGOTTEN * range) {
            rows.push(row);
        }
    }
    rows
}

struct Search<'a> {
    joints: &'a JointsLab,
    terms: &'a [Term],
    data: &'a Measurements,
    calibration: &'a [Calibration],
    recordings: &'a [(String, usize)],
}

impl Search<'_> {
    /// What a straight line through predictions and measurements is made of, by joint and trial.
    fn sums(&self, starts: &Starts) -> Result<BTreeMap<(usize, u32), Sums>, LabError> {
        let joints = self.joints.with_starts(starts.clone());
        let machine = FreeJoints::new(&joints, self.data, self.calibration, self.recordings);
        let own = machine.effects().last().cloned();
        let effects: Vec<Term> = self.terms.iter().cloned().chain(own).collect();
        let predicted = machine.predict(&effects, self.data)?;
        let mut sums = BTreeMap::new();
        for (row, trial) in self.data.trial.iter().enumerate() {
            for (joint, &y) in self.data.output(row).iter().enumerate().filter(|(_, y)| y.is_finite()) {
                let x = predicted[row * self.data.n_outputs + joint];
                let own: &mut Sums = sums.entry((joint, *trial)).or_default();
                let new = [1.0, x, y, x * x, x * y, y * y];
                own.iter_mut().zip(new).for_each(|(sum, new)| *sum += new);
            }
        }
        Ok(sums)
    }

    /// Squared errors of a joint in all trials of a recording, with gain and offset solved for where the model leaves them open: a start
    /// that is judged with the gain of another one looks worse than it is.
    fn left(&self, sums: &BTreeMap<(usize, u32), Sums>, joint: usize, trial: u32) -> f64 {
        let recording = |trial: u32| self.recordings.partition_point(|(_, first)| *first <= trial as usize);
        let own = sums.iter().filter(|((k, other), _)| *k == joint && recording(*other) == recording(trial));
        let mut all = Sums::default();
        own.for_each(|(_, sums)| all.iter_mut().zip(sums).for_each(|(sum, new)| *sum += new));
        let [n, x, y, xx, xy, yy] = all;
        let is_held = |number: Number| matches!(number, Number::Held(_));
        match (is_held(self.joints.gain_known(joint)), is_held(self.joints.offset_known(joint))) {
            (true, true) => xx - 2.0 * xy + yy,
            (true, false) => xx - 2.0 * xy + yy - (y - x).powi(2) / n.max(1.0),
            (false, true) => yy - xy * xy / xx.max(f64::MIN_POSITIVE),
            (false, false) => {
                let (sxx, sxy, syy) = (xx - x * x / n, xy - x * y / n, yy - y * y / n);
                if sxx > 0.0 { syy - sxy * sxy / sxx } else { syy }
            }
        }
    }
}

/// Rows, and sums of predictions x, measurements y, x x, x y and y y.
type Sums = [f64; 6];
