//! Where guided poses go: planes, bends from below and from above, and the poses of the check.

/// Planes of the fit, deg: they balance an error of one line's zero.
const PLANES_DEG: [f64; 6] = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
/// Bends in each plane, deg.
const BENDS_DEG: [f64; 5] = [10.0, 22.5, 35.0, 47.5, 60.0];
/// Planes of a fit that rests on what is seen from the front only, deg: those that the picture shows. The check is then in the first.
const FRONT_PLANES_DEG: [f64; 2] = [0.0, 180.0];
/// The plane of the check, deg, and its bends.
const CHECK_PLANE_DEG: f64 = 45.0;
const CHECK_DEG: [f64; 3] = [20.0, 40.0, 50.0];
/// Bend the other way before each plane, deg.
const BEFORE_DEG: f64 = 30.0;
/// Bend beyond the largest before the way back, deg: lines 2 and 3 move half as far as line 1, and all have to turn.
const BEYOND_DEG: f64 = 16.0;
/// The same in the plane of the check, in which line 2 moves a quarter as far.
const CHECK_BEYOND_DEG: f64 = 26.0;

/// One place of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) plane_deg: f64,
    pub(crate) bend_deg: f64,
    /// Nothing is measured here.
    pub(crate) passing: bool,
    pub(crate) check: bool,
    pub(crate) from: &'static str,
}

/// Every place, in its order.
pub(crate) fn plan(front_only: bool) -> Vec<Place> {
    let mut places = Vec::new();
    let (planes_deg, check_deg): (&[f64], f64) =
        if front_only { (&FRONT_PLANES_DEG, FRONT_PLANES_DEG[0]) } else { (&PLANES_DEG, CHECK_PLANE_DEG) };
    for plane_deg in planes_deg {
        plane(&mut places, *plane_deg, &BENDS_DEG, false);
    }
    plane(&mut places, check_deg, &CHECK_DEG, true);
    places
}

fn plane(places: &mut Vec<Place>, plane_deg: f64, bends_deg: &[f64], check: bool) {
    let place = |bend_deg, passing, from| Place { plane_deg, bend_deg, passing, check, from };
    places.push(place(-BEFORE_DEG, true, ""));
    places.extend(bends_deg.iter().map(|b| place(*b, false, "below")));
    let top = bends_deg.iter().fold(0.0_f64, |m, b| m.max(*b));
    let beyond_deg = if check { CHECK_BEYOND_DEG } else { BEYOND_DEG };
    places.push(place(top + beyond_deg, true, ""));
    places.extend(bends_deg.iter().rev().map(|b| place(*b, false, "above")));
}
