//! What was measured of the machine's shape: published by whoever measures it, read by `estimate` and `record`.

use super::{MAX_JOINTS, message};
use iceoryx2::prelude::ZeroCopySend;

/// A measured shape: the bend of a snake, or the positions of joints.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.Shape")]
pub struct Shape {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of exposure, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// When the shape was published, CLOCK_MONOTONIC, nanoseconds.
    pub available_ns: i64,
    /// Measured bend vector b (cos delta, sin delta), rad; NaN where the view was lost, and for joints.
    pub bend_rad: [f64; 2],
    /// Tangent angle of the end disk in the snake plane, rad; pi/2 is straight.
    pub theta_l_rad: f64,
    /// delta as in the paper, rad, in (-pi, pi]; arbitrary at the straight pose.
    pub delta_rad: f64,
    /// Covariance of `bend_rad` as its maker states it (xx, xy, yy), rad^2; NaN where it states none.
    pub bend_covariance_rad2: [f64; 3],
    /// Actuator positions q~ at the instant of exposure, m; NaN where the maker does not know them.
    pub q_tilde_m: [f64; 3],
    /// Measured positions of the joints, rad (m for a sliding joint); NaN for a snake and behind the last joint. Of a snake with a gripper
    /// the measured jaw in the place [`super::JAW`].
    pub joints_rad: [f64; MAX_JOINTS],
    /// Their variances as the maker states them, rad^2; NaN where it states none.
    pub joint_variances_rad2: [f64; MAX_JOINTS],
    /// How many joints it shows; 0 for a snake.
    pub n_joints: u32,
    /// See [`Validity`].
    pub validity: u32,
}

message!(Shape, "shape", 2);

/// What a shape is worth.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Validity {
    /// A measurement.
    Valid = 0,
    /// A frame that does not show the machine; its values are NaN.
    Lost = 1,
    /// A measurement that cannot follow the one before it at any speed of the machine; kept as evidence, not to be used.
    Outlying = 2,
}

impl Validity {
    /// The value for a number received from another process.
    pub fn from_u32(value: u32) -> Option<Self> {
        [Self::Valid, Self::Lost, Self::Outlying].into_iter().find(|v| *v as u32 == value)
    }
}

impl Shape {
    /// A valid bend with its tangent angle and plane, measured at `sample_ns` and published at `available_ns`.
    pub fn of_bend(sequence: u64, sample_ns: i64, available_ns: i64, bend_rad: [f64; 2]) -> Self {
        let [x, y] = bend_rad;
        Self {
            bend_rad,
            theta_l_rad: core::f64::consts::FRAC_PI_2 - x.hypot(y),
            delta_rad: y.atan2(x),
            validity: Validity::Valid as u32,
            ..Self::lost(sequence, sample_ns, available_ns)
        }
    }

    /// Valid positions of joints, at most [`MAX_JOINTS`]; what is beyond is left out.
    pub fn of_joints(sequence: u64, sample_ns: i64, available_ns: i64, positions_rad: &[f64]) -> Self {
        let mut shape = Self::lost(sequence, sample_ns, available_ns);
        let mut n_joints = 0;
        for (joint, position) in shape.joints_rad.iter_mut().zip(positions_rad) {
            *joint = *position;
            n_joints += 1;
        }
        Self { n_joints, validity: Validity::Valid as u32, ..shape }
    }

    /// A frame that does not show the machine.
    pub fn lost(sequence: u64, sample_ns: i64, available_ns: i64) -> Self {
        Self {
            sequence,
            sample_ns,
            available_ns,
            bend_rad: [f64::NAN; 2],
            theta_l_rad: f64::NAN,
            delta_rad: f64::NAN,
            bend_covariance_rad2: [f64::NAN; 3],
            q_tilde_m: [f64::NAN; 3],
            joints_rad: [f64::NAN; MAX_JOINTS],
            joint_variances_rad2: [f64::NAN; MAX_JOINTS],
            n_joints: 0,
            validity: Validity::Lost as u32,
        }
    }

    /// The same with the same standard deviation of both components, uncorrelated, rad.
    pub fn with_sigma(self, sigma_bend_rad: f64) -> Self {
        let variance = sigma_bend_rad * sigma_bend_rad;
        Self { bend_covariance_rad2: [variance, 0.0, variance], ..self }
    }

    /// Root mean square of both components' standard deviations, rad; NaN where the maker states none.
    pub fn sigma_bend_rad(&self) -> f64 {
        let [xx, _, yy] = self.bend_covariance_rad2;
        (0.5 * (xx + yy)).sqrt()
    }

    /// The bend, if this is a valid measurement of one.
    pub fn valid_bend_rad(&self) -> Option<[f64; 2]> {
        let is_valid = self.validity == Validity::Valid as u32 && self.bend_rad.iter().all(|b| b.is_finite());
        is_valid.then_some(self.bend_rad)
    }

    /// The same shape of a snake with the measured jaw of its gripper, rad, and its standard deviation; NaN changes nothing.
    pub fn with_jaw(mut self, jaw_rad: f64, sigma_rad: f64) -> Self {
        if jaw_rad.is_finite() {
            (self.joints_rad[super::JAW], self.joint_variances_rad2[super::JAW]) = (jaw_rad, sigma_rad * sigma_rad);
        }
        self
    }

    /// The jaw of a snake's gripper, rad, if this is a valid measurement of one.
    pub fn valid_jaw_rad(&self) -> Option<f64> {
        let jaw_rad = self.joints_rad[super::JAW];
        (self.n_joints == 0 && self.valid_bend_rad().is_some() && jaw_rad.is_finite()).then_some(jaw_rad)
    }

    /// The positions of the joints, if this is a valid measurement of some.
    pub fn valid_joints_rad(&self) -> Option<&[f64]> {
        let positions = self.joints_rad.get(..self.n_joints as usize)?;
        let is_valid = self.validity == Validity::Valid as u32 && positions.iter().all(|q| q.is_finite());
        (is_valid && !positions.is_empty()).then_some(positions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_valid_and_finite_measurement_is_used() {
        let shape = Shape::of_bend(1, 2, 3, [0.3, -0.4]).with_sigma(0.01);
        assert_eq!(shape.valid_bend_rad(), Some([0.3, -0.4]));
        assert!((shape.sigma_bend_rad() - 0.01).abs() < 1e-15);
        assert!((core::f64::consts::FRAC_PI_2 - shape.theta_l_rad - 0.5).abs() < 1e-15);
        assert_eq!(Shape { validity: Validity::Outlying as u32, ..shape }.valid_bend_rad(), None);
        assert_eq!(Shape { validity: 77, ..shape }.valid_bend_rad(), None, "no version of krait sends that");
        assert_eq!(Shape { bend_rad: [0.3, f64::NAN], ..shape }.valid_bend_rad(), None);
        assert_eq!(Shape::lost(1, 2, 3).valid_bend_rad(), None);
        assert_eq!(shape.valid_joints_rad(), None);
        assert!(Shape::of_bend(1, 2, 3, [0.0; 2]).sigma_bend_rad().is_nan(), "none is stated");
    }

    #[test]
    fn a_jaw_is_shown_beside_a_bend_and_is_no_joint() {
        let shape = Shape::of_bend(1, 2, 3, [0.3, -0.4]);
        assert_eq!((shape.valid_jaw_rad(), shape.with_jaw(f64::NAN, 0.1).valid_jaw_rad()), (None, None));
        let shown = shape.with_jaw(0.5, 0.01);
        assert_eq!((shown.valid_jaw_rad(), shown.valid_bend_rad()), (Some(0.5), Some([0.3, -0.4])));
        assert_eq!(shown.valid_joints_rad(), None);
        assert_eq!(Shape::of_joints(1, 2, 3, &[0.1]).valid_jaw_rad(), None);
        assert_eq!(Shape { validity: Validity::Outlying as u32, ..shown }.valid_jaw_rad(), None);
    }

    #[test]
    fn joints_are_shown_as_many_as_there_are() {
        let shape = Shape::of_joints(1, 2, 3, &[0.1, 0.2]);
        assert_eq!(shape.valid_joints_rad(), Some(&[0.1, 0.2][..]));
        assert_eq!(shape.valid_bend_rad(), None);
        assert_eq!(Shape { n_joints: 9, ..shape }.valid_joints_rad(), None, "no version of krait sends that");
        assert_eq!(Shape { n_joints: 3, ..shape }.valid_joints_rad(), None, "the third is not finite");
    }
}
