//! eta and play from guided poses, through the dialogue, on the simulated snake, whose plant shares no code with the model.

use crate::common::{N_SEEDS, Noise, User, fresh, honest, shared};
use krait_calibrate::poses::{PoseGoal, PosePlan, PoseSettings, Poses, price, run};
use krait_calibrate::{CalibrateError, ConeFriction, Dialogue, written};
use krait_model::MachineParameters;
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, lines, three};
use nalgebra::Vector3;
use std::path::Path;

struct Bench {
    snake: SimulatedSnake,
    /// The plane that a picture from one side shows, deg.
    picture_deg: Option<f64>,
    noise: Noise,
    sd_deg: f64,
    n_asked: usize,
    n_answers: usize,
}

fn measured(
    truth: &Truth,
    settings: &PoseSettings,
    seed: u64,
    csv: &Path,
    n_answers: usize,
) -> (Result<Poses, CalibrateError>, String) {
    let mut snake = SimulatedSnake::new(truth);
    snake.set_power(0, true).unwrap();
    let sd_deg = settings.sd_rad.to_degrees();
    let is_front = !settings.plan.front_deg().is_empty();
    let bench = shared(Bench { snake, picture_deg: None, noise: Noise::new(seed), sd_deg, n_asked: 0, n_answers });
    let eyes = bench.clone();
    let user = User::new(move || {
        let mut bench = eyes.borrow_mut();
        bench.n_asked += 1;
        if bench.n_asked > bench.n_answers {
            return None;
        }
        let [x, y] = bench.snake.bend_rad().map(f64::to_degrees);
        let sd = bench.sd_deg;
        if let Some((sin, cos)) = bench.picture_deg.map(|deg| deg.to_radians().sin_cos()) {
            return Some(format!("{:.5}", x * cos + y * sin + sd * bench.noise.next()));
        }
        Some(format!("{:.5} {:.5}", x + sd * bench.noise.next(), y + sd * bench.noise.next()))
    });
    let mut said = Vec::new();
    let mut dialogue = Dialogue::new(user, &mut said);
    let found = run(&mut dialogue, csv, None, settings, |_, goal: PoseGoal| {
        let mut bench = bench.borrow_mut();
        let robot = |e: krait_slave::DriveError| CalibrateError::Robot(e.to_string());
        bench.picture_deg = goal.picture_deg.filter(|_| is_front);
        bench.snake.write(0, lines(goal.q_tilde_m.into())).map_err(robot)?;
        Ok(Vector3::from(three(&bench.snake.read(0).map_err(robot)?.q_tilde_m)).into())
    });
    (found, String::from_utf8(said).unwrap())
}

fn settings(sd_deg: f64) -> PoseSettings {
    PoseSettings {
        machine: MachineParameters::default(),
        mu: 0.1727,
        f_s_n: 1.959,
        sd_rad: sd_deg.to_radians(),
        ..PoseSettings::default()
    }
}

#[test]
fn every_seed_states_its_own_error() {
    over_seeds(24, "poses-seeds");
}

#[test]
#[ignore = "100 seeds: .ci/long"]
fn each_of_a_hundred_seeds_states_its_own_error() {
    over_seeds(N_SEEDS, "poses-hundred-seeds");
}

fn over_seeds(n_seeds: u64, name: &str) {
    over_seeds_of(&Truth::default(), &settings(1.0), n_seeds, name);
}

fn over_seeds_of(truth: &Truth, settings: &PoseSettings, n_seeds: u64, name: &str) {
    let csv = fresh(name);
    let (mut eta, mut half_width) = (Vec::new(), Vec::new());
    for seed in 0..n_seeds {
        let (found, said) = measured(truth, settings, seed, &csv, usize::MAX);
        let found = found.unwrap_or_else(|e| panic!("{e}\n{said}"));
        eta.push(found.eta());
        half_width.push(found.half_width_m());
        std::fs::remove_file(&csv).unwrap();
    }
    honest(&format!("{name}: eta"), &eta, 1.22);
    honest(&format!("{name}: half-width"), &half_width, 0.089e-3);
}

fn front(planes_deg: &[f64], largest_deg: f64) -> PoseSettings {
    PoseSettings { plan: PosePlan::new(planes_deg, largest_deg).unwrap(), ..settings(1.0) }
}

/// Friction along the cone and lines that extend inside the snake, in the snake and in the fit.
fn spread() -> (Truth, PoseSettings) {
    let mut truth = Truth::default();
    (truth.lines.inside, truth.lines.cone_radius_m) = (0.9, 0.02);
    let arc_share = 2.0 * truth.lines.cone_radius_m * truth.machine.phi_rad / truth.machine.l_c_m;
    (truth, PoseSettings { cone: ConeFriction::Distributed { arc_share }, inside_share: 0.9, ..settings(1.0) })
}

#[test]
fn one_camera_states_its_own_error_in_planes_of_its_choice() {
    over_seeds_of(&Truth::default(), &front(&[0.0, 60.0, 120.0], PosePlan::FULL_DEG), 24, "poses-front");
}

#[test]
#[ignore = "100 seeds each: .ci/long"]
fn other_kinds_of_poses_state_their_own_error_over_a_hundred_seeds() {
    over_seeds_of(&Truth::default(), &front(&[0.0], PosePlan::FULL_DEG), N_SEEDS, "one camera, plane 0");
    over_seeds_of(
        &Truth::default(),
        &front(&[0.0, 60.0, 120.0], PosePlan::FULL_DEG),
        N_SEEDS,
        "one camera, 0, 60, 120",
    );
    over_seeds_of(&Truth::default(), &front(&[], 50.0), N_SEEDS, "bends up to 50 deg");
    let (truth, known) = spread();
    over_seeds_of(&truth, &known, N_SEEDS, "friction along the cone, extension inside");
}

/// The price of a plan is what its poses then give, as far as it does not end before them all are read.
#[test]
fn a_plan_costs_what_it_says() {
    for own in [front(&[0.0], 60.0), front(&[15.0, 75.0], PosePlan::FULL_DEG), front(&[], 46.0)] {
        let said = price(&own).unwrap().unwrap();
        let number = |after: &str| -> f64 {
            said.split(after).nth(1).unwrap().split_whitespace().next().unwrap().parse().unwrap()
        };
        let (eta, half_width_mm) = (number("it gives eta to "), number("half-width to "));
        let csv = fresh("poses-price");
        let (found, told) = measured(&Truth::default(), &own, 4, &csv, usize::MAX);
        let found = found.unwrap_or_else(|e| panic!("{e}\n{told}"));
        // Widened where the readings scatter more, and as precise as wanted before the end.
        let stated = |k: usize| found.fit.covariance[(k, k)].sqrt();
        let n_planned = own.plan.n_poses() - 6;
        let n_fitted = told.matches("eta ").count() as f64;
        assert!(n_fitted > 6.0, "{told}");
        let n_components = if own.plan.front_deg().is_empty() { 2 } else { 1 };
        let part = (found.fit.dof as f64 + 2.0) / (n_components * n_planned) as f64;
        for (k, planned) in [eta, half_width_mm * 1e-3].into_iter().enumerate() {
            let ratio = stated(k) * part.sqrt() / planned;
            assert!((0.8..1.25).contains(&ratio), "{said}: {} after {part} of the poses", stated(k));
        }
    }
    assert!(price(&settings(1.0)).unwrap().is_none(), "the full plan has no price");
}

#[test]
fn without_noise_the_snakes_own_values_come_out() {
    let csv = fresh("poses-clean");
    let mut truth = Truth::default();
    truth.drive.encoder_resolution_m = 0.0;
    let exact = PoseSettings { sd_rad: 1e-3_f64.to_radians(), ..settings(1.0) };
    let (found, said) = measured(&truth, &exact, 1, &csv, usize::MAX);
    let found = found.unwrap_or_else(|e| panic!("{e}\n{said}"));
    assert!((found.eta().0 - 1.22).abs() < 1e-3 && (found.half_width_m().0 - 0.089e-3).abs() < 1e-6, "{found:?}");
}

#[test]
fn friction_along_the_cone_and_lines_that_extend_inside_the_snake_belong_to_the_fit_of_a_model_that_has_them() {
    let (mut truth, known) = spread();
    truth.drive.encoder_resolution_m = 0.0;
    let known = PoseSettings { sd_rad: 1e-3_f64.to_radians(), ..known };
    let exact = PoseSettings { cone: ConeFriction::Lumped, inside_share: 0.0, ..known };
    let csv = fresh("poses-spread");
    let (found, said) = measured(&truth, &known, 1, &csv, usize::MAX);
    let found = found.unwrap_or_else(|e| panic!("{e}\n{said}"));
    assert!((found.eta().0 - 1.22).abs() < 1e-3 && (found.half_width_m().0 - 0.089e-3).abs() < 1e-6, "{found:?}");
    // The same readings without either: they are taken for eta and play, and the fit does not bear it out.
    for lacking in
        [PoseSettings { cone: ConeFriction::Lumped, ..known }, PoseSettings { inside_share: 0.0, ..known }, exact]
    {
        let csv = fresh("poses-lacking");
        let (found, _) = measured(&truth, &lacking, 1, &csv, usize::MAX);
        let sentence = found.unwrap_err().to_string();
        assert!(sentence.contains("chi2"), "{sentence}");
    }
}

#[test]
fn a_dialogue_that_ended_goes_on_and_ends_the_same() {
    let (whole, part) = (fresh("poses-whole"), fresh("poses-part"));
    let (found, _) = measured(&Truth::default(), &settings(1.0), 5, &whole, usize::MAX);
    let found = found.unwrap();
    let (ended, _) = measured(&Truth::default(), &settings(1.0), 5, &part, 12);
    let sentence = ended.unwrap_err().to_string();
    assert!(sentence.contains("for the check"), "{sentence}");
    assert_eq!(std::fs::read_to_string(&part).unwrap().lines().count(), 1 + 12);
    // Other noise for what is left, so the values differ, but both describe the same snake.
    let (resumed, _) = measured(&Truth::default(), &settings(1.0), 6, &part, usize::MAX);
    let resumed = resumed.unwrap();
    assert!((resumed.eta().0 - found.eta().0).abs() < 5.0 * resumed.eta().1, "{resumed:?} {found:?}");
}

#[test]
fn a_whole_dialogue_taken_up_again_moves_nothing_and_finds_the_same() {
    let csv = fresh("poses-again");
    let (found, _) = measured(&Truth::default(), &settings(1.0), 5, &csv, usize::MAX);
    let mut nobody = Dialogue::new(User::new(|| None), Vec::new());
    let again = run(&mut nobody, &csv, None, &settings(1.0), |_, _| panic!("it moved")).unwrap();
    assert_eq!(again.eta(), found.unwrap().eta());
}

#[test]
fn poses_from_one_side_are_not_enough_with_a_coarse_camera() {
    let csv = fresh("poses-few");
    let (found, _) = measured(&Truth::default(), &settings(3.0), 2, &csv, 5);
    let sentence = found.unwrap_err().to_string();
    assert!(sentence.contains("not determined") && sentence.contains("from above"), "{sentence}");
}

#[test]
fn a_snake_with_another_effect_is_refused() {
    let csv = fresh("poses-effect");
    let mut truth = Truth::default();
    truth.effects.tip_force_in_base_n = [0.6, 0.0];
    let (found, _) = measured(&truth, &settings(0.3), 2, &csv, usize::MAX);
    let sentence = found.unwrap_err().to_string();
    assert!(sentence.contains("chi2") && sentence.contains("krait lab diagnose"), "{sentence}");
}

#[test]
fn values_stand_in_the_model_file_with_their_origin() {
    let csv = fresh("poses-model");
    let (found, _) = measured(&Truth::default(), &settings(1.0), 1, &csv, usize::MAX);
    let found = found.unwrap();
    let text = written(None, &found.calibrated(), "poses.csv", "2026-05-01").unwrap();
    let file = krait_model::model_file::ModelFile::parse(&text).unwrap();
    let effect = |name: &str| file.effects().iter().find(|e| e.setting().kind().name() == name).unwrap();
    let eta = effect("stiffness-scale");
    assert_eq!(eta.setting().value("eta"), Some(found.eta().0));
    let origin = eta.origin("eta").unwrap();
    assert_eq!((origin.se, origin.from.as_deref()), (Some(found.eta().1), Some("poses.csv")));
    assert_eq!(effect("backlash").origin("half_width_m").unwrap().date.as_deref(), Some("2026-05-01"));
    // A later calibration replaces its own values only.
    let mut later = found.calibrated();
    later.truncate(1);
    later[0].value = 1.3;
    let again = written(Some(&text), &later, "later.csv", "2026-06-01").unwrap();
    let file = krait_model::model_file::ModelFile::parse(&again).unwrap();
    assert_eq!(file.effects().len(), 2);
    assert_eq!(file.effects()[0].setting().value("eta"), Some(1.3));
    assert_eq!(file.effects()[1].origin("half_width_m").unwrap().from.as_deref(), Some("poses.csv"));
}
