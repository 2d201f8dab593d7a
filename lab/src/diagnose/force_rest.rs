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
/// Powers of the angle, and of the angle where friction differs along the way.
const N_ANGLE: usize = 10;
const N_PLACES: usize = 5;
/// Slow waves have up to so many periods in a record, ...
const MOST_PERIODS: f64 = 12.0;
/// ... in steps of this part of one.
const STEP: f64 = 0.25;

/// Shapes of each joint, by what they depend on.
pub(super) fn groups(data: &Measurements) -> Vec<Group> {
    let mut groups: Vec<Group> = ["the pose", "direction of motion", "speed", "time", "direction of motion, and time"]
        .map(|name| Group { name, columns: Vec::new() })
        .into();
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
        (0..N_PLACES).for_each(|k| add(1, &|row| sign(row) * chebyshev(k, angle[row])));
        for power in 1..=3 {
            add(2, &|row| (speed[row] / fastest).powi(power));
        }
        add(2, &|row| (speed[row] / fastest).abs());
        add(3, &|row| time[row]);
        for quarter in [-0.5, 0.0, 0.5] {
            add(3, &|row| if time[row] >= quarter { 1.0 } else { 0.0 });
        }
        (0..4).for_each(|k| add(4, &|row| sign(row) * chebyshev(k, time[row])));
    }
    groups
}

/// Which of the effects behind the model's own stand beside what remains. `fit` is of `problem`.
///
/// # Errors
/// [`LabError`] where effects make no chain.
pub(super) fn standing(problem: &Problem, fit: &Fit, n_own: usize, seed: u64) -> Result<Vec<bool>, LabError> {
    let mut shapes = vec![weighted(problem, vec![1.0; problem.data.outputs.len()])];
    let groups = groups(&problem.data);
    for _ in 0..MOST_SHAPES {
        let basis = orthonormal(&[fit.slopes.as_slice(), &shapes].concat());
        let mut left = fit.residual.clone();
        remove(&basis, &mut left);
        let rest = of_groups(problem, &left, &basis, groups.clone(), seed);
        let wave = slow_wave(problem, &left);
        let wave_share = share(problem, &wave, &left);
        match rest.groups.first().filter(|group| group.share > LEAST_SHARE.max(wave_share)) {
            Some(group) => {
                let own = groups.iter().filter(|own| own.name == group.name).flat_map(|own| &own.columns);
                shapes.extend(own.map(|own| weighted(problem, own.clone())));
            }
            None if wave_share > LEAST_SHARE => shapes.extend(wave),
            None => break,
        }
    }
    (n_own..fit.effects.len())
        .map(|place| {
            let mut without = fit.effects.clone();
            without.remove(place);
            let target = problem.residual(&without)?;
            let of = |is_own: bool| {
                fit.variables.iter().zip(&fit.slopes).filter(move |(v, _)| (v.effect == place) == is_own)
            };
            let others: Vec<Vec<f64>> =
                shapes.iter().cloned().chain(of(false).map(|(_, slope)| slope.clone())).collect();
            let all: Vec<Vec<f64>> = others.iter().cloned().chain(of(true).map(|(_, slope)| slope.clone())).collect();
            let left = |columns: &[Vec<f64>]| {
                // What is nearly the same as others would only spoil the inverse.
                1.0 - share(problem, &orthonormal(columns), &target)
            };
            Ok(1.0 - left(&all) / left(&others).max(f64::MIN_POSITIVE) >= BESIDE)
        })
        .collect()
}

/// Puts first what the rest depends on most.
///
/// What depends on angle and speed has sums and differences of the motion's frequencies, so that a rhythm stands behind a shape that
/// takes more. A slow wave may be the sensor's wandering: it names a rest, and does not say that there is one.
pub(super) fn name_rest(problem: &Problem, residual: &[f64], is_structured: bool, rest: &mut Structure) {
    if is_structured {
        let share = share(problem, &slow_wave(problem, residual), residual);
        rest.groups.push(GroupShare { name: "time", share, p_value: rest.p_value });
    }
    rest.groups.sort_by(|a, b| b.share.total_cmp(&a.share));
}

/// How much of a residual columns take away on blocks that they were not fitted to.
fn share(problem: &Problem, columns: &[Vec<f64>], residual: &[f64]) -> f64 {
    held_out_share(problem, &block_moments(problem, columns, residual), residual)
}

/// Sine and cosine of the time at the frequency that fits best, for each joint.
fn slow_wave(problem: &Problem, residual: &[f64]) -> Vec<Vec<f64>> {
    let data = &problem.data;
    let (low, high) = bounds(data.time_s.iter().copied());
    let n = data.n_outputs;
    let at = |periods: f64, joint: usize| -> Vec<Vec<f64>> {
        let mut waves = vec![vec![0.0; data.outputs.len()]; 2];
        for row in 0..data.n_rows() {
            let place = row * n + joint;
            let (sine, cosine) = (TAU * periods * (data.time_s[row] - low) / (high - low).max(1e-9)).sin_cos();
            (waves[0][place], waves[1][place]) = (sine * problem.weight[place], cosine * problem.weight[place]);
        }
        waves
    };
    let of = |joint: usize| {
        let power = |periods: f64| -> f64 {
            orthonormal(&at(periods, joint)).iter().map(|wave| dot(wave, residual).powi(2)).sum()
        };
        let steps = (1..=(MOST_PERIODS / STEP) as usize).map(|k| STEP * (1 + k) as f64);
        let best = steps.map(|periods| (periods, power(periods))).max_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(Vec::new(), |(periods, _)| at(periods, joint))
    };
    (0..n).flat_map(of).collect()
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
