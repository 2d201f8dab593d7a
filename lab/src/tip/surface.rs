//! The surface on which the tip of a segment of constant curvature stays, and the bend that belongs to a point near it.

use krait_model::Snake;
use nalgebra::{Matrix3x2, Vector2, Vector3};

/// Steps of Gauss and Newton's method from the bend of a marker at the end disk; four are enough within a marker's reach.
const STEPS: usize = 12;
/// A step that is smaller than this ends them, rad.
const SMALL_RAD: f64 = 1e-12;

/// Where a marker on the tip's axis can be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface<'a> {
    pub snake: &'a Snake,
    /// How far the marker sits beyond the end disk, m.
    pub beyond_m: f64,
}

/// A point as the surface sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Bend vector of the nearest point of the surface, rad.
    pub bend_rad: Vector2<f64>,
    /// Distance to it, m; negative towards the base.
    pub off_m: f64,
}

impl Surface<'_> {
    /// The marker in the base frame, m.
    pub(super) fn point_in_base_m(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        self.snake.tip_pos_in_base_m(bend_rad) + self.axis(bend_rad) * self.beyond_m
    }

    /// The tip's axis in the base frame.
    pub(super) fn axis(&self, bend_rad: Vector2<f64>) -> Vector3<f64> {
        self.snake.base_from_tip_rotation(bend_rad) * Vector3::z()
    }

    /// How the marker moves with the bend, m/rad.
    pub(super) fn tangents_m(&self, bend_rad: Vector2<f64>) -> Matrix3x2<f64> {
        let j = self.snake.j_x_bend(bend_rad);
        let lever_m = self.axis(bend_rad) * self.beyond_m;
        let mut along = j.fixed_view::<3, 2>(0, 0).into_owned();
        for (mut column, turn) in along.column_iter_mut().zip(j.fixed_view::<3, 2>(3, 0).column_iter()) {
            column += turn.cross(&lever_m);
        }
        along
    }

    /// Height over the base of the point about which the surface is nearly a sphere, m: its centre of curvature at the straight pose.
    pub(super) fn centre_m(&self) -> f64 {
        let (l_m, beyond_m) = (self.snake.l_m(), self.beyond_m);
        // The marker is at r = (l/2 + d) b and l + d - (l/6 + d/2) b^2 there.
        let across_m = 0.5 * l_m + beyond_m;
        l_m + beyond_m - across_m * across_m / (l_m / 3.0 + beyond_m)
    }

    /// The nearest point of the surface to a point in the base frame, m.
    pub(super) fn seen(&self, point_in_base_m: Vector3<f64>) -> Seen {
        let (x_m, y_m, z_m) = (point_in_base_m.x, point_in_base_m.y, point_in_base_m.z);
        let r_m = x_m.hypot(y_m);
        // Exact where the marker sits in the end disk.
        let mut bend = 2.0 * r_m.atan2(z_m);
        let mut normal = Vector2::y();
        let mut apart_m = Vector2::zeros();
        for _ in 0..STEPS {
            let at = Vector2::new(bend, 0.0);
            let (sin, cos) = bend.sin_cos();
            let (end_m, j) = (self.snake.tip_pos_in_base_m(at), self.snake.j_x_bend(at));
            let along = Vector2::new(j[(0, 0)] + self.beyond_m * cos, j[(2, 0)] - self.beyond_m * sin);
            apart_m = Vector2::new(r_m - end_m.x - self.beyond_m * sin, z_m - end_m.z - self.beyond_m * cos);
            // A marker half a segment before the end disk does not move near the straight pose.
            let Some(across) = Vector2::new(-along.y, along.x).try_normalize(1e-12) else { break };
            normal = across;
            let step = apart_m.dot(&along) / along.norm_squared();
            bend += step;
            if step.abs() < SMALL_RAD {
                break;
            }
        }
        let towards = if r_m > 0.0 { Vector2::new(x_m, -y_m) / r_m } else { Vector2::x() };
        Seen { bend_rad: towards * bend, off_m: apart_m.dot(&normal) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_model::MachineParameters;

    #[test]
    fn a_points_bend_is_that_of_the_marker_which_is_there() {
        let snake = Snake::new(&MachineParameters::default()).expect("the default snake");
        for beyond_m in [0.0, 0.004, -0.003] {
            let surface = Surface { snake: &snake, beyond_m };
            for (x, y) in [(0.0, 0.0), (1e-7, -1e-6), (0.3, -0.2), (-0.9, 0.6), (0.1, 1.7), (-1.5, -0.1)] {
                let bend_rad = Vector2::new(x, y);
                let point_m = surface.point_in_base_m(bend_rad);
                let seen = surface.seen(point_m);
                assert!((seen.bend_rad - bend_rad).norm() < 1e-9, "{seen:?} instead of {bend_rad}");
                assert!(seen.off_m.abs() < 1e-12);
                let step = Vector2::new(2e-7, -1e-7);
                let moved_m = surface.point_in_base_m(bend_rad + step) - surface.point_in_base_m(bend_rad - step);
                assert!((moved_m - surface.tangents_m(bend_rad) * step * 2.0).norm() < 1e-6 * moved_m.norm());
                let outwards = surface.seen(point_m * 1.001);
                assert!(outwards.off_m > 0.0, "{outwards:?}");
            }
        }
    }
}
