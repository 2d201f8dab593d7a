//! The floor of one joint: what no model could explain, from visits to the same place with the same history, rests and differences.

use super::refine::Fit;
use super::signal::Signal;
use crate::Problem;
use crate::noise::{FloorSource, NO_MEMORY, NoiseFloor, at_floor, autocorrelation_time, relative_error};
use krait_model::joints::play;

/// A floor with how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Floor {
    /// Standard deviation of a row, in the outputs' unit; `None`: unknown.
    pub sigma: Option<f64>,
    /// Its relative standard error.
    pub relative_error: f64,
    /// Where it comes from.
    pub source: &'static str,
    /// What else was estimated.
    pub estimates: NoiseFloor,
    /// Whether the noise is white, as far as the data tell.
    pub is_white: bool,
}

/// Noise with a memory makes a floor from visits, rests or differences up to a fifth too low, whatever its rows say: with this four of
/// 188 simulated sets change their verdict, without it fifteen (docs/bench/2026-11-26-lab-joints.md).
const UNSEEN: f64 = 0.1;

impl Floor {
    /// Whether an error lies so far above the floor that it is not the measurement's own, whether or not a test sees what it depends on.
    pub fn is_far_below(&self, rms: f64) -> bool {
        let most = at_floor(self.relative_error.hypot(UNSEEN));
        !self.is_white && self.sigma.is_some_and(|sigma| rms > most * sigma)
    }
}

/// Pairs of visits are this far apart, as a part of the record, and this near in history, as a part of the range.
const APART: f64 = 0.05;
const NEAR: f64 = 0.01;
/// What another joint's place counts beside the joint's own.
const OF_OTHERS: f64 = 0.1;
const FEWEST_PAIRS: usize = 30;
const MOST_PAIRS: usize = 200_000;
/// Visits and differences disagree beyond this ratio: what does not repeat may be noise, or an effect that nobody has found.
const DISAGREE: f64 = 2.0;

/// The floor, from what a fit leaves.
pub(super) fn floor(signal: &Signal, problem: &Problem, fit: &Fit, held_out_rms: f64) -> Floor {
    let estimates = NoiseFloor::new(problem, &fit.solution.residual);
    let memory = autocorrelation_time(&fit.solution.residual, 1).max(1.0);
    let visits = on_visits(signal, fit);
    let n = signal.rows.len() as f64;
    let is_white = matches!(estimates.sigma(), Some((_, FloorSource::White))) && memory < 3.0;
    let of = |sigma: f64, n: f64, source| {
        // No floor lies above what a model reaches on data that it has not seen.
        let (sigma, source) =
            if sigma > held_out_rms { (held_out_rms, "the best held-out error") } else { (sigma, source) };
        (Some(sigma), relative_error(n), source)
    };
    let fast = estimates.differences;
    let (sigma, relative_error, source) = match (estimates.sigma(), visits) {
        (Some((sigma, FloorSource::White)), _) if is_white => of(sigma, n, "white: rests and differences agree"),
        (Some((sigma, _)), _) if memory < NO_MEMORY => of(sigma, n, "differences; what is left has no memory"),
        (_, Some((sigma, n_pairs))) if fast.is_none_or(|fast| sigma < DISAGREE * fast) => {
            of(sigma, (n_pairs as f64).min(n / memory), "visits to the same place with the same history")
        }
        (_, Some(_)) => (None, 0.0, "unknown: visits to the same place differ by far more than neighbouring rows"),
        (Some((sigma, FloorSource::Rest)), _) => of(sigma, n / memory, "slow noise, from rests"),
        _ => (None, 0.0, "the data do not tell"),
    };
    Floor { sigma, relative_error, source, estimates, is_white }
}

/// Half the mean square of differences between visits that agree in place and history; the place's slope taken out.
fn on_visits(signal: &Signal, fit: &Fit) -> Option<(f64, usize)> {
    let histories = histories(signal);
    let gains = &fit.solution.gains;
    let mut visits: Vec<(&[f64], usize)> = signal.rows.iter().map(|&row| (histories[row].as_slice(), row)).collect();
    visits.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.1.cmp(&b.1)));
    let apart_s = APART * signal.longest_s;
    let (mut sum, mut n_pairs) = (0.0, 0);
    for (i, (a, row)) in visits.iter().enumerate() {
        for (b, other) in visits[i + 1..].iter().take_while(|(b, _)| b[0] - a[0] < NEAR) {
            let square: f64 = a.iter().zip(*b).map(|(x, y)| (x - y).powi(2)).sum();
            let far = signal.trial[*row] != signal.trial[*other]
                || (signal.time_s[*row] - signal.time_s[*other]).abs() > apart_s;
            let (first, second) = (signal.recording(*row), signal.recording(*other));
            if square > NEAR * NEAR || !far || first != second {
                continue;
            }
            let slope = gains[first] * signal.range * (b[0] - a[0]);
            sum += 0.5 * (signal.measured[*other] - signal.measured[*row] - slope).powi(2);
            n_pairs += 1;
        }
        if n_pairs > MOST_PAIRS {
            break;
        }
    }
    (n_pairs >= FEWEST_PAIRS).then(|| ((sum / n_pairs as f64).sqrt(), n_pairs))
}

/// Place, two plays and a lag of every row, as parts of the range, and place and play of each other joint, which count less: rows that
/// agree in them have the same history.
fn histories(signal: &Signal) -> Vec<Vec<f64>> {
    let own = &signal.inputs[signal.joint];
    let mut state = [0.0; 3];
    let lag_s = 10.0 * signal.typical_step_s;
    let others: Vec<(&Vec<f64>, f64)> = (0..signal.inputs.len())
        .filter(|k| *k != signal.joint)
        .map(|k| (&signal.inputs[k], signal.range_of(k)))
        .collect();
    let mut plays = vec![0.0; others.len()];
    let of = |(row, &u): (usize, &f64)| {
        if signal.fresh[row] {
            state = [u; 3];
        }
        state[0] = play(state[0], u, 0.05 * signal.range);
        state[1] = play(state[1], u, 0.2 * signal.range);
        state[2] += (u - state[2]) * (1.0 - (-signal.step_s[row] / lag_s).exp());
        let part = |x: f64| (x - u) / signal.range;
        let mut history = vec![u / signal.range, part(state[0]), part(state[1]), part(state[2])];
        for ((other, range), behind) in others.iter().zip(&mut plays) {
            let u = other[row];
            *behind = if signal.fresh[row] { u } else { play(*behind, u, 0.05 * range) };
            history.extend([OF_OTHERS * u / range, OF_OTHERS * (*behind - u) / range]);
        }
        history
    };
    own.iter().enumerate().map(of).collect()
}
