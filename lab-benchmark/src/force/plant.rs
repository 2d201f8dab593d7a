//! The plant: how a joint moves, and what each hidden part of the force is from it.

use super::kind::{Draw, ForceKind};
use crate::generate::Random;
use core::f64::consts::TAU;

/// Force of one unit of a part.
pub(super) type Law = fn(&Moment, &Draw) -> f64;

/// A joint at one time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moment {
    pub time_s: f64,
    /// Part of the record that is over.
    pub part: f64,
    /// rad, rad/s, rad/s^2.
    pub angle: f64,
    pub speed: f64,
    pub acceleration: f64,
    /// Root mean square of the speed over the record, rad/s.
    pub usual_speed: f64,
    /// What the gear carries, Nm.
    pub load: f64,
}

impl Moment {
    /// 1 forth, -1 back.
    pub(super) fn way(&self) -> f64 {
        if self.speed > 0.0 { 1.0 } else { -1.0 }
    }
}

/// A motion of so many rows: four sines, or one whose frequency rises and falls.
pub(super) fn motion(random: &mut Random, n: usize, period_s: f64, sweeps: bool) -> Vec<Moment> {
    let mut all = if sweeps { sweep(random, n, period_s) } else { sines(random, n, period_s) };
    let usual_speed = (all.iter().map(|now| now.speed.powi(2)).sum::<f64>() / n as f64).sqrt();
    all.iter_mut().for_each(|now| now.usual_speed = usual_speed);
    all
}

fn sines(random: &mut Random, n: usize, period_s: f64) -> Vec<Moment> {
    let lines: Vec<[f64; 3]> = [0.13, 0.31, 0.53, 0.97]
        .map(|hz| {
            let w = TAU * hz * random.between(0.8, 1.25);
            [random.between(0.5, 1.0) * 0.25 / hz.sqrt(), w, random.between(0.0, TAU)]
        })
        .to_vec();
    (0..n)
        .map(|k| {
            let time_s = k as f64 * period_s;
            let mut now = Moment { time_s, part: k as f64 / n as f64, ..Moment::default() };
            for [size, w, phase] in &lines {
                let (sine, cosine) = (w * time_s + phase).sin_cos();
                now.angle += size * sine;
                now.speed += size * w * cosine;
                now.acceleration -= size * w * w * sine;
            }
            now
        })
        .collect()
}

/// Phase w t + (a / v) sin(v t), so that the frequency goes between w - a and w + a; the middle wanders as well.
fn sweep(random: &mut Random, n: usize, period_s: f64) -> Vec<Moment> {
    let [w, slow] = [random.between(0.35, 0.5), random.between(0.03, 0.05)].map(|hz| TAU * hz);
    let (a, size, start) = (w * random.between(0.5, 0.75), random.between(0.5, 0.9), random.between(0.0, TAU));
    let (middle, wander) = (random.between(0.2, 0.5), TAU * random.between(0.015, 0.03));
    (0..n)
        .map(|k| {
            let time_s = k as f64 * period_s;
            let (sine, cosine) = (w * time_s + a / slow * (slow * time_s).sin() + start).sin_cos();
            let (rate, turn) = (w + a * (slow * time_s).cos(), -a * slow * (slow * time_s).sin());
            let (own_sine, own_cosine) = (wander * time_s).sin_cos();
            Moment {
                time_s,
                part: k as f64 / n as f64,
                angle: size * sine + middle * own_sine,
                speed: size * rate * cosine + middle * wander * own_cosine,
                acceleration: size * (turn * cosine - rate * rate * sine) - middle * wander * wander * own_sine,
                ..Moment::default()
            }
        })
        .collect()
}

/// One unit of a part over a motion.
pub(super) fn column(kind: &ForceKind, draw: &Draw, motion: &[Moment]) -> Vec<f64> {
    motion.iter().map(|now| (kind.law)(now, draw)).collect()
}

/// Root mean square of what a column has beyond a constant and these others.
pub(super) fn beyond(column: &[f64], others: &[Vec<f64>]) -> f64 {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for other in core::iter::once(&vec![1.0; column.len()]).chain(others) {
        let left = without(other, &basis);
        let length = dot(&left, &left).sqrt();
        if length > 1e-9 * dot(other, other).sqrt() {
            basis.push(left.iter().map(|x| x / length).collect());
        }
    }
    let left = without(column, &basis);
    (dot(&left, &left) / column.len() as f64).sqrt()
}

fn without(column: &[f64], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut left = column.to_vec();
    for own in basis {
        let part = dot(&left, own);
        left.iter_mut().zip(own).for_each(|(x, b)| *x -= part * b);
    }
    left
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::Purpose;

    #[test]
    fn speed_and_acceleration_are_the_angle_s_derivatives() {
        for sweeps in [false, true] {
            let all = motion(&mut Random::new(3, Purpose::Motion), 5000, 1e-3, sweeps);
            for trio in all.windows(3) {
                let speed = (trio[2].angle - trio[0].angle) / 2e-3;
                let acceleration = (trio[2].speed - trio[0].speed) / 2e-3;
                assert!((speed - trio[1].speed).abs() < 1e-4 * trio[1].usual_speed, "{sweeps}");
                assert!((acceleration - trio[1].acceleration).abs() < 1e-3, "{sweeps}");
            }
        }
    }

    #[test]
    fn what_others_make_is_not_beyond_them() {
        let columns = [0, 1, 2].map(|k| (0..400).map(|i| f64::from(i * (k + 1)).sin()).collect::<Vec<f64>>());
        let sum: Vec<f64> = (0..400).map(|i| 2.0 * columns[0][i] - columns[1][i] + 3.0).collect();
        assert!(beyond(&sum, &columns[..2]) < 1e-9);
        assert!((beyond(&columns[2], &columns[..2]) - 0.5_f64.sqrt()).abs() < 0.02);
    }
}
