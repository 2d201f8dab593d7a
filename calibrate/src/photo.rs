//! The bend from photographs of the snake before graph paper: clicked points in, bend vectors with standard errors out.
//!
//! Each view has grid corners with their millimetres, and both edges of the base disk and of the end disk. The homography of the
//! corners takes the edges into the paper's plane. The base's line is the mean over all pictures of a session and view. Two
//! estimates: the angle of the end disk's line against the base's (edge), and twice the angle of the line from base to end disk
//! (chord), which is the bend if the curvature is constant. Views from the front (x, z) and the side (y, z), or a mirror at
//! 45 deg whose x is turned over, give both components of the bend vector.
//!
//! Errors come from the stated standard deviation of a click, carried through every formula by differences; the two estimates
//! are combined with their joint covariance, so that an edge seen end-on near 90 deg loses its weight by itself.

use crate::CalibrateError;
use crate::homography::Homography;
use crate::log::{MOST_BYTES, file_error, rows};
use krait_ipc::input;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Matrix4x2, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Grid corners that a picture needs at least.
const FEWEST_CORNERS: usize = 12;
/// Corners may be seen this far from where the homography puts them, px rms.
const MAX_REPROJECTION_PX: f64 = 0.5;
/// Two edges of a disk are farther apart than this, px.
const NEAREST_EDGES_PX: f64 = 2.0;
/// Standard deviations between edge and chord beyond which the curvature is not constant.
const PLAUSIBLE: f64 = 3.0;
/// A bend of fewer standard deviations than this has no plane: its delta would be 20 deg off, or anything.
const HAS_PLANE: f64 = 3.0;

/// From where a picture was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PhotoView {
    /// The plane of x and z.
    Front,
    /// The plane of y and z.
    Side,
    /// The plane of y and z in a mirror at 45 deg, whose paper runs the other way.
    Mirror,
}

/// What was clicked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClickKind {
    /// A corner of the grid, with its millimetres.
    Corner,
    /// An edge of the base disk; two of them, in the order of the paper's x.
    Base,
    /// An edge of the end disk; two of them, in the same order.
    End,
}

/// One clicked point: a row of the CSV.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Click {
    /// The picture; front and side of one pose share its name.
    pub image: String,
    /// From where.
    pub view: PhotoView,
    /// What.
    pub kind: ClickKind,
    /// Across, on the paper, mm; for corners only.
    pub x_mm: Option<f64>,
    /// Along the base's axis, on the paper, mm; for corners only.
    pub z_mm: Option<f64>,
    /// Column in the picture, px.
    pub u_px: f64,
    /// Row in the picture, px.
    pub v_px: f64,
}

/// One pose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bend {
    /// The picture.
    pub image: String,
    /// Bend vector, rad; the second component is NaN if there is one view only.
    pub b_x_rad: f64,
    /// Second component, rad.
    pub b_y_rad: f64,
    /// Standard deviations, rad.
    pub sd_x_rad: f64,
    /// Second one, rad.
    pub sd_y_rad: f64,
    /// The part of the first that the base makes, rad: all bends of a session begin at it and share that error.
    pub base_sd_x_rad: f64,
    /// Of the second, rad.
    pub base_sd_y_rad: f64,
    /// Size of the bend by the edge alone, rad.
    pub edge_rad: f64,
    /// Size of the bend by the chord alone, rad.
    pub chord_rad: f64,
    /// Distance of the two in standard deviations.
    pub apart_sd: f64,
}

impl Bend {
    /// Whether edge and chord agree, as they do for constant curvature.
    pub fn plausible(&self) -> bool {
        self.apart_sd.abs() <= PLAUSIBLE
    }

    /// Whether the bend is large enough to have a plane; without one its delta means nothing.
    pub fn has_plane(&self) -> bool {
        let size = self.b_x_rad.hypot(self.b_y_rad);
        size > HAS_PLANE * self.sd_x_rad.max(self.sd_y_rad)
    }

    /// The pose in words.
    pub fn sentence(&self) -> String {
        let deg = f64::to_degrees;
        let word = if self.plausible() { "plausible" } else { "edge and chord disagree: curvature is not constant" };
        let size = format!("(edge {:.1}, chord {:.1})", deg(self.edge_rad), deg(self.chord_rad));
        if self.b_y_rad.is_nan() {
            let (b, sd) = (deg(self.b_x_rad), deg(self.sd_x_rad));
            return format!("{}: bend in the picture {b:.1} +- {sd:.1} {size} deg, delta not seen; {word}", self.image);
        }
        let (x, y) = (self.b_x_rad, self.b_y_rad);
        let b = x.hypot(y);
        if !self.has_plane() {
            let sd = self.sd_x_rad.max(self.sd_y_rad);
            let apart = if self.plausible() { "" } else { "; edge and chord disagree" };
            return format!(
                "{}: bend {:.1} +- {:.1} {size} deg, too small to have a plane: delta is not determined{apart}",
                self.image,
                deg(b),
                deg(sd)
            );
        }
        let along = (x * self.sd_x_rad).hypot(y * self.sd_y_rad) / b;
        let across = (y * self.sd_x_rad).hypot(x * self.sd_y_rad) / b;
        format!(
            "{}: bend {:.1} +- {:.1} {size}, delta {:.1} +- {:.1} deg; {word}",
            self.image,
            deg(b),
            deg(along),
            deg(y.atan2(x)),
            deg(across / b)
        )
    }
}

/// Reads a CSV of clicks.
///
/// # Errors
/// [`CalibrateError::File`] and [`CalibrateError::Row`].
pub fn read(path: &Path) -> Result<Vec<Click>, CalibrateError> {
    let text = input::text(path, MOST_BYTES).map_err(|e| file_error(path, "read", &e))?;
    let clicks: Vec<Click> = rows(path, &text)?;
    if clicks.is_empty() {
        let reason = "there is no click under the header, expected at least one picture's".to_owned();
        return Err(CalibrateError::Row { file: path.display().to_string(), row: 2, reason });
    }
    Ok(clicks)
}

/// The bends as a table, a column for each of their numbers; empty where not seen.
pub fn table(bends: &[Bend]) -> String {
    let mut text = String::from(
        "image,b_x_rad,b_y_rad,sd_x_rad,sd_y_rad,base_sd_x_rad,base_sd_y_rad,edge_rad,chord_rad,apart_sd\n",
    );
    for b in bends {
        let numbers = [
            b.b_x_rad,
            b.b_y_rad,
            b.sd_x_rad,
            b.sd_y_rad,
            b.base_sd_x_rad,
            b.base_sd_y_rad,
            b.edge_rad,
            b.chord_rad,
            b.apart_sd,
        ];
        let cells = numbers.map(|v| if v.is_finite() { format!("{v:.8}") } else { String::new() });
        text += &format!("\"{}\",{}\n", b.image.replace('"', "\"\""), cells.join(","));
    }
    text
}

/// One view: its map, and both edges of both disks in the picture.
struct Seen {
    image: String,
    view: PhotoView,
    homography: Homography,
    base_px: [Vector2<f64>; 2],
    end_px: [Vector2<f64>; 2],
}

/// What the pictures of a session gave.
#[derive(Debug)]
pub struct PhotoSession {
    /// The bends of all that can be used.
    pub bends: Vec<Bend>,
    /// Why each of the others was left out; its base is in no mean.
    pub left_out: Vec<CalibrateError>,
}

/// Bends of every picture that can be used; `click_sd_px` is the standard deviation of an edge in each coordinate. A picture without
/// enough points, or whose corners do not lie on a plane grid, is left out.
///
/// # Errors
/// [`CalibrateError::Setting`] for the standard deviation; the first picture's [`CalibrateError::NotDetermined`] where none can be used.
pub fn bends(clicks: &[Click], click_sd_px: f64) -> Result<PhotoSession, CalibrateError> {
    if !(click_sd_px > 0.0 && click_sd_px < 100.0) {
        return Err(CalibrateError::Setting {
            name: "click_sd_px",
            found: click_sd_px,
            expected: "more than 0, less than 100 px",
        });
    }
    let mut images: Vec<&str> = Vec::new();
    for click in clicks {
        if !images.contains(&click.image.as_str()) {
            images.push(&click.image);
        }
    }
    let (mut seen, mut bends, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    images.retain(|image| match views(image, clicks) {
        Ok(views) => {
            seen.extend(views);
            true
        }
        Err(error) => {
            left_out.push(error);
            false
        }
    });
    for image in &images {
        match bend(image, &seen, click_sd_px) {
            Ok(bend) => bends.push(bend),
            Err(error) => left_out.push(error),
        }
    }
    if bends.is_empty() && !left_out.is_empty() {
        return Err(left_out.swap_remove(0));
    }
    Ok(PhotoSession { bends, left_out })
}

/// Every view of one picture, or why it cannot be used.
fn views(image: &str, clicks: &[Click]) -> Result<Vec<Seen>, CalibrateError> {
    let mut seen = Vec::new();
    for view in [PhotoView::Front, PhotoView::Side, PhotoView::Mirror] {
        let own: Vec<&Click> = clicks.iter().filter(|c| c.image == image && c.view == view).collect();
        if !own.is_empty() {
            seen.push(Seen::new(image, view, &own)?);
        }
    }
    Ok(seen)
}

impl Seen {
    fn new(image: &str, view: PhotoView, clicks: &[&Click]) -> Result<Self, CalibrateError> {
        let refused =
            |found: String, missing: String| CalibrateError::NotDetermined { parameter: "the bend", found, missing };
        if let Some(bad) = clicks.iter().find(|c| !(c.u_px.is_finite() && c.v_px.is_finite())) {
            return Err(refused(
                format!("{image} has a click at ({}, {})", bad.u_px, bad.v_px),
                "that point again".to_owned(),
            ));
        }
        let mut pairs = Vec::new();
        for corner in clicks.iter().filter(|c| c.kind == ClickKind::Corner) {
            let (Some(x), Some(z)) = (corner.x_mm, corner.z_mm) else {
                return Err(refused(
                    format!("{image} has a corner without x_mm, z_mm"),
                    "its place on the paper".to_owned(),
                ));
            };
            // The mirror shows the paper's x the other way round.
            let x = if view == PhotoView::Mirror { -x } else { x };
            pairs.push((Vector2::new(x, z), Vector2::new(corner.u_px, corner.v_px)));
        }
        let more = || {
            format!("grid corners of {image}, at least {FEWEST_CORNERS} (64 are better), spread over both directions")
        };
        if pairs.len() < FEWEST_CORNERS {
            return Err(refused(format!("{image} has {} grid corners", pairs.len()), more()));
        }
        let homography =
            Homography::new(&pairs).ok_or_else(|| refused(format!("the corners of {image} lie on a line"), more()))?;
        let rms_px = homography.rms(&pairs);
        if rms_px.is_nan() || rms_px > MAX_REPROJECTION_PX {
            let found = format!(
                "the corners of {image} miss their grid by {rms_px:.2} px rms, expected at most {MAX_REPROJECTION_PX}"
            );
            return Err(refused(found, "the corners again, or a flat paper and a lens without distortion".to_owned()));
        }
        let edges = |kind: ClickKind, word: &str| -> Result<[Vector2<f64>; 2], CalibrateError> {
            let found: Vec<Vector2<f64>> =
                clicks.iter().filter(|c| c.kind == kind).map(|c| Vector2::new(c.u_px, c.v_px)).collect();
            let [one, other] = found.as_slice() else {
                let n = found.len();
                return Err(refused(
                    format!("{image} has {n} {word} edges"),
                    format!("both {word} edges of {image}, and no more"),
                ));
            };
            if (one - other).norm() < NEAREST_EDGES_PX {
                let missing = format!("the other {word} edge of {image}");
                return Err(refused(format!("both {word} edges of {image} are at one place"), missing));
            }
            Ok([*one, *other])
        };
        let (base_px, end_px) = (edges(ClickKind::Base, "base")?, edges(ClickKind::End, "end")?);
        Ok(Self { image: image.to_owned(), view, homography, base_px, end_px })
    }

    /// Edges in the paper's plane with one picture coordinate moved by `by_px`; 0 to 3 are the base's, 4 to 7 the end's.
    fn edges_mm(&self, moved: Option<usize>, by_px: f64) -> [Vector2<f64>; 4] {
        let mut px = [self.base_px[0], self.base_px[1], self.end_px[0], self.end_px[1]];
        if let Some(k) = moved {
            px[k / 2][k % 2] += by_px;
        }
        px.map(|p| self.homography.to_plane(p))
    }
}

/// What one view says: the direction of the end disk's normal and the place of its centre, both in the base's frame.
#[derive(Clone, Copy)]
struct Apparent {
    normal: Vector2<f64>,
    centre: Vector2<f64>,
}

fn apparent(base: [Vector2<f64>; 2], end: [Vector2<f64>; 2]) -> Apparent {
    // Edges that coincide were refused when the clicks were read.
    let across = (base[1] - base[0]).try_normalize(0.0).unwrap_or_default();
    let along = Vector2::new(-across.y, across.x);
    let line = end[1] - end[0];
    let chord = (end[0] + end[1] - base[0] - base[1]) * 0.5;
    let in_base = |v: Vector2<f64>| Vector2::new(v.dot(&across), v.dot(&along));
    let line = in_base(line);
    Apparent { normal: Vector2::new(-line.y, line.x), centre: in_base(chord) }
}

/// Edge estimate, then chord estimate, of the bend vector from one or two views.
fn estimates(front: &Apparent, side: Option<&Apparent>) -> [Vector2<f64>; 2] {
    let Some(side) = side else {
        let chord = 2.0 * front.centre.x.atan2(front.centre.y);
        return [Vector2::new(front.normal.x.atan2(front.normal.y), 0.0), Vector2::new(chord, 0.0)];
    };
    // n ~ (tan a1, tan a2, 1), and the same for the direction from base to end.
    let of = |a: Vector2<f64>, b: Vector2<f64>, factor: f64| {
        let v = Vector3::new(a.x / a.y, b.x / b.y, 1.0);
        let size = factor * v.xy().norm().atan2(v.z);
        // The bending plane's azimuth is -delta.
        let plane = v.xy().try_normalize(1e-12).unwrap_or_default();
        Vector2::new(plane.x, -plane.y) * size
    };
    [of(front.normal, side.normal, 1.0), of(front.centre, side.centre, 2.0)]
}

fn bend(image: &str, all: &[Seen], click_sd_px: f64) -> Result<Bend, CalibrateError> {
    let find = |views: &[PhotoView]| all.iter().find(|s| s.image == image && views.contains(&s.view));
    let Some(front) = find(&[PhotoView::Front]) else {
        let (found, missing) = (format!("{image} has no front view"), format!("the front view of {image}"));
        return Err(CalibrateError::NotDetermined { parameter: "the bend", found, missing });
    };
    let side = find(&[PhotoView::Side, PhotoView::Mirror]);
    // A click of the pose's own pictures; those of other pictures act through the mean base and their number.
    let compute = |moved: Option<(usize, usize)>, by_px: f64| {
        let of = |seen: &Seen, view: usize| {
            let moved = moved.filter(|m| m.0 == view).map(|m| m.1);
            let own = seen.edges_mm(moved, by_px);
            apparent(mean_base(seen, all, moved, by_px), [own[2], own[3]])
        };
        let (a, b) = (of(front, 0), side.map(|seen| of(seen, 1)));
        let [edge, chord] = estimates(&a, b.as_ref());
        DVector::from_vec(vec![edge.x, edge.y, chord.x, chord.y])
    };
    let at = compute(None, 0.0);
    let end_on = |seen: &Seen| {
        let own = seen.edges_mm(None, 0.0);
        apparent(mean_base(seen, all, None, 0.0), [own[2], own[3]]).normal.y <= 0.0
    };
    let beyond = || CalibrateError::NotDetermined {
        parameter: "the bend",
        found: format!("{image} shows the end disk end-on, or bent beyond 90 deg"),
        missing: "a picture from another side, or of a smaller bend".to_owned(),
    };
    if end_on(front) || side.is_some_and(end_on) {
        return Err(beyond());
    }
    let n_views = 1 + usize::from(side.is_some());
    let (mut covariance, mut of_base) = (DMatrix::zeros(4, 4), DMatrix::zeros(4, 4));
    for view in 0..n_views {
        let seen = if view == 0 { Some(front) } else { side };
        let n_pictures = seen.map_or(1, |s| all.iter().filter(|o| o.view == s.view).count());
        for k in 0..8 {
            let slope = (compute(Some((view, k)), 0.05) - compute(Some((view, k)), -0.05)) / 0.1;
            // Each picture's base edges move the mean alike.
            let times = if k < 4 { n_pictures as f64 } else { 1.0 };
            let part = &slope * slope.transpose() * (click_sd_px.powi(2) * times);
            if k < 4 {
                of_base += &part;
            }
            covariance += part;
        }
    }
    combined(image, &at, [&covariance, &of_base], side.is_some()).ok_or_else(beyond)
}

/// Edges of the base, mm: the mean over every picture from the same side.
fn mean_base(seen: &Seen, all: &[Seen], moved: Option<usize>, by_px: f64) -> [Vector2<f64>; 2] {
    let same: Vec<&Seen> = all.iter().filter(|other| other.view == seen.view).collect();
    let mut sum = [Vector2::zeros(); 2];
    for other in &same {
        let moved = moved.filter(|_| core::ptr::eq(*other, seen));
        let edges = other.edges_mm(moved, by_px);
        sum[0] += edges[0];
        sum[1] += edges[1];
    }
    sum.map(|s| s / same.len() as f64)
}

/// The best of edge and chord with their joint covariance, and that which the base makes of it.
fn combined(
    image: &str,
    at: &DVector<f64>,
    [covariance, of_base]: [&DMatrix<f64>; 2],
    two_views: bool,
) -> Option<Bend> {
    let size = |k: usize| if two_views { at[k].hypot(at[k + 1]) } else { at[k] };
    let (edge_rad, chord_rad) = (size(0), size(2));
    if !at.iter().all(|v| v.is_finite()) {
        return None;
    }
    let (value, sd, base_sd, apart_sd) = if two_views {
        let joint = Matrix4::from_fn(|i, k| covariance[(i, k)]);
        let inverse = joint.try_inverse()?;
        let stack = Matrix4x2::new(1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0);
        let own: Matrix2<f64> = (stack.transpose() * inverse * stack).try_inverse()?;
        let weights = own * stack.transpose() * inverse;
        let value: Vector2<f64> = weights * at.fixed_rows::<4>(0);
        let sd = own.diagonal().map(f64::sqrt);
        let shared = weights * Matrix4::from_fn(|i, k| of_base[(i, k)]) * weights.transpose();
        // Along the bend, where a curvature that is not constant shows.
        let along = value.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        let d = nalgebra::Vector4::new(along.x, along.y, -along.x, -along.y);
        let apart_sd = d.dot(&at.fixed_rows::<4>(0)) / d.dot(&(joint * d)).sqrt();
        (value, sd, shared.diagonal().map(f64::sqrt), apart_sd)
    } else {
        let (e, c, both) = (covariance[(0, 0)], covariance[(2, 2)], covariance[(0, 2)]);
        let difference = e + c - 2.0 * both;
        let weight = (c - both) / difference;
        let value = Vector2::new(weight * at[0] + (1.0 - weight) * at[2], f64::NAN);
        let sd = Vector2::new(((e * c - both * both) / difference).sqrt(), f64::NAN);
        let [one, other] = [weight, 1.0 - weight];
        let shared =
            one * one * of_base[(0, 0)] + 2.0 * one * other * of_base[(0, 2)] + other * other * of_base[(2, 2)];
        (value, sd, Vector2::new(shared.sqrt(), f64::NAN), (at[0] - at[2]) / difference.sqrt())
    };
    Some(Bend {
        image: image.to_owned(),
        b_x_rad: value.x,
        b_y_rad: value.y,
        sd_x_rad: sd.x,
        sd_y_rad: sd.y,
        base_sd_x_rad: base_sd.x,
        base_sd_y_rad: base_sd.y,
        edge_rad,
        chord_rad,
        apart_sd,
    })
}

#[cfg(test)]
mod tests;
