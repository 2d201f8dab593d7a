//! From photographs to a model's values without a bend being typed: poses that name their pictures, clicked points of rendered
//! pictures, their table, and the same command again. The snake is the simulated one, which shares no code with the model.

use crate::common::pictures::{Camera, picture};
use crate::common::{Fresh, N_SEEDS, Noise, User, fresh, honest, shared};
use krait_calibrate::photo::{self, ClickKind, PhotoView};
use krait_calibrate::poses::{PoseGoal, PosePlan, PoseSettings, run};
use krait_calibrate::{CalibrateError, Dialogue};
use krait_model::MachineParameters;
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, lines, three};
use nalgebra::{Rotation2, Vector2, Vector3};
use std::path::Path;

const CLICK_SD_PX: f64 = 0.5;

fn settings() -> PoseSettings {
    PoseSettings {
        machine: MachineParameters::default(),
        mu: 0.1727,
        f_s_n: 1.959,
        sd_rad: 1_f64.to_radians(),
        ..PoseSettings::default()
    }
}

/// What the snake's bend was at each name that was typed.
type Shown = Vec<(String, [f64; 2])>;

/// The dialogue on the simulated snake; every pose is photographed.
fn photographed(csv: &Path, table: &Path, settings: &PoseSettings) -> (String, Shown) {
    let mut snake = SimulatedSnake::new(&Truth::default());
    snake.set_power(0, true).unwrap();
    let bench = shared((snake, Shown::new(), 0_usize, 0.0));
    let is_front = !settings.plan.front_deg().is_empty();
    let eyes = bench.clone();
    let user = User::new(move || {
        let (snake, shown, n_asked, picture_rad) = &mut *eyes.borrow_mut();
        *n_asked += 1;
        // A name that is another pose's is asked for again; Enter takes the one in brackets.
        if *n_asked == 3 {
            return Some(shown[0].0.clone());
        }
        let name = if shown.len() == 10 { "the eleventh, \"again\"".to_owned() } else { format!("i{}", shown.len()) };
        // The robot is turned until the picture shows the plane: what is seen is turned with it.
        let seen = Rotation2::new(-*picture_rad) * Vector2::from(snake.bend_rad());
        shown.push((name.clone(), seen.into()));
        Some(name)
    });
    let mut said = Vec::new();
    let mut dialogue = Dialogue::new(user, &mut said);
    let ended = run(&mut dialogue, csv, Some(table), settings, |_, goal: PoseGoal| {
        let (snake, _, _, picture_rad) = &mut *bench.borrow_mut();
        if let Some(plane_deg) = goal.picture_deg.filter(|_| is_front) {
            *picture_rad = plane_deg.to_radians();
        }
        let robot = |e: krait_slave::DriveError| CalibrateError::Robot(e.to_string());
        snake.write(0, lines(goal.q_tilde_m.into())).map_err(robot)?;
        Ok(Vector3::from(three(&snake.read(0).map_err(robot)?.q_tilde_m)).into())
    });
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("\"i0\" is of pose "), "{said}");
    let shown = bench.borrow().1.clone();
    (ended.unwrap_err().to_string(), shown)
}

/// Again, with nothing left to be read: what was found, and what was said.
fn again(csv: &Path, table: Option<&Path>) -> (Result<krait_calibrate::poses::Poses, CalibrateError>, String) {
    fitted(csv, table, &settings())
}

fn fitted(
    csv: &Path,
    table: Option<&Path>,
    settings: &PoseSettings,
) -> (Result<krait_calibrate::poses::Poses, CalibrateError>, String) {
    let mut said = Vec::new();
    let mut nobody = Dialogue::new(User::new(|| None), &mut said);
    let found = run(&mut nobody, csv, table, settings, |_, _| panic!("it moved"));
    (found, String::from_utf8(said).unwrap())
}

#[test]
fn pictures_lead_to_eta_and_the_play_with_their_own_standard_errors() {
    let (csv, table): (Fresh, Fresh) = (fresh("pictures"), fresh("pictures-bends"));
    let (sentence, shown) = photographed(&csv, &table, &settings());
    assert!(sentence.contains("the pictures i0, i1, i2, i3, i4, i5 and ") && sentence.contains(" more are not in "));
    assert!(sentence.contains("krait calibrate photo CLICKS --out"), "{sentence}");

    let (camera, mut noise) = (Camera::new(5.0, 3.0), Noise::new(11));
    let mut clicks = Vec::new();
    for (k, (name, b)) in shown.iter().enumerate() {
        for view in [PhotoView::Front, PhotoView::Side] {
            // One is seen from one side only, and of one an edge was forgotten.
            if k == 4 && view == PhotoView::Side {
                continue;
            }
            clicks.extend(picture(name, view, &camera, Vector2::from(*b), CLICK_SD_PX, &mut noise));
        }
    }
    let edge = clicks.iter().position(|c| c.image == "i7" && c.kind == ClickKind::End).unwrap();
    clicks.remove(edge);
    let session = photo::bends(&clicks, CLICK_SD_PX).unwrap();
    assert_eq!(session.left_out.len(), 1);
    std::fs::write(&table, photo::table(&session.bends)).unwrap();

    let (found, said) = again(&csv, Some(&table));
    let found = found.unwrap_or_else(|e| panic!("{e}\n{said}"));
    assert!(said.contains("the pictures i7 are not in") && said.contains("the pictures i4 were seen from one side"));
    let ((eta, eta_se), (half_width_m, half_width_se_m)) = (found.eta(), found.half_width_m());
    assert!((eta - 1.22).abs() < 3.0 * eta_se && eta_se < 0.006, "eta {eta} +- {eta_se}");
    let off_m = (half_width_m - 0.089e-3).abs();
    assert!(off_m < 3.0 * half_width_se_m && half_width_se_m < 5e-6, "{half_width_m} +- {half_width_se_m}");
    // Twice the stated error of a click is twice the standard error of what is found, unless the scatter says more.
    let wider = photo::bends(&clicks, 4.0 * CLICK_SD_PX).unwrap();
    std::fs::write(&table, photo::table(&wider.bends)).unwrap();
    let wide_se = again(&csv, Some(&table)).0.unwrap().eta().1;
    assert!((wide_se / eta_se - 4.0).abs() < 1.2, "{wide_se} and {eta_se}");
    // What was photographed cannot be mixed with what was typed.
    let sentence = again(&csv, None).0.unwrap_err().to_string();
    assert!(sentence.contains("row 2") && sentence.contains("say with --bends"), "{sentence}");
}

#[test]
fn pictures_from_the_front_are_enough_in_the_planes_that_they_show() {
    let (csv, table): (Fresh, Fresh) = (fresh("front"), fresh("front-bends"));
    let front = PoseSettings { plan: PosePlan::new(&[0.0], PosePlan::FULL_DEG).unwrap(), ..settings() };
    let (_, shown) = photographed(&csv, &table, &front);
    assert_eq!(shown.len(), 2 * 10 + 6, "two planes and the check");
    let across_rad = shown.iter().map(|(_, b)| b[1].abs()).fold(0.0, f64::max);
    assert!(across_rad < 0.02, "it stays in the picture's plane: {across_rad}");
    let (camera, mut noise) = (Camera::new(5.0, 3.0), Noise::new(12));
    let of = |(name, b): &(String, [f64; 2])| {
        picture(name, PhotoView::Front, &camera, Vector2::from(*b), CLICK_SD_PX, &mut noise)
    };
    let clicks: Vec<_> = shown.iter().flat_map(of).collect();
    let session = photo::bends(&clicks, CLICK_SD_PX).unwrap();
    std::fs::write(&table, photo::table(&session.bends)).unwrap();
    let (found, said) = fitted(&csv, Some(&table), &front);
    let found = found.unwrap_or_else(|e| panic!("{e}\n{said}"));
    let ((eta, eta_se), (half_width_m, half_width_se_m)) = (found.eta(), found.half_width_m());
    assert!((eta - 1.22).abs() < 3.0 * eta_se && eta_se < 0.01, "eta {eta} +- {eta_se}");
    let off_m = (half_width_m - 0.089e-3).abs();
    assert!(off_m < 3.0 * half_width_se_m && half_width_se_m < 8e-6, "{half_width_m} +- {half_width_se_m}");
    assert_eq!(found.fit.dof, 2 * 10 - 2, "one component each");
    // Without --front these poses are of another plan.
    let sentence = again(&csv, Some(&table)).0.unwrap_err().to_string();
    assert!(sentence.contains("another plan") && sentence.contains("--front"), "{sentence}");
}

/// The same poses under other noise of the clicks, from the sides that are seen.
fn over_seeds(name: &str, settings: &PoseSettings, views: &[PhotoView]) {
    let (csv, table): (Fresh, Fresh) = (fresh("pictures-seeds"), fresh("pictures-seeds-bends"));
    let (_, shown) = photographed(&csv, &table, settings);
    let (mut eta, mut half_width) = (Vec::new(), Vec::new());
    for seed in 0..N_SEEDS {
        let (camera, mut noise) = (Camera::new(5.0, 3.0), Noise::new(1000 + seed));
        let mut clicks = Vec::new();
        for (name, b) in &shown {
            for view in views {
                clicks.extend(picture(name, *view, &camera, Vector2::from(*b), CLICK_SD_PX, &mut noise));
            }
        }
        std::fs::write(&table, photo::table(&photo::bends(&clicks, CLICK_SD_PX).unwrap().bends)).unwrap();
        let (found, said) = fitted(&csv, Some(&table), settings);
        let found = found.unwrap_or_else(|e| panic!("{name}, seed {seed}: {e}\n{said}"));
        eta.push(found.eta());
        half_width.push(found.half_width_m());
    }
    honest(&format!("{name}: eta"), &eta, 1.22);
    honest(&format!("{name}: half-width"), &half_width, 0.089e-3);
}

#[test]
#[ignore = "100 seeds each: .ci/long"]
fn poses_from_pictures_state_their_own_error_over_a_hundred_seeds() {
    let front = |planes_deg: &[f64]| PoseSettings {
        plan: PosePlan::new(planes_deg, PosePlan::FULL_DEG).unwrap(),
        ..settings()
    };
    over_seeds("pictures from two sides", &settings(), &[PhotoView::Front, PhotoView::Side]);
    over_seeds("pictures from one side, plane 0", &front(&[0.0]), &[PhotoView::Front]);
    over_seeds("pictures from one side, planes 0, 60, 120", &front(&[0.0, 60.0, 120.0]), &[PhotoView::Front]);
}

#[test]
fn pictures_from_one_side_are_enough_in_three_planes_to_which_the_robot_is_turned() {
    let (csv, table): (Fresh, Fresh) = (fresh("turned"), fresh("turned-bends"));
    let turned = PoseSettings { plan: PosePlan::new(&[0.0, 60.0, 120.0], 60.0).unwrap(), ..settings() };
    let (_, shown) = photographed(&csv, &table, &turned);
    assert_eq!(shown.len(), 6 * 10 + 6, "six planes and the check");
    let across_rad = shown.iter().map(|(_, b)| b[1].abs()).fold(0.0, f64::max);
    assert!(across_rad < 0.02, "every bend is in its picture's plane: {across_rad}");
    let (camera, mut noise) = (Camera::new(5.0, 3.0), Noise::new(12));
    let of = |(name, b): &(String, [f64; 2])| {
        picture(name, PhotoView::Front, &camera, Vector2::from(*b), CLICK_SD_PX, &mut noise)
    };
    let clicks: Vec<_> = shown.iter().flat_map(of).collect();
    std::fs::write(&table, photo::table(&photo::bends(&clicks, CLICK_SD_PX).unwrap().bends)).unwrap();
    let (found, said) = fitted(&csv, Some(&table), &turned);
    let found = found.unwrap_or_else(|e| panic!("{e}\n{said}"));
    let ((eta, eta_se), (half_width_m, half_width_se_m)) = (found.eta(), found.half_width_m());
    assert!((eta - 1.22).abs() < 3.0 * eta_se && eta_se < 0.01, "eta {eta} +- {eta_se}");
    let off_m = (half_width_m - 0.089e-3).abs();
    assert!(off_m < 3.0 * half_width_se_m && half_width_se_m < 6e-6, "{half_width_m} +- {half_width_se_m}");
    assert_eq!(found.fit.dof, 6 * 10 - 2, "one component each");
}

#[test]
fn a_table_that_nobody_could_have_measured_is_refused_by_row() {
    let (csv, table) = (fresh("pictures-bad"), fresh("pictures-bad-bends"));
    let header = "image,b_x_rad,b_y_rad,sd_x_rad,sd_y_rad\n";
    let with_base = "image,b_x_rad,b_y_rad,sd_x_rad,sd_y_rad,base_sd_x_rad,base_sd_y_rad\n";
    for (rows, words) in [
        ("a,0.1,0.2,0.01,0.01\na,0.1,0.2,0.01,0.01\n", "row 3: the picture \"a\" is there twice"),
        ("a,inf,0.2,0.01,0.01\n", "row 2: inf is no bend"),
        ("a,0.1,0.2,0,0.01\n", "row 2: a standard deviation is out of range"),
        ("a,much,0.2,0.01,0.01\n", "row 2: "),
        ("a,0.1,0.2,0.01,0.01,0.02,0.001\n", "row 2: the base's part of a standard deviation is out of range"),
    ] {
        let header = if rows.matches(',').count() == 6 { with_base } else { header };
        std::fs::write(&table, format!("{header}{rows}")).unwrap();
        let sentence = again(&csv, Some(&table)).0.unwrap_err().to_string();
        assert!(sentence.contains(words), "{sentence}");
    }
}
