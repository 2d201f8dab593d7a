//! Where a tracker stands beside the base: rotation, origin and the marker's place on the axis, from a motion that the model knows in part.
//!
//! Two things are known of every position. It lies on the [`Surface`] that the tip can reach, to the tracker's noise. And its bend is
//! about a gain times the bend that the model predicts, and an offset that is probably small: friction, play and whatever else is missing
//! stand between them. The first is worth much more than the second, and how much, the residuals say. Only a small motion, whose piece of
//! the surface is as good as flat, leaves it to the second how the tracker is tilted.

use super::surface::{Seen, Surface};
use krait_model::Snake;
use nalgebra::{
    Isometry3, Matrix2, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector2, Vector3,
};

/// Turn and shift of the tracker, the gain from predicted to seen bends with its two shears, their offset, the marker's place on the axis.
const N: usize = 12;
const GAIN: usize = 6;
const OFFSET: usize = 9;
const BEYOND: usize = 11;
/// Steps for each weighing of both sorts of residuals, and weighings.
const STEPS: usize = 25;
const WEIGHINGS: usize = 8;
/// Standard deviations of what is known beforehand: of the gain around one, of its shears, of the offset, of the marker's place in segment
/// lengths.
const GAIN_SD: f64 = 0.5;
const SHEAR_SD: f64 = 0.1;
const OFFSET_SD_RAD: f64 = 0.1;
const BEYOND_SD_L: f64 = 0.1;
/// The marker's place is told where it is known to this part of the segment.
const TOLD_L: f64 = 0.02;
/// Standard errors that are believed at most: neighbouring residuals are alike, and the surface is no machine's to the last digit.
const WITHIN: f64 = 5.0;
/// Residuals beyond so many standard deviations pull no more than at it (Huber).
const HUBER: f64 = 2.0;
/// Distance from the surface that is rounding, m, and the least part of the other residuals.
const LEAST_M: f64 = 1e-7;
const LEAST_PART: f64 = 1e-3;

/// A position in the tracker's frame, m, and the bend that the model predicts there, rad.
pub(super) type Pair = (Vector3<f64>, Vector2<f64>);

/// Where the tracker stands.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Registration {
    pub base_from_tracker: Isometry3<f64>,
    /// Marker beyond the end disk, m; `None` where the motion does not tell it, and it is taken for the disk's centre.
    pub beyond_m: Option<f64>,
    /// How far it may be from there, m.
    pub beyond_bound_m: f64,
    /// Typical distance from the surface, m (from the median).
    pub off_surface_m: f64,
    /// Share of the bends' variation that is the gain times the predicted ones.
    pub share: f64,
}

/// Finds it; `None` where the positions leave it open.
pub(super) fn register(snake: &Snake, pairs: &[Pair]) -> Option<Registration> {
    let base_from_tracker = aligned(snake, pairs, Handed::Right)?.0;
    let start = State { base_from_tracker, gain: Vector3::x(), offset_rad: Vector2::zeros(), beyond_m: 0.0 };
    let (free, se_m) = Fit { snake, pairs, is_beyond_free: true }.run(start)?;
    let is_told = se_m < TOLD_L * snake.l_m();
    let (state, beyond_m, beyond_bound_m) = match is_told {
        true => (free, Some(free.beyond_m), se_m),
        false => (Fit { snake, pairs, is_beyond_free: false }.run(start)?.0, None, BEYOND_SD_L * snake.l_m()),
    };
    let seen: Vec<(Seen, Vector2<f64>)> =
        pairs.iter().map(|(point_m, bend)| (state.seen(snake, point_m), state.expected(bend))).collect();
    let n = seen.len() as f64;
    let mean = seen.iter().map(|(own, _)| own.bend_rad).sum::<Vector2<f64>>() / n;
    let whole: f64 = seen.iter().map(|(own, _)| (own.bend_rad - mean).norm_squared()).sum();
    let left: f64 = seen.iter().map(|(own, expected)| (own.bend_rad - expected).norm_squared()).sum();
    Some(Registration {
        base_from_tracker: state.base_from_tracker,
        beyond_m,
        beyond_bound_m,
        off_surface_m: typical(seen.iter().map(|(own, _)| own.off_m)),
        share: 1.0 - left / whole,
    })
}

/// Whether the positions are those of a mirrored frame: they suit the predicted ones much better so.
pub(super) fn is_mirrored(snake: &Snake, pairs: &[Pair]) -> bool {
    let left = |handed| aligned(snake, pairs, handed).map_or(f64::INFINITY, |(_, left)| left);
    // Squares: half of the distances.
    left(Handed::Left) < 0.25 * left(Handed::Right)
}

#[derive(Clone, Copy, PartialEq)]
enum Handed {
    Right,
    Left,
}

/// The rigid motion that takes the positions nearest to the predicted ones (Kabsch), and the squares that it leaves, m^2. Of a
/// left-handed frame the motion is that of the mirrored positions.
fn aligned(snake: &Snake, pairs: &[Pair], handed: Handed) -> Option<(Isometry3<f64>, f64)> {
    let mirror = |point: &Vector3<f64>| if handed == Handed::Left { -point } else { *point };
    let n = pairs.len() as f64;
    let surface = Surface { snake, beyond_m: 0.0 };
    let both: Vec<(Vector3<f64>, Vector3<f64>)> =
        pairs.iter().map(|(point_m, bend)| (mirror(point_m), surface.point_in_base_m(*bend))).collect();
    let (seen_mean, base_mean) = (
        both.iter().map(|(seen, _)| seen).sum::<Vector3<f64>>() / n,
        both.iter().map(|(_, base)| base).sum::<Vector3<f64>>() / n,
    );
    let cross: Matrix3<f64> = both.iter().map(|(seen, base)| (base - base_mean) * (seen - seen_mean).transpose()).sum();
    let svd = cross.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let sign = (u * v_t).determinant().signum();
    let turn = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t);
    let origin = base_mean - turn * seen_mean;
    let left = both.iter().map(|(seen, base)| (turn * seen + origin - base).norm_squared()).sum();
    Some((Isometry3::from_parts(Translation3::from(origin), UnitQuaternion::from_rotation_matrix(&turn)), left))
}

/// What is looked for.
#[derive(Clone, Copy, Debug)]
struct State {
    base_from_tracker: Isometry3<f64>,
    /// Gain, and how much more it is along x than along y and along the diagonal.
    gain: Vector3<f64>,
    offset_rad: Vector2<f64>,
    beyond_m: f64,
}

impl State {
    fn seen(&self, snake: &Snake, point_m: &Vector3<f64>) -> Seen {
        let at = self.base_from_tracker.rotation * point_m + self.base_from_tracker.translation.vector;
        Surface { snake, beyond_m: self.beyond_m }.seen(at)
    }

    fn expected(&self, bend_rad: &Vector2<f64>) -> Vector2<f64> {
        let (gain, shear, skew) = (self.gain.x, self.gain.y, self.gain.z);
        Matrix2::new(gain + shear, skew, skew, gain - shear) * bend_rad + self.offset_rad
    }

    /// The state after a step; turns about the base's axes, before the shift.
    fn moved(&self, step: &SVector<f64, N>) -> Self {
        let own = &self.base_from_tracker;
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        let shift = own.translation.vector + step.fixed_rows::<3>(3);
        Self {
            base_from_tracker: Isometry3::from_parts(Translation3::from(shift), turn * own.rotation),
            gain: self.gain + step.fixed_rows::<3>(GAIN),
            offset_rad: self.offset_rad + step.fixed_rows::<2>(OFFSET),
            beyond_m: self.beyond_m + step[BEYOND],
        }
    }
}

struct Fit<'a> {
    snake: &'a Snake,
    pairs: &'a [Pair],
    is_beyond_free: bool,
}

impl Fit<'_> {
    /// The state that fits best, and how far the marker may be from its place in it, m.
    fn run(&self, start: State) -> Option<(State, f64)> {
        let mut state = start;
        let mut information = SMatrix::<f64, N, N>::zeros();
        let mut scales = self.scales(&state);
        // Both sorts alike at first: neither is known yet.
        scales[1] = scales[0].max(scales[1]);
        for _ in 0..WEIGHINGS {
            (state, information) = self.descend(state, scales)?;
            scales = self.scales(&state);
        }
        let covariance = information.try_inverse()?;
        Some((state, WITHIN * covariance[(BEYOND, BEYOND)].sqrt()))
    }

    /// Typical residuals: along the surface and off it, m.
    fn scales(&self, state: &State) -> [f64; 2] {
        let all: Vec<Vector3<f64>> = self.pairs.iter().map(|pair| self.residual_m(state, pair)).collect();
        let along = typical(all.iter().flat_map(|own| [own.x, own.y])).max(LEAST_M);
        [along, typical(all.iter().map(|own| own.z)).max(LEAST_M).max(LEAST_PART * along)]
    }

    /// Two residuals along the surface and one off it, m.
    fn residual_m(&self, state: &State, (point_m, bend_rad): &Pair) -> Vector3<f64> {
        let seen = state.seen(self.snake, point_m);
        // A tip near the straight pose moves by half of the length for each radian.
        let along = (seen.bend_rad - state.expected(bend_rad)) * (0.5 * self.snake.l_m());
        Vector3::new(along.x, along.y, seen.off_m)
    }

    /// Gauss and Newton's steps, damped where one makes it worse (Levenberg and Marquardt).
    fn descend(&self, start: State, scales: [f64; 2]) -> Option<(State, SMatrix<f64, N, N>)> {
        let (mut state, mut damping) = (start, 1e-6);
        let mut cost = self.cost(&state, scales);
        let (mut gradient, mut information) = self.normal(&state, scales);
        for _ in 0..STEPS {
            let mut damped = information;
            damped.set_diagonal(&(information.diagonal() * (1.0 + damping)));
            let step = -damped.cholesky()?.solve(&gradient);
            let next = state.moved(&step);
            let next_cost = self.cost(&next, scales);
            if next_cost.is_nan() || next_cost > cost {
                damping *= 10.0;
                continue;
            }
            let is_end = cost - next_cost < 1e-10 * cost;
            (state, cost, damping) = (next, next_cost, 0.1 * damping);
            (gradient, information) = self.normal(&state, scales);
            if is_end {
                break;
            }
        }
        Some((state, information))
    }

    /// What is known beforehand: each parameter's distance from its likely value in standard deviations, and their reciprocals.
    fn prior(&self, state: &State) -> [(usize, f64, f64); 6] {
        let beyond_sd_m = if self.is_beyond_free { BEYOND_SD_L * self.snake.l_m() } else { LEAST_M };
        let of = |k, apart: f64, sd: f64| (k, apart / sd, sd.recip());
        [
            of(GAIN, state.gain.x - 1.0, GAIN_SD),
            of(GAIN + 1, state.gain.y, SHEAR_SD),
            of(GAIN + 2, state.gain.z, SHEAR_SD),
            of(OFFSET, state.offset_rad.x, OFFSET_SD_RAD),
            of(OFFSET + 1, state.offset_rad.y, OFFSET_SD_RAD),
            of(BEYOND, state.beyond_m, beyond_sd_m),
        ]
    }

    fn scaled(&self, state: &State, pair: &Pair, [along_m, off_m]: [f64; 2]) -> Vector3<f64> {
        self.residual_m(state, pair).component_div(&Vector3::new(along_m, along_m, off_m))
    }

    fn cost(&self, state: &State, scales: [f64; 2]) -> f64 {
        let huber = |r: f64| if r.abs() <= HUBER { 0.5 * r * r } else { HUBER * (r.abs() - 0.5 * HUBER) };
        let rows: f64 =
            self.pairs.iter().map(|pair| self.scaled(state, pair, scales).iter().map(|r| huber(*r)).sum::<f64>()).sum();
        rows + self.prior(state).iter().map(|(_, apart, _)| 0.5 * apart * apart).sum::<f64>()
    }

    /// Gradient and information (J' W J) of the cost.
    fn normal(&self, state: &State, scales: [f64; 2]) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        // Angles, metres, ratios: each by a step of its own size.
        let sizes: [f64; N] = core::array::from_fn(|k| match k {
            0..3 | GAIN..BEYOND => 1e-6,
            _ => 1e-6 * self.snake.l_m(),
        });
        let (mut gradient, mut information) = (SVector::zeros(), SMatrix::zeros());
        let moved: Vec<[State; 2]> = sizes
            .iter()
            .enumerate()
            .map(|(k, size)| [*size, -size].map(|size| state.moved(&(SVector::<f64, N>::ith(k, size)))))
            .collect();
        for pair in self.pairs {
            let here = self.scaled(state, pair, scales);
            let mut j = SMatrix::<f64, 3, N>::zeros();
            for ((mut column, [ahead, behind]), size) in j.column_iter_mut().zip(&moved).zip(sizes) {
                let change = self.scaled(ahead, pair, scales) - self.scaled(behind, pair, scales);
                column.copy_from(&(change / (2.0 * size)));
            }
            for (r, row) in here.iter().zip(j.row_iter()) {
                let weight = if r.abs() <= HUBER { 1.0 } else { HUBER / r.abs() };
                gradient += row.transpose() * (weight * r);
                information += row.transpose() * row * weight;
            }
        }
        for (k, apart, per_unit) in self.prior(state) {
            gradient[k] += apart * per_unit;
            information[(k, k)] += per_unit * per_unit;
        }
        (gradient, information)
    }
}

/// Standard deviation of a normal distribution with the same median magnitude.
fn typical(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.map(f64::abs).collect();
    all.sort_by(f64::total_cmp);
    1.4826 * all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}
