//! The simulated snake on three cables under tension: what each pulls with, from where the actuators are. For drives that are
//! emulated, and for nothing that measures shapes.

use crate::plant::Plant;
use crate::truth::Truth;

/// How far each cable is pulled where the actuators are at zero, m; with the built-in truth that is a load of 8 N to 9 N.
const TENSION_M: f64 = 0.5e-3;
/// How much softer a cable is where it is pushed.
const PUSH_SOFTNESS: f64 = 1e4;

/// A snake whose lines pull and never push. It starts straight and under tension.
#[derive(Clone, Debug)]
pub struct CableSnake {
    plant: Plant,
    travel_m: f64,
}

impl CableSnake {
    /// The snake of a truth that has been checked ([`Truth::check`]), on cables in place of its tubes.
    pub fn new(mut truth: Truth) -> Self {
        truth.lines.push_softness = PUSH_SOFTNESS;
        let mut snake = Self { plant: Plant::new(&truth), travel_m: truth.drive.travel_m };
        snake.loads_n([0.0; 3]);
        snake
    }

    /// Moves the actuators to a place, m from zero, push positive, at most to the hard stops, and says what each cable's load is, N,
    /// push positive: negative under tension, nearly 0 where it is slack.
    pub fn loads_n(&mut self, q_tilde_m: [f64; 3]) -> [f64; 3] {
        self.plant.move_to(q_tilde_m.map(|q| q.clamp(-self.travel_m, self.travel_m) - TENSION_M), 0.0);
        self.plant.actuator_loads_n()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::EffectsTruth;

    #[test]
    fn a_cable_that_is_pulled_loads_itself_and_its_antagonists_and_one_that_is_pushed_goes_slack() {
        for (effects, antagonist_n) in [(EffectsTruth::none(), 0.5), (EffectsTruth::default(), 0.0)] {
            let mut snake = CableSnake::new(Truth { effects, ..Truth::default() });
            let rest = snake.loads_n([0.0; 3]);
            let pulled = snake.loads_n([-0.4e-3, 0.0, 0.0]);
            assert!(rest.iter().all(|tau| *tau < -5.0), "{rest:?}");
            assert!(pulled[0] < rest[0] - 3.0, "{rest:?} {pulled:?}");
            // In the built-in truth the cone's friction keeps what the antagonists feel from their actuators.
            assert!(rest[1] - pulled[1] >= antagonist_n, "{rest:?} {pulled:?}");
            assert!((pulled[1] - pulled[2]).abs() < 1e-6, "{pulled:?}");
            let loads = snake.loads_n([2e-3, 0.0, 0.0]);
            assert!(loads[0].abs() < 0.05 && loads[1] < -1.0, "{loads:?}");
            let further = snake.loads_n([3e-3, 0.0, 0.0]);
            let change = (0..3).fold(0.0, |most: f64, k| most.max((further[k] - loads[k]).abs()));
            assert!(change < 0.05, "what is slack hands nothing on: {loads:?} {further:?}");
            assert_eq!(snake.plant.n_unsolved(), 0);
        }
    }
}
