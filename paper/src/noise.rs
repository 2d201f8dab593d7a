//! What a camera errs by, drawn anew for each run of a study: standard normal numbers from a seed.

use core::f64::consts::TAU;
use nalgebra::Vector2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of noise.
pub struct CameraNoise(ChaCha8Rng);

impl CameraNoise {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Two independent numbers with mean 0 and standard deviation 1 (Box-Muller).
    pub fn pair(&mut self) -> Vector2<f64> {
        // 1 - u is in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        Vector2::new(cos, sin) * radius
    }

    /// In [0, 1), with the 53 bits that a double can tell apart.
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
