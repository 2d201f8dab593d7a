//! What each procedure states as its standard error, against the numbers of an independent bench (`golden/calibrate.json`).

use crate::common::Noise;
use crate::common::pictures::{Camera, picture};
use krait_calibrate::friction::{Direction, FrictionReading, FrictionSettings, friction};
use krait_calibrate::photo::{Click, PhotoView, bends};
use krait_calibrate::poses::{PoseReading, PoseSettings, poses};
use krait_model::effects::EffectKind;
use krait_model::{Chain, ChainSettings, Circumstances, EffectSetting, KnownColumns, MachineParameters, Snake};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/calibrate.json");

fn golden(key: &str) -> Value {
    serde_json::from_str::<Value>(GOLDEN).unwrap()[key].clone()
}

fn numbers(row: &Value) -> Vec<f64> {
    row.as_array().unwrap().iter().filter_map(Value::as_f64).collect()
}

fn near(what: &str, found: f64, expected: f64, part: f64) {
    assert!((found / expected - 1.0).abs() <= part, "{what}: {found} and {expected}");
}

#[test]
fn friction_states_the_standard_errors_of_the_bench() {
    let rows: Vec<(f64, bool, f64)> = golden("friction_example_csv_g")
        .as_array()
        .unwrap()
        .iter()
        .map(|row| (row[0].as_f64().unwrap(), row[1] == "up", row[2].as_f64().unwrap()))
        .collect();
    let cases = golden("friction");
    for case in cases.as_array().unwrap() {
        let (data, scale_sd_g) = (case["data"].as_str().unwrap(), case["scale_sd_g"].as_f64().unwrap());
        let reading = |(weight_g, is_up, scale_g): &(f64, bool, f64)| FrictionReading {
            line: 1,
            weight_g: *weight_g,
            direction: if *is_up { Direction::Up } else { Direction::Down },
            scale_g: *scale_g,
            // The bench takes weights for exact.
            weight_sd_g: 0.0,
            scale_sd_g,
            note: String::new(),
        };
        let both = !data.starts_with("up only");
        let readings: Vec<FrictionReading> = rows.iter().filter(|row| both || row.1).map(reading).collect();
        assert_eq!(Some(readings.len() as u64), case["readings"].as_u64());
        let settings = FrictionSettings { free_zero: data.contains("zero"), ..FrictionSettings::default() };
        let found = friction(&readings, &settings).unwrap();
        let of = |key: &str| case[key].as_f64().unwrap();
        near(&format!("{data}, {scale_sd_g} g: mu"), found.mu().1, of("se_mu"), 0.01);
        near(&format!("{data}, {scale_sd_g} g: f_s"), found.f_s_n().1, of("se_f_s_n"), 0.01);
        near("mu", found.mu().0, 0.1727, 1e-4);
        let (mut mu, mut f_s_n, mut noise) = (Vec::new(), Vec::new(), Noise::new(15));
        for _ in 0..2000 {
            let mut read = readings.clone();
            read.iter_mut().for_each(|r| r.scale_g += scale_sd_g * noise.next());
            let found = friction(&read, &settings).unwrap();
            mu.push(found.mu().0);
            f_s_n.push(found.f_s_n().0);
        }
        // The bench has 600 runs, these are 2000: 3.3 % of a standard deviation, three times.
        near(&format!("{data}, {scale_sd_g} g: scatter of mu"), mean_and_sd(&mu).1, of("simulated_sd_mu"), 0.1);
        near(&format!("{data}, {scale_sd_g} g: scatter of f_s"), mean_and_sd(&f_s_n).1, of("simulated_sd_f_s_n"), 0.1);
    }
}

fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

/// Standard deviation of the bend that so many pictures of one bend state, deg.
fn stated_deg(n: usize, bend_deg: f64, (behind_mm, tilt_deg): (f64, f64)) -> f64 {
    let (camera, mut noise) = (Camera::new(tilt_deg, behind_mm), Noise::new(3));
    let b = Vector2::new(bend_deg.to_radians(), 0.0);
    let clicks: Vec<Click> =
        (0..n).flat_map(|k| picture(&format!("{k}"), PhotoView::Front, &camera, b, 0.5, &mut noise)).collect();
    let found = bends(&clicks, 0.5).unwrap().bends;
    (found.iter().map(|bend| bend.sd_x_rad.powi(2)).sum::<f64>() / found.len() as f64).sqrt().to_degrees()
}

#[test]
fn pictures_state_the_standard_deviations_that_the_bench_simulated() {
    // The bench's own scatter: 5 %.
    for row in golden("photograph")["rows"].as_array().unwrap() {
        let row = numbers(row);
        near(&format!("one picture, {row:?}"), stated_deg(1, row[0], (row[1], row[2])), row[7], 0.05);
    }
    for row in golden("photograph_base_from_20_pictures")["rows"].as_array().unwrap() {
        let row = numbers(row);
        near(&format!("twenty pictures, {row:?}"), stated_deg(20, row[0], (3.0, 5.0)), row[5], 0.05);
    }
}

/// Errors of edge and chord, deg, over sessions of so many pictures of one bend.
fn edge_and_chord_deg(n_sessions: usize, n: usize, bend_deg: f64, place: (f64, f64), px: f64) -> Vec<[f64; 2]> {
    let (camera, mut noise) = (Camera::new(place.1, place.0), Noise::new(15));
    let b = Vector2::new(bend_deg.to_radians(), 0.0);
    let mut all = Vec::new();
    for _ in 0..n_sessions {
        let clicks: Vec<Click> =
            (0..n).flat_map(|k| picture(&format!("{k}"), PhotoView::Front, &camera, b, px, &mut noise)).collect();
        let found = bends(&clicks, 0.5).unwrap().bends;
        all.extend(found.iter().map(|b| [b.edge_rad, b.chord_rad].map(|rad| rad.to_degrees() - bend_deg)));
    }
    all
}

/// Standard deviation of the best combination of edge and chord, and the chord's weight in it.
fn best_of_both(errors: &[[f64; 2]]) -> (f64, f64) {
    let n = errors.len() as f64;
    let mean = [0, 1].map(|k| errors.iter().map(|e| e[k]).sum::<f64>() / n);
    let joint =
        |i: usize, k: usize| errors.iter().map(|e| (e[i] - mean[i]) * (e[k] - mean[k])).sum::<f64>() / (n - 1.0);
    let (edge, chord, both) = (joint(0, 0), joint(1, 1), joint(0, 1));
    let difference = edge + chord - 2.0 * both;
    (((edge * chord - both * both) / difference).sqrt(), (edge - both) / difference)
}

#[test]
fn edge_and_chord_scatter_as_the_bench_simulated_and_paper_behind_does_not_bias_them() {
    for row in golden("photograph")["rows"].as_array().unwrap() {
        let row = numbers(row);
        let place = (row[1], row[2]);
        let errors = edge_and_chord_deg(1000, 1, row[0], place, 0.5);
        let (best_sd, weight) = best_of_both(&errors);
        let clean = edge_and_chord_deg(1, 1, row[0], place, 0.0)[0];
        // 1000 pictures here and 1500 there: 3 % of each standard deviation and 0.04 of it in each mean.
        for (k, name) in ["edge", "chord"].into_iter().enumerate() {
            let (bias, sd) = mean_and_sd(&errors.iter().map(|e| e[k]).collect::<Vec<f64>>());
            near(&format!("{name}, {row:?}"), sd, row[4 + 2 * k], 0.1);
            assert!((bias - row[3 + 2 * k]).abs() < 0.16 * sd, "{name}, {row:?}: {bias}");
            assert!(clean[k].abs() < 0.05, "{name} without noise, {row:?}: {}", clean[k]);
        }
        near(&format!("both, {row:?}"), best_sd, row[7], 0.1);
        assert!((weight - row[8]).abs() < 0.1, "{row:?}: {weight}");
    }
    for row in golden("photograph_base_from_20_pictures")["rows"].as_array().unwrap() {
        let row = numbers(row);
        let errors = edge_and_chord_deg(400, 20, row[0], (3.0, 5.0), 0.5);
        // The base is common to the 20 pictures of a session, so that their chords are little more than 400 readings: 4 %.
        for (k, name) in ["edge", "chord"].into_iter().enumerate() {
            let (bias, sd) = mean_and_sd(&errors.iter().map(|e| e[k]).collect::<Vec<f64>>());
            near(&format!("{name}, {row:?}"), sd, row[3 + k], 0.15);
            assert!((bias - row[1 + k]).abs() < 0.23 * sd, "{name}, {row:?}: {bias}");
        }
        near(&format!("both, {row:?}"), best_of_both(&errors).0, row[5], 0.15);
    }
}

#[test]
fn a_plane_that_is_off_the_view_biases_the_edge_as_the_bench_says() {
    let camera = Camera::new(0.0, 0.0);
    for row in golden("one_view_bias")["rows"].as_array().unwrap() {
        let row = numbers(row);
        for (k, bend_deg) in [30.0_f64, 60.0, 80.0].into_iter().enumerate() {
            let (sin, cos) = row[0].to_radians().sin_cos();
            let b = Vector2::new(cos, sin) * bend_deg.to_radians();
            let clicks = picture("a", PhotoView::Front, &camera, b, 0.0, &mut Noise::new(1));
            let bias_deg = bends(&clicks, 0.5).unwrap().bends[0].edge_rad.to_degrees() - bend_deg;
            // The bench's pictures see the disk's rim from the front, which moves the edge by some thousandths.
            assert!((bias_deg - row[1 + k]).abs() < 0.005, "{row:?} at {bend_deg}: {bias_deg}");
        }
    }
}

/// Readings without an error, from 30 deg the other way up through these bends, and with `down` on the way back from above.
fn readings(planes_deg: &[f64], bends_deg: &[f64], down: bool) -> Vec<PoseReading> {
    let effects = [
        EffectSetting::new(EffectKind::StiffnessScale).with("eta", 1.22).unwrap(),
        EffectSetting::new(EffectKind::StaticFriction).with("f_s_n", 1.959).unwrap(),
        EffectSetting::new(EffectKind::ConeFriction).with("mu", 0.1727).unwrap(),
        EffectSetting::new(EffectKind::Backlash).with("half_width_m", 0.089e-3).unwrap(),
    ];
    let settings = ChainSettings { transition_m: 1e-9, ..ChainSettings::default() };
    let chain = Chain::new(&MachineParameters::default(), settings, &effects, KnownColumns::default()).unwrap();
    let mut all = Vec::new();
    for plane_deg in planes_deg {
        let (sin, cos) = plane_deg.to_radians().sin_cos();
        let mut compensator = chain.compensator().unwrap();
        let mut way: Vec<(f64, f64)> = vec![(-30.0, 0.0)];
        way.extend(bends_deg.iter().map(|bend| (*bend, 1.0)));
        if down {
            way.push((75.0, 0.0));
            way.extend(bends_deg.iter().rev().map(|bend| (*bend, -1.0)));
        }
        let mut at_deg = 0.0;
        for (to_deg, sense) in way {
            let mut q_m = Vector3::zeros();
            for step in 1..=50 {
                let bend_deg = at_deg + (to_deg - at_deg) * f64::from(step) / 50.0;
                let b = Vector2::new(cos, sin) * f64::to_radians(bend_deg);
                q_m = compensator.step(b, &Circumstances::at(0.0)).q_tilde_m;
            }
            at_deg = to_deg;
            if sense == 0.0 {
                continue;
            }
            // q is least where the snake bends towards a line: J = -r (cos, -sin) of its azimuth.
            let s = [0.0_f64, 120.0, 240.0].map(|own| {
                let towards = own.to_radians().cos() * cos - own.to_radians().sin() * sin;
                if towards.abs() < 1e-9 { 1.0 } else { -sense * towards.signum() }
            });
            let b = Vector2::new(cos, sin) * f64::to_radians(to_deg);
            all.push(PoseReading {
                pose: all.len() as u32 + 1,
                check: false,
                plane_deg: *plane_deg,
                bend_deg: to_deg,
                b_x_rad: b.x,
                b_y_rad: b.y,
                sd_rad: 1_f64.to_radians(),
                q1_m: q_m.x,
                q2_m: q_m.y,
                q3_m: q_m.z,
                s1: s[0],
                s2: s[1],
                s3: s[2],
                image: None,
                sd_xy_rad: None,
                base_sd_xy_rad: None,
            });
        }
    }
    all
}

#[test]
fn guided_poses_state_the_standard_errors_of_the_bench() {
    let ten: Vec<f64> = (0..10).map(|k| 10.0 + 50.0 * f64::from(k) / 9.0).collect();
    let five: Vec<f64> = (0..5).map(|k| 10.0 + 12.5 * f64::from(k)).collect();
    let planes: Vec<f64> = (0..6).map(|k| 60.0 * f64::from(k)).collect();
    let table = golden("guided_poses")["rows"].clone();
    let cases = [readings(&[0.0], &ten, false), readings(&[0.0], &ten, true), readings(&planes, &five, true)];
    for (row, case) in table.as_array().unwrap().iter().zip(&cases) {
        let expected = numbers(row);
        for (k, sd_deg) in [1.0_f64, 0.5].into_iter().enumerate() {
            let settings = PoseSettings {
                machine: MachineParameters::default(),
                mu: 0.1727,
                f_s_n: 1.959,
                sd_rad: sd_deg.to_radians(),
                ..PoseSettings::default()
            };
            let case: Vec<PoseReading> =
                case.iter().map(|r| PoseReading { sd_rad: settings.sd_rad, ..r.clone() }).collect();
            let found = poses(&case, &settings).unwrap();
            assert!((found.eta().0 - 1.22).abs() < 1e-4, "{row}: {:?}", found.eta());
            near(&format!("{row}, {sd_deg} deg: eta"), found.eta().1, expected[2 * k], 0.02);
            near(&format!("{row}, {sd_deg} deg: half-width"), found.half_width_m().1 * 1e3, expected[2 * k + 1], 0.02);
        }
    }
}

/// Ten bends up and down in one plane without an error, and what a wrong assumption makes of eta and of the half-width, mm.
fn with_wrong(settings: &PoseSettings, zero_1_m: f64) -> [f64; 2] {
    let ten: Vec<f64> = (0..10).map(|k| 10.0 + 50.0 * f64::from(k) / 9.0).collect();
    let mut rows = readings(&[0.0], &ten, true);
    rows.iter_mut().for_each(|row| row.q1_m += zero_1_m);
    let found = poses(&rows, settings).unwrap();
    [found.eta().0 - 1.22, (found.half_width_m().0 - 0.089e-3) * 1e3]
}

#[test]
fn a_wrong_assumption_moves_eta_and_play_as_the_bench_says() {
    let right = PoseSettings {
        machine: MachineParameters::default(),
        mu: 0.1727,
        f_s_n: 1.959,
        sd_rad: 1_f64.to_radians(),
        ..PoseSettings::default()
    };
    let r_m = right.machine.r_m * 1.01;
    let cases = [
        ("mu_plus_0p009", PoseSettings { mu: 0.1817, ..right }, 0.0),
        ("f_s_plus_0p13", PoseSettings { f_s_n: 2.089, ..right }, 0.0),
        ("r_plus_1_percent", PoseSettings { machine: MachineParameters { r_m, ..right.machine }, ..right }, 0.0),
        ("zero_line1_0p05mm", right, 0.05e-3),
    ];
    let bench = golden("sensitivity_of_eta_and_half_width_mm");
    assert_eq!(bench.as_object().unwrap().len(), cases.len());
    for (key, settings, zero_1_m) in cases {
        let (found, expected) = (with_wrong(&settings, zero_1_m), numbers(&bench[key]));
        // The bench weights the readings of every bend alike, this fit by what a bend says: they differ by a hundredth of eta's error and 0.07 um.
        for ((found, expected), apart) in found.iter().zip(&expected).zip([1e-4, 7e-5]) {
            assert!((found - expected).abs() <= 0.1 * expected.abs() + apart, "{key}: {found} and {expected}");
        }
    }
}

/// Actuator travel, mm, that takes line 1 from its one direction to the other at a bend, deg, in the model with these.
fn travel_to_turn_mm(bend_deg: f64, f_s_n: f64, half_width_m: f64) -> f64 {
    let effects = [
        EffectSetting::new(EffectKind::StiffnessScale).with("eta", 1.22).unwrap(),
        EffectSetting::new(EffectKind::StaticFriction).with("f_s_n", f_s_n).unwrap(),
        EffectSetting::new(EffectKind::ConeFriction).with("mu", 0.1727).unwrap(),
        EffectSetting::new(EffectKind::Backlash).with("half_width_m", half_width_m).unwrap(),
    ];
    let (machine, settings) =
        (MachineParameters::default(), ChainSettings { transition_m: 1e-9, ..ChainSettings::default() });
    let chain = Chain::new(&machine, settings, &effects, KnownColumns::default()).unwrap();
    let b = Vector2::new(bend_deg.to_radians(), 0.0);
    let [pushed, drawn] = [1.0, -1.0].map(|sign| {
        let mut compensator = chain.compensator().unwrap();
        compensator.restart(b, Vector3::repeat(sign), &Circumstances::at(0.0));
        1e3 * compensator.step(b, &Circumstances::at(0.0)).q_tilde_m.x
    });
    pushed - drawn
}

#[test]
fn a_line_turns_after_the_travel_that_the_bench_says_and_one_without_load_after_more_than_it_says() {
    let bench = golden("travel_to_turn_a_line");
    let of = |key: &str| bench[key].as_f64().unwrap();
    near("stick at 45 deg", travel_to_turn_mm(45.0, 1.959, 0.0), of("stick_lumped_line1_at_45deg_mm"), 1e-5);
    let with_play = travel_to_turn_mm(45.0, 1.959, 0.089e-3) - travel_to_turn_mm(45.0, 1.959, 0.0);
    near("play", with_play, of("play_mm"), 1e-5);
    // (G + 1/G) f_s/K_c, with G = e^(2 mu phi), is what f_s adds where a line carries more than f_s: one way it lies on the load and
    // the cone multiplies both, the other way it is taken off and the cone divides.
    let of_f_s = travel_to_turn_mm(45.0, 1.959, 0.0) - travel_to_turn_mm(45.0, 0.0, 0.0);
    near("f_s beside a load", of_f_s, of("f_s_alone_mm"), 1e-4);
    // A line without load is held by f_s whichever way it slides, and the cone multiplies it both times: 2 G f_s/K_c. The bench
    // prints the number above under the name of this one.
    let snake = Snake::new(&MachineParameters::default()).unwrap();
    let g = (2.0 * 0.1727 * MachineParameters::default().phi_rad).exp();
    let alone_mm = travel_to_turn_mm(0.0, 1.959, 0.0);
    near("f_s alone", alone_mm, 2e3 * g * 1.959 / snake.k_c_n_per_m(), 1e-5);
    assert!((alone_mm - 0.0370).abs() < 5e-5 && alone_mm > 1.2 * of("f_s_alone_mm"), "{alone_mm}");
}
