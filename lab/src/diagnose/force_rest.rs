//! What remains of a force, in shapes of angle, direction, speed and time that name no physics.

use super::beside::{share, wave, waves};
use super::screen::orthonormal;
use super::structure::{Group, GroupShare, Structure};
use crate::fit::dot;
use crate::noise::bounds;
use crate::read::column;
use crate::{Measurements, Problem};

/// Shapes of friction that differs along the way, or changes with time.
pub(super) const FRICTION: [&str; 2] = ["direction of motion", "direction of motion, and time"];
/// Powers of the angle, and of the angle where friction differs along the way.
const N_ANGLE: usize = 10;
const N_PLACES: usize = 5;
/// Slow waves have up to so many periods in a record, ...
const MOST_PERIODS: f64 = 12.0;
/// ... in steps of this part of one.
const STEP: f64 = 0.25;

/// Shapes of each joint, by what they depend on; those of friction with what is the same everywhere and always, or without it: that is dry
/// friction.
pub(super) fn groups(data: &Measurements, with_steady: bool) -> Vec<Group> {
    let first = usize::from(!with_steady);
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
        (first..=N_PLACES).for_each(|k| add(1, &|row| sign(row) * chebyshev(k, angle[row])));
        for power in 1..=3 {
            add(2, &|row| (speed[row] / fastest).powi(power));
        }
        add(2, &|row| (speed[row] / fastest).abs());
        add(3, &|row| time[row]);
        for quarter in [-0.5, 0.0, 0.5] {
            add(3, &|row| if time[row] >= quarter { 1.0 } else { 0.0 });
        }
        (first..4).for_each(|k| add(4, &|row| sign(row) * chebyshev(k, time[row])));
    }
    groups
}

/// Puts first what the rest depends on most.
///
/// What depends on angle and speed has sums and differences of the motion's frequencies, so that a rhythm stands behind a shape that
/// takes more. A slow wave may be the sensor's wandering: it names a rest, and does not say that there is one.
pub(super) fn name_rest(problem: &Problem, residual: &[f64], is_structured: bool, rest: &mut Structure) {
    if is_structured {
        rest.groups.push(GroupShare { name: "time", share: slow_share(problem, residual), p_value: rest.p_value });
    }
    rest.groups.sort_by(|a, b| b.share.total_cmp(&a.share));
}

/// How much of a residual its best slow wave takes away.
pub(super) fn slow_share(problem: &Problem, residual: &[f64]) -> f64 {
    share(problem, &waves(problem, &slow_wave(problem, residual)), residual)
}

/// How many periods in the record the wave has that takes most, for each joint.
pub(super) fn slow_wave(problem: &Problem, residual: &[f64]) -> Vec<f64> {
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

/// Values spread over -1 to 1.
fn spread(values: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let (low, high) = bounds(values.clone());
    values.map(|x| (2.0 * x - low - high) / (high - low).max(f64::MIN_POSITIVE)).collect()
}

/// Chebyshev's polynomial: no two of them are alike within -1 to 1.
fn chebyshev(k: usize, x: f64) -> f64 {
    (k as f64 * x.clamp(-1.0, 1.0).acos()).cos()
}
