//! Noise that is partly white and partly slow, and the filter that makes it white.
//!
//! Model: r_k = m_k + w_k, with m an AR(1) process, m_k = a m_{k-1} + ..., a = e^(-dt/T), of variance S, and w white of
//! variance W. A camera whose noise is coloured, and an error that the model never explained, are of this kind.
//!
//! Whitening is the Kalman filter of m: z = (r - m⁻) / sqrt(P⁻ + W), which holds for any distance in time.
//!
//! Fit: T from a grid, S by least squares on the covariances at several distances; nothing slow where these are not
//! larger than those of white noise would be by chance.

use super::learning::LAGS;

/// Correlation times that are tried, in samples.
const TIMES: [f64; 10] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0];
/// The slow part counts if the evidence for it is this many times its standard deviation under white noise; best of a grid.
const EVIDENCE: f64 = 3.5;
/// At least this part of the variance is white.
const LEAST_WHITE: f64 = 0.02;

/// Variances of the two parts, and the correlation time of the slow one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SlowNoise {
    pub(super) slow: f64,
    pub(super) white: f64,
    pub(super) time_s: f64,
}

impl SlowNoise {
    /// The noise with this variance and these covariances at [`LAGS`], estimated from this many pairs.
    pub(super) fn of(variance: f64, covariances: &[f64; LAGS.len()], n_pairs: f64, period_s: f64) -> Self {
        let white = Self { slow: 0.0, white: variance, time_s: period_s };
        let mut best = (0.0, white);
        for time in TIMES {
            let shape = LAGS.map(|lag| (-(lag as f64) / time).exp());
            let (mut cross, mut square) = (0.0, 0.0);
            for (covariance, expected) in covariances.iter().zip(shape) {
                cross += covariance * expected;
                square += expected * expected;
            }
            let evidence = cross / square.sqrt();
            if evidence > best.0 {
                let slow = (cross / square).min((1.0 - LEAST_WHITE) * variance);
                best = (evidence, Self { slow, white: variance - slow, time_s: time * period_s });
            }
        }
        if best.0 * n_pairs.sqrt() > EVIDENCE * variance { best.1 } else { white }
    }
}

/// Makes one component white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Whitener {
    noise: SlowNoise,
    mean: f64,
    variance: f64,
}

impl Whitener {
    pub(super) fn new(noise: SlowNoise) -> Self {
        Self { noise, mean: 0.0, variance: noise.slow }
    }

    /// The newest value, `dt_s` after the one before, without what was to be expected, in standard deviations.
    pub(super) fn whiten(&mut self, r: f64, dt_s: f64) -> f64 {
        let keep = (-dt_s / self.noise.time_s).exp();
        let mean = keep * self.mean;
        let variance = keep * keep * self.variance + (1.0 - keep * keep) * self.noise.slow;
        let total = variance + self.noise.white;
        let gain = variance / total;
        self.mean = mean + gain * (r - mean);
        self.variance = (1.0 - gain) * variance;
        (r - mean) / total.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_are_found_from_exact_covariances() {
        let (slow, white, time) = (0.5, 0.5, 32.0);
        let covariances = LAGS.map(|lag| slow * (-(lag as f64) / time).exp());
        let found = SlowNoise::of(slow + white, &covariances, 3600.0, 0.02);
        assert!((found.slow - slow).abs() < 1e-12 && (found.white - white).abs() < 1e-12, "{found:?}");
        assert!((found.time_s - time * 0.02).abs() < 1e-12);
    }

    #[test]
    fn covariances_within_chance_are_called_white() {
        let found = SlowNoise::of(2.0, &[0.02, -0.03, 0.01, 0.0, 0.02, -0.01, 0.02], 3600.0, 0.02);
        assert_eq!((found.slow, found.white), (0.0, 2.0));
    }

    #[test]
    fn without_a_slow_part_only_the_size_changes_and_a_long_pause_forgets() {
        let mut white = Whitener::new(SlowNoise { slow: 0.0, white: 4.0, time_s: 1.0 });
        assert_eq!([white.whiten(3.0, 0.1), white.whiten(-1.0, 0.1)], [1.5, -0.5]);
        let noise = SlowNoise { slow: 3.0, white: 1.0, time_s: 1.0 };
        let mut slow = Whitener::new(noise);
        let first = slow.whiten(2.0, 0.01);
        assert_eq!(first, 1.0);
        assert!(slow.whiten(2.0, 0.01) < 0.5, "the second one was to be expected");
        assert!((slow.whiten(2.0, 1e3) - 1.0).abs() < 1e-9);
    }
}
