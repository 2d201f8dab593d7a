//! A rhythm in what is left that the motion does not have: breathing, a heart, a vibration. The noise floor cannot know it.
//!
//! A machine that rests on something that sways looks noisy at rest, so that the floor contains the sway and nothing seems to be
//! left. Noise, whatever its colour, has a smooth spectrum; a rhythm is a line in it: power at one frequency beside the median
//! of its neighbours, which for Gaussian noise is a Gamma variable. Frequencies of the motion do not count.

use crate::Problem;
use core::f64::consts::TAU;
use rayon::prelude::*;

/// A line in the spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rhythm {
    /// Its frequency, Hz.
    pub hz: f64,
    /// Share of the residual's variance.
    pub share: f64,
    /// Probability of such a line by chance, over all frequencies.
    pub p_value: f64,
}

/// Slowest and fastest rhythm, Hz: slower ones are drift, faster ones average out.
const BAND_HZ: [f64; 2] = [0.08, 2.5];
/// Length of a stretch that is transformed, and the most of them.
const STRETCH_S: f64 = 200.0;
const MOST_STRETCHES: usize = 8;
/// Neighbours are frequencies within this ratio.
const NEAR: f64 = 1.5;
/// A line of a smaller share matters to nobody.
const SMALLEST_SHARE: f64 = 0.05;
/// A frequency with more than this share of the inputs' variance is the motion's own.
const LARGEST_OF_MOTION: f64 = 0.01;
const LEVEL: f64 = 1e-4;

/// The strongest rhythm of a residual, if there is one that the inputs do not have.
pub(crate) fn rhythm(problem: &Problem, residual: &[f64]) -> Option<Rhythm> {
    let data = &problem.data;
    let stretches = stretches(problem);
    let seconds = stretches.iter().map(|&(first, end)| data.time_s[end - 1] - data.time_s[first]).fold(0.0, f64::max);
    if seconds * BAND_HZ[0] < 4.0 {
        return None;
    }
    let n = (2.0 * seconds * (BAND_HZ[1] - BAND_HZ[0])) as usize;
    let frequencies: Vec<f64> = (0..n).map(|k| BAND_HZ[0] + 0.5 * k as f64 / seconds).collect();
    let power = |values: &[f64], width: usize| -> Vec<f64> {
        let at = |f: &f64| stretches.iter().map(|&stretch| power(problem, values, width, stretch, *f)).sum();
        frequencies.par_iter().map(at).collect()
    };
    let left = power(residual, data.n_outputs);
    let terms = stretches.len() * data.n_outputs;
    let chance = |powers: &[f64], k: usize, terms: usize| {
        let near = |f: f64| f < frequencies[k] * NEAR && f > frequencies[k] / NEAR;
        let mut around: Vec<f64> = (0..n).filter(|&j| near(frequencies[j])).map(|j| powers[j]).collect();
        around.sort_by(f64::total_cmp);
        let middle = around.get(around.len() / 2).copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
        n as f64 * above(powers[k] / middle * median(terms), terms)
    };
    let best = (0..n).max_by(|&a, &b| left[a].total_cmp(&left[b]))?;
    let p_value = chance(&left, best, terms).min(1.0);
    let share = |power: f64, values: &[f64], width: usize| -> f64 {
        let all = |&(first, end): &(usize, usize)| {
            let column = |k: usize| values[first * width..end * width].iter().skip(k).step_by(width);
            let n = (end - first) as f64;
            let square = |k: usize| {
                let mean = column(k).sum::<f64>() / n;
                column(k).map(|v| (v - mean).powi(2)).sum::<f64>()
            };
            0.5 * n * (0..width).map(square).sum::<f64>()
        };
        power / stretches.iter().map(all).sum::<f64>().max(f64::MIN_POSITIVE)
    };
    let own = share(left[best], residual, data.n_outputs);
    let moves = || {
        let inputs = power(&data.inputs, data.n_inputs);
        share(inputs[best], &data.inputs, data.n_inputs) > LARGEST_OF_MOTION
    };
    (p_value < LEVEL && own > SMALLEST_SHARE && !moves()).then_some(Rhythm {
        hz: frequencies[best],
        share: own,
        p_value,
    })
}

/// First row and end of stretches within trials, the same number of rows each.
fn stretches(problem: &Problem) -> Vec<(usize, usize)> {
    let data = &problem.data;
    let mut found = Vec::new();
    let mut first = 0;
    for row in 1..=data.n_rows() {
        let ends = row == data.n_rows() || data.starts_trial(row);
        let is_long = data.time_s[row - 1] - data.time_s[first] >= STRETCH_S;
        if ends || is_long {
            found.push((first, row));
            first = row;
        }
    }
    let longest = found.iter().map(|(first, end)| end - first).max().unwrap_or(0);
    // Short rests of trials would have other frequencies.
    found.retain(|(first, end)| 10 * (end - first) >= 9 * longest);
    let stride = found.len().div_ceil(MOST_STRETCHES).max(1);
    found.into_iter().step_by(stride).collect()
}

/// |sum v e^(-2 pi i f t)|^2 summed over columns, each without its mean.
fn power(problem: &Problem, values: &[f64], width: usize, (first, end): (usize, usize), f: f64) -> f64 {
    let mut sums = vec![[0.0; 3]; width];
    let mut waves = [0.0; 2];
    for row in first..end {
        let (sine, cosine) = (TAU * f * (problem.data.time_s[row] - problem.data.time_s[first])).sin_cos();
        waves[0] += sine;
        waves[1] += cosine;
        for (sum, v) in sums.iter_mut().zip(&values[row * width..(row + 1) * width]) {
            sum[0] += v * sine;
            sum[1] += v * cosine;
            sum[2] += v;
        }
    }
    let n = (end - first) as f64;
    sums.iter().map(|s| (s[0] - s[2] * waves[0] / n).powi(2) + (s[1] - s[2] * waves[1] / n).powi(2)).sum()
}

/// Probability that a Gamma variable of whole shape and scale 1 is larger than x: e^-x sum x^k/k!.
fn above(x: f64, shape: usize) -> f64 {
    let mut term = (-x).exp();
    let mut sum = 0.0;
    for k in 0..shape {
        sum += term;
        term *= x / (k as f64 + 1.0);
    }
    sum
}

/// Its median, nearly.
fn median(shape: usize) -> f64 {
    let a = shape as f64;
    a * (1.0 - 1.0 / (9.0 * a)).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gamma_distribution_is_that_of_the_textbook() {
        for shape in [1, 2, 6] {
            assert!((above(median(shape), shape) - 0.5).abs() < 0.01, "{shape}");
        }
        assert!((above(3.0, 2) - 4.0 * (-3.0_f64).exp()).abs() < 1e-12);
    }
}
