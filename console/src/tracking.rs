//! How far the measured shape is from the setpoint at the instant of its exposure, and the root mean square of a second.
//!
//! Of a snake: the distance of two bend vectors, rad. Of joints: the joint that is farthest off, rad (m where it slides). Of segments: the
//! distance of the two bend vectors of the segment that is farthest off, rad.

use krait_ipc::message::{JointValues, MAX_JOINTS, Setpoint, Shape};
use std::collections::VecDeque;

/// Setpoints kept: longer than a camera takes to say what it saw, at 8 kHz.
const MOST_SETPOINTS: usize = 4096;
/// The error is summed up over this time, ns.
const WINDOW_NS: i64 = 1_000_000_000;

/// Setpoints of the last while, and the errors of the last second.
#[derive(Debug, Default)]
pub struct LiveTracking {
    n_joints: u32,
    has_segments: bool,
    setpoints: VecDeque<(i64, JointValues)>,
    errors: VecDeque<(i64, JointValues)>,
}

impl LiveTracking {
    /// Takes a setpoint; instants that go back, or another kind of machine, begin anew.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        let values = if setpoint.n_joints == 0 { of_bend(setpoint.bend_rad) } else { setpoint.joints_rad };
        self.has_segments = setpoint.n_segments() > 0;
        self.wanted(setpoint.sample_ns, setpoint.n_joints, values);
    }

    fn wanted(&mut self, sample_ns: i64, n_joints: u32, values: JointValues) {
        let goes_back = self.setpoints.back().is_some_and(|(last_ns, _)| *last_ns > sample_ns);
        if goes_back || self.n_joints != n_joints {
            self.setpoints.clear();
            self.errors.clear();
            self.n_joints = n_joints;
        }
        if self.setpoints.len() == MOST_SETPOINTS {
            self.setpoints.pop_front();
        }
        self.setpoints.push_back((sample_ns, values));
    }

    /// Takes a measured shape; one from before the first setpoint kept, of another machine, or without numbers has no error.
    pub fn shape(&mut self, shape: &Shape) {
        let after = self.setpoints.partition_point(|(ns, _)| *ns <= shape.sample_ns);
        let Some((_, wanted)) = after.checked_sub(1).and_then(|at| self.setpoints.get(at)) else { return };
        let measured = match self.n_joints {
            0 => shape.valid_bend_rad().map(of_bend),
            n => shape.valid_joints_rad().filter(|joints| joints.len() == n as usize).map(|joints| {
                let mut values = [0.0; MAX_JOINTS];
                values[..joints.len()].copy_from_slice(joints);
                values
            }),
        };
        let Some(measured) = measured.filter(|values| values.iter().all(|value| value.is_finite())) else { return };
        self.errors.push_back((shape.sample_ns, core::array::from_fn(|k| measured[k] - wanted[k])));
        while self.errors.front().is_some_and(|(ns, _)| shape.sample_ns - ns > WINDOW_NS) {
            self.errors.pop_front();
        }
    }

    /// The root mean square of the errors of the last second before an instant.
    pub fn rms(&self, now_ns: i64) -> Option<f64> {
        self.rms_of_each(now_ns).map(|each| self.together(&each))
    }

    /// The same of each joint, or of each component of the segments' bend vectors; zeros behind the last.
    pub fn rms_of_each(&self, now_ns: i64) -> Option<JointValues> {
        let (mut n, mut sums) = (0u32, [0.0; MAX_JOINTS]);
        for (_, error) in self.errors.iter().filter(|(ns, _)| now_ns - ns <= WINDOW_NS) {
            n += 1;
            sums.iter_mut().zip(error).for_each(|(sum, error)| *sum += error * error);
        }
        (n > 0).then(|| sums.map(|sum| (sum / f64::from(n)).sqrt()))
    }

    /// The newest error.
    pub fn newest(&self) -> Option<f64> {
        self.errors.back().map(|(_, error)| self.together(error))
    }

    fn together(&self, each: &JointValues) -> f64 {
        match self.n_joints {
            0 => each[0].hypot(each[1]),
            _ if self.has_segments => each.chunks_exact(2).fold(0.0, |most, own| own[0].hypot(own[1]).max(most)),
            _ => each.iter().fold(0.0, |most, error| error.abs().max(most)),
        }
    }
}

/// A bend vector in the first two places.
fn of_bend([x, y]: [f64; 2]) -> JointValues {
    let mut values = [0.0; MAX_JOINTS];
    (values[0], values[1]) = (x, y);
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_is_compared_with_the_setpoint_of_its_exposure() {
        let mut tracking = LiveTracking::default();
        for n in 0..100i64 {
            tracking.wanted(n * 1_000_000, 0, of_bend([0.01 * n as f64, 0.0]));
        }
        tracking.shape(&Shape::of_bend(1, 50_500_000, 51_000_000, [0.50, 0.03]));
        assert!((tracking.newest().expect("an error") - 0.03).abs() < 1e-12);
        tracking.shape(&Shape::lost(2, 55_000_000, 56_000_000));
        tracking.shape(&Shape::of_bend(3, 60_000_000, 61_000_000, [0.60, 0.04]));
        let rms = tracking.rms(61_000_000).expect("a second");
        assert!((rms - (0.5f64 * (0.03f64.powi(2) + 0.04f64.powi(2))).sqrt()).abs() < 1e-12, "{rms}");
        assert_eq!(tracking.rms(5_000_000_000), None, "nothing of the last second");
    }

    #[test]
    fn of_joints_the_one_that_is_farthest_off_counts() {
        let mut tracking = LiveTracking::default();
        let mut joints_rad = [0.0; MAX_JOINTS];
        joints_rad[..3].copy_from_slice(&[0.1, -0.2, 0.3]);
        tracking.wanted(10, 3, joints_rad);
        tracking.shape(&Shape::of_joints(1, 20, 30, &[0.1, -0.25, 0.28]));
        assert!((tracking.newest().expect("an error") - 0.05).abs() < 1e-12);
        let each = tracking.rms_of_each(30).expect("a second");
        assert!((each[2] - 0.02).abs() < 1e-12 && each[3..].iter().all(|rest| *rest == 0.0), "{each:?}");
        tracking.shape(&Shape::of_bend(2, 25, 30, [0.9, 0.9]));
        assert!((tracking.newest().expect("an error") - 0.05).abs() < 1e-12, "a bend is none of theirs");
    }
}
