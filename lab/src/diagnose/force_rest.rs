//! What remains of a force, in shapes of angle, direction, speed and time that name no physics; and which effects stand beside them.
//!
//! Problem: a part of the force that no effect makes is taken for one that is nearly like it: a cable that stiffens for weight, friction
//! that differs along the way for dry friction.
//! Intuition: an effect stands where it takes away much that these shapes cannot, on blocks that neither was fitted to.

use super::screen::{block_moments, orthonormal, remove};
use super::structure::{Group, GroupShare, Structure, held_out_share, of_groups};
use crate::fit::{Fit, dot};
use crate::noise::bounds;
use crate::read::column;
use crate::{LabError, Measurements, Problem};
use core::f64::consts::TAU;

/// An effect takes away at least this share of what the shapes and the other effects leave.
const BESIDE: f64 = 0.25;
/// A shape that takes away less of the rest is not put beside the effects, and no more than so many are.
const LEAST_SHARE: f64 = 0.1;
const MOST_SHAPES: usize = 3;
/// Shapes of friction that differs along the way, or changes with time.
const FRICTION: [&str; 2] = ["direction of motion", "direction of motion, and time"];
/// Dry friction is at least this part of the friction that it and these shapes make: every friction that differs has a mean.
const STEADY: f64 = 0.65;
const DRY: &str = "coulomb";
/// Powers of the angle, and of the angle where friction differs along the way.
const N_ANGLE: usize = 10;
const N_PLACES: usize = 5;
/// Slow waves have up to so many periods in a record, ...
const MOST_PERIODS: f64 = 12.0;
/// ... in steps of this part of one.
const STEP: f64 = 0.25;

/// Shapes of each joint, by what they depend on.
pub(super) fn groups(data: &Measurements) -> Vec<Group> {
    let mut groups: Vec<Group> =
        ["the pose", FRICTION[0], "speed", "time", FRICTION[1]].map(|name| Group { name, columns: Vec::new() }).into();
    for joint in 0..data.n_outputs {
        let of = |what: &str| {
            let name = column(what, joint);
            data.extra(&name).unwrap_or_else(|| unreachable!("measurements of kind force hold {name}"))
        };
        let (speed, direction) = (of("speed"), of("direction"));
        let angle = spread(data.inputs.iter().skip(joint).step_by(data.n_inputs).copied());
        let time = spread(data.time_s.iter().copied());
        let fastest = speed.iter().fold(f64::MIN_POSITIVE, |most, v| most.max(v.abs()));
        let sign = |row: usize| direction[row].signum();
        let mut add = |group: usize, value: &dyn Fn(usize) -> f64| {
            let mut own = vec![0.0; data.outputs.len()];
            (0..data.n_rows()).for_each(|row| own[row * data.n_outputs + joint] = value(row));
            groups[group].columns.push(own);
        };
        (1..=N_ANGLE).for_each(|k| add(0, &|row| chebyshev(k, angle[row])));
        // What is the same everywhere is dry friction.
        (1..=N_PLACES).for_each(|k| add(1, &|row| sign(row) * chebyshev(k, angle[row])));
        for power in 1..=3 {
            add(2, &|row| (speed[row] / fastest).powi(power));
        }
        add(2, &|row| (speed[row] / fastest).abs());
        add(3, &|row| time[row]);
        for quarter in [-0.5, 0.0, 0.5] {
            add(3, &|row| if time[row] >= quarter { 1.0 } else { 0.0 });
        }
        (1..4).for_each(|k| add(4, &|row| sign(row) * chebyshev(k, time[row])));
    }
    groups
}

/// A shape that what remains has.
enum Shape {
    /// All columns of the group of this name.
    Group(&'static str),
    /// A slow wave with so many periods in the record, for each joint.
    Wave(Vec<f64>),
}

/// Shapes that stand beside effects, the one that takes most first.
#[derive(Default)]
pub(super) struct Shapes(Vec<Shape>);

impl Shapes {
    /// The shapes of what a fit of `problem` leaves.
    pub(super) fn left_by(problem: &Problem, fit: &Fit, seed: u64) -> Self {
        let mut own = Self::default();
        while own.grow(problem, fit, seed) {}
        own
    }

    /// Takes up the shape that takes most of what a fit and these shapes leave; whether there is one.
    pub(super) fn grow(&mut self, problem: &Problem, fit: &Fit, seed: u64) -> bool {
        if self.0.len() == MOST_SHAPES {
            return false;
        }
        let basis = orthonormal(&[fit.slopes.as_slice(), &self.columns(problem)].concat());
        let mut left = fit.residual.clone();
        remove(&basis, &mut left);
        let rest = of_groups(problem, &left, &basis, groups(&problem.data), seed);
        let periods = slow_wave(problem, &left);
        let wave_share = share(problem, &waves(problem, &periods), &left);
        match rest.groups.first().filter(|group| group.share > LEAST_SHARE.max(wave_share)) {
            Some(group) => self.0.push(Shape::Group(group.name)),
            None if wave_share > LEAST_SHARE => self.0.push(Shape::Wave(periods)),
            None => return false,
        }
        true
    }

    /// Their columns with an offset, weighted as the problem's rows are.
    pub(super) fn columns(&self, problem: &Problem) -> Vec<Vec<f64>> {
        self.columns_of(problem, |_| true)
    }

    fn columns_of(&self, problem: &Problem, is_wanted: impl Fn(&Shape) -> bool) -> Vec<Vec<f64>> {
        let mut columns = vec![weighted(problem, vec![1.0; problem.data.outputs.len()])];
        for shape in self.0.iter().filter(|shape| is_wanted(shape)) {
            match shape {
                Shape::Group(name) => {
                    let own = groups(&problem.data).into_iter().filter(|own| own.name == *name);
                    columns.extend(own.flat_map(|own| own.columns).map(|own| weighted(problem, own)));
                }
                Shape::Wave(periods) => columns.extend(waves(problem, periods)),
            }
        }
        columns
    }
}

/// Which of the effects behind the model's own stand beside these shapes.
///
/// # Errors
/// [`LabError`] where effects make no chain.
pub(super) fn standing(problem: &Problem, fit: &Fit, n_own: usize, shapes: &Shapes) -> Result<Vec<bool>, LabError> {
    let every = shapes.columns(problem);
    let steady = shapes.columns_of(problem, |shape| !matches!(shape, Shape::Group(name) if FRICTION.contains(name)));
    (n_own..fit.effects.len())
        .map(|place| {
            let mut without = fit.effects.clone();
            without.remove(place);
            let target = problem.residual(&without)?;
            let slopes = |is_own: bool| {
                let own = fit.variables.iter().zip(&fit.slopes).filter(move |(v, _)| (v.effect == place) == is_own);
                own.map(|(_, slope)| slope.clone()).collect::<Vec<_>>()
            };
            // What is nearly the same as others would only spoil the inverse.
            let taken = |columns: &[&[Vec<f64>]]| share(problem, &orthonormal(&columns.concat()), &target);
            let (own, others) = (slopes(true), slopes(false));
            let [all, without] = [taken(&[&every, &others, &own]), taken(&[&every, &others])];
            let stands = all - without >= BESIDE * (1.0 - without);
            if !stands || fit.effects[place].name != DRY {
                return Ok(stands);
            }
            let [none, dry] = [taken(&[&steady, &others]), taken(&[&steady, &others, &own])];
            Ok(dry - none >= STEADY * (all - none))
        })
        .collect()
}

/// Puts first what the rest depends on most.
///
/// What depends on angle and speed has sums and differences of the motion's frequencies, so that a rhythm stands behind a shape that
/// takes more. A slow wave may be the sensor's wandering: it names a rest, and does not say that there is one.
pub(super) fn name_rest(problem: &Problem, residual: &[f64], is_structured: bool, rest: &mut Structure) {
    if is_structured {
        let share = share(problem, &waves(problem, &slow_wave(problem, residual)), residual);
        rest.groups.push(GroupShare { name: "time", share, p_value: rest.p_value });
    }
    rest.groups.sort_by(|a, b| b.share.total_cmp(&a.share));
}

/// How much of a residual columns take away on blocks that they were not fitted to.
fn share(problem: &Problem, columns: &[Vec<f64>], residual: &[f64]) -> f64 {
    held_out_share(problem, &block_moments(problem, columns, residual), residual)
}

/// How many periods in the record the wave has that takes most, for each joint.
fn slow_wave(problem: &Problem, residual: &[f64]) -> Vec<f64> {
    let power = |joint: usize, periods: f64| -> f64 {
        orthonormal(&wave(problem, joint, periods)).iter().map(|wave| dot(wave, residual).powi(2)).sum()
    };
    let best = |joint: usize| {
        let steps = (1..=(MOST_PERIODS / STEP) as usize).map(|k| STEP * (1 + k) as f64);
        let all = steps.map(|periods| (periods, power(joint, periods)));
        all.fold((0.0, f64::NEG_INFINITY), |best, own| if own.1 > best.1 { own } else { best }).0
    };
    (0..problem.data.n_outputs).map(best).collect()
}

/// Waves of so many periods in the record, for each joint.
fn waves(problem: &Problem, periods: &[f64]) -> Vec<Vec<f64>> {
    periods.iter().enumerate().flat_map(|(joint, &periods)| wave(problem, joint, periods)).collect()
}

/// Sine and cosine of the time, weighted.
fn wave(problem: &Problem, joint: usize, periods: f64) -> [Vec<f64>; 2] {
    let data = &problem.data;
    let (low, high) = bounds(data.time_s.iter().copied());
    let mut waves = [vec![0.0; data.outputs.len()], vec![0.0; data.outputs.len()]];
    for row in 0..data.n_rows() {
        let place = row * data.n_outputs + joint;
        let (sine, cosine) = (TAU * periods * (data.time_s[row] - low) / (high - low).max(1e-9)).sin_cos();
        (waves[0][place], waves[1][place]) = (sine * problem.weight[place], cosine * problem.weight[place]);
    }
    waves
}

fn weighted(problem: &Problem, mut column: Vec<f64>) -> Vec<f64> {
    column.iter_mut().zip(&problem.weight).for_each(|(x, w)| *x *= w);
    column
}

/// Values spread over -1 to 1.
fn spread(values: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let (low, high) = bounds(values.clone());
    values.map(|x| (2.0 * x - low - high) / (high - low).max(f64::MIN_POSITIVE)).collect()
}

/// Chebyshev's polynomial: no two of them are alike within -1 to 1.
fn chebyshev(k: usize, x: f64) -> f64 {
    (k as f64 * x.clamp(-1.0, 1.0).acos()).cos()
}
