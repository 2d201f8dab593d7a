//! A mechanical stop, known from what an actuator that goes towards it reads: its load stays and its encoder stands while its goal goes on.
//!
//! Problem: a load alone is no stop: a line under tension, friction and an antagonist load a motor too, and it goes on against them.
//!
//! Intuition: over the newest stretch of the way ([`STRETCH_M`], and [`READINGS`] readings) every load was at the threshold, and the encoder
//! went by little of what the goal went by. Each reading is kept with the goal that stood when it came.
//!
//! Failure: readings that do not come anew are no readings, so a bus that is silent is no stop.

use std::collections::VecDeque;

/// The goal goes so far on while the stop is being pressed, m.
const STRETCH_M: f64 = 1e-4;
/// Readings that must agree.
const READINGS: usize = 5;
/// The encoder of an actuator at its stop goes by less than this part of what its goal goes by.
const STILL_PART: f64 = 0.25;

/// One reading, in the direction of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pressed {
    /// Where the goal was, m.
    pub(super) goal_m: f64,
    /// Where the encoder is, m.
    pub(super) place_m: f64,
    /// What it presses with, N.
    pub(super) load_n: f64,
}

/// Looks at readings one after the other.
#[derive(Debug)]
pub(super) struct StopWatch {
    threshold_n: f64,
    newest: VecDeque<Pressed>,
}

impl StopWatch {
    pub(super) fn new(threshold_n: f64) -> Self {
        Self { threshold_n, newest: VecDeque::new() }
    }

    /// Takes a new reading; whether the actuator stands at a stop.
    pub(super) fn look(&mut self, reading: Pressed) -> bool {
        self.newest.push_back(reading);
        // The front goes once the rest is long enough without it.
        while self.newest.len() > READINGS && self.newest.get(1).is_some_and(|second| is_long(second, &reading)) {
            self.newest.pop_front();
        }
        let Some(first) = self.newest.front() else { return false };
        let stands = (reading.place_m - first.place_m).abs() < STILL_PART * (reading.goal_m - first.goal_m);
        let is_pressed = self.newest.iter().all(|own| own.load_n >= self.threshold_n);
        self.newest.len() >= READINGS && is_long(first, &reading) && is_pressed && stands
    }
}

/// Whether the goal went far enough between two readings; what rounding takes from a whole stretch does not count.
fn is_long(from: &Pressed, to: &Pressed) -> bool {
    to.goal_m - from.goal_m >= STRETCH_M * (1.0 - 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings every so many metres of goal; encoder and load follow from the goal. Where the stop was known, m of goal.
    fn known(step_m: f64, reads: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
        let mut watch = StopWatch::new(2.0);
        (0..2000).map(|k| f64::from(k) * step_m).take_while(|goal_m| *goal_m < 5e-3).find(|goal_m| {
            let (place_m, load_n) = reads(*goal_m);
            watch.look(Pressed { goal_m: *goal_m, place_m, load_n })
        })
    }

    /// A stop at 1 mm against which the load grows by 20 N/mm, read 12 um late.
    fn at_stop(goal_m: f64) -> (f64, f64) {
        let goal_m = goal_m - 12e-6;
        (goal_m.min(1e-3), ((goal_m - 1e-3) * 2e4).max(0.0))
    }

    #[test]
    fn a_stop_is_known_once_the_load_was_there_for_a_stretch_and_five_readings() {
        for (step_m, latest_m) in [(2.5e-6, 1.22e-3), (10e-6, 1.23e-3), (40e-6, 1.32e-3)] {
            let found_m = known(step_m, at_stop).unwrap();
            assert!(found_m >= 1.21e-3 && found_m <= latest_m, "steps of {step_m}: {found_m}");
        }
    }

    #[test]
    fn a_load_that_is_gone_against_and_an_encoder_that_stands_without_load_are_no_stop() {
        assert_eq!(known(10e-6, |goal_m| (goal_m - 12e-6, 10.0)), None, "it moves");
        assert_eq!(known(10e-6, |goal_m| (0.5 * goal_m, 10.0)), None, "it is slow");
        assert_eq!(known(10e-6, |goal_m| (goal_m.min(1e-3), 1.9)), None, "it carries less");
        let for_a_moment = |goal_m: f64| if (1e-3..1.075e-3).contains(&goal_m) { (1e-3, 10.0) } else { (goal_m, 10.0) };
        assert_eq!(known(10e-6, for_a_moment), None, "it sticks for a moment");
        let spoilt = |goal_m: f64| if (goal_m * 1e5).round() as i32 % 4 == 0 { (1e-3, 0.0) } else { (1e-3, 10.0) };
        assert_eq!(known(10e-6, spoilt), None, "every fourth reading says no");
    }
}
