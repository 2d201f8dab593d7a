//! One row of the table of guided poses.

use crate::pose_plan::{direction, picture_deg};
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// One row of the CSV.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseReading {
    /// Place in the plan, from 1.
    pub pose: u32,
    /// Whether it is kept for the check.
    pub check: bool,
    /// Planned plane, deg.
    pub plane_deg: f64,
    /// Planned bend, deg.
    pub bend_deg: f64,
    /// Measured bend vector, rad; NaN where a picture is yet to show it. Where it was seen from one side only: its component in the plane
    /// of the picture, which is `plane_deg` or the plane across from it, whichever is below 180 deg.
    pub b_x_rad: f64,
    /// Second component, rad; NaN where it was seen from one side only.
    pub b_y_rad: f64,
    /// Standard deviation of each component, rad.
    pub sd_rad: f64,
    /// Encoders, m, push positive.
    pub q1_m: f64,
    /// Line 2.
    pub q2_m: f64,
    /// Line 3.
    pub q3_m: f64,
    /// Direction in which line 1 moved last, 1 or -1.
    pub s1: f64,
    /// Line 2.
    pub s2: f64,
    /// Line 3.
    pub s3: f64,
    /// The picture that shows the bend; none: it was typed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Standard deviation of each component where the picture states its own, rad, without what all pictures share; never in the CSV.
    #[serde(skip)]
    pub sd_xy_rad: Option<[f64; 2]>,
    /// What the base that all pictures share makes of each component, rad; never in the CSV.
    #[serde(skip)]
    pub base_sd_xy_rad: Option<[f64; 2]>,
}

impl PoseReading {
    /// Whether its bend is known, or what one side shows of it.
    pub(crate) fn is_measured(&self) -> bool {
        self.b_x_rad.is_finite()
    }

    /// Components that are known.
    pub(crate) fn n_components(&self) -> usize {
        [self.b_x_rad, self.b_y_rad].into_iter().filter(|b| b.is_finite()).count()
    }

    pub(crate) fn sd_rad(&self) -> [f64; 2] {
        self.sd_xy_rad.unwrap_or([self.sd_rad; 2])
    }

    /// Measured minus predicted, rad, with its standard deviation, rad, for each component that is known.
    pub(crate) fn errors_rad(&self, predicted_rad: Vector2<f64>) -> Vec<(f64, f64)> {
        let [sd_x, sd_y] = self.sd_rad();
        if self.b_y_rad.is_finite() {
            return vec![(self.b_x_rad - predicted_rad.x, sd_x), (self.b_y_rad - predicted_rad.y, sd_y)];
        }
        vec![(self.b_x_rad - predicted_rad.dot(&in_picture(self.plane_deg)), sd_x)]
    }

    pub(crate) fn q_m(&self) -> Vector3<f64> {
        Vector3::new(self.q1_m, self.q2_m, self.q3_m)
    }

    pub(crate) fn signs(&self) -> Vector3<f64> {
        Vector3::new(self.s1, self.s2, self.s3)
    }
}

/// Where bends in a plane show as positive in a picture of it: the direction of the picture's plane.
pub(crate) fn in_picture(plane_deg: f64) -> Vector2<f64> {
    direction(picture_deg(plane_deg))
}
