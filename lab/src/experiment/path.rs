//! The motion of the experiment: bend vector over time, and the tip velocities that make it.

use core::f64::consts::TAU;
use core::fmt::Write;
use krait_model::Snake;
use nalgebra::{Vector2, Vector3};

/// Time between rows, s.
pub(super) const PERIOD_S: f64 = 0.05;
/// Rest before the first motion: homing ends in this time, s.
const LEAD_S: f64 = 5.0;
const DEG: f64 = core::f64::consts::PI / 180.0;
/// Rates of the three speeds, rad/s.
const SPEEDS: [f64; 3] = [10.0 * DEG, 20.0 * DEG, 40.0 * DEG];

/// The bend vector of every row, rad, from straight to straight.
pub(super) fn path_rad() -> Vec<Vector2<f64>> {
    let mut pen = Pen { path: vec![Vector2::zeros()] };
    pen.rest(LEAD_S);
    for (plane, speed) in [0.0, 60.0 * DEG].into_iter().flat_map(|plane| SPEEDS.map(|speed| (plane, speed))) {
        for (top, low) in [(60.0, 0.0), (50.0, 10.0), (40.0, 20.0), (33.0, 27.0)] {
            pen.to(polar(top * DEG, plane), speed);
            pen.to(polar(low * DEG, plane), speed);
        }
        pen.rest(3.0);
        pen.to(Vector2::zeros(), speed);
    }
    pen.to(polar(40.0 * DEG, 0.0), SPEEDS[1]);
    for turn in [TAU, -TAU] {
        pen.rotate(40.0 * DEG, turn, 8.0);
        pen.rest(3.0);
    }
    pen.to(Vector2::zeros(), SPEEDS[1]);
    pen.rest(2.0);
    pen.path
}

/// The script of the experiment for a snake, in the columns of `krait run --master script`.
pub fn script(snake: &Snake) -> String {
    let path = path_rad();
    let tip_m: Vec<Vector3<f64>> = path.iter().map(|bend| snake.tip_pos_in_base_m(*bend)).collect();
    let mut text = String::from(
        "# Nested loops in two planes at three speeds, rotations both ways, holds: separates effects with memory.\n\
         # Velocities of the tip in the view frame, for a view that is not rolled.\n\
         time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch\n",
    );
    for (row, tip) in tip_m.iter().enumerate() {
        // Central differences: their trapezoids sum to the path.
        let before = tip_m.get(row.saturating_sub(1)).unwrap_or(tip);
        let after = tip_m.get(row + 1).unwrap_or(tip);
        let velocity = (after - before) / (2.0 * PERIOD_S);
        // Writing to a string cannot fail.
        let _ok =
            writeln!(text, "{:.2},{:.7},{:.7},{:.7},1,0", row as f64 * PERIOD_S, velocity.x, velocity.y, velocity.z);
    }
    text
}

fn polar(bend: f64, delta: f64) -> Vector2<f64> {
    Vector2::new(bend * delta.cos(), bend * delta.sin())
}

struct Pen {
    path: Vec<Vector2<f64>>,
}

impl Pen {
    fn last(&self) -> Vector2<f64> {
        self.path.last().copied().unwrap_or_default()
    }

    fn rest(&mut self, seconds: f64) {
        let here = self.last();
        self.draw(seconds, |_| here);
    }

    /// A straight line of the bend vector with soft ends, at a mean speed.
    fn to(&mut self, target: Vector2<f64>, speed_rad_per_s: f64) {
        let here = self.last();
        let seconds = ((target - here).norm() / speed_rad_per_s).max(0.4);
        self.draw(seconds, |part| here + (target - here) * soft(part));
    }

    fn rotate(&mut self, bend: f64, turn: f64, seconds: f64) {
        self.draw(seconds, |part| polar(bend, turn * soft(part)));
    }

    fn draw(&mut self, seconds: f64, at: impl Fn(f64) -> Vector2<f64>) {
        let n = (seconds / PERIOD_S).round().max(1.0) as usize;
        self.path.extend((1..=n).map(|k| at(k as f64 / n as f64)));
    }
}

fn soft(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_stays_within_a_chain_s_default_limits_and_ends_straight() {
        let path = path_rad();
        assert!(path.iter().all(|bend| bend.norm() <= 60.0 * DEG + 1e-9));
        let fastest = path.windows(2).map(|w| (w[1] - w[0]).norm() / PERIOD_S).fold(0.0, f64::max);
        assert!(fastest > 0.9 * 1.5 * SPEEDS[2] && fastest < 1.1, "{fastest} rad/s");
        let sharpest =
            path.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).norm() / PERIOD_S.powi(2)).fold(0.0, f64::max);
        assert!(sharpest < 40.0, "{sharpest} rad/s^2");
        assert!(path.last().is_some_and(|bend| bend.norm() < 1e-12));
    }
}
