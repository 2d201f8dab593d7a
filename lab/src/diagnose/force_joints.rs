//! A force of several joints, joint by joint: each has weight and friction of its own, and a small motor's force is lost beside a large
//! one's where all are weighed alike.
//!
//! Columns come first, of all joints together: a torque may be another joint's.

use super::answer::{CandidateAnswer, Diagnosis, FoundEffect, Remaining, Verdict};
use super::experiment::{next, separate_force};
use super::force_columns;
use super::verdict::by_one_clock;
use super::whole::DiagnoseOptions;
use super::words::sentence;
use crate::free::free_variables;
use crate::machine::{ForceLab, MachineUnderTest, OneJoint};
use crate::offered::on_joint;
use crate::prepare::prepare;
use crate::read::of_joint;
use crate::{LabError, Measurements, Term};

/// A joint and what was found of it.
struct Joint {
    /// Its number, from 0.
    number: usize,
    places: Vec<usize>,
    found: Diagnosis,
}

/// The diagnosis of a machine of kind force.
///
/// # Errors
/// As [`by_one_clock`].
pub(super) fn by_joints(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    let n = data.n_outputs;
    let apart = |lab: &ForceLab| (0..n).map(|joint| lab.of_joint(joint, &options.free)).collect::<Option<Vec<_>>>();
    let Some(apart) = machine.as_force().filter(|_| n > 1).and_then(apart) else {
        return by_one_clock(machine, data, options);
    };
    let free = free_variables(machine, data, &options.free)?;
    if force_columns::check(&prepare(machine, data)?.problem, &free)?.is_some() {
        return by_one_clock(machine, data, options);
    }
    let mut joints = Vec::with_capacity(n);
    for (number, OneJoint { lab, places, free }) in apart.into_iter().enumerate() {
        let options = DiagnoseOptions { free, ..options.clone() };
        let found = by_one_clock(&lab, &of_joint(data, number), &options)?;
        joints.push(Joint { number, places, found });
    }
    Ok(together(machine, data, joints))
}

impl Joint {
    /// Whether its effects are asserted.
    fn stands(&self) -> bool {
        matches!(self.found.verdict, Verdict::Missing | Verdict::Partly)
    }

    /// The error that its part of the answer leaves.
    fn after(&self) -> f64 {
        let is_left = matches!(self.found.verdict, Verdict::Unknown | Verdict::TooShort);
        if is_left { self.found.base_heldout_rms } else { self.found.final_heldout_rms }
    }

    /// Effects of it as those of a machine of several joints.
    fn own<'a>(&'a self, effects: &'a [FoundEffect]) -> impl Iterator<Item = FoundEffect> + 'a {
        effects.iter().map(|own| FoundEffect { joint: Some(self.number + 1), ..own.clone() })
    }

    /// The terms of its effects, with the fitted values.
    fn terms(&self, n_joints: usize) -> impl Iterator<Item = Term> + '_ {
        self.found.terms.iter().skip(self.places.len()).filter(|_| self.stands()).map(move |term| {
            let formula = term.formula.as_ref().map(|text| on_joint(text, n_joints, self.number));
            Term { formula, ..term.clone() }
        })
    }
}

/// Root of the sum of squares: the length of all joints' errors.
fn length(of_joints: impl Iterator<Item = f64>) -> f64 {
    of_joints.map(|own| own * own).sum::<f64>().sqrt()
}

/// The answer of all joints.
fn together(machine: &dyn MachineUnderTest, data: &Measurements, joints: Vec<Joint>) -> Diagnosis {
    let n = joints.len();
    let verdicts: Vec<Verdict> = joints.iter().map(|own| own.found.verdict).collect();
    let verdict = Verdict::together(&verdicts);
    let gained = |own: &FoundEffect| own.before.powi(2) - own.after.powi(2);
    let of_all = |part: fn(&Diagnosis) -> &[FoundEffect]| {
        let mut all: Vec<FoundEffect> = joints.iter().flat_map(|own| own.own(part(&own.found))).collect();
        all.sort_by(|a, b| gained(b).total_cmp(&gained(a)));
        all
    };
    let (effects, partial) = (of_all(|own| &own.effects), of_all(|own| &own.partial));
    let before = length(joints.iter().map(|own| own.found.base_heldout_rms));
    let after = length(joints.iter().map(Joint::after));
    let floors: Option<Vec<f64>> = joints.iter().map(|own| own.found.noise_floor).collect();
    let noise_floor = floors.map(|own| length(own.into_iter()));
    let explained_share = noise_floor.filter(|_| !effects.is_empty()).and_then(|floor| {
        let above = before * before - floor * floor;
        (above > 0.0).then(|| ((before * before - after * after) / above).clamp(0.0, 1.0))
    });
    let unexplained = explained_share.map_or_else(|| (after / before).powi(2).min(1.0), |share| 1.0 - share);
    let is_left = |own: &&Joint| own.found.remaining.structured;
    let most = |a: &&Joint, b: &&Joint| a.after().total_cmp(&b.after());
    let worst = joints.iter().filter(is_left).max_by(most).or_else(|| joints.iter().max_by(most));
    let Some(worst) = worst.map(|own| own.found.clone()) else { unreachable!("a machine of several joints") };
    let remaining = Remaining { unexplained, ..worst.remaining.clone() };
    let separating = || effects.iter().find_map(|own| separate_force(&own.class, own.joint));
    let next_experiment = next(verdict, separating, remaining.looks_like);
    let (unit, _) = machine.error_unit();
    let place = |own: &FoundEffect| own.joint.map_or(String::new(), |joint| format!(" on {}", data.names.joint(joint)));
    let said = match verdict {
        Verdict::TooShort => worst.sentence.clone(),
        _ => sentence(verdict, &effects, place, &remaining, after, noise_floor, unit),
    };
    let rows = |k: usize| joints.iter().map(move |own| own.found.rows[k]);
    Diagnosis {
        verdict,
        sentence: said,
        needed_s: joints.iter().filter_map(|own| own.found.needed_s).reduce(f64::max),
        cautions: cautions(data, &joints),
        noise_floor,
        as_given_rms: length(joints.iter().map(|own| own.found.as_given_rms)),
        base_heldout_rms: before,
        final_heldout_rms: after,
        explained_share,
        calibration: joints
            .iter()
            .flat_map(|own| own.found.calibration.iter().cloned().map(|number| (own.number, number)))
            .map(|(joint, number)| crate::diagnose::Calibration { joint: Some(joint + 1), ..number })
            .collect(),
        candidates: candidates(&joints, &effects, before),
        effects,
        partial,
        remaining,
        next_experiment,
        terms: terms(machine, &joints, n),
        rows: [data.n_rows(), rows(1).min().unwrap_or(0), rows(2).sum(), rows(3).min().unwrap_or(0)],
        ..worst
    }
}

/// The machine's own effects with what was found of them, and the missing ones of all joints.
fn terms(machine: &dyn MachineUnderTest, joints: &[Joint], n: usize) -> Vec<Term> {
    let mut terms = machine.effects().to_vec();
    for own in joints {
        // What a fit may find of the machine's own is one joint's alone.
        for (&place, term) in own.places.iter().zip(&own.found.terms) {
            if term.values.first().is_some_and(|joint| *joint == (own.number + 1) as f64) && term.formula.is_none() {
                terms[place] = term.clone();
            }
        }
    }
    terms.extend(joints.iter().flat_map(|own| own.terms(n)));
    terms
}

/// What is said of all joints once, of some with the joint before it.
fn cautions(data: &Measurements, joints: &[Joint]) -> Vec<String> {
    let mut said: Vec<String> = Vec::new();
    for own in joints {
        for caution in &own.found.cautions {
            let is_of_all = joints.iter().all(|other| other.found.cautions.contains(caution));
            let words = match is_of_all {
                true => caution.clone(),
                false => format!("{}: {caution}", data.names.joint(own.number + 1)),
            };
            if !said.contains(&words) {
                said.push(words);
            }
        }
    }
    said
}

/// Every candidate by the joint where it helps most: the error of all joints with it there alone.
fn candidates(joints: &[Joint], effects: &[FoundEffect], before: f64) -> Vec<CandidateAnswer> {
    let mut all: Vec<CandidateAnswer> = Vec::new();
    for joint in joints {
        for own in &joint.found.candidates {
            let of_all =
                |rms: f64| (before.powi(2) - joint.found.base_heldout_rms.powi(2) + rms.powi(2)).max(0.0).sqrt();
            let chosen = effects.iter().position(|effect| effect.name == own.name);
            let state = chosen.map_or_else(|| own.state.clone(), |n| format!("chosen, number {}", n + 1));
            all.push(CandidateAnswer { heldout_rms: own.heldout_rms.map(of_all), state, ..own.clone() });
        }
    }
    CandidateAnswer::best_of_each(all)
}
