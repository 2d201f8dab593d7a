//! What a tracker in a frame of its own leaves open in every prediction: an offset of the bends, a turn of their plane, and the tracker's
//! tilt, which positions that are nearly on a sphere hardly tell. And how far the marker sits beyond the end disk, which makes a gain of
//! the bends, is known within bounds.
//!
//! They are solved for in each prediction, for each recording, so that no effect is found or hidden by where a tracker stands.

use super::surface::Surface;
use crate::Measurements;
use krait_model::Snake;
use krait_model::effects::EffectKind;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

/// Why an effect cannot be seen by a tracker in a frame of its own; `None` for one that can.
pub(crate) fn cannot(kind: EffectKind, data: &Measurements) -> Option<String> {
    let is_same = matches!(kind, EffectKind::CameraOffset | EffectKind::PlaneOffset | EffectKind::EncoderZero);
    (is_same && !data.tip_frames.is_empty()).then(|| "cannot be told from where the tip's tracker stands".to_owned())
}

/// What is open in every recording: the offset in x and y, the turn, the tilt about x and about y; and the marker's place, within bounds.
const OPEN: usize = 6;
const BEYOND: usize = 5;

/// Adds to predicted bends, row after row, what is open, so that they are nearest to the measured ones.
pub(crate) fn align(snake: &Snake, predicted_rad: &mut [f64], data: &Measurements) {
    for (k, frame) in data.tip_frames.iter().enumerate() {
        let row_of = |trial: u32| data.first_row_of(trial as usize);
        let end = data.tip_frames.get(k + 1).map_or(data.n_rows(), |next| row_of(next.first_trial));
        let rows = row_of(frame.first_trial)..end;
        let surface = Surface { snake, beyond_m: frame.beyond_m.unwrap_or(0.0) };
        let bend = |predicted: &[f64], row: usize| Vector2::new(predicted[2 * row], predicted[2 * row + 1]);
        let (mut gram, mut score, mut n) = (SMatrix::<f64, OPEN, OPEN>::zeros(), SVector::<f64, OPEN>::zeros(), 0.0);
        for row in rows.clone().filter(|row| data.is_scored(*row)) {
            let own = bend(predicted_rad, row);
            let columns = open_columns(&surface, own);
            gram += columns.transpose() * columns;
            score += columns.transpose() * (Vector2::from_column_slice(data.output(row)) - own);
            n += 1.0;
        }
        // A small motion does not tell a tilt from an offset, nor a plane that could be turned: so much of each is as good as none.
        gram += SMatrix::<f64, OPEN, OPEN>::from_diagonal_element(1e-9 * n);
        let Some(moved) = within(gram, score, frame.beyond_bound_m) else { continue };
        for row in rows {
            let own = bend(predicted_rad, row);
            let aligned = own + open_columns(&surface, own) * moved;
            predicted_rad[2 * row..2 * row + 2].copy_from_slice(aligned.as_slice());
        }
    }
}

/// The least squares, with the marker's place no further from where it was found than this; an effect that changes the gain by more is
/// seen but for so much.
fn within(
    mut gram: SMatrix<f64, OPEN, OPEN>,
    mut score: SVector<f64, OPEN>,
    bound_m: f64,
) -> Option<SVector<f64, OPEN>> {
    let moved = gram.cholesky()?.solve(&score);
    if moved[BEYOND].abs() <= bound_m {
        return Some(moved);
    }
    let held_m = bound_m.copysign(moved[BEYOND]);
    score -= gram.column(BEYOND) * held_m;
    gram.fill_row(BEYOND, 0.0);
    gram.fill_column(BEYOND, 0.0);
    (gram[(BEYOND, BEYOND)], score[BEYOND]) = (1.0, held_m);
    Some(gram.cholesky()?.solve(&score))
}

/// How the bend that a tracker shows changes with what is open, rad for each rad and each m. A tilt is one about the point about which the surface is nearly a
/// sphere: the positions hardly leave it so.
fn open_columns(surface: &Surface, bend_rad: Vector2<f64>) -> SMatrix<f64, 2, OPEN> {
    let mut columns = SMatrix::<f64, 2, OPEN>::zeros();
    columns[(0, 0)] = 1.0;
    columns[(1, 1)] = 1.0;
    columns[(0, 2)] = -bend_rad.y;
    columns[(1, 2)] = bend_rad.x;
    let along = surface.tangents_m(bend_rad);
    let from_centre = surface.point_in_base_m(bend_rad) - Vector3::z() * surface.centre_m();
    if let Some(inverse) = (along.transpose() * along).try_inverse() {
        // A marker further out, and the tracker so much nearer: the straight snake's marker stays where it is.
        let further = Vector3::z() - surface.axis(bend_rad);
        let moves = [Vector3::x().cross(&from_centre), Vector3::y().cross(&from_centre), further];
        for (k, own) in moves.iter().enumerate() {
            columns.set_column(3 + k, &(inverse * (along.transpose() * own)));
        }
    }
    columns
}
