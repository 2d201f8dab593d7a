//! Loads in the likelihood: how fits scatter, and what a common gain is taken for.

use super::*;
use crate::fit::{Variable, fit};
use crate::machine::SnakeLab;
use crate::{Quantity, Term};
use core::f64::consts::{PI, TAU};
use krait_model::model_file::ModelFile;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Load scale, play's half-width (m), f_s (N), friction of the cone.
const TRUTH: [f64; 4] = [1.22, 0.089e-3, 1.959, 0.1727];
/// Rows at each pose, so that twenty poses are rows enough; each has so much more noise.
const AT_A_POSE: usize = 5;
/// Lines of a snake.
const N: usize = 3;

/// Encoders (m) and loads at the actuators (N) at a bend, all lines sliding, from the equations.
fn bench(bend_rad: f64, way: f64) -> ([f64; 3], [f64; 3]) {
    let [eta, h, f_s, mu] = TRUTH;
    let ea = 54e9 * PI / 4.0 * (0.66e-3_f64.powi(2) - 0.5e-3_f64.powi(2));
    let ei = 54e9 * PI / 64.0 * (0.66e-3_f64.powi(4) - 0.5e-3_f64.powi(4));
    let (l, r) = (26e-3, 1.684e-3);
    let j = [-r, 0.5 * r, 0.5 * r];
    let sum: f64 = 1.0 / l + j.iter().map(|j| 1.0 / (l + j * bend_rad)).sum::<f64>();
    let slope: f64 = j.iter().map(|j| -j / (l + j * bend_rad).powi(2)).sum();
    let moment = ei * (bend_rad * sum + 0.5 * bend_rad * bend_rad * slope);
    let across: f64 = j.iter().map(|j| j * j).sum();
    let loads = j.map(|j| {
        let (t, s) = (eta * moment * j / across, way * j.signum());
        let slid = t + s * f_s;
        slid * (2.0 * mu * 41_f64.to_radians() * if s * slid > 0.0 { 1.0 } else { -1.0 }).exp()
    });
    let reading = core::array::from_fn(|i| {
        j[i] * bend_rad + eta * moment * j[i] / across * 0.48 / ea + loads[i] * 0.058 / ea + way * j[i].signum() * h
    });
    (reading, loads)
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    (-2.0 * (1.0 - uniform()).ln()).sqrt() * (TAU * uniform()).cos()
}

/// Up to 62 degrees and back, measured at ten bends from 10 to 60 degrees each way, or everywhere.
fn measured(seed: u64, sigma: [f64; 2], everywhere: bool) -> Measurements {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let poses: Vec<f64> = (0..10).map(|k| 10.0 + 50.0 * f64::from(k) / 9.0).collect();
    let mut up: Vec<(f64, bool)> = (1..=124).map(|k| (0.5 * f64::from(k), false)).collect();
    up.extend(poses.iter().flat_map(|pose| [(*pose, true); AT_A_POSE]));
    up.sort_by(|a, b| a.0.total_cmp(&b.0));
    let path = up.iter().map(|own| (*own, 1.0)).chain(up.iter().rev().map(|own| (*own, -1.0)));
    let (mut inputs, mut outputs, mut loads) = (Vec::new(), Vec::new(), Vec::new());
    for ((bend_deg, is_measured), way) in path {
        let (reading, own) = bench(bend_deg.to_radians(), way);
        inputs.extend(reading);
        let seen = [bend_deg.to_radians(), 0.0].map(|b| b + sigma[0] * normal(&mut random));
        outputs.extend(if is_measured || everywhere { seen } else { [f64::NAN; 2] });
        loads.extend(own.map(|n| n + sigma[1] * normal(&mut random)));
    }
    let time_s = (0..outputs.len() / 2).map(|k| 0.1 * k as f64).collect();
    let bare = Measurements::bare(String::new(), Quantity::Snake, time_s, (inputs, 3), (outputs, 2));
    Measurements { loads_n: Some(loads), ..bare }
}

/// Camera 1 degree, cells 0.1 N, twenty poses: what the rows of the likelihood predict, with gains and offsets of the cells free.
#[test]
fn fits_scatter_as_the_rows_of_the_likelihood_predict() {
    const PREDICTED: [f64; 4] = [0.0140, 0.00702e-3, 0.0729, 0.4564 / 41.0 * 0.1727];
    const SEEDS: u64 = 60;
    let file = ModelFile::parse("format = 1\n\n[machine]\nkind = \"snake\"\n").unwrap();
    let lab = SnakeLab::new(&file).unwrap();
    let effects: Vec<Term> = ["stiffness-scale", "backlash", "static-friction", "cone-friction"]
        .into_iter()
        .zip(TRUTH)
        .map(|(name, value)| Term::new(name, vec![1.05 * value]))
        .collect();
    let variables: Vec<Variable> =
        (0..4).map(|k| Variable::new(&lab, &effects, k, 0, 0.1 * TRUTH[k]).unwrap()).collect();
    let sigma = [1_f64.to_radians(), 0.1].map(|sigma| sigma * (AT_A_POSE as f64).sqrt());
    let cells = Cells { sigma_n: vec![sigma[1]; N], sigma_output: sigma[0], is_white: true };
    let mut sums = [[0.0; 2]; 4];
    for seed in 0..SEEDS {
        let problem = Problem::new(&lab, measured(seed, sigma, false), &[], 1.0).with_loads(Some(&cells));
        assert_eq!((problem.width(), problem.n_scored), (5, 5 * 20 * AT_A_POSE));
        let found = fit(&problem, &effects, &variables, 30, 1e-9).unwrap();
        for ((sums, term), truth) in sums.iter_mut().zip(&found.effects).zip(TRUTH) {
            let off = term.values[0] - truth;
            *sums = [sums[0] + off, sums[1] + off * off];
        }
    }
    for ((sums, predicted), term) in sums.iter().zip(PREDICTED).zip(&effects) {
        let n = SEEDS as f64;
        let (mean, sd) = (sums[0] / n, (sums[1] / n - (sums[0] / n).powi(2)).sqrt());
        println!("{}: sd {sd:.3e}, predicted {predicted:.3e}, mean error {mean:.3e}", term.name);
        // Sixty fits know their scatter to 9 %.
        assert!((sd / predicted - 1.0).abs() < 0.25 && mean.abs() < 3.0 * predicted / n.sqrt(), "{}", term.name);
    }
}

/// Loads that all read so many newtons for each, which are stated to be one give or take `gain_sd`.
fn estimated(reads: f64, gain_sd: f64) -> (Measurements, Cells) {
    let (sigma, sigma_n) = (0.2_f64.to_radians(), 0.05);
    let mut data = measured(7, [sigma, sigma_n], true);
    data.load_use = LoadUse::Estimated { gain_sd };
    data.loads_n = data.loads_n.map(|loads| loads.iter().map(|n| reads * n).collect());
    (data, Cells { sigma_n: vec![sigma_n; N], sigma_output: sigma, is_white: true })
}

fn with_true_effects() -> (SnakeLab, Vec<Term>) {
    let file = ModelFile::parse("format = 1\n\n[machine]\nkind = \"snake\"\n").unwrap();
    let names = ["stiffness-scale", "backlash", "static-friction", "cone-friction"];
    let effects = names.into_iter().zip(TRUTH).map(|(name, value)| Term::new(name, vec![value])).collect();
    (SnakeLab::new(&file).unwrap(), effects)
}

/// What is left of estimated loads has the squares of the best common gain with its prior's share, which is searched for here.
#[test]
fn a_common_gain_with_its_prior_is_taken_out_of_the_squares_of_estimated_loads() {
    let (lab, effects) = with_true_effects();
    for (reads, gain_sd) in [(1.0, 0.3), (1.4, 0.3), (1.4, 0.01), (0.7, 0.001), (1.4, 30.0)] {
        let (data, cells) = estimated(reads, gain_sd);
        let rows = LoadRows::new(&data, &cells, |row| data.outputs[2 * row].is_finite()).unwrap();
        let (_, predicted_n) = lab.predict_with_loads(&effects, &data).unwrap();
        let predicted_n = predicted_n.unwrap();
        let squares = |residual: &[f64]| residual.iter().map(|x| x * x).sum::<f64>();
        // In one trial the best offset of a gain is the mean of what it leaves.
        let left_by = |gain: f64| {
            let of_line = |line: usize| {
                let left: Vec<f64> = rows
                    .rows
                    .iter()
                    .map(|row| data.loads_n.as_ref().unwrap()[row * N + line] - gain * predicted_n[row * N + line])
                    .collect();
                let mean = left.iter().sum::<f64>() / left.len() as f64;
                left.iter().map(|x| ((x - mean) * cells.sigma_output / cells.sigma_n[line]).powi(2)).sum::<f64>()
            };
            (0..N).map(of_line).sum::<f64>() + ((gain - 1.0) / gain_sd * cells.sigma_output).powi(2)
        };
        let (best, least) = (0..=4000)
            .map(|k| 0.5 + 2.5e-4 * f64::from(k))
            .map(|gain| (gain, left_by(gain)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        let found = squares(&rows.residual(&predicted_n));
        assert!((found / least - 1.0).abs() < 1e-3, "reads {reads}, sd {gain_sd}: {found:e}, by a search {least:e}");
        assert!((rows.cell(0, &predicted_n).gain - best).abs() < 5e-4, "reads {reads}, sd {gain_sd}: {best}");
    }
}

/// Estimated loads that read 25 % too much: with their uncertainty stated the stiffness is not drawn after them, as it is by cells
/// that are said to be right.
#[test]
fn a_stated_uncertainty_of_the_gain_keeps_wrong_loads_from_bending_the_stiffness() {
    let (lab, effects) = with_true_effects();
    let variables: Vec<Variable> =
        (0..4).map(|k| Variable::new(&lab, &effects, k, 0, 0.1 * TRUTH[k]).unwrap()).collect();
    let stiffness = |load_use: LoadUse| {
        let (data, cells) = estimated(1.25, 0.3);
        let problem = Problem::new(&lab, Measurements { load_use, ..data }, &[], 1.0).with_loads(Some(&cells));
        fit(&problem, &effects, &variables, 30, 1e-9).unwrap().effects[0].values[0]
    };
    let (stated, believed) =
        (stiffness(LoadUse::Estimated { gain_sd: 0.3 }), stiffness(LoadUse::Counted { gain_apart: 0.005 }));
    println!("stiffness {stated:.3} with the uncertainty stated, {believed:.3} with loads believed, true {}", TRUTH[0]);
    assert!((stated / TRUTH[0] - 1.0).abs() < 0.05 && believed / TRUTH[0] - 1.0 > 0.1, "{stated} {believed}");
}

/// No estimate is taken for better than its stated part of its own size, however still it stands.
#[test]
fn the_noise_of_estimated_loads_has_a_floor() {
    let [eta, h, f_s, mu] = TRUTH;
    let effects = format!(
        "[[effect]]\nkind = \"stiffness-scale\"\neta = {eta}\n[[effect]]\nkind = \"static-friction\"\nf_s_n = {f_s}\n[[effect]]\nkind = \
         \"cone-friction\"\nmu = {mu}\n[[effect]]\nkind = \"backlash\"\nhalf_width_m = {h}\n"
    );
    let file = ModelFile::parse(&format!("format = 1\n\n[machine]\nkind = \"snake\"\n{effects}")).unwrap();
    let lab = SnakeLab::new(&file).unwrap();
    let sigma_n = |gain_sd: f64| {
        let (data, _) = estimated(1.0, gain_sd);
        let problem = Problem::new(&lab, data, &[], 1.0);
        match Usable::of(&lab, &problem, Some(0.2_f64.to_radians()), 1.0).unwrap() {
            Usable::Cells(cells) => cells.sigma_n,
            other => panic!("{other:?}"),
        }
    };
    let (small, half, whole) = (sigma_n(0.001), sigma_n(0.15), sigma_n(0.3));
    println!("{small:?} {half:?} {whole:?} N");
    for line in 0..N {
        assert!(whole[line] > 3.0 * small[line] && (half[line] / whole[line] - 0.5).abs() < 0.01);
    }
}
