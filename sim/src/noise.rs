//! White Gaussian noise from a seed, the same on every run.

use core::f64::consts::TAU;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Standard normal numbers by the Box-Muller transform of a ChaCha stream.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    generator: ChaCha8Rng,
}

impl Noise {
    /// A source of its own for each `stream` of the same `seed`, so that how often one sensor is read does not change
    /// what another one sees.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { generator }
    }

    /// Two independent numbers with mean 0 and standard deviation 1.
    pub(crate) fn pair(&mut self) -> [f64; 2] {
        // 1 - u is in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        [radius * cos, radius * sin]
    }

    /// In [0, 1), with the 53 bits that a double can tell apart.
    fn uniform(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_mean_zero_and_unit_variance_and_its_axes_are_independent() {
        let mut noise = Noise::new(7, 1);
        let n = 100_000;
        let (mut sum, mut squares, mut products) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let [a, b] = noise.pair();
            sum += a + b;
            squares += a * a + b * b;
            products += a * b;
        }
        let n = f64::from(n);
        assert!((sum / (2.0 * n)).abs() < 0.01, "mean {}", sum / (2.0 * n));
        assert!((squares / (2.0 * n) - 1.0).abs() < 0.02, "variance {}", squares / (2.0 * n));
        assert!((products / n).abs() < 0.02, "covariance {}", products / n);
    }

    #[test]
    fn a_seed_gives_the_same_numbers_again_and_streams_differ() {
        let (mut a, mut b, mut c) = (Noise::new(7, 1), Noise::new(7, 1), Noise::new(7, 2));
        let first = a.pair();
        assert_eq!(first, b.pair());
        assert_ne!(first, c.pair());
    }
}
