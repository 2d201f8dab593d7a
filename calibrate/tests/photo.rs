//! Bends from clicked points of pictures that were rendered with a camera of their own: noise, tilt, paper behind, two views.

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

mod common;

use common::{N_SEEDS, Noise, fresh, honest};
use krait_calibrate::photo::{Click, ClickKind, PhotoView, bends, read};
use nalgebra::{Rotation3, Vector2, Vector3};

/// Half of the disks' diameter and the backbone's length, mm.
const RADIUS_MM: f64 = 2.1;
const LENGTH_MM: f64 = 26.0;

/// A camera 300 mm away with 20 px/mm.
struct Camera {
    tilt: Rotation3<f64>,
    /// The paper is this far behind the snake, mm.
    behind_mm: f64,
}

impl Camera {
    fn new(tilt_deg: f64, behind_mm: f64) -> Self {
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
fn picture(image: &str, view: PhotoView, camera: &Camera, b: Vector2<f64>, px: f64, noise: &mut Noise) -> Vec<Click> {
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

fn bend(deg: f64, delta_deg: f64) -> Vector2<f64> {
    let (sin, cos) = delta_deg.to_radians().sin_cos();
    Vector2::new(cos, sin) * deg.to_radians()
}

#[test]
fn known_angles_come_out_of_clean_pictures_from_one_side_two_or_a_mirror() {
    let camera = Camera::new(5.0, 0.0);
    let mut noise = Noise::new(1);
    for side in [PhotoView::Side, PhotoView::Mirror] {
        for (deg, delta_deg) in [(5.0, 0.0), (30.0, 30.0), (60.0, -100.0), (80.0, 200.0)] {
            let b = bend(deg, delta_deg);
            let mut clicks = picture("a", PhotoView::Front, &camera, b, 0.0, &mut noise);
            clicks.extend(picture("a", side, &camera, b, 0.0, &mut noise));
            let found = &bends(&clicks, 0.5).unwrap()[0];
            let off = Vector2::new(found.b_x_rad, found.b_y_rad) - b;
            assert!(off.norm().to_degrees() < 1e-6, "{deg} {delta_deg}: {found:?}");
            assert!(found.plausible(), "{found:?}");
        }
    }
    let one = &bends(&picture("b", PhotoView::Front, &camera, bend(40.0, 0.0), 0.0, &mut noise), 0.5).unwrap()[0];
    assert!((one.b_x_rad.to_degrees() - 40.0).abs() < 1e-6 && one.b_y_rad.is_nan(), "{one:?}");
    assert!(one.sentence().contains("delta not seen"), "{}", one.sentence());
}

#[test]
fn every_seed_states_its_own_error_over_tilt_and_paper_behind() {
    for (tilt_deg, behind_mm) in [(0.0, 0.0), (5.0, 3.0), (5.0, 8.0)] {
        let camera = Camera::new(tilt_deg, behind_mm);
        let mut by_component = [Vec::new(), Vec::new()];
        let truth = bend(45.0, 25.0);
        for seed in 0..N_SEEDS {
            let mut noise = Noise::new(seed);
            // A session of four poses: the base's line is their mean.
            let mut clicks = Vec::new();
            for (k, b) in [truth, bend(10.0, 0.0), bend(60.0, 90.0), bend(30.0, 180.0)].into_iter().enumerate() {
                for view in [PhotoView::Front, PhotoView::Side] {
                    clicks.extend(picture(&format!("pose {k}"), view, &camera, b, 0.5, &mut noise));
                }
            }
            let found = &bends(&clicks, 0.5).unwrap()[0];
            by_component[0].push((found.b_x_rad.to_degrees(), found.sd_x_rad.to_degrees()));
            by_component[1].push((found.b_y_rad.to_degrees(), found.sd_y_rad.to_degrees()));
        }
        honest(&format!("b_x, tilt {tilt_deg}, paper {behind_mm} mm behind"), &by_component[0], truth.x.to_degrees());
        honest(&format!("b_y, tilt {tilt_deg}, paper {behind_mm} mm behind"), &by_component[1], truth.y.to_degrees());
    }
}

#[test]
fn the_base_of_a_whole_session_makes_the_chord_better() {
    let camera = Camera::new(5.0, 3.0);
    let sd = |n: usize| {
        let mut noise = Noise::new(7);
        let clicks: Vec<Click> = (0..n)
            .flat_map(|k| picture(&format!("{k}"), PhotoView::Front, &camera, bend(30.0, 0.0), 0.5, &mut noise))
            .collect();
        bends(&clicks, 0.5).unwrap()[0].sd_x_rad.to_degrees()
    };
    let (alone, session) = (sd(1), sd(20));
    assert!((0.6..0.8).contains(&alone) && (0.19..0.27).contains(&session), "{alone} {session}");
}

#[test]
fn curvature_that_is_not_constant_is_said() {
    let camera = Camera::new(0.0, 0.0);
    let mut noise = Noise::new(3);
    let b = bend(60.0, 0.0);
    let mut clicks = picture("a", PhotoView::Front, &camera, b, 0.1, &mut noise);
    // The end disk stands 6 deg steeper than the arc says.
    let [p, q] = [0, 1].map(|k| clicks.iter().rposition(|c| c.kind == ClickKind::End).unwrap() - k);
    let at = |k: usize| Vector2::new(clicks[k].u_px, clicks[k].v_px);
    let (middle, half) = ((at(p) + at(q)) * 0.5, (at(p) - at(q)) * 0.5);
    let turned = nalgebra::Rotation2::new(6_f64.to_radians()) * half;
    for (k, at) in [(p, middle + turned), (q, middle - turned)] {
        (clicks[k].u_px, clicks[k].v_px) = (at.x, at.y);
    }
    let found = &bends(&clicks, 0.1).unwrap()[0];
    assert!(!found.plausible() && found.sentence().contains("not constant"), "{found:?}");
}

#[test]
fn pictures_that_cannot_be_used_say_why() {
    let camera = Camera::new(5.0, 3.0);
    let mut noise = Noise::new(2);
    let clicks = picture("a.jpg", PhotoView::Front, &camera, bend(30.0, 0.0), 0.1, &mut noise);
    let refused = |clicks: &[Click]| bends(clicks, 0.5).unwrap_err().to_string();
    let few: Vec<Click> = clicks.iter().filter(|c| c.kind != ClickKind::Corner).cloned().collect();
    assert!(refused(&few).contains("a.jpg has 0 grid corners"), "{}", refused(&few));
    let mut line = clicks.clone();
    line.retain(|c| c.kind != ClickKind::Corner || c.z_mm == Some(0.0) || c.z_mm == Some(5.0));
    line.iter_mut().filter(|c| c.z_mm == Some(5.0)).for_each(|c| c.z_mm = Some(0.0));
    assert!(refused(&line).contains("corners of a.jpg"), "{}", refused(&line));
    let mut wrong = clicks.clone();
    wrong[5].x_mm = Some(12.0);
    assert!(refused(&wrong).contains("miss their grid by"), "{}", refused(&wrong));
    let mut edges = clicks.clone();
    edges.pop();
    assert!(refused(&edges).contains("1 end edges"), "{}", refused(&edges));
    let mut nan = clicks;
    nan[0].u_px = f64::NAN;
    assert!(refused(&nan).contains("NaN"), "{}", refused(&nan));
}

#[test]
fn a_table_without_a_click_is_refused() {
    let csv = fresh("photo-empty");
    std::fs::write(&csv, "image,view,kind,x_px,y_px,x_mm,y_mm\n").unwrap();
    let sentence = read(&csv).unwrap_err().to_string();
    assert!(sentence.contains("no click"), "{sentence}");
}
