//! Where guided poses go: planes, bends from below and from above, and the poses of the check.

use crate::CalibrateError;
use nalgebra::Vector2;

/// Planes of the fit, deg: they balance an error of one line's zero.
const PLANES_DEG: [f64; 6] = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
/// The plane of the check, deg; with pictures of single planes it is the first of them.
const CHECK_PLANE_DEG: f64 = 45.0;
/// Azimuths of the lines, deg.
const LINES_DEG: [f64; 3] = [0.0, 120.0, 240.0];
/// Bends of a plane, from the smallest (0) to the largest (1), and those of the check.
const PARTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
const CHECK_PARTS: [f64; 3] = [0.25, 0.75, 1.0];
/// Smallest bend that is measured, deg, and the largest, in the planes of the fit and in that of the check.
const SMALLEST_DEG: f64 = 10.0;
const TOP_DEG: f64 = 60.0;
const CHECK_TOP_DEG: f64 = 50.0;
/// The largest measured bend may not be nearer to straight than this, deg: less says nothing of eta.
const LEAST_TOP_DEG: f64 = 20.0;
/// Bend the other way before each plane, deg.
const BEFORE_DEG: f64 = 30.0;
/// Bend beyond the largest before the way back, deg: every line has to turn, also one that moves half as far as another.
const BEYOND_DEG: f64 = 16.0;
/// The same for a line that moves as far as one in the plane of the bend, deg: one that moves less needs more.
const TURN_DEG: f64 = 6.7;
/// A line that moves less than this part of the farthest would need too large a bend to turn.
const LEAST_MOTION: f64 = 0.25;
/// Planes of one camera.
const MOST_FRONT: usize = 6;

/// Which planes and how far: six planes up to 76 deg, or what one camera and the robot allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePlan {
    front_deg: [f64; MOST_FRONT],
    n_front: usize,
    largest_deg: f64,
}

impl Default for PosePlan {
    fn default() -> Self {
        Self { front_deg: [0.0; MOST_FRONT], n_front: 0, largest_deg: Self::FULL_DEG }
    }
}

impl PosePlan {
    /// The largest bend of the full plan, deg: beyond the largest that is measured, before the way back.
    pub const FULL_DEG: f64 = TOP_DEG + BEYOND_DEG;

    /// A plan for one camera that shows these planes, deg, one after the other (none: both components of every bend are seen), and a
    /// robot that bends so far, deg.
    ///
    /// # Errors
    /// [`CalibrateError::Setting`]: a plane in which a line does not move, or a bend that leaves too little to be measured.
    pub fn new(front_deg: &[f64], largest_deg: f64) -> Result<Self, CalibrateError> {
        let refused = |name, found, expected| Err(CalibrateError::Setting { name, found, expected });
        let mut own = Self { largest_deg, ..Self::default() };
        for (k, plane_deg) in front_deg.iter().copied().enumerate() {
            if !(0.0..180.0).contains(&plane_deg) {
                let expected =
                    "0 to less than 180 deg, since a picture that shows a plane also shows the one across from it";
                return refused("a plane of --front", plane_deg, expected);
            }
            if least_motion(plane_deg) < LEAST_MOTION {
                let expected = "one that is 15 deg or more away from 30, 90 and 150 deg, where one line does not move";
                return refused("a plane of --front", plane_deg, expected);
            }
            if front_deg[..k].iter().any(|other| (other - plane_deg).abs() < 1.0) {
                return refused("a plane of --front", plane_deg, "each plane once");
            }
            let Some(place) = own.front_deg.get_mut(k) else {
                return refused("the number of planes of --front", front_deg.len() as f64, "6 at most");
            };
            *place = plane_deg;
            own.n_front += 1;
        }
        let is_short = |(plane_deg, check)| own.top_deg(plane_deg, check) < LEAST_TOP_DEG;
        if largest_deg.is_nan() || largest_deg > Self::FULL_DEG || own.planes().into_iter().any(is_short) {
            let expected = "46 to 76 deg, or from 36 deg on with --front 0, 60 or 120, so that every line turns";
            return refused("the largest bend (--largest-deg)", largest_deg, expected);
        }
        Ok(own)
    }

    /// Planes that the pictures show, deg; none if both components of every bend are seen.
    pub fn front_deg(&self) -> &[f64] {
        &self.front_deg[..self.n_front]
    }

    /// The largest bend, deg.
    pub fn largest_deg(&self) -> f64 {
        self.largest_deg
    }

    /// Poses that are measured, those of the check included.
    pub fn n_poses(&self) -> usize {
        self.places().iter().filter(|place| !place.passing).count()
    }

    /// Every plane in its order, deg, and whether it is for the check.
    fn planes(&self) -> Vec<(f64, bool)> {
        let front = self.front_deg();
        let mut planes: Vec<(f64, bool)> = match front {
            [] => PLANES_DEG.iter().map(|plane_deg| (*plane_deg, false)).collect(),
            _ => front.iter().flat_map(|plane_deg| [(*plane_deg, false), (plane_deg + 180.0, false)]).collect(),
        };
        planes.push((front.first().copied().unwrap_or(CHECK_PLANE_DEG), true));
        planes
    }

    /// The largest bend that is measured in a plane, deg.
    fn top_deg(&self, plane_deg: f64, check: bool) -> f64 {
        (self.largest_deg - beyond_deg(plane_deg)).min(if check { CHECK_TOP_DEG } else { TOP_DEG })
    }

    /// Every place, in its order.
    pub(crate) fn places(&self) -> Vec<Place> {
        let mut places = Vec::new();
        for (plane_deg, check) in self.planes() {
            let place = |bend_deg, passing, from| Place { plane_deg, bend_deg, passing, check, from };
            let parts: &[f64] = if check { &CHECK_PARTS } else { &PARTS };
            let top_deg = self.top_deg(plane_deg, check);
            let bends_deg = parts.iter().map(|part| SMALLEST_DEG + part * (top_deg - SMALLEST_DEG));
            places.push(place(-BEFORE_DEG, true, ""));
            places.extend(bends_deg.clone().map(|bend_deg| place(bend_deg, false, "below")));
            places.push(place(top_deg + beyond_deg(plane_deg), true, ""));
            places.extend(bends_deg.rev().map(|bend_deg| place(bend_deg, false, "above")));
        }
        places
    }
}

/// How far the line that moves least moves in a plane, as a part of one that lies in it.
fn least_motion(plane_deg: f64) -> f64 {
    LINES_DEG.iter().map(|line_deg| (line_deg + plane_deg).to_radians().cos().abs()).fold(f64::INFINITY, f64::min)
}

fn beyond_deg(plane_deg: f64) -> f64 {
    (TURN_DEG / least_motion(plane_deg)).max(BEYOND_DEG)
}

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

impl Place {
    /// The plane that a picture from one side shows here, deg: this one, or the one across from it.
    pub(crate) fn picture_deg(&self) -> f64 {
        picture_deg(self.plane_deg)
    }
}

/// The direction of a plane, of length 1.
pub(crate) fn direction(plane_deg: f64) -> Vector2<f64> {
    let (sin, cos) = plane_deg.to_radians().sin_cos();
    Vector2::new(cos, sin)
}

/// The plane of the picture in which a plane lies, deg.
pub(crate) fn picture_deg(plane_deg: f64) -> f64 {
    plane_deg.rem_euclid(180.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_full_plan_is_six_planes_up_to_76_deg_and_the_check() {
        let places = PosePlan::default().places();
        let measured = |check| places.iter().filter(move |p| !p.passing && p.check == check);
        assert_eq!((measured(false).count(), measured(true).count()), (60, 6));
        let bends: Vec<f64> = measured(false).take(5).map(|p| p.bend_deg).collect();
        assert_eq!(bends, [10.0, 22.5, 35.0, 47.5, 60.0]);
        let bends: Vec<f64> = measured(true).take(3).map(|p| p.bend_deg).collect();
        assert_eq!(bends, [20.0, 40.0, 50.0]);
        let largest = places.iter().map(|p| p.bend_deg).fold(0.0, f64::max);
        assert!((largest - PosePlan::FULL_DEG).abs() < 0.05, "{largest}");
    }

    #[test]
    fn every_line_turns_in_every_plane_and_no_bend_is_larger_than_allowed() {
        for (front, largest_deg) in
            [(&[][..], 46.0), (&[][..], 60.0), (&[0.0, 60.0, 120.0][..], 36.0), (&[15.0, 105.0][..], 50.0)]
        {
            let plan = PosePlan::new(front, largest_deg).expect("a plan");
            for place in plan.places() {
                assert!(place.bend_deg <= largest_deg + 1e-9, "{front:?}: {place:?}");
                assert!(front.is_empty() || front.contains(&place.picture_deg()), "{place:?}");
            }
            let above = plan.places().windows(2).filter(|p| p[0].passing && p[1].from == "above").count();
            assert_eq!(above, plan.planes().len());
        }
    }

    #[test]
    fn planes_in_which_a_line_stands_still_and_bends_too_small_are_refused_in_one_sentence() {
        for (front, largest_deg, words) in [
            (&[30.0][..], 76.0, "where one line does not move"),
            (&[0.0, 100.0][..], 76.0, "where one line does not move"),
            (&[200.0][..], 76.0, "across from it"),
            (&[60.0, 60.0][..], 76.0, "each plane once"),
            (&[0.0, 5.0, 10.0, 45.0, 60.0, 70.0, 120.0][..], 76.0, "6 at most"),
            (&[][..], 40.0, "46 to 76 deg"),
            (&[0.0][..], 35.0, "from 36 deg on"),
            (&[][..], 90.0, "46 to 76 deg"),
            (&[][..], f64::NAN, "46 to 76 deg"),
        ] {
            let sentence = PosePlan::new(front, largest_deg).expect_err("refused").to_string();
            assert!(sentence.contains(words) && !sentence.contains('\n'), "{sentence}");
        }
    }
}
