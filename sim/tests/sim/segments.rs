//! Simulated segments against the simulated snake, against energies written out here, and against what lines that pass must do.

use core::f64::consts::PI;
use krait_ipc::message::lines;
use krait_sim::{
    EffectsTruth, LinesTruth, SegmentEffectsTruth, SegmentTruth, SegmentsTruth, SegmentsTruthError, SimulatedSegments,
    SimulatedSnake, Truth,
};
use krait_slave::Drive;

const R_M: f64 = 1.684e-3;
const L_M: f64 = 26e-3;

fn segment(azimuths_deg: &[f64]) -> SegmentTruth {
    SegmentTruth { azimuths_rad: azimuths_deg.iter().map(|deg| deg.to_radians()).collect(), ..SegmentTruth::default() }
}

fn two() -> SegmentsTruth {
    SegmentsTruth::ideal(vec![segment(&[0.0, 120.0, 240.0]), segment(&[60.0, 180.0, 300.0])])
}

#[test]
fn one_segment_of_three_lines_moves_as_the_simulated_snake_does() {
    let effects = EffectsTruth::default();
    let mut one = SegmentsTruth::ideal(vec![segment(&[0.0, 120.0, 240.0])]);
    let EffectsTruth { play_m, load_scale, mu, f_s_n, .. } = effects;
    one.effects = SegmentEffectsTruth { play_m, load_scale, mu, f_s_n, inside: 0.8 };
    assert!(play_m > 0.0 && mu > 0.0 && f_s_n > 0.0, "the snake's own friction and play");
    let mut segments = SimulatedSegments::new(&one).unwrap();
    let hidden = LinesTruth { inside: 0.8, ..LinesTruth::default() };
    let mut snake = SimulatedSnake::new(&Truth { effects, lines: hidden, ..Truth::default() });
    snake.set_power(0, true).unwrap();
    let mut largest_rad = 0.0_f64;
    for k in 0..=120 {
        // There and back with a turn of the plane: each line turns round.
        let (size, plane) = (1.1 * (f64::from(k) * PI / 60.0).sin(), f64::from(k) * 0.02);
        let q_tilde_m = [0.0, 120.0, 240.0].map(|deg: f64| -1.9 * R_M * size * (plane + deg.to_radians()).cos());
        segments.move_to(&q_tilde_m);
        snake.write(i64::from(k) * 1_000_000, lines(q_tilde_m)).unwrap();
        let (ours, theirs) = (segments.bend_rad(0), snake.bend_rad());
        largest_rad = largest_rad.max(theirs[0].hypot(theirs[1]));
        assert!((ours[0] - theirs[0]).hypot(ours[1] - theirs[1]) < 1e-7, "{k}: {ours:?} {theirs:?}");
        for (own, expected) in segments.actuator_loads_n().zip(snake.actuator_loads_n()) {
            assert!((own - expected).abs() < 1e-5, "{k}: {own} N, expected {expected} N");
        }
    }
    assert!(largest_rad > 0.8 && segments.n_unsolved() == 0, "{largest_rad}");
}

/// Energy of all backbones and lines of two segments, J, written out: arcs, springs, no matrix.
fn energy_j(q_tilde_m: &[f64; 6], z: &[f64; 6]) -> f64 {
    let modulus = 54e9 * PI / 64.0 * (0.66e-3_f64.powi(4) - 0.50e-3_f64.powi(4));
    let axial_n = 54e9 * PI / 4.0 * (0.66e-3_f64.powi(2) - 0.50e-3_f64.powi(2));
    let bend = |j: usize| (z[3 * j].hypot(z[3 * j + 1]), z[3 * j + 1].atan2(z[3 * j]));
    let azimuths_deg: [f64; 6] = [0.0, 120.0, 240.0, 60.0, 180.0, 300.0];
    let mut energy = 0.0;
    for j in 0..2 {
        let (b, _) = bend(j);
        energy += modulus * b * b / (2.0 * L_M) + axial_n / L_M * z[3 * j + 2].powi(2) / 2.0;
    }
    for (k, azimuth_deg) in azimuths_deg.into_iter().enumerate() {
        let mut end_m = 0.0;
        for j in 0..=k / 3 {
            let (b, delta) = bend(j);
            let longer_m = -R_M * b * (delta + azimuth_deg.to_radians()).cos();
            energy += modulus * b * b / (2.0 * (L_M + longer_m));
            end_m += longer_m + z[3 * j + 2];
        }
        let compliance = (0.480 + 0.058) / axial_n;
        energy += (q_tilde_m[k] - end_m).powi(2) / (2.0 * compliance);
    }
    energy
}

#[test]
fn two_ideal_segments_come_to_rest_where_their_whole_energy_is_least() {
    let mut segments = SimulatedSegments::new(&two()).unwrap();
    for q_tilde_m in [
        [-2e-3, 1e-3, 1e-3, 0.5e-3, 1.5e-3, -2e-3],
        [0.5e-3, 0.5e-3, 0.5e-3, -1e-3, 2e-3, -1e-3],
        [1.5e-3, -2.5e-3, 1e-3, 2e-3, -1e-3, -1e-3],
    ] {
        segments.move_to(&q_tilde_m);
        let ([x1, y1], [x2, y2]) = (segments.bend_rad(0), segments.bend_rad(1));
        // The stretches follow from the loads that pass.
        let axial_n = 54e9 * PI / 4.0 * (0.66e-3_f64.powi(2) - 0.50e-3_f64.powi(2));
        let loads: Vec<f64> = segments.loads_n().collect();
        let (u1, u2) = (loads.iter().sum::<f64>() * L_M / axial_n, loads[3..].iter().sum::<f64>() * L_M / axial_n);
        let z = [x1, y1, u1, x2, y2, u2];
        for k in 0..6 {
            let h = if k % 3 == 2 { 1e-7 } else { 1e-4 };
            let at = |by: f64| {
                let mut z = z;
                z[k] += by;
                energy_j(&q_tilde_m, &z)
            };
            let (slope, curvature) = ((at(h) - at(-h)) / (2.0 * h), (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h));
            let off = slope / curvature;
            assert!(curvature > 0.0 && off.abs() < if k % 3 == 2 { 1e-9 } else { 1e-6 }, "{q_tilde_m:?} {k}: {off}");
        }
        assert!(x1.hypot(y1) > 0.05 && x2.hypot(y2) > 0.1, "{z:?}");
    }
    assert_eq!(segments.n_unsolved(), 0);
}

#[test]
fn a_distal_segment_that_bends_moves_the_proximal_one_too() {
    // Lines of the second segment pushed as if nothing gave: the first one's lines stand still, and it bends all the same.
    let mut segments = SimulatedSegments::new(&two()).unwrap();
    let q_m = [60.0, 180.0, 300.0].map(|deg: f64| -R_M * 0.6 * deg.to_radians().cos());
    segments.move_to(&[0.0, 0.0, 0.0, q_m[0], q_m[1], q_m[2]]);
    let ([x1, y1], [x2, y2]) = (segments.bend_rad(0), segments.bend_rad(1));
    assert!(x1 > 0.05 && y1.abs() < 1e-9 && x2 > 0.1 && y2.abs() < 1e-9, "{x1} {y1} {x2} {y2}");
    assert!(x1 + x2 < 0.6, "the lines give");
    assert!(segments.loads_n().sum::<f64>().abs() < 1.0);
}

#[test]
fn a_path_s_number_of_commands_does_not_matter_and_bad_places_move_nothing() {
    let mut truth = two();
    (truth.effects.play_m, truth.effects.mu, truth.effects.f_s_n) = (1.8e-4, 0.17, 1.9);
    let there = [-2e-3, 1e-3, 1e-3, 0.5e-3, 1.5e-3, -2e-3];
    let (mut at_once, mut in_steps) =
        (SimulatedSegments::new(&truth).unwrap(), SimulatedSegments::new(&truth).unwrap());
    at_once.move_to(&there);
    for k in 1..=80 {
        in_steps.move_to(&there.map(|q: f64| q * f64::from(k) / 80.0));
    }
    for j in 0..2 {
        let (a, b) = (at_once.bend_rad(j), in_steps.bend_rad(j));
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-6, "{a:?} {b:?}");
    }
    let before = at_once.bend_rad(0);
    at_once.move_to(&[f64::NAN; 6]);
    at_once.move_to(&[1e-3; 5]);
    assert_eq!(at_once.bend_rad(0), before);
}

#[test]
fn truths_that_cannot_be_are_refused() {
    type Edit = fn(&mut SegmentsTruth);
    let edits: [(&str, Edit); 9] = [
        ("0 segments", |t| t.segment.clear()),
        ("4 segments", |t| t.segment = vec![segment(&[0.0, 120.0, 240.0]); 4]),
        ("2 lines", |t| t.segment = vec![segment(&[0.0, 120.0])]),
        ("13 lines", |t| t.segment[1].azimuths_rad = vec![1.0; 10]),
        ("effects.mu is NaN", |t| t.effects.mu = f64::NAN),
        ("effects.play_m is 1", |t| t.effects.play_m = 1.0),
        ("r_m is 0.02", |t| t.segment[1].machine.r_m = 0.02),
        ("l_m is 0.026, expected 0.032", |t| t.segment[1].machine.r_m = 0.004),
        ("azimuths_rad is 7", |t| t.segment[0].azimuths_rad[1] = 7.0),
    ];
    for (words, edit) in edits {
        let mut truth = two();
        edit(&mut truth);
        let refused: SegmentsTruthError = SimulatedSegments::new(&truth).unwrap_err();
        assert!(refused.to_string().contains(words), "{words}: {refused}");
    }
}
