//! Encoders that begin anew after a turn: their readings made continuous.

/// Readings of one encoder, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turns {
    /// A turn, in the readings' unit.
    turn: f64,
    last: Option<f64>,
    n_turns: f64,
}

impl Turns {
    pub(crate) fn new(turn: f64) -> Self {
        Self { turn, last: None, n_turns: 0.0 }
    }

    /// The next reading, continuous with the one before: a step of more than half a turn went the other way round.
    pub(crate) fn next(&mut self, reading: f64) -> f64 {
        if let Some(last) = self.last {
            let step = (reading - last) / self.turn;
            self.n_turns -= if step.abs() > 0.5 { step.round() } else { 0.0 };
        }
        self.last = Some(reading);
        reading + self.n_turns * self.turn
    }

    /// Begins again: what comes next is continuous with nothing.
    pub(crate) fn restart(&mut self) {
        *self = Self::new(self.turn);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrapped_motion_comes_back_as_it_was() {
        let mut turns = Turns::new(360.0);
        for k in -400..400 {
            let angle = 3.0 * f64::from(k);
            let found = turns.next(angle.rem_euclid(360.0));
            // The first reading, -1200 degrees, stands for 240.
            assert!((found - angle - 1440.0).abs() < 1e-9, "{found} at {angle}");
        }
        turns.restart();
        assert_eq!(turns.next(1.0), 1.0);
    }
}
