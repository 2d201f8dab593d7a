//! Fine shapes of a snake's error that no effect of the library makes: each a few columns, so that two of them make a plain error and none
//! makes everything.
//!
//! Polar coordinates of the bend: along the bend and across it, waves in the plane of so many periods in a turn, products of the
//! components, and the area that the path has swept, which is what a plane remembers that slips as it rolls round. What a single effect of
//! the library makes alone (a shift, a turn, a twist, a scale, a cubic bend, a linear map) is not among them.

use crate::Problem;

/// The plane's waves have up to so many periods in a turn.
const MOST_WAVES: u32 = 8;

/// The columns of each shape of a snake whose bend is predicted, as outputs are laid out, without weights.
pub(super) fn fine_shapes(problem: &Problem, predicted: &[f64]) -> Vec<Vec<Vec<f64>>> {
    let poses = poses(problem, predicted);
    let one = |value: &dyn Fn(&Pose) -> [f64; 2]| column(&poses, value);
    let mut shapes = vec![
        vec![one(&|p| p.along(1.0))],
        vec![one(&|p| p.along(p.bend.powi(2)))],
        vec![one(&|p| p.along(p.bend.powi(4)))],
        vec![one(&|p| p.across(1.0))],
        vec![one(&|p| p.across(p.bend.powi(3)))],
    ];
    // Two periods that grow with the bend are a linear map, which effects make.
    let waves = (1..=MOST_WAVES).flat_map(|n| [(n, 1), (n, 2)]).filter(|own| *own != (2, 1));
    for (n, power) in waves {
        let wave = |side: fn(&Pose, f64) -> [f64; 2], part: fn(f64) -> f64| {
            one(&|p| side(p, p.bend.powi(power) * part(f64::from(n) * p.plane_rad)))
        };
        let sides: [fn(&Pose, f64) -> [f64; 2]; 2] = [Pose::along, Pose::across];
        shapes.push(sides.into_iter().flat_map(|side| [wave(side, f64::cos), wave(side, f64::sin)]).collect());
    }
    let products = |terms: &[fn(f64, f64) -> f64]| -> Vec<Vec<f64>> {
        let both = |term: &fn(f64, f64) -> f64| {
            [one(&|p| [term(p.at[0], p.at[1]), 0.0]), one(&|p| [0.0, term(p.at[0], p.at[1])])]
        };
        terms.iter().flat_map(both).collect()
    };
    shapes.push(products(&[|x, _| x * x, |x, y| x * y, |_, y| y * y]));
    shapes.push(products(&[|x, _| x.powi(3), |x, y| x * x * y, |x, y| x * y * y, |_, y| y.powi(3)]));
    shapes.push(vec![one(&|p| p.across(p.bend * p.swept[0])), one(&|p| p.across(p.bend * p.swept[1]))]);
    shapes
}

/// Where the snake is in a row.
struct Pose {
    /// The bend vector in units of its largest value.
    at: [f64; 2],
    /// Its length.
    bend: f64,
    plane_rad: f64,
    /// Twice the area that the path has swept about the straight pose: all of it, and what is left where it fades as the bend does.
    swept: [f64; 2],
}

impl Pose {
    /// A vector of this length along the bend.
    fn along(&self, length: f64) -> [f64; 2] {
        let (sin, cos) = self.plane_rad.sin_cos();
        // Near the straight pose the plane is anywhere.
        let length = length * (self.bend / STRAIGHT).min(1.0);
        [length * cos, length * sin]
    }

    /// The same across it.
    fn across(&self, length: f64) -> [f64; 2] {
        let [x, y] = self.along(length);
        [-y, x]
    }
}

/// A smaller part of the largest bend is straight.
const STRAIGHT: f64 = 0.02;

fn poses(problem: &Problem, predicted: &[f64]) -> Vec<Pose> {
    let scale = predicted.iter().fold(0.0_f64, |most, y| most.max(y.abs())).max(1e-12);
    let mut poses: Vec<Pose> = Vec::with_capacity(problem.data.n_rows());
    for (row, own) in predicted.chunks(2).enumerate() {
        let at = [own[0] / scale, own[1] / scale];
        let bend = at[0].hypot(at[1]);
        let swept = match poses.last() {
            Some(before) if !problem.data.starts_trial(row) => {
                let area = before.at[0] * at[1] - before.at[1] * at[0];
                let kept = if bend < before.bend { bend / before.bend } else { 1.0 };
                [before.swept[0] + area, before.swept[1] * kept + area]
            }
            _ => [0.0; 2],
        };
        poses.push(Pose { at, bend, plane_rad: at[1].atan2(at[0]), swept });
    }
    poses
}

fn column(poses: &[Pose], value: &dyn Fn(&Pose) -> [f64; 2]) -> Vec<f64> {
    poses.iter().flat_map(value).collect()
}
