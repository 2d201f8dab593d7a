//! How far the measured shape is from the setpoint at the instant of its exposure, and the root mean square of a second.

use std::collections::VecDeque;

/// Setpoints kept: longer than a camera takes to say what it saw, at 8 kHz.
const MOST_SETPOINTS: usize = 4096;
/// The error is summed up over this time, ns.
const WINDOW_NS: i64 = 1_000_000_000;

/// Setpoints of the last while, and the errors of the last second.
#[derive(Debug, Default)]
pub struct LiveTracking {
    setpoints: VecDeque<(i64, [f64; 2])>,
    errors: VecDeque<(i64, f64)>,
}

impl LiveTracking {
    /// Takes a setpoint; instants that go back begin anew.
    pub fn setpoint(&mut self, sample_ns: i64, bend_rad: [f64; 2]) {
        if self.setpoints.back().is_some_and(|(last_ns, _)| *last_ns > sample_ns) {
            self.setpoints.clear();
            self.errors.clear();
        }
        if self.setpoints.len() == MOST_SETPOINTS {
            self.setpoints.pop_front();
        }
        self.setpoints.push_back((sample_ns, bend_rad));
    }

    /// Takes a measured shape; one from before the first setpoint kept, or without numbers, has no error.
    pub fn shape(&mut self, sample_ns: i64, bend_rad: [f64; 2]) {
        let after = self.setpoints.partition_point(|(ns, _)| *ns <= sample_ns);
        let Some((_, wanted)) = after.checked_sub(1).and_then(|at| self.setpoints.get(at)) else { return };
        let error = (bend_rad[0] - wanted[0]).hypot(bend_rad[1] - wanted[1]);
        if !error.is_finite() {
            return;
        }
        self.errors.push_back((sample_ns, error));
        while self.errors.front().is_some_and(|(ns, _)| sample_ns - ns > WINDOW_NS) {
            self.errors.pop_front();
        }
    }

    /// The root mean square of the errors of the last second before an instant, rad.
    pub fn rms_rad(&self, now_ns: i64) -> Option<f64> {
        let fresh = self.errors.iter().filter(|(ns, _)| now_ns - ns <= WINDOW_NS);
        let (n, sum) = fresh.fold((0u32, 0.0), |(n, sum), (_, error)| (n + 1, sum + error * error));
        (n > 0).then(|| (sum / f64::from(n)).sqrt())
    }

    /// The newest error, rad.
    pub fn newest_rad(&self) -> Option<f64> {
        self.errors.back().map(|(_, error)| *error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_is_compared_with_the_setpoint_of_its_exposure() {
        let mut tracking = LiveTracking::default();
        for n in 0..100i64 {
            tracking.setpoint(n * 1_000_000, [0.01 * n as f64, 0.0]);
        }
        tracking.shape(50_500_000, [0.50, 0.03]);
        assert!((tracking.newest_rad().expect("an error") - 0.03).abs() < 1e-12);
        tracking.shape(60_000_000, [0.60, 0.04]);
        let rms = tracking.rms_rad(61_000_000).expect("a second");
        assert!((rms - (0.5f64 * (0.03f64.powi(2) + 0.04f64.powi(2))).sqrt()).abs() < 1e-12, "{rms}");
        assert_eq!(tracking.rms_rad(5_000_000_000), None, "nothing of the last second");
    }
}
