//! Fig. 9: compensated length of line 1 over the whole workspace; where the sign of motion matters, two sheets.

use crate::bench::bend_rad;
use crate::variants::OF_EQ_22;
use krait_model::Snake;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// Largest bend, deg.
const BEND_TO_DEG: u32 = 90;
/// Spacing of the bends, deg.
const BEND_STEP_DEG: usize = 5;
/// Spacing of the planes, deg.
const DELTA_STEP_DEG: usize = 5;

/// Line 1 at one pose, mm.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// Bend, deg.
    pub bend_deg: f64,
    /// Plane, deg.
    pub delta_deg: f64,
    /// q of Eq. (1).
    pub q_mm: f64,
    /// eps of Eqs. (15)-(17).
    pub eps_naive_mm: f64,
    /// eps of Eq. (18) with eta and lambda of Eq. (22), as printed.
    pub eps_printed_mm: f64,
    /// eps with the sign of motion while line 1 is pushed: eta of Eq. (22), half of its lambda.
    pub eps_pushed_mm: f64,
    /// The same while line 1 is drawn back.
    pub eps_drawn_mm: f64,
}

/// The workspace, one row of planes for each bend.
pub fn surface(snake: &Snake) -> Vec<Vec<Point>> {
    let row = |bend: u32| (0..=360_u32).step_by(DELTA_STEP_DEG).map(|delta| point(snake, bend, delta)).collect();
    (0..=BEND_TO_DEG).step_by(BEND_STEP_DEG).map(row).collect()
}

fn point(snake: &Snake, bend: u32, delta: u32) -> Point {
    let (bend_deg, delta_deg) = (f64::from(bend), f64::from(delta));
    let b: Vector2<f64> = bend_rad(bend_deg, delta_deg);
    let (eta, lambda_m) = (OF_EQ_22.0, PRINTED_LAMBDA_M);
    let signed = |s| snake.extension_with_signs(b, eta, 0.5 * lambda_m, &Vector3::repeat(s)).eps_m.x * 1e3;
    Point {
        bend_deg,
        delta_deg,
        q_mm: snake.q(b).x * 1e3,
        eps_naive_mm: snake.extension_naive(b).eps_m.x * 1e3,
        eps_printed_mm: snake.extension_as_printed(b, eta, lambda_m).eps_m.x * 1e3,
        eps_pushed_mm: signed(1.0),
        eps_drawn_mm: signed(-1.0),
    }
}

/// lambda of Eq. (22), m, with every printed digit.
const PRINTED_LAMBDA_M: f64 = 0.1778e-3;
