//! Joints whose gains and offsets stand in the list of effects too, so that one fit finds them together with the effects' values.

use super::geometry::{GEOMETRY, is_geometry};
use super::{Candidate, JointsLab, MachineUnderTest, OpenNumber, nearest};
use crate::diagnose::Calibration;
use crate::joint::{Number, Together};
use crate::noise::bounds;
use crate::{LabError, Measurements, Parameter, Term};

/// Joints with what is free of them in the list of effects: one entry behind the model's own, which holds gain and offset of each joint
/// in each recording.
pub(crate) struct FreeJoints<'a> {
    joints: &'a JointsLab,
    effects: Vec<Term>,
    open: Vec<OpenNumber>,
    /// First trial of each recording.
    first_trials: Vec<u32>,
    /// What counts as a large change of a gain and of an offset.
    sizes: [f64; 2],
}

/// Numbers of one joint in one recording: gain and offset.
const NUMBERS: usize = 2;

/// Gains and offsets that are freed by name, `machine.gain1`, or `machine.gain` for every joint, and the names that are left.
///
/// # Errors
/// [`LabError::UnknownParameter`] for another number of the machine.
pub(crate) fn freed(joints: &JointsLab, free: &[(String, String)]) -> Result<Freed, LabError> {
    let n = joints.joints().n;
    let mut own = Freed { joints: joints.clone(), numbers: Vec::new(), others: Vec::new() };
    let known: Vec<(String, bool, usize)> = [false, true]
        .into_iter()
        .flat_map(|is_offset| (1..=n).map(move |joint| (joint_number(is_offset, joint), is_offset, joint)))
        .collect();
    for (effect, name) in free {
        if effect != GEOMETRY {
            own.others.push((effect.clone(), name.clone()));
            continue;
        }
        let is_meant = |number: &&(String, bool, usize)| {
            number.0 == *name || *name == joint_number(number.1, 0).trim_end_matches('0')
        };
        let mut meant = known.iter().filter(is_meant).peekable();
        if meant.peek().is_none() {
            return Err(LabError::UnknownParameter {
                effect: GEOMETRY.to_owned(),
                name: name.clone(),
                nearest: nearest(name, known.iter().map(|(name, ..)| name.as_str())),
            });
        }
        for (_, is_offset, joint) in meant {
            own.joints = own.joints.with_free(*is_offset, joint - 1);
            own.numbers.push((*is_offset, *joint));
        }
    }
    Ok(own)
}

/// Joints some of whose gains and offsets are freed.
pub(crate) struct Freed {
    /// The joints.
    pub joints: JointsLab,
    /// Whether it is an offset, and the joint, from 1, of each that was named.
    pub numbers: Vec<(bool, usize)>,
    /// Effect's label and parameter's name of what is no number of the machine.
    pub others: Vec<(String, String)>,
}

/// What a joint's gain or offset is called where it is freed: `gain1`, `offset2`.
pub(crate) fn joint_number(is_offset: bool, joint: usize) -> String {
    format!("{}{joint}", if is_offset { "offset" } else { "gain" })
}

impl<'a> FreeJoints<'a> {
    /// The joints with the gains and offsets that a fit found, which name joint and recording in this order.
    pub fn new(
        joints: &'a JointsLab,
        data: &Measurements,
        calibration: &[Calibration],
        recordings: &[(String, usize)],
    ) -> Self {
        let (_, scale) = joints.error_unit();
        let n = joints.joints().n;
        let mut first_trials: Vec<u32> = recordings.iter().map(|(_, first)| *first as u32).collect();
        if first_trials.is_empty() {
            first_trials.push(0);
        }
        let place = joints.effects().len();
        let mut values = vec![0.0; NUMBERS * n * first_trials.len()];
        let mut open = joints.open_numbers();
        for joint in 0..n {
            let known = [("gain", joints.gain_known(joint), 1.0), ("offset", joints.offset_known(joint), scale)];
            for (which, (name, number, scale)) in known.into_iter().enumerate() {
                let found = calibration.iter().filter(|own| own.name == name && own.joint == Some(joint + 1));
                for (recording, found) in found.take(first_trials.len()).enumerate() {
                    let parameter = NUMBERS * (recording * n + joint) + which;
                    values[parameter] = found.value / scale;
                    let prior = match number {
                        Number::Held(_) => continue,
                        Number::Free => None,
                        Number::Near(value, se) => Some((value, se)),
                    };
                    open.push(OpenNumber { effect: place, parameter, prior, from: None });
                }
            }
        }
        let range = |values: &[f64]| {
            let (low, high) = bounds(values.iter().copied().filter(|value| value.is_finite()));
            if high > low { high - low } else { 1.0 }
        };
        let (u, y) = (range(&data.inputs), range(&data.outputs));
        let mut effects = joints.effects().to_vec();
        effects.push(Term::new(GEOMETRY, values));
        Self { joints, effects, open, first_trials, sizes: [y / u, y] }
    }

    /// What a fit found, with gains and offsets as calibration and no longer in the list.
    pub fn without_machine(&self, mut found: Together) -> Together {
        let (_, scale) = self.joints.error_unit();
        let (place, n) = (self.joints.effects().len(), self.joints.joints().n);
        for (variable, se) in found.variables.iter().zip(&found.uncertainty.robust).filter(|(v, _)| v.effect == place) {
            let (of_joint, which) = (variable.parameter / NUMBERS, variable.parameter % NUMBERS);
            let (name, scale) = if which == 0 { ("gain", 1.0) } else { ("offset", scale) };
            let own =
                found.calibration.iter_mut().filter(|own| own.name == name && own.joint == Some(of_joint % n + 1));
            if let Some(own) = own.into_iter().nth(of_joint / n) {
                (own.value, own.se) = (scale * variable.value(&found.terms), scale * se);
            }
        }
        let keep: Vec<bool> = found.variables.iter().map(|variable| variable.effect != place).collect();
        let kept = |values: &[f64]| values.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(v, _)| *v).collect();
        found.uncertainty.robust = kept(&found.uncertainty.robust);
        found.uncertainty.naive = kept(&found.uncertainty.naive);
        found.variables.retain(|variable| variable.effect != place);
        for variable in found.variables.iter_mut().filter(|variable| variable.effect > place) {
            variable.effect -= 1;
        }
        found.terms.remove(place);
        found
    }
}

impl MachineUnderTest for FreeJoints<'_> {
    fn kind(&self) -> &'static str {
        self.joints.kind()
    }

    fn error_unit(&self) -> (&str, f64) {
        self.joints.error_unit()
    }

    fn input_unit(&self) -> &str {
        self.joints.input_unit()
    }

    fn effects(&self) -> &[Term] {
        &self.effects
    }

    fn parameters(&self, term: &Term) -> Result<Vec<Parameter>, LabError> {
        if !is_geometry(term) {
            return self.joints.parameters(term);
        }
        let own = |k: usize| {
            let (which, reach) = (k % NUMBERS, 1e3 * self.sizes[k % NUMBERS]);
            let name = joint_number(which == 1, k / NUMBERS + 1);
            Parameter { name, unit: String::new(), low: -reach, high: reach, default: 0.0 }
        };
        Ok((0..term.values.len()).map(own).collect())
    }

    fn open_numbers(&self) -> Vec<OpenNumber> {
        self.open.clone()
    }

    fn candidates(&self, data: &Measurements) -> Vec<Candidate> {
        self.joints.candidates(data)
    }

    fn predict(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError> {
        let Some(machine) = effects.iter().find(|term| is_geometry(term)) else {
            return self.joints.predict(effects, data);
        };
        let own: Vec<Term> = effects.iter().filter(|term| !is_geometry(term)).cloned().collect();
        let recording = |row: usize| self.first_trials.partition_point(|first| *first <= data.trial[row]).max(1) - 1;
        let of = |recording: usize, which: usize| -> Vec<f64> {
            let n = self.joints.joints().n;
            (0..n).map(|joint| machine.values[NUMBERS * (recording * n + joint) + which]).collect()
        };
        let calibrated = |recording: usize| self.joints.calibrated(&of(recording, 0), &of(recording, 1));
        if self.first_trials.len() == 1 {
            return calibrated(0).predict(&own, data);
        }
        let mut outputs = Vec::with_capacity(data.n_rows() * data.n_outputs);
        let mut first = 0;
        while first < data.n_rows() {
            let this = recording(first);
            let end = (first..data.n_rows()).find(|row| recording(*row) != this).unwrap_or(data.n_rows());
            let rows: Vec<usize> = (first..end).collect();
            outputs.extend(calibrated(this).predict(&own, &data.select(&rows))?);
            first = end;
        }
        Ok(outputs)
    }
}
