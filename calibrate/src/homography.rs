//! The map between a plane and its picture from points seen in both: normalised direct linear transform.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};

/// A plane seen by a camera without distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homography {
    picture_from_plane: Matrix3<f64>,
    plane_from_picture: Matrix3<f64>,
}

impl Homography {
    /// From at least four pairs (plane, picture), no three of them on a line; `None` where they determine no map.
    pub fn new(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Self> {
        let (plane, picture) = (normal(pairs.iter().map(|p| p.0))?, normal(pairs.iter().map(|p| p.1))?);
        let mut rows = DMatrix::zeros(2 * pairs.len().max(5), 9);
        for (k, (a, b)) in pairs.iter().enumerate() {
            let (a, b) = (plane * a.push(1.0), picture * b.push(1.0));
            for column in 0..3 {
                rows[(2 * k, column)] = a[column];
                rows[(2 * k, 6 + column)] = -b.x * a[column];
                rows[(2 * k + 1, 3 + column)] = a[column];
                rows[(2 * k + 1, 6 + column)] = -b.y * a[column];
            }
        }
        let svd = rows.svd(false, true);
        // A second direction that the rows hardly see: the points lie nearly on a line.
        let mut sizes: Vec<f64> = svd.singular_values.iter().copied().collect();
        sizes.sort_by(f64::total_cmp);
        if sizes[1] < 5e-3 * sizes[8] {
            return None;
        }
        let least = svd.singular_values.argmin().0;
        let v_t = svd.v_t?;
        let unit = Matrix3::from_fn(|i, k| v_t[(least, 3 * i + k)]);
        let picture_from_plane = picture.try_inverse()? * unit * plane;
        Some(Self { picture_from_plane, plane_from_picture: picture_from_plane.try_inverse()? })
    }

    /// Where a point of the picture lies in the plane.
    pub fn to_plane(self, at: Vector2<f64>) -> Vector2<f64> {
        divided(self.plane_from_picture * at.push(1.0))
    }

    /// Where a point of the plane is seen.
    pub fn to_picture(self, at: Vector2<f64>) -> Vector2<f64> {
        divided(self.picture_from_plane * at.push(1.0))
    }

    /// Distance of seen points from where the map puts them, root mean square over coordinates.
    pub fn rms(&self, pairs: &[(Vector2<f64>, Vector2<f64>)]) -> f64 {
        let square: f64 = pairs.iter().map(|(a, b)| (self.to_picture(*a) - b).norm_squared()).sum();
        (square / (2 * pairs.len()) as f64).sqrt()
    }
}

fn divided(v: Vector3<f64>) -> Vector2<f64> {
    v.xy() / v.z
}

/// Centre at zero and mean distance sqrt(2): the equations are then well conditioned.
fn normal(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count();
    if n < 4 {
        return None;
    }
    let centre = points.clone().sum::<Vector2<f64>>() / n as f64;
    let mean = points.map(|p| (p - centre).norm()).sum::<f64>() / n as f64;
    let scale = core::f64::consts::SQRT_2 / mean;
    scale.is_finite().then(|| Matrix3::new(scale, 0.0, -scale * centre.x, 0.0, scale, -scale * centre.y, 0.0, 0.0, 1.0))
}
