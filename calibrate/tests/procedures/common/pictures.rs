//! Clicked points of pictures that are rendered with a camera of their own: a snake of known bend before graph paper.

use super::Noise;
use krait_calibrate::photo::{Click, ClickKind, PhotoView};
use nalgebra::{Rotation3, Vector2, Vector3};

/// Half of the disks' diameter and the backbone's length, mm.
const RADIUS_MM: f64 = 2.1;
const LENGTH_MM: f64 = 26.0;

/// A camera 300 mm away with 20 px/mm.
pub struct Camera {
    tilt: Rotation3<f64>,
    /// The paper is this far behind the snake, mm.
    behind_mm: f64,
}

impl Camera {
    pub fn new(tilt_deg: f64, behind_mm: f64) -> Self {
        let tilt = tilt_deg.to_radians();
        Self { tilt: Rotation3::from_euler_angles(tilt, tilt, 0.0), behind_mm }
    }

    /// A point (across, along, depth), mm; rows of a picture count downwards.
    fn see(&self, at: Vector3<f64>) -> Vector2<f64> {
        let turned = self.tilt * at;
        Vector2::new(turned.x, -turned.y) * (6000.0 / (300.0 + turned.z)) + Vector2::new(1500.0, 1800.0)
    }
}

/// One pose seen from one side: across is x, or y.
pub fn picture(
    image: &str,
    view: PhotoView,
    camera: &Camera,
    b: Vector2<f64>,
    px: f64,
    noise: &mut Noise,
) -> Vec<Click> {
    let size = b.norm();
    let direction = if size > 1e-9 { Vector2::new(b.x, -b.y) / size } else { Vector2::zeros() };
    let radius = if size > 1e-9 { LENGTH_MM / size } else { 0.0 };
    let out = radius * (1.0 - size.cos());
    let centre = Vector3::new(direction.x * out, direction.y * out, radius * size.sin());
    let normal = Vector3::new(direction.x * size.sin(), direction.y * size.sin(), size.cos());
    let across = |v: Vector3<f64>| if view == PhotoView::Front { v.x } else { v.y };
    // The outermost points of the end disk in this view: perpendicular to the apparent normal.
    let seen = Vector2::new(across(normal), normal.z);
    let apparent = seen / seen.norm();
    let edge = Vector2::new(apparent.y, -apparent.x) * RADIUS_MM;
    let end = Vector2::new(across(centre), centre.z);
    let mut clicks = Vec::new();
    let mut add = |kind, place: Option<(f64, f64)>, at: Vector3<f64>, px: f64| {
        let seen = camera.see(at) + Vector2::new(noise.next(), noise.next()) * px;
        let (x_mm, z_mm) = (place.map(|p| p.0), place.map(|p| p.1));
        clicks.push(Click { image: image.to_owned(), view, kind, x_mm, z_mm, u_px: seen.x, v_px: seen.y });
    };
    for column in 0..8 {
        for row in 0..8 {
            let (x, z) = (-15.0 + 5.0 * f64::from(column), -5.0 + 5.0 * f64::from(row));
            // A mirror shows the paper's own x the other way round.
            let printed = if view == PhotoView::Mirror { -x } else { x };
            add(ClickKind::Corner, Some((printed, z)), Vector3::new(x, z, camera.behind_mm), 0.6 * px);
        }
    }
    for at in [Vector2::new(-RADIUS_MM, 0.0), Vector2::new(RADIUS_MM, 0.0)] {
        add(ClickKind::Base, None, at.push(0.0), px);
    }
    for at in [end - edge, end + edge] {
        add(ClickKind::End, None, at.push(0.0), px);
    }
    clicks
}
