//! Bends from clicked points of pictures that were rendered with a camera of their own: noise, tilt, paper behind, two views.

use crate::common::pictures::{Camera, picture};
use crate::common::{N_SEEDS, Noise, fresh, honest};
use krait_calibrate::photo::{Click, ClickKind, PhotoView, bends, read};
use nalgebra::Vector2;

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
            let found = &bends(&clicks, 0.5).unwrap().bends[0];
            let off = Vector2::new(found.b_x_rad, found.b_y_rad) - b;
            assert!(off.norm().to_degrees() < 1e-6, "{deg} {delta_deg}: {found:?}");
            assert!(found.plausible(), "{found:?}");
        }
    }
    let one = &bends(&picture("b", PhotoView::Front, &camera, bend(40.0, 0.0), 0.0, &mut noise), 0.5).unwrap().bends[0];
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
            let found = &bends(&clicks, 0.5).unwrap().bends[0];
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
        bends(&clicks, 0.5).unwrap().bends[0].sd_x_rad.to_degrees()
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
    let found = &bends(&clicks, 0.1).unwrap().bends[0];
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
fn one_bad_picture_is_named_and_left_out_and_the_others_are_as_without_it() {
    let camera = Camera::new(5.0, 3.0);
    let both = |image: &str, b, noise: &mut Noise| -> Vec<Click> {
        let views = [PhotoView::Front, PhotoView::Side];
        views.into_iter().flat_map(|view| picture(image, view, &camera, b, 0.3, noise)).collect()
    };
    let mut noise = Noise::new(4);
    let mut clicks = both("good", bend(30.0, 20.0), &mut noise);
    clicks.extend(both("too", bend(50.0, -70.0), &mut noise));
    let alone = bends(&clicks, 0.3).unwrap();
    assert!(alone.left_out.is_empty());
    // Its base would draw the mean; its corners are of another paper.
    let mut bad = both("bad", bend(40.0, 0.0), &mut noise);
    bad[5].x_mm = Some(12.0);
    bad.iter_mut().filter(|c| c.kind == ClickKind::Base).step_by(2).for_each(|c| c.v_px += 40.0);
    clicks.extend(bad);
    // One whose pictures from the front are missing.
    clicks.extend(picture("half", PhotoView::Side, &camera, bend(40.0, 0.0), 0.0, &mut noise));
    let session = bends(&clicks, 0.3).unwrap();
    let names: Vec<&str> = session.bends.iter().map(|b| b.image.as_str()).collect();
    assert_eq!(names, ["good", "too"]);
    let why: Vec<String> = session.left_out.iter().map(ToString::to_string).collect();
    assert!(why.len() == 2 && why[0].contains("corners of bad miss their grid"), "{why:?}");
    assert!(why[1].contains("half has no front view"), "{why:?}");
    // The side view of the half one has a good base, so that it may stand in the mean of that side, and nothing else may.
    for (with, without) in session.bends.iter().zip(&alone.bends) {
        let [dx, dy] = [with.b_x_rad - without.b_x_rad, with.b_y_rad - without.b_y_rad];
        assert!(dx.hypot(dy).to_degrees() < 0.5, "{with:?} {without:?}");
    }
}

#[test]
fn a_bend_near_zero_has_no_delta_and_does_not_look_plausible() {
    let camera = Camera::new(0.0, 0.0);
    let mut noise = Noise::new(5);
    let mut of = |b| {
        let views = [PhotoView::Front, PhotoView::Side];
        let clicks: Vec<Click> =
            views.into_iter().flat_map(|view| picture("a", view, &camera, b, 0.5, &mut noise)).collect();
        bends(&clicks, 0.5).unwrap().bends.swap_remove(0)
    };
    for b in [bend(0.0, 0.0), bend(0.3, 40.0)] {
        let small = of(b);
        assert!(!small.has_plane(), "{small:?}");
        let sentence = small.sentence();
        assert!(sentence.contains("delta is not determined") && !sentence.contains("plausible"), "{sentence}");
    }
    let large = of(bend(20.0, 40.0));
    assert!(large.has_plane() && large.sentence().ends_with("deg; plausible"), "{}", large.sentence());
}

#[test]
fn a_table_without_a_click_is_refused() {
    let csv = fresh("photo-empty");
    std::fs::write(&csv, "image,view,kind,x_px,y_px,x_mm,y_mm\n").unwrap();
    let sentence = read(&csv).unwrap_err().to_string();
    assert!(sentence.contains("no click"), "{sentence}");
}
