//! One simulated cable-driven joint: a cable with slack and give, a pulley that rubs, and what pulls the joint back.
//!
//! Problem: the drive's end of the cable stands at q; where does the pulley go, x, both in metres of cable?
//!
//! Intuition: of all the places that it could go to from x_0 in the time dt, the pulley takes the one that costs least: the
//! energy in cable and spring, and the work against friction and drag on the way,
//! k/2 gap(q - x)^2 + p/2 x^2 + F |x - x_0| + d (x - x_0)^2 / (2 dt), where gap(z) takes off half of the slack.
//! The slope of this rises with x, so bisection finds its zero.
//!
//! where: friction needs no memory but the place itself; what a model calls play and what it calls friction come out of one law.

use crate::joints_truth::JointTruth;

/// Halvings of the interval in which the pulley's place lies: to rounding.
const HALVINGS: usize = 60;

/// A joint that exists only in numbers.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    truth: JointTruth,
    pulley_m: f64,
    cable_m: f64,
    /// Once it was beyond this place, the pulley goes no further back, m.
    stop_m: f64,
}

impl Joint {
    /// A joint at rest at its zero, its cable slack.
    pub(crate) fn new(truth: &JointTruth) -> Self {
        Self { truth: truth.clone(), pulley_m: 0.0, cable_m: 0.0, stop_m: f64::NEG_INFINITY }
    }

    /// The same with something hard in its way back, m of cable, once it was beyond that.
    pub(crate) fn that_stops_at(self, stop_m: f64) -> Self {
        Self { stop_m, ..self }
    }

    /// Moves the drive's end of the cable; the pulley then has a time to follow, above 0.
    pub(crate) fn pull(&mut self, cable_m: f64, elapsed_s: f64) {
        self.cable_m = cable_m;
        let from_m = self.pulley_m;
        let pull_n = self.force_n(from_m);
        if pull_n.abs() <= self.truth.friction_n {
            return;
        }
        let sign = pull_n.signum();
        // Beyond the end of the cable and beyond the spring's rest nothing pulls on in this direction.
        let end_m = sign * (sign * (cable_m + sign * 0.5 * self.truth.slack_m)).max(sign * from_m).max(0.0);
        let drag_n_per_m = self.truth.drag_n_s_per_m / elapsed_s;
        let (mut near_m, mut far_m) = (from_m, end_m);
        for _ in 0..HALVINGS {
            let middle_m = 0.5 * (near_m + far_m);
            let left_n = self.force_n(middle_m) - sign * self.truth.friction_n - drag_n_per_m * (middle_m - from_m);
            if left_n * sign > 0.0 {
                near_m = middle_m;
            } else {
                far_m = middle_m;
            }
        }
        let stop_m = if from_m >= self.stop_m { self.stop_m } else { f64::NEG_INFINITY };
        self.pulley_m = (0.5 * (near_m + far_m)).max(stop_m);
    }

    /// What cable and spring do to a pulley at a place, N.
    fn force_n(&self, pulley_m: f64) -> f64 {
        self.tension_n(pulley_m) - self.truth.spring_n_per_m * pulley_m
    }

    fn tension_n(&self, pulley_m: f64) -> f64 {
        let (way_m, half_m) = (self.cable_m - pulley_m, 0.5 * self.truth.slack_m);
        self.truth.cable_n_per_m * (way_m - way_m.clamp(-half_m, half_m))
    }

    /// Load of the cable at its drive, N, positive where the drive pushes x onwards.
    pub(crate) fn load_n(&self) -> f64 {
        self.tension_n(self.pulley_m)
    }

    /// Where the pulley stands, m of cable.
    pub(crate) fn pulley_m(&self) -> f64 {
        self.pulley_m
    }

    /// Position of the joint, rad (m for a sliding joint).
    pub(crate) fn position_rad(&self) -> f64 {
        self.truth.zero_rad + self.pulley_m / self.truth.radius_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> Joint {
        Joint::new(&JointTruth { zero_rad: 0.0, ..JointTruth::default() })
    }

    /// Pulls in steps of 10 um.
    fn pull_to(joint: &mut Joint, to_m: f64) {
        let from_m = joint.cable_m;
        let n = ((to_m - from_m).abs() / 1e-5).ceil().max(1.0) as i32;
        (1..=n).for_each(|k| joint.pull(from_m + (to_m - from_m) * f64::from(k) / f64::from(n), 1e-3));
    }

    #[test]
    fn a_pulley_follows_its_cable_behind_slack_and_stretch_and_stays_behind_them_when_it_turns_back() {
        let mut joint = joint();
        let truth = JointTruth { drag_n_s_per_m: 0.0, ..joint.truth.clone() };
        joint.truth = truth.clone();
        pull_to(&mut joint, 3e-3);
        let up_m = joint.pulley_m();
        // Balance of forces: k (q - x - s/2) = p x + F.
        let (k, p) = (truth.cable_n_per_m, truth.spring_n_per_m);
        let expected_m = (k * (3e-3 - 0.5 * truth.slack_m) - truth.friction_n) / (k + p);
        assert!((up_m - expected_m).abs() < 1e-9, "{up_m} for {expected_m}");
        assert!((joint.load_n() - truth.friction_n - p * up_m).abs() < 1e-6, "{}", joint.load_n());
        let lost_m = truth.slack_m + 2.0 * truth.friction_n / k;
        pull_to(&mut joint, 3e-3 - 0.9 * lost_m);
        assert!((joint.pulley_m() - up_m).abs() < 1e-12, "inside the dead band nothing moves");
        pull_to(&mut joint, 3e-3 - 1.5 * lost_m);
        assert!(joint.pulley_m() < up_m - 0.3 * lost_m, "behind it, it moves");
    }

    #[test]
    fn a_pulley_stops_at_what_is_in_its_way_back_and_its_load_grows() {
        let mut joint = joint().that_stops_at(1e-3);
        pull_to(&mut joint, 0.5e-3);
        pull_to(&mut joint, 0.0);
        assert!(joint.pulley_m() < 0.5e-3, "it was not there yet");
        pull_to(&mut joint, 3e-3);
        pull_to(&mut joint, 0.0);
        let truth = &joint.truth;
        let pull_n = truth.cable_n_per_m * (1e-3 - 0.5 * truth.slack_m);
        assert!(
            (joint.pulley_m() - 1e-3).abs() < 1e-12 && (joint.load_n() + pull_n).abs() < 1e-6,
            "{}",
            joint.load_n()
        );
        pull_to(&mut joint, 3e-3);
        assert!(joint.pulley_m() > 2e-3, "and it opens again");
    }

    #[test]
    fn drag_makes_a_fast_pulley_late_and_leaves_no_trace_at_rest() {
        let mut joint = joint();
        joint.truth.drag_n_s_per_m = 200.0;
        pull_to(&mut joint, 3e-3);
        let late_m = joint.pulley_m();
        (0..2000).for_each(|_| joint.pull(3e-3, 1e-3));
        let rest_m = joint.pulley_m();
        assert!(rest_m - late_m > 2e-5, "at 10 mm/s it was {} mm behind", 1e3 * (rest_m - late_m));
        let mut slow = super::Joint::new(&JointTruth { drag_n_s_per_m: 0.0, ..joint.truth.clone() });
        pull_to(&mut slow, 3e-3);
        assert!((rest_m - slow.pulley_m()).abs() < 1e-7);
    }
}
