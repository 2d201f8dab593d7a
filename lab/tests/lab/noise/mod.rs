//! Noise that is the same in every run: uniform numbers of a linear congruence, twelve of which make a nearly normal one.

/// A sequence of numbers that follows from its seed.
pub struct Noise(pub u64);

impl Noise {
    /// Mean 0, standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (0..12).fold(-6.0, |sum, _| {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum + (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        })
    }
}
