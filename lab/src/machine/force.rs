//! Joints whose torque or current follows from their motion: inertia, gravity and the ladder of servo friction models.

use super::{Candidate, MachineUnderTest, OpenNumber, snake};
use crate::called::{called, meant};
use crate::diagnose::screen::{orthonormal, remove};
use crate::fit::dot;
use crate::read::{self, ReadError, column, filter_s};
use crate::{LabError, Measurements, Parameter, Term};
use krait_model::ChainError;
use krait_model::effects::{AtForce, EffectKind, ForceEffect, ForceFormula, MAX_PARAMETERS};
use krait_model::model_file::{ForceMachine, ModelFile};

/// A machine of kind force with its model.
#[derive(Clone, Debug)]
pub struct ForceLab {
    machine: ForceMachine,
    effects: Vec<Term>,
    /// What of them a fit finds, or is drawn to.
    open: Vec<OpenNumber>,
    /// Its number, from 0, where this is one joint of several by itself.
    only: Option<usize>,
}

impl ForceLab {
    /// The machine of a model file; `None` if it is of another kind.
    pub fn new(file: &ModelFile) -> Option<Self> {
        let krait_model::model_file::Machine::Force(machine) = file.machine() else { return None };
        let effects = file.effects().iter().map(|effect| snake::term(effect.setting())).collect();
        Some(Self { machine: machine.clone(), effects, open: snake::open_values(file), only: None })
    }

    /// A joint, from 0, by itself, with the places that its effects have here; `None` where a number that a fit may find is of more than
    /// this joint. `free`: what the user frees.
    pub(crate) fn of_joint(&self, joint: usize, free: &[(String, String)]) -> Option<OneJoint> {
        let is_of_more = |own: &Term| own.formula.is_some() || joint_of(own) == 0;
        let is_of = |own: &Term| is_of_more(own) || joint_of(own) == joint + 1;
        let places: Vec<usize> = (0..self.effects.len()).filter(|place| is_of(&self.effects[*place])).collect();
        let effects: Vec<Term> = places.iter().map(|place| self.effects[*place].clone()).collect();
        let names = called(self.kind(), &effects);
        let mut own_free = Vec::new();
        for (effect, parameter) in free {
            let meant = meant(self.kind(), &self.effects, effect);
            if meant.is_empty() || meant.iter().any(|place| is_of_more(&self.effects[*place])) {
                return None;
            }
            let here = places.iter().zip(&names).filter(|(place, _)| meant.contains(place));
            own_free.extend(here.map(|(_, name)| (name.clone(), parameter.clone())));
        }
        if self.open.iter().any(|own| is_of_more(&self.effects[own.effect])) {
            return None;
        }
        let open = self.open.iter().filter_map(|own| {
            let effect = places.iter().position(|place| *place == own.effect)?;
            Some(OpenNumber { effect, ..own.clone() })
        });
        let lab = Self {
            machine: ForceMachine { n: 1, ..self.machine.clone() },
            effects,
            open: open.collect(),
            only: Some(joint),
        };
        Some(OneJoint { lab, places, free: own_free })
    }

    /// Measurements as they were recorded, filtered as those of a file are; load in columns `load1_nm`.
    ///
    /// # Errors
    /// [`ReadError::TooLittle`]: a joint does not move, or its force does not change.
    pub fn filtered(&self, data: Measurements) -> Result<Measurements, ReadError> {
        read::filtered(data, &self.machine)
    }

    fn unit(&self, unit: &str) -> String {
        let own = self.machine.unit.word();
        match unit {
            "y" => own.to_owned(),
            "1/y" => format!("1/{own}"),
            other => other.strip_prefix("y ").map_or_else(|| other.to_owned(), |rest| format!("{own} {rest}")),
        }
    }

    /// Force of every row for these effects, without the sensor's offset.
    fn bare(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError> {
        let n = data.n_outputs;
        let laws = effects.iter().map(Law::of).collect::<Result<Vec<_>, _>>()?;
        let mut forces = vec![0.0; n * data.n_rows()];
        for joint in 0..n {
            let motion = Motion::of(data, joint)?;
            // A formula is of every joint: it can name one itself.
            let number = self.only.unwrap_or(joint);
            let is_own = |term: &Term| term.formula.is_some() || joint_of(term) == 0 || joint_of(term) == number + 1;
            let all = effects.iter().zip(&laws);
            let terms: Vec<(&Term, &Law)> = all.filter(|(term, _)| is_own(term)).collect();
            for row in 0..data.n_rows() {
                let now = motion.at(row);
                let gravity: f64 = terms
                    .iter()
                    .map(|(term, law)| match law {
                        Law::Known(ForceEffect::Gravity) => now.force(ForceEffect::Gravity, &term.values, 0.0),
                        _ => 0.0,
                    })
                    .sum();
                let load = now.load.unwrap_or(gravity);
                let part = |(term, law): &(&Term, &Law)| match law {
                    Law::Known(kind) => now.force(*kind, &term.values, load),
                    // Not finite counts as zero, as in a chain.
                    Law::Own(own, parameters) => {
                        own.value(&now.seen(load, number, data.time_s[row]), parameters).unwrap_or(0.0)
                    }
                };
                forces[row * n + joint] = terms.iter().map(part).sum();
            }
        }
        Ok(forces)
    }
}

/// A joint of a machine by itself.
pub(crate) struct OneJoint {
    pub lab: ForceLab,
    /// Where its effects stand in the machine.
    pub places: Vec<usize>,
    /// What the user frees of them.
    pub free: Vec<(String, String)>,
}

/// The joint of a known effect, from 1; 0 for all.
fn joint_of(term: &Term) -> usize {
    term.values.first().copied().map_or(0, |joint| joint.round() as usize)
}

/// What a term says: an effect of the library, or the user's formula with its numbers.
enum Law {
    Known(ForceEffect),
    Own(Box<ForceFormula>, [f64; MAX_PARAMETERS]),
}

impl Law {
    fn of(term: &Term) -> Result<Self, LabError> {
        let Some(text) = &term.formula else { return effect(&term.name).map(Self::Known) };
        let own = ForceFormula::new(text).map_err(ChainError::from)?;
        let mut parameters = [0.0; MAX_PARAMETERS];
        parameters.iter_mut().zip(&term.values).for_each(|(own, value)| *own = *value);
        Ok(Self::Own(Box::new(own), parameters))
    }
}

/// A joint's columns.
struct Motion<'a> {
    data: &'a Measurements,
    joint: usize,
    speed: &'a [f64],
    acceleration: &'a [f64],
    direction: &'a [f64],
    load: Option<&'a [f64]>,
    /// Standard deviation of the filter in time, s.
    filter_s: f64,
}

/// A joint in one row.
struct Now {
    angle: f64,
    speed: f64,
    acceleration: f64,
    direction: f64,
    load: Option<f64>,
    /// How far angle and speed spread within the filter, rad and rad/s.
    angle_spread: f64,
    speed_spread: f64,
}

impl<'a> Motion<'a> {
    fn of(data: &'a Measurements, joint: usize) -> Result<Self, LabError> {
        let find = |what: &str| data.extra(&column(what, joint));
        let (Some(speed), Some(acceleration), Some(direction), Some(filter_s)) =
            (find("speed"), find("acceleration"), find("direction"), filter_s(data))
        else {
            return Err(LabError::OtherMachine {
                data: data.source.clone(),
                expected: "force",
                found: "joints or snake",
            });
        };
        Ok(Self { data, joint, speed, acceleration, direction, load: find("load"), filter_s })
    }

    fn at(&self, row: usize) -> Now {
        Now {
            angle: self.data.input(row)[self.joint],
            speed: self.speed[row],
            acceleration: self.acceleration[row],
            direction: self.direction[row].signum(),
            load: self.load.map(|load| load[row]),
            angle_spread: self.speed[row].abs() * self.filter_s,
            speed_spread: self.acceleration[row].abs() * self.filter_s,
        }
    }
}

impl Now {
    /// As a formula sees it.
    fn seen(&self, load: f64, joint: usize, time_s: f64) -> AtForce {
        AtForce {
            angle_rad: self.angle,
            speed_rad_per_s: self.speed,
            acceleration_rad_per_s2: self.acceleration,
            motion: self.direction,
            load,
            joint,
            time_s,
        }
    }

    /// An effect's part; values as its definition has them, the joint first.
    ///
    /// The recorded force passed the filter, so what is not linear passes it too: within a Gaussian filter angle and speed run nearly
    /// straight, and the mean of each law over such a stretch has a closed form.
    fn force(&self, kind: ForceEffect, values: &[f64], load: f64) -> f64 {
        let value = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
        let falls = || {
            let width = value(2).powi(2) + 2.0 * self.speed_spread.powi(2);
            (value(2).powi(2) / width).sqrt() * (-self.speed.powi(2) / width).exp()
        };
        match kind {
            ForceEffect::Inertia => value(1) * self.acceleration,
            ForceEffect::Gravity => {
                (value(1) * self.angle.sin() + value(2) * self.angle.cos()) * (-0.5 * self.angle_spread.powi(2)).exp()
            }
            ForceEffect::Coulomb => value(1) * self.direction,
            ForceEffect::Viscous => value(1) * self.speed,
            ForceEffect::Stribeck => value(1) * self.direction * falls(),
            ForceEffect::LoadCoulomb => value(1) * load.abs() * self.direction,
            ForceEffect::LoadStribeck => value(1) * load.abs() * self.direction * falls(),
            ForceEffect::QuadraticLoad => value(1) * load * load * self.direction,
            ForceEffect::DirectionViscous => value(1) * self.speed.abs(),
            ForceEffect::QuadraticViscous => {
                value(1) * self.speed.signum() * (self.speed.powi(2) + self.speed_spread.powi(2))
            }
        }
    }
}

impl MachineUnderTest for ForceLab {
    fn kind(&self) -> &'static str {
        "force"
    }

    fn as_force(&self) -> Option<&ForceLab> {
        Some(self)
    }

    fn error_unit(&self) -> (&str, f64) {
        (self.machine.unit.word(), 1.0)
    }

    fn input_unit(&self) -> &str {
        "rad"
    }

    fn effects(&self) -> &[Term] {
        &self.effects
    }

    fn parameters(&self, term: &Term) -> Result<Vec<Parameter>, LabError> {
        if let Some(own) = snake::formula_parameters(term) {
            return Ok(own);
        }
        let own = kind(&term.name)?.definition().parameters.iter().map(snake::own_parameter);
        let last = self.only.map_or(self.machine.n, |number| number + 1) as f64;
        let high = |own: &Parameter| if own.name == "joint" { last } else { own.high };
        let with_unit = |own: Parameter| Parameter { unit: self.unit(&own.unit), high: high(&own), ..own };
        Ok(own.map(with_unit).collect())
    }

    fn open_numbers(&self) -> Vec<OpenNumber> {
        self.open.clone()
    }

    fn candidates(&self, data: &Measurements) -> Vec<Candidate> {
        let joints: Vec<f64> = match self.only {
            Some(number) => vec![(number + 1) as f64],
            None if data.n_outputs == 1 => vec![0.0],
            None => (1..=data.n_outputs).map(|joint| joint as f64).collect(),
        };
        ForceEffect::ALL.into_iter().map(|effect| candidate(effect, data, &joints)).collect()
    }

    /// The sensor's offset is solved for in each trial: the mean of what is left over the rows that were measured.
    fn predict(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError> {
        let mut forces = self.bare(effects, data)?;
        let n = data.n_outputs;
        let starts: Vec<usize> = (0..data.n_rows()).filter(|row| data.starts_trial(*row)).collect();
        for (k, &start) in starts.iter().enumerate() {
            let end = starts.get(k + 1).copied().unwrap_or(data.n_rows());
            for joint in 0..n {
                let places = || (start..end).map(|row| row * n + joint);
                let left = places().map(|at| data.outputs[at] - forces[at]).filter(|left| left.is_finite());
                let (sum, count) = left.fold((0.0, 0.0), |(sum, count), left| (sum + left, count + 1.0));
                if count > 0.0 {
                    places().for_each(|at| forces[at] += sum / count);
                }
            }
        }
        Ok(forces)
    }
}

/// Where to look for an effect; `joints`: the numbers of those that may have it.
fn candidate(effect: ForceEffect, data: &Measurements, joints: &[f64]) -> Candidate {
    let definition = effect.definition();
    let neutral: Vec<f64> = definition.parameters.iter().map(|p| p.default).collect();
    let n_amplitudes = if effect == ForceEffect::Gravity { 2 } else { 1 };
    let size = 0.1 * crate::noise::bounds(data.outputs.iter().copied().filter(|y| y.is_finite())).1.abs().max(1e-6);
    let falls = neutral.len() > 1 + n_amplitudes;
    let highest = falls.then(|| FALLEN * fast(data));
    let velocities = match highest {
        Some(highest) => [1.0, 0.3, 0.1, 0.03].map(|part| part * highest).to_vec(),
        None => vec![1.0],
    };
    let mut starts = Vec::new();
    for &joint in joints {
        for velocity in &velocities {
            let mut start = neutral.clone();
            start[0] = joint;
            start[1..=n_amplitudes].fill(if definition.parameters[1].unit == "1" { 0.1 } else { size });
            if falls {
                start[1 + n_amplitudes] = *velocity;
            }
            starts.push(start);
        }
    }
    Candidate {
        name: definition.name,
        class: definition.class.label(),
        cannot: cannot(effect, data),
        free: (1..neutral.len()).collect(),
        amplitudes: (1..=n_amplitudes).collect(),
        one_sided: n_amplitudes == 1 && definition.parameters[1].low == 0.0,
        neutral,
        starts,
        highest: highest.map(|highest| (1 + n_amplitudes, highest)),
        periodic: None,
        formula: None,
    }
}

/// A friction that falls with speed must have fallen, to e^-4, at a speed that the motion reaches: one that falls at higher speeds
/// only is dry friction with a drag that is not quite linear.
const FALLEN: f64 = 0.5;

/// Speed that a twentieth of the scored rows pass, of the fastest joint, rad/s.
fn fast(data: &Measurements) -> f64 {
    let of_joint = |joint: usize| {
        let motion = Motion::of(data, joint).ok()?;
        let scored = (0..data.n_rows()).filter(|row| data.is_scored(*row));
        let mut speeds: Vec<f64> = scored.map(|row| motion.speed[row].abs()).collect();
        speeds.sort_by(f64::total_cmp);
        speeds.get(speeds.len() * 19 / 20).copied()
    };
    (0..data.n_outputs).filter_map(of_joint).fold(1e-3, f64::max)
}

/// Part of an effect's column that no other one of the plain joint makes; below it the motion does not show the effect.
const LEAST_SHARE: f64 = 0.01;

/// Why this motion cannot show an effect.
fn cannot(effect: ForceEffect, data: &Measurements) -> Option<String> {
    let of_load = matches!(effect, ForceEffect::LoadCoulomb | ForceEffect::LoadStribeck | ForceEffect::QuadraticLoad);
    let plain = [ForceEffect::Inertia, ForceEffect::Gravity, ForceEffect::Coulomb, ForceEffect::Viscous];
    if !of_load && !plain.contains(&effect) {
        return None;
    }
    let shows = (0..data.n_outputs).any(|joint| {
        let Ok(motion) = Motion::of(data, joint) else { return false };
        let rows: Vec<usize> = (0..data.n_rows()).filter(|row| data.is_scored(*row)).collect();
        let column = |kind: ForceEffect, values: [f64; 3]| -> Vec<f64> {
            rows.iter().map(|row| motion.at(*row).force(kind, &values, 1.0)).collect()
        };
        let unit = [0.0, 1.0, 0.0];
        let weights = [column(ForceEffect::Gravity, unit), column(ForceEffect::Gravity, [0.0, 0.0, 1.0])];
        let others: Vec<Vec<f64>> = plain
            .into_iter()
            .filter(|kind| *kind != effect && *kind != ForceEffect::Gravity)
            .map(|kind| column(kind, unit))
            .collect();
        if of_load {
            // Without a recorded load it is the weight that loads the gear.
            let is_weighed = weights.iter().any(|own| orthogonal_share(own, &others) > LEAST_SHARE);
            return motion.load.is_some() || is_weighed;
        }
        if effect == ForceEffect::Gravity {
            return weights.iter().any(|own| orthogonal_share(own, &others) > LEAST_SHARE);
        }
        let all: Vec<Vec<f64>> = others.into_iter().chain(weights).collect();
        orthogonal_share(&column(effect, unit), &all) > LEAST_SHARE
    });
    (!shows).then(|| "is not observable in this motion".to_owned())
}

/// Part of a column's sum of squares that no others make, nor a constant.
fn orthogonal_share(column: &[f64], others: &[Vec<f64>]) -> f64 {
    let constant = vec![1.0; column.len()];
    let basis = orthonormal(&[&[constant], others].concat());
    let mut own = column.to_vec();
    remove(&basis[..basis.len().min(1)], &mut own);
    let whole = dot(&own, &own);
    // A column that hardly changes is the sensor's offset.
    if whole <= 1e-4 * dot(column, column) {
        return 0.0;
    }
    remove(&basis, &mut own);
    dot(&own, &own) / whole
}

fn effect(name: &str) -> Result<ForceEffect, LabError> {
    ForceEffect::from_name(name).ok_or_else(|| LabError::UnknownEffect {
        name: name.to_owned(),
        machine: "force",
        nearest: super::nearest(name, ForceEffect::ALL.iter().map(|effect| effect.name())),
    })
}

/// The effect that a name stands for.
pub(super) fn kind(name: &str) -> Result<EffectKind, LabError> {
    effect(name).map(EffectKind::Force)
}
