//! Pose of the last disk and its Jacobian: circular arcs, frame after frame, each smooth through its straight pose.
//!
//! base_from_tip = T(b_1) T(b_2) ..., where T turns by the rotation vector (b_y, b_x, 0) and ends at L (b_x c, -b_y c, s) with
//! c = (1 - cos b)/b^2 and s = sin b / b, as [`crate::Snake`]'s. A rate of b_j moves the tip as segment j's own end moves, and turns
//! all that is behind it about that end.

use super::{Bends, MAX_SEGMENTS, Segments, TwistByBends};
use crate::series::Arc;
use nalgebra::{Isometry3, Matrix3, Matrix3x2, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

/// One arc: end, rotation, and how both move with the bend vector.
struct Segment {
    end_m: Vector3<f64>,
    rotation: Matrix3<f64>,
    linear: Matrix3x2<f64>,
    angular: Matrix3x2<f64>,
}

impl Segments {
    /// Pose of the last disk in the base frame, m.
    pub fn base_from_tip(&self, bends_rad: &Bends) -> Isometry3<f64> {
        self.base_from_disk(bends_rad, self.n - 1)
    }

    /// Pose of a segment's disk (from 0) in the base frame, m.
    pub fn base_from_disk(&self, bends_rad: &Bends, segment: usize) -> Isometry3<f64> {
        self.base_from_part(bends_rad, segment, 1.0)
    }

    /// Pose, in the base frame, m, of the cross-section at the part `along` (0 to 1) of a segment's length (from 0). The piece up to
    /// there is a shorter segment with the same part of the bend: curvature is constant.
    pub fn base_from_part(&self, bends_rad: &Bends, segment: usize, along: f64) -> Isometry3<f64> {
        let segment = segment.min(self.n - 1);
        let (mut at_m, mut base_from_here) = (Vector3::zeros(), Matrix3::identity());
        for j in 0..=segment {
            let part = if j == segment { along } else { 1.0 };
            let arc = Segment::of(self.bend(bends_rad, j) * part, self.l_m[j] * part);
            at_m += base_from_here * arc.end_m;
            base_from_here *= arc.rotation;
        }
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(base_from_here));
        Isometry3::from_parts(Translation3::from(at_m), rotation)
    }

    /// Position of the last disk's centre in the base frame, m.
    pub fn tip_pos_in_base_m(&self, bends_rad: &Bends) -> Vector3<f64> {
        // From the tip to the base: each arc carries what lies behind it.
        (0..self.n).rev().fold(Vector3::zeros(), |behind_m, segment| {
            let bend = self.bend(bends_rad, segment);
            let arc = Arc::of_square(bend.norm_squared());
            let axis = Vector3::new(bend.y, bend.x, 0.0);
            let turned_m = axis.cross(&behind_m);
            let end_m = Vector3::new(bend.x * arc.cosc, -bend.y * arc.cosc, arc.sinc) * self.l_m[segment];
            end_m + behind_m + turned_m * arc.sinc + axis.cross(&turned_m) * arc.cosc
        })
    }

    /// Position of the last disk's centre in the base frame, m, and the Jacobian of its twist by the bends.
    pub fn tip(&self, bends_rad: &Bends) -> (Vector3<f64>, TwistByBends) {
        let mut ends_m = [Vector3::zeros(); MAX_SEGMENTS];
        let mut j = TwistByBends::zeros();
        let (mut at_m, mut base_from_here) = (Vector3::zeros(), Matrix3::identity());
        for (idx, end_m) in ends_m.iter_mut().enumerate().take(self.n) {
            let arc = self.arc(idx, bends_rad);
            j.fixed_view_mut::<3, 2>(0, 2 * idx).copy_from(&(base_from_here * arc.linear));
            j.fixed_view_mut::<3, 2>(3, 2 * idx).copy_from(&(base_from_here * arc.angular));
            at_m += base_from_here * arc.end_m;
            *end_m = at_m;
            base_from_here *= arc.rotation;
        }
        for (idx, end_m) in ends_m.iter().enumerate().take(self.n) {
            let lever_m = at_m - end_m;
            for column in 2 * idx..2 * idx + 2 {
                let turning = Vector3::new(j[(3, column)], j[(4, column)], j[(5, column)]).cross(&lever_m);
                (0..3).for_each(|row| j[(row, column)] += turning[row]);
            }
        }
        (at_m, j)
    }

    fn arc(&self, segment: usize, bends_rad: &Bends) -> Segment {
        Segment::of(self.bend(bends_rad, segment), self.l_m[segment])
    }
}

impl Segment {
    fn of(bend: Vector2<f64>, l_m: f64) -> Self {
        let (x, y) = (bend.x, bend.y);
        let arc = Arc::of_square(bend.norm_squared());
        let cross = Vector3::new(y, x, 0.0).cross_matrix();
        let square = cross * cross;
        let left = Matrix3::identity() + cross * arc.cosc + square * arc.sinc3;
        let linear = Matrix3x2::new(
            arc.cosc + x * x * arc.cosc_slope,
            x * y * arc.cosc_slope,
            -x * y * arc.cosc_slope,
            -arc.cosc - y * y * arc.cosc_slope,
            x * arc.sinc_slope,
            y * arc.sinc_slope,
        );
        Self {
            end_m: Vector3::new(x * arc.cosc, -y * arc.cosc, arc.sinc) * l_m,
            rotation: Matrix3::identity() + cross * arc.sinc + square * arc.cosc,
            linear: linear * l_m,
            angular: Matrix3x2::from_columns(&[left.column(1), left.column(0)]),
        }
    }
}
