//! The sign of motion of three lines, with memory: it advances with travel, never with time.
//!
//! Each sign is a stop operator: s <- clamp(s + 2 dx / w, -1, 1) for a travel dx, so that a reversal carries it from one end to
//! the other over the travel w. It does not change at rest, cannot chatter, never jumps, and depends on the sequence of
//! positions only. Where the start is not known, the lowest and the highest possible sign are both carried along; they
//! meet, exactly, once the line has travelled w in one direction.

use nalgebra::Vector3;

/// Signs of motion of three lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignMemory {
    position_m: Vector3<f64>,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl SignMemory {
    /// Starts at a position (m) with known signs, each clamped to -1..=1.
    pub fn known(position_m: Vector3<f64>, signs: Vector3<f64>) -> Self {
        let signs = signs.map(|s| s.clamp(-1.0, 1.0));
        Self { position_m, low: signs, high: signs }
    }

    /// Starts at a position (m) without knowing where the lines came from.
    pub fn unknown(position_m: Vector3<f64>) -> Self {
        Self { position_m, low: Vector3::repeat(-1.0), high: Vector3::repeat(1.0) }
    }

    /// Moves to a position (m); `reversal_travel_m` is the travel that turns each sign around, m, at least a nanometre.
    ///
    /// A position that is not finite is ignored.
    pub fn advance(&mut self, position_m: Vector3<f64>, reversal_travel_m: Vector3<f64>) {
        for i in 0..3 {
            let step = 2.0 * (position_m[i] - self.position_m[i]) / reversal_travel_m[i].max(1e-9);
            if step.is_finite() {
                self.low[i] = (self.low[i] + step).clamp(-1.0, 1.0);
                self.high[i] = (self.high[i] + step).clamp(-1.0, 1.0);
                self.position_m[i] = position_m[i];
            }
        }
    }

    /// The signs, each in -1..=1: the middle of what is possible. An end is only reported once an unknown start is forgotten.
    pub fn signs(&self) -> Vector3<f64> {
        (self.low + self.high) * 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRAVEL_M: f64 = 20e-6;

    fn moved(memory: &mut SignMemory, x_m: f64) -> f64 {
        memory.advance(Vector3::repeat(x_m), Vector3::repeat(TRAVEL_M));
        memory.signs().x
    }

    #[test]
    fn sign_turns_over_the_travel_and_not_beyond() {
        let mut memory = SignMemory::known(Vector3::zeros(), Vector3::repeat(1.0));
        assert_eq!(moved(&mut memory, 1e-3), 1.0);
        assert!((moved(&mut memory, 1e-3 - 10e-6) - 0.0).abs() < 1e-9);
        assert_eq!(moved(&mut memory, 1e-3 - 25e-6), -1.0);
    }

    #[test]
    fn sign_does_not_change_at_rest_and_does_not_depend_on_the_number_of_steps() {
        let mut coarse = SignMemory::known(Vector3::zeros(), Vector3::zeros());
        let mut fine = coarse;
        moved(&mut coarse, 5e-6);
        for k in 1..=1000 {
            moved(&mut fine, 5e-9 * f64::from(k));
        }
        assert!((coarse.signs() - fine.signs()).norm() < 1e-9);
        let before = fine;
        moved(&mut fine, 5e-6);
        assert_eq!(fine, before);
    }

    #[test]
    fn an_unknown_start_is_forgotten_after_one_travel_in_one_direction() {
        let mut memory = SignMemory::unknown(Vector3::zeros());
        moved(&mut memory, 19e-6);
        assert!(memory.signs().x < 1.0, "the line may have come from the other side");
        moved(&mut memory, 21e-6);
        assert_eq!(memory.signs().x, 1.0);
    }

    #[test]
    fn a_position_that_is_not_finite_leaves_the_memory_as_it_was() {
        let mut memory = SignMemory::known(Vector3::zeros(), Vector3::repeat(0.5));
        let before = memory;
        memory.advance(Vector3::repeat(f64::NAN), Vector3::repeat(TRAVEL_M));
        memory.advance(Vector3::repeat(f64::INFINITY), Vector3::repeat(TRAVEL_M));
        assert_eq!(memory, before);
    }
}
