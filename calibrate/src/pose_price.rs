//! What a plan of guided poses is worth before a pose is read: the standard errors to expect of it, beside those of the full plan.

use crate::lines::Lines;
use crate::pose_plan::{Place, PosePlan, direction};
use crate::pose_reading::in_picture;
use nalgebra::{Matrix2, Vector2, Vector3};

/// The snake of which the errors are computed: the paper's eta, and half of its play, m.
const LIKE: [f64; 2] = [1.22, 0.089e-3];
/// Steps of both for slopes.
const STEPS: [f64; 2] = [1e-4, 1e-8];

/// Standard errors of eta, 1, and of the half-width, m.
pub(crate) type Expected = [f64; 2];

/// What all poses of a plan would give with bends of this standard deviation, rad; `None` where they determine nothing.
pub(crate) fn expected(plan: &PosePlan, lines: &Lines, sd_rad: f64) -> Option<Expected> {
    let is_front = !plan.front_deg().is_empty();
    let mut normal = Matrix2::zeros();
    for place in plan.places().iter().filter(|place| !place.passing && !place.check) {
        let slopes = slopes(place, lines)?;
        let rows: Vec<Vector2<f64>> = if is_front {
            let along = in_picture(place.plane_deg);
            vec![Vector2::new(slopes[0].dot(&along), slopes[1].dot(&along))]
        } else {
            (0..2).map(|k| Vector2::new(slopes[0][k], slopes[1][k])).collect()
        };
        normal += rows.iter().map(|row| row * row.transpose()).sum::<Matrix2<f64>>() / sd_rad.powi(2);
    }
    let scale = Matrix2::from_diagonal(&Vector2::from(STEPS));
    let covariance = scale * (scale * normal * scale).try_inverse()? * scale;
    Some([covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()])
}

/// How the predicted bend vector, rad, moves with eta, 1, and with the half-width, m, at a place of a plan.
fn slopes(place: &Place, lines: &Lines) -> Option<[Vector2<f64>; 2]> {
    let towards = direction(place.plane_deg);
    let bend_rad = towards * place.bend_deg.to_radians();
    let way = if place.from == "below" { 1.0 } else { -1.0 };
    let signs: Vector3<f64> = lines.motion(towards).map(|moved| way * moved.signum());
    let q_m = lines.encoders_m(bend_rad, &signs, LIKE[0], LIKE[1]);
    let at = |k: usize, side: f64| {
        let mut value = LIKE;
        value[k] += side * STEPS[k];
        lines.bend_rad(q_m, &signs, value[0], value[1])
    };
    let slope = |k: usize| Some((at(k, 1.0)? - at(k, -1.0)?) / (2.0 * STEPS[k]));
    Some([slope(0)?, slope(1)?])
}

/// The plan in words, and what it costs against the full one; nothing for the full one.
pub(crate) fn sentence(plan: &PosePlan, lines: &Lines, sd_rad: f64) -> Option<String> {
    if *plan == PosePlan::default() {
        return None;
    }
    let [own, full] = [*plan, PosePlan::default()].map(|plan| expected(&plan, lines, sd_rad));
    let (own, full) = (own?, full?);
    let places = plan.places();
    let n = |check: bool| places.iter().filter(|p| !p.passing && p.check == check).count();
    let of = match plan.front_deg() {
        [] => String::new(),
        planes => {
            let planes: Vec<String> = planes.iter().map(|plane_deg| format!("{plane_deg:.0}")).collect();
            format!(", seen from one side in the planes {} deg and across from them", planes.join(", "))
        }
    };
    Some(format!(
        "the plan has {} poses and {} for the check, bends up to {:.0} deg{of}; with every bend to {:.2} deg it gives eta to {:.4} and the \
         half-width to {:.4} mm, {:.2} and {:.2} times the standard errors of the full plan (six planes, both components, up to {:.0} deg)",
        n(false),
        n(true),
        plan.largest_deg(),
        sd_rad.to_degrees(),
        own[0],
        own[1] * 1e3,
        own[0] / full[0],
        own[1] / full[1],
        PosePlan::FULL_DEG
    ))
}
