//! Tip positions as a snake's bends: a tracker sees a marker on the tip in a frame of its own, and the motion says where that frame is.
//!
//! The end of a segment of constant curvature stays on a surface (Xu and Simaan 2006, the arc of eq. 1), so that a position in the
//! base frame is a bend. The bends then count as those of a camera do, in every fit and picture, but for what the frame leaves open.

mod align;
mod registration;
mod surface;

pub(crate) use align::{align, cannot};

use crate::{LabError, Measurements};
use krait_model::Snake;
use nalgebra::{Isometry3, Vector2, Vector3};
use registration::{Pair, is_mirrored, register};
use serde_json::{Value, json};
use surface::Surface;

/// Rows that are asked where the tracker stands; more say nothing more.
const ASKED: usize = 800;
/// Distance from the surface, beside how far the tip moves, from which on it is said, and from which on it is refused.
const OFF: f64 = 0.05;
const NOT_ON_IT: f64 = 0.3;
/// Share of the bends that must follow the commands.
const FOLLOWS: f64 = 0.5;

/// Columns of a tip's position.
pub(crate) const N_POS: usize = 3;

/// Where a tracker stands beside the base, as one recording's motion says.
#[derive(Clone, Debug, PartialEq)]
pub struct TipFrame {
    /// The recording.
    pub source: String,
    /// The recording's first trial.
    pub first_trial: u32,
    /// From the tracker's frame to the base's, m.
    pub base_from_tracker: Isometry3<f64>,
    /// How far the marker sits beyond the end disk's centre along its axis, m; `None` where the motion does not tell it.
    pub beyond_m: Option<f64>,
    /// How far it may be from there, m.
    pub beyond_bound_m: f64,
    /// Typical distance of the positions from the surface that the marker can reach, m.
    pub off_surface_m: f64,
    /// The same beside how far the tip moves (rms).
    pub off_part: f64,
    /// Share of the bends' variation that follows the model's bends.
    pub share: f64,
}

impl TipFrame {
    /// The same as JSON, lengths in m, the rotation as a quaternion w, x, y, z.
    pub fn to_json(&self) -> Value {
        let (origin, turn) = (&self.base_from_tracker.translation.vector, &self.base_from_tracker.rotation);
        json!({
            "recording": self.source,
            "tracker_in_base_m": [origin.x, origin.y, origin.z],
            "base_from_tracker_wxyz": [turn.w, turn.i, turn.j, turn.k],
            "marker_beyond_m": self.beyond_m,
            "marker_beyond_bound_m": self.beyond_bound_m,
            "off_surface_m": self.off_surface_m,
            "share": self.share,
        })
    }

    /// What was found, in a sentence.
    pub fn sentence(&self) -> String {
        let base_in_tracker_mm = 1e3 * self.base_from_tracker.inverse().translation.vector;
        let marker = match self.beyond_m {
            Some(beyond_m) => {
                format!("{:.2} mm beyond the end disk (give or take {:.2})", 1e3 * beyond_m, 1e3 * self.beyond_bound_m)
            }
            None => "in the end disk, since the motion does not tell where".to_owned(),
        };
        let off = format!("{:.3} mm off the surface that it can reach", 1e3 * self.off_surface_m);
        let doubt = match self.off_part > OFF {
            true => format!(
                " ({:.0} % of its motion: the curvature is not constant there, and the bends have that error)",
                100.0 * self.off_part
            ),
            false => String::new(),
        };
        format!(
            "{}: bends are those of the tip's positions; by the motion the base is at ({:.1}, {:.1}, {:.1}) mm in the tracker's frame and the \
             marker {marker}, {off}{doubt}; an offset of the bends, a turn of their plane and a gain that the marker's place makes cannot be told from where the \
             tracker stands",
            self.source, base_in_tracker_mm.x, base_in_tracker_mm.y, base_in_tracker_mm.z
        )
    }
}

/// The same measurements with bends for outputs, of those with tip positions for outputs.
///
/// `predicted_rad` are the bends that the model as given predicts for every row.
///
/// # Errors
/// [`LabError::Tip`] where the positions are no tip's of such a snake, or leave open where the tracker stands.
pub(crate) fn with_bends(snake: &Snake, predicted_rad: &[f64], data: Measurements) -> Result<Measurements, LabError> {
    let refuse = |why: String| Err(LabError::Tip { data: data.source.clone(), why });
    let scored: Vec<usize> = (0..data.n_rows()).filter(|row| data.is_scored(*row)).collect();
    let step = scored.len().div_ceil(ASKED).max(1);
    let pairs: Vec<Pair> = scored.iter().step_by(step).map(|row| pair(&data, predicted_rad, *row)).collect();
    let spread_m = spread_m(&pairs);
    if is_mirrored(snake, &pairs) {
        return refuse(
            "they follow the motion only as their mirror image, expected a right-handed frame and the lines in their order; exchange two axes or \
             two lines, or negate an axis"
                .to_owned(),
        );
    }
    let Some(found) = register(snake, &pairs).filter(|found| found.share.is_finite()) else {
        return refuse(
            "they leave open where the tracker stands, expected a motion in more than one direction; record one"
                .to_owned(),
        );
    };
    let off_part = found.off_surface_m / spread_m;
    if off_part > NOT_ON_IT {
        return refuse(format!(
            "they leave the surface that the tip of a segment of {:.1} mm can reach by {:.2} mm in a motion of {:.2} mm, expected less than a \
             third of it; check l_m of the model, the columns' unit and which column is which axis",
            1e3 * snake.l_m(),
            1e3 * found.off_surface_m,
            1e3 * spread_m
        ));
    }
    if found.share < FOLLOWS {
        return refuse(format!(
            "{:.0} % of their motion follows the lines, expected half of it; check the order and the sign of the lines, and that both are of \
             one motion",
            100.0 * found.share.max(0.0)
        ));
    }
    let surface = Surface { snake, beyond_m: found.beyond_m.unwrap_or(0.0) };
    let mut outputs = vec![f64::NAN; 2 * data.n_rows()];
    for row in scored {
        let at = found.base_from_tracker.rotation * position_m(&data, row) + found.base_from_tracker.translation.vector;
        outputs[2 * row..2 * row + 2].copy_from_slice(surface.seen(at).bend_rad.as_slice());
    }
    let frame = TipFrame {
        source: data.source.clone(),
        first_trial: 0,
        base_from_tracker: found.base_from_tracker,
        beyond_m: found.beyond_m,
        beyond_bound_m: found.beyond_bound_m,
        off_surface_m: found.off_surface_m,
        off_part,
        share: found.share,
    };
    let names = crate::Names { outputs: Vec::new(), ..data.names };
    Ok(Measurements { outputs, n_outputs: 2, names, tip_frames: vec![frame], ..data })
}

fn pair(data: &Measurements, predicted_rad: &[f64], row: usize) -> Pair {
    (position_m(data, row), Vector2::new(predicted_rad[2 * row], predicted_rad[2 * row + 1]))
}

fn position_m(data: &Measurements, row: usize) -> Vector3<f64> {
    Vector3::from_column_slice(data.output(row))
}

/// How far the positions are from their mean, rms, m.
fn spread_m(pairs: &[Pair]) -> f64 {
    let n = pairs.len() as f64;
    let mean = pairs.iter().map(|(point_m, _)| point_m).sum::<Vector3<f64>>() / n;
    (pairs.iter().map(|(point_m, _)| (point_m - mean).norm_squared()).sum::<f64>() / n).sqrt()
}
