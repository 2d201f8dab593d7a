//! Two numbers that a hand can be told: the largest line load against its limit, and how much of the lines' way is compensation. Pure.

use krait_ipc::message::{Command, N_LINES, N_WITH_GRIPPER, SlaveState, used};

/// Largest loads that the slave lets a line carry, N; from `[slave.limits]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineLoadLimits {
    /// While it is pushed.
    pub push_n: f64,
    /// While it is pulled.
    pub pull_n: f64,
}

impl Default for LineLoadLimits {
    /// None is known, so that no load is near one.
    fn default() -> Self {
        Self { push_n: f64::INFINITY, pull_n: f64::INFINITY }
    }
}

impl LineLoadLimits {
    /// The largest measured load of a line as a part of its limit; 0 where none is measured or limited. A gripper's wire is no line.
    pub(crate) fn load_ratio(self, drives: &SlaveState) -> f64 {
        let loads_n = lines_of(used(&drives.measured_tau_n, drives.n_actuators), drives.n_joints);
        let ratio = |tau_n: &f64| tau_n.abs() / if *tau_n > 0.0 { self.push_n } else { self.pull_n };
        // `max` leaves a load out that is not measured.
        loads_n.iter().map(ratio).fold(0.0, f64::max)
    }
}

/// Below this way compensation is compared with it, m: near the zero a play of 0.1 mm would be all of the way, and means nothing. About
/// 15 deg of the snake.
const LEAST_WAY_M: f64 = 0.4e-3;

/// max |q~_i - q_i| / max |q~_i| over the lines (Eq. 17: q~ = q + eps), the ways from the zero of the actuators: 0..=1.
pub(crate) fn compensation_share(command: &Command) -> f64 {
    let lines = |all| lines_of(used(all, command.n_actuators), command.n_joints);
    let (told_m, bare_m) = (lines(&command.q_tilde_m), lines(&command.q_uncompensated_m));
    let eps_m = told_m.iter().zip(bare_m).map(|(told, bare)| (told - bare).abs()).fold(0.0, f64::max);
    let way_m = told_m.iter().map(|told| told.abs()).fold(LEAST_WAY_M, f64::max);
    (eps_m / way_m).min(1.0)
}

/// The actuators without a gripper's wire.
fn lines_of(actuators: &[f64], n_joints: u32) -> &[f64] {
    let has_gripper = n_joints == 0 && actuators.len() == N_WITH_GRIPPER;
    if has_gripper { &actuators[..N_LINES] } else { actuators }
}

/// Quarters of what a meter tells: below a quarter, from one, two, three, four quarters on.
pub(crate) const FULL: u8 = 4;

/// Keeps the largest value since it was last read, so that no peak goes between two codes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Meter {
    peak_ratio: f64,
    told: u8,
}

impl Meter {
    /// Notes a value; true if it is a quarter more than what is told.
    pub(crate) fn note(&mut self, ratio: f64) -> bool {
        self.peak_ratio = self.peak_ratio.max(ratio);
        self.quarters() > self.told
    }

    /// Tells the largest value from now on, and begins anew.
    pub(crate) fn latch(&mut self) {
        self.told = self.quarters();
        self.peak_ratio = 0.0;
    }

    /// Quarters that are told.
    pub(crate) fn told(self) -> u8 {
        self.told
    }

    fn quarters(self) -> u8 {
        // 0..=4 by the clamp, so that nothing is cut off.
        (self.peak_ratio * f64::from(FULL)).clamp(0.0, f64::from(FULL)) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::message::Actuators;

    fn actuators(first: &[f64]) -> Actuators {
        let mut all = Actuators::default();
        all[..first.len()].copy_from_slice(first);
        all
    }

    #[test]
    fn the_load_that_is_nearest_to_its_own_limit_counts_and_none_that_is_not_measured() {
        let limits = LineLoadLimits { push_n: 20.0, pull_n: 40.0 };
        let drives = |tau_n: &[f64], n_actuators| SlaveState {
            measured_tau_n: actuators(tau_n),
            n_actuators,
            ..SlaveState::default()
        };
        assert_eq!(limits.load_ratio(&drives(&[5.0, -20.0, 0.0], 0)), 0.5);
        assert_eq!(limits.load_ratio(&drives(&[15.0, -20.0, f64::NAN], 0)), 0.75);
        assert_eq!(limits.load_ratio(&drives(&[f64::NAN; 3], 0)), 0.0);
        assert_eq!(limits.load_ratio(&drives(&[1.0, 0.0, 0.0, 400.0], 4)), 0.05, "a gripper's wire is no line");
        assert_eq!(limits.load_ratio(&drives(&[1.0, 0.0, 0.0, 0.0, 30.0], 5)), 1.5);
        assert_eq!(LineLoadLimits::default().load_ratio(&drives(&[50.0], 0)), 0.0, "no limit is known");
    }

    #[test]
    fn the_share_is_the_largest_compensation_of_the_largest_way_and_nothing_near_the_zero() {
        let command = |told_mm: &[f64], bare_mm: &[f64], n_actuators| Command {
            q_tilde_m: actuators(told_mm).map(|mm| mm * 1e-3),
            q_uncompensated_m: actuators(bare_mm).map(|mm| mm * 1e-3),
            n_actuators,
            ..Command::default()
        };
        let share = |told, bare, n| compensation_share(&command(told, bare, n));
        assert!((share(&[-2.0, 1.0, 1.0], &[-1.5, 0.75, 0.75], 0) - 0.25).abs() < 1e-12);
        assert_eq!(share(&[-2.0, 1.0, 1.0], &[-2.0, 1.0, 1.0], 0), 0.0);
        assert!((share(&[0.1, 0.0, 0.0], &[0.0; 3], 0) - 0.25).abs() < 1e-12, "0.1 of 0.4 mm");
        assert_eq!(share(&[1.0, 0.0, 0.0], &[-9.0, 0.0, 0.0], 0), 1.0);
        assert_eq!(share(&[-2.0, 1.0, 1.0, 9.0], &[-2.0, 1.0, 1.0, 0.0], 4), 0.0, "a gripper's wire is no line");
    }

    #[test]
    fn a_meter_tells_the_largest_value_since_it_was_read() {
        let mut meter = Meter::default();
        assert!(!meter.note(0.24));
        assert!(meter.note(0.51) && meter.note(0.1), "more than is told, also a look later");
        meter.latch();
        assert_eq!(meter.told(), 2);
        assert!(!meter.note(0.6));
        meter.latch();
        meter.latch();
        assert_eq!(meter.told(), 0);
        for (ratio, quarters) in [(f64::NAN, 0), (0.25, 1), (0.99, 3), (1.0, 4), (7.0, 4)] {
            let mut meter = Meter::default();
            meter.note(ratio);
            meter.latch();
            assert_eq!(meter.told(), quarters, "{ratio}");
        }
    }
}
