//! What encoders read of where the actuators are: zero, scale, the screws' periodic error, and back; and one that sticks.

use crate::hidden::EncodersTruth;
use core::f64::consts::TAU;

/// Rounds of the inverse of the screws' error; each gains a factor of at least 1.6 and with usual screws 16.
const ROUNDS: usize = 60;

/// Readings of places and places of readings.
#[derive(Clone, Debug)]
pub(crate) struct Encoders {
    truth: EncodersTruth,
    is_neutral: bool,
    /// What an encoder that sticks reads from then on, m.
    stuck_m: [Option<f64>; 3],
}

impl Encoders {
    pub(crate) fn new(truth: &EncodersTruth) -> Self {
        let neutral = EncodersTruth { zero_m: [0.0; 3], scale: [0.0; 3], screw_m: 0.0, ..truth.clone() };
        Self { truth: truth.clone(), is_neutral: *truth == neutral, stuck_m: [None; 3] }
    }

    /// Reads them: one that has come to where it sticks reads that ever after.
    pub(crate) fn read_m(&mut self, place_m: [f64; 3]) -> [f64; 3] {
        let mut reading_m = self.reading_m(place_m);
        for (i, reading_m) in reading_m.iter_mut().enumerate() {
            let sticks_at_m = self.truth.sticks_at_m[i];
            if sticks_at_m > 0.0 && reading_m.abs() >= sticks_at_m {
                self.stuck_m[i].get_or_insert(*reading_m);
            }
            *reading_m = self.stuck_m[i].unwrap_or(*reading_m);
        }
        reading_m
    }

    /// reading_i = (1 + k_i) (q_i + A sin(2 π q_i / p + φ_i)) + z_i.
    pub(crate) fn reading_m(&self, place_m: [f64; 3]) -> [f64; 3] {
        if self.is_neutral {
            return place_m;
        }
        core::array::from_fn(|i| {
            (1.0 + self.truth.scale[i]) * (place_m[i] + self.screw_m(i, place_m[i])) + self.truth.zero_m[i]
        })
    }

    /// Where the actuators stand for readings.
    pub(crate) fn place_m(&self, reading_m: [f64; 3]) -> [f64; 3] {
        if self.is_neutral {
            return reading_m;
        }
        core::array::from_fn(|i| {
            let moved = (reading_m[i] - self.truth.zero_m[i]) / (1.0 + self.truth.scale[i]);
            (0..ROUNDS).fold(moved, |place, _| moved - self.screw_m(i, place))
        })
    }

    fn screw_m(&self, i: usize, place_m: f64) -> f64 {
        self.truth.screw_m * (TAU * place_m / self.truth.screw_pitch_m + self.truth.screw_phase_rad[i]).sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_readings_are_the_places_that_were_read() {
        let encoders = Encoders::new(&EncodersTruth {
            zero_m: [1e-4, -5e-5, 0.0],
            scale: [0.02, -0.01, 0.0],
            screw_m: 5e-5,
            screw_pitch_m: 5e-4,
            screw_phase_rad: [0.0, 1.0, 2.0],
            ..EncodersTruth::default()
        });
        for k in -50..=50_i32 {
            let place = [f64::from(k) * 7e-5, f64::from(-k) * 3e-5, f64::from(k) * 1e-5];
            let back = encoders.place_m(encoders.reading_m(place));
            assert!(place.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-11), "{place:?} comes back as {back:?}");
        }
    }

    #[test]
    fn an_encoder_that_sticks_reads_on_where_it_stuck_and_the_others_do_not() {
        let mut encoders = Encoders::new(&EncodersTruth { sticks_at_m: [1e-3, 0.0, 0.0], ..EncodersTruth::default() });
        assert_eq!(encoders.read_m([9e-4, 9e-4, 0.0]), [9e-4, 9e-4, 0.0]);
        assert_eq!(encoders.read_m([1.1e-3, 2e-3, 0.0]), [1.1e-3, 2e-3, 0.0]);
        assert_eq!(encoders.read_m([-2e-3, 0.0, 3e-3]), [1.1e-3, 0.0, 3e-3]);
    }
}
