//! `krait calibrate stem`: a recording with load cells becomes the stem's angle in a model file.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_model::model_file::{Known, Machine, ModelFile};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, lines};
use krait_tests::{Ended, TempFolder};
use nalgebra::Vector2;

const PATIENCE: Duration = Duration::from_secs(60);
/// The simulated snake's own: phi, eta, half-width (m), f_s (N).
const TRUTH: [f64; 4] = [41.0 * core::f64::consts::PI / 180.0, 1.22, 0.089e-3, 1.959];
const MODEL: &str = "format = 1\n[machine]\nkind = \"snake\"\nphi_rad = 0.5\n[[effect]]\nkind = \"cone-friction\"\n\
                     mu = { value = 0.1727, se = 0.0091, from = \"weights.csv\", date = \"2026-05-01\" }\n";

/// A table of ten bends there and the same back, as a recorder of encoders, cells and a camera writes it: q, tau, bend.
fn path() -> String {
    let mut truth = Truth::default();
    truth.drive.encoder_resolution_m = 0.0;
    let mut snake = SimulatedSnake::new(&truth);
    snake.set_power(0, true).expect("power");
    let model = krait_model::Snake::new(&Default::default()).expect("the paper's snake");
    let compliance_m_per_n = model.frictionless_compliance_m_per_n();
    let bends_deg: Vec<f64> = (0..10).map(|k| 10.0 + f64::from(k) * 50.0 / 9.0).collect();
    let mut plan = vec![(-40.0, false)];
    plan.extend(bends_deg.iter().map(|bend_deg| (*bend_deg, true)));
    plan.push((90.0, false));
    plan.extend(bends_deg.iter().rev().map(|bend_deg| (*bend_deg, true)));
    let mut text = "time_s,q1_m,q2_m,q3_m,tau1_n,tau2_n,tau3_n,bend_x_rad,bend_y_rad\n".to_owned();
    for (row, (bend_deg, is_measured)) in plan.into_iter().enumerate() {
        let bend_rad = Vector2::new(f64::to_radians(bend_deg), 0.0);
        let to_m = model.q(bend_rad) + model.tau_n(bend_rad) * (TRUTH[1] * compliance_m_per_n);
        snake.write(0, lines(to_m.into())).expect("taken");
        let [a, b, c] = snake.q_tilde_m();
        let [t, u, v] = snake.actuator_loads_n();
        let bend = if is_measured {
            let [x, y] = snake.bend_rad();
            format!("{x},{y}")
        } else {
            ",".to_owned()
        };
        text += &format!("{row},{a},{b},{c},{t},{u},{v},{bend}\n");
    }
    text
}

#[test]
fn a_recording_with_cells_becomes_the_stems_angle_in_a_new_model_file() {
    let folder = TempFolder::new("calibrate-stem");
    let (data, model, out) = (folder.file("slow.csv"), folder.file("robot.toml"), folder.file("out.toml"));
    std::fs::write(&data, path()).expect("written");
    std::fs::write(&model, MODEL).expect("written");
    let words = ["calibrate", "stem", "--model", &model, "--data", &data, "--out", &out];
    let ended = Ended::of(&words, PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(
        ended.stdout.contains("stem angle phi 4") && ended.stdout.contains("mu's own error 0.0091"),
        "{}",
        ended.stdout
    );

    let file = ModelFile::parse(&std::fs::read_to_string(&out).expect("written")).expect("a model file");
    let Machine::Snake(snake) = file.machine() else { panic!("{file:?}") };
    let Known::Fitted { se, from, .. } = snake.known("phi_rad") else { panic!("{snake:?}") };
    assert_eq!(from.as_deref(), Some("slow.csv"));
    // mu's own error is the larger part: 41 deg times 0.0091 in 0.1727.
    let of_mu_rad = TRUTH[0] * 0.0091 / 0.1727;
    assert!(*se > of_mu_rad && *se < 1.2 * of_mu_rad, "{se}");
    let value = |effect: &str, parameter: &str| {
        let own = file.effects().iter().find(|own| own.setting().kind().name() == effect).expect(effect);
        (
            own.setting().value(parameter).expect(parameter),
            own.origin(parameter).and_then(|own| own.se).expect("an error"),
        )
    };
    let found = [
        (snake.parameters.phi_rad, *se),
        value("stiffness-scale", "eta"),
        value("backlash", "half_width_m"),
        value("static-friction", "f_s_n"),
    ];
    for ((found, se), truth) in found.into_iter().zip(TRUTH) {
        assert!((found - truth).abs() < 2.0 * se, "{found} +- {se} instead of {truth}");
    }
    let checked = Ended::of(&["model", "check", &out], PATIENCE);
    assert_eq!(checked.code, Some(0), "{}", checked.stderr);

    let again = Ended::of(&words, PATIENCE);
    assert!(again.code != Some(0) && again.sentence().contains("--force"), "{}", again.stderr);
}

#[test]
fn what_the_recording_or_the_model_leaves_open_is_said_and_nothing_is_written() {
    let folder = TempFolder::new("calibrate-stem-bad");
    let (data, model, out) = (folder.file("slow.csv"), folder.file("robot.toml"), folder.file("out.toml"));
    let table = path();
    let without = |column: &str| table.replacen(column, "other", 1);
    let no_cells = table.replacen("tau1_n", "a", 1).replacen("tau2_n", "b", 1).replacen("tau3_n", "c", 1);
    let weighted = table
        .lines()
        .enumerate()
        .fold(String::new(), |text, (k, line)| text + line + if k == 0 { ",weight\n" } else { ",1\n" });
    let (header, rows) = table.split_once('\n').expect("a first line");
    let place = rows.lines().nth(1).and_then(|row| row.split_once(',')).expect("a row").1;
    let at_rest = (0..20).fold(format!("{header}\n"), |text, k| text + &format!("{k},{place}\n"));
    let joints = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n";
    let cases = [
        (without("tau2_n"), MODEL, "loads of 2 lines, expected those of all 3"),
        (no_cells, MODEL, "load cells"),
        (weighted, MODEL, "leave it out"),
        (table.clone(), "format = 1\n[machine]\nkind = \"snake\"\n", "krait calibrate friction"),
        (
            (0..50).fold("time_s,u1_rad,y1_rad\n".to_owned(), |text, k| text + &format!("{k},0.{k},0.{k}\n")),
            joints,
            "expected a snake",
        ),
        (at_rest, MODEL, "expected a machine that moves"),
    ];
    for (table, file, words) in cases {
        std::fs::write(&data, table).expect("written");
        std::fs::write(&model, file).expect("written");
        let ended = Ended::of(&["calibrate", "stem", "--model", &model, "--data", &data, "--out", &out], PATIENCE);
        assert!(ended.code != Some(0) && ended.sentence().contains(words), "{words}: {}", ended.stderr);
        assert!(!std::path::Path::new(&out).exists(), "{words}: nothing is written");
    }
}
