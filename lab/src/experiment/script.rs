//! The motion of an experiment as a table that a chain, or the user's own controller, plays.

use super::ground::{Body, Ground, snake};
use crate::LabError;
use core::fmt::Write;
use nalgebra::{Vector2, Vector3};

/// How every script begins, by which it is known as one of the lab's.
pub const BEGINS: &str = "# The next experiment for the look-alikes of a diagnosis, from rest to rest:\n";

/// The script: of a snake in the columns of `krait run --master script`, of joints one column of commands each.
///
/// # Errors
/// [`LabError::Chain`] for a snake that a model file would refuse.
pub(super) fn script(ground: &Ground, words: &[String], path: &[Vec<f64>]) -> Result<String, LabError> {
    let mut text = BEGINS.to_owned();
    words.iter().for_each(|own| text += &format!("# - {own}\n"));
    match ground.body() {
        Body::Snake(machine) => {
            let snake = snake(machine)?;
            let tip = |bend: &Vec<f64>| snake.tip_pos_in_base_m(Vector2::new(bend[0], bend[1]));
            velocities(&mut text, &path.iter().map(tip).collect::<Vec<_>>(), ground.period_s);
        }
        Body::Joints { joints, .. } => {
            let name = |k: usize| format!("u{}_{}", k + 1, joints.u_unit);
            for k in 0..joints.n {
                text += &format!("# {}: {}\n", name(k), ground.input_name(k));
            }
            let head: Vec<String> = (0..joints.n).map(name).collect();
            text += &format!("time_s,{}\n", head.join(","));
            for (row, commands) in path.iter().enumerate() {
                let commands: Vec<String> = commands.iter().map(|own| format!("{own:.6}")).collect();
                text += &format!("{:.3},{}\n", row as f64 * ground.period_s, commands.join(","));
            }
        }
    }
    Ok(text)
}

/// Velocities of a snake's tip along its positions in the base frame, m.
fn velocities(text: &mut String, tip_m: &[Vector3<f64>], period_s: f64) {
    *text += "# Velocities of the tip in the view frame, for a view that is not rolled.\n\
              time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch\n";
    for (row, tip) in tip_m.iter().enumerate() {
        // Central differences: their trapezoids sum to the path.
        let before = tip_m.get(row.saturating_sub(1)).unwrap_or(tip);
        let after = tip_m.get(row + 1).unwrap_or(tip);
        let velocity = (after - before) / (2.0 * period_s);
        // Writing to a string cannot fail.
        let _ok =
            writeln!(text, "{:.2},{:.7},{:.7},{:.7},1,0", row as f64 * period_s, velocity.x, velocity.y, velocity.z);
    }
}
