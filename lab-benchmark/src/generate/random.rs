//! Random numbers that are the same everywhere for a seed, one stream for each purpose.

use core::f64::consts::TAU;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// What numbers are for: what is drawn for one purpose does not change what is drawn for another.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Purpose {
    /// Which effects.
    Kind = 1,
    /// Their signs, directions and times.
    Effect = 2,
    /// The motion.
    Motion = 3,
    /// The camera's noise.
    Noise = 4,
    /// Errors of the base parameters.
    Machine = 5,
    /// The load cells' noise.
    Loads = 6,
}

/// A stream of numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64, purpose: Purpose) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(purpose as u64);
        Self(generator)
    }

    /// In [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// In [low, high), as often between 1 and 2 as between 10 and 20.
    pub(crate) fn between_log(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// 1 or -1.
    pub(crate) fn sign(&mut self) -> f64 {
        if self.between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }
    }

    /// A whole number below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.between(0.0, n as f64) as usize).min(n.saturating_sub(1))
    }

    /// Mean 0, standard deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        // 1 - u is in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * (1.0 - self.between(0.0, 1.0)).ln()).sqrt();
        radius * (TAU * self.between(0.0, 1.0)).cos()
    }

    /// A direction among N without a common part: sum 0, largest component 1.
    pub(crate) fn direction<const N: usize>(&mut self) -> [f64; N] {
        let raw: [f64; N] = core::array::from_fn(|_| self.normal());
        let mean = raw.iter().sum::<f64>() / N as f64;
        let centred = raw.map(|x| x - mean);
        let largest = centred.iter().fold(1e-9_f64, |most, x| most.max(x.abs()));
        centred.map(|x| x / largest)
    }
}
