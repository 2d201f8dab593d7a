//! A delay line of fixed size for the shape: what the camera showed is the shape of a moment ago.

use crate::effects::{Real, Scalar};

/// Samples kept. Those that come faster than a hundredth of the delay are thinned out, so that the whole delay fits.
const N_SAMPLES: usize = 128;
const N_PER_DELAY: f64 = 100.0;

/// Shapes of the last moments, of so many numbers each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DelayLine<P, const Y: usize = 2> {
    samples: [(f64, [P; Y]); N_SAMPLES],
    newest: usize,
    n: usize,
}

impl<P: Real, const Y: usize> DelayLine<P, Y> {
    pub(crate) fn new() -> Self {
        Self { samples: [(0.0, [P::constant(0.0); Y]); N_SAMPLES], newest: 0, n: 0 }
    }

    /// Takes the shape of now and gives the shape of `delay` ago, linear between samples; before the first one, the first one.
    pub(crate) fn pass<S: Scalar<P>>(&mut self, time_s: f64, shape: [S; Y], delay: P) -> [S; Y] {
        let then = S::constant(time_s) - S::lift(delay);
        let (mut after_s, mut after) = (time_s, shape);
        for back in 0..self.n {
            let (at_s, sample) = self.samples[(self.newest + N_SAMPLES - back) % N_SAMPLES];
            let sample = sample.map(S::lift);
            if at_s <= then.value() {
                if after_s <= at_s {
                    break;
                }
                let part = (then - S::constant(at_s)) * S::constant(1.0 / (after_s - at_s));
                for (after, sample) in after.iter_mut().zip(sample) {
                    *after = sample + (*after - sample) * part;
                }
                break;
            }
            (after_s, after) = (at_s, sample);
        }
        self.store(time_s, shape.map(S::settle), delay.value());
        after
    }

    /// The newest sample is always kept, and moves until it is far enough from the one before.
    fn store(&mut self, time_s: f64, shape: [P; Y], delay_s: f64) {
        let before = (self.newest + N_SAMPLES - 1) % N_SAMPLES;
        let thin = self.n >= 2 && time_s - self.samples[before].0 < delay_s / N_PER_DELAY;
        if !thin {
            self.newest = (self.newest + 1) % N_SAMPLES;
            self.n = (self.n + 1).min(N_SAMPLES);
        }
        self.samples[self.newest] = (time_s, shape);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_comes_out_later_at_any_rate_of_samples() {
        for rate_hz in [20.0, 1000.0, 20_000.0] {
            let mut line = DelayLine::<f64>::new();
            for k in 0..(2.0 * rate_hz) as u32 {
                let t = f64::from(k) / rate_hz;
                let seen = line.pass(t, [t, -2.0 * t], 0.05);
                let expected = (t - 0.05).max(0.0);
                assert!(
                    (seen[0] - expected).abs() < 1e-12 && (seen[1] + 2.0 * expected).abs() < 1e-12,
                    "{rate_hz} {t}"
                );
            }
        }
    }

    #[test]
    fn no_delay_is_no_change() {
        let mut line = DelayLine::<f64>::new();
        assert_eq!(line.pass(0.0, [1.0, 2.0], 0.0), [1.0, 2.0]);
        assert_eq!(line.pass(0.0, [3.0, 2.0], 0.0), [3.0, 2.0]);
        assert_eq!(line.pass(0.1, [4.0, 2.0], 0.0), [4.0, 2.0]);
    }
}
