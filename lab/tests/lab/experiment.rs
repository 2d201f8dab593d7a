//! The next experiment of a joint: the motion that is proposed leaves fewer laws alike than two cycles did.

use krait_lab::Measurements;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use krait_lab::experiment::{Experiment, experiment};
use krait_lab::machine::JointsLab;
use krait_lab::read::{ColumnMap, read};
use krait_model::model_file::ModelFile;
use std::path::PathBuf;

const GAIN: f64 = -0.9;
const OFFSET_RAD: f64 = 1.2;
/// Two plays side by side, a weight and a half-width (rad) each: Prandtl and Ishlinskii's hysteresis.
const PLAYS: [(f64, f64); 2] = [(0.5, 0.01), (0.5, 0.05)];
const TRUTH: &str = "prandtl-ishlinskii";
const NOISE_RAD: f64 = 0.015;

fn machine() -> (ModelFile, JointsLab) {
    let file = ModelFile::parse("format = 1\n[machine]\nkind = \"joints\"\nn = 1\n").expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    (file, machine)
}

/// Commands at 50 Hz: two cycles of a triangle over 1 rad, 0.1 Hz.
fn two_cycles() -> Vec<f64> {
    (0..1000).map(|row| 1.0 - 2.0 * ((f64::from(row) / 500.0).fract() - 0.5).abs()).collect()
}

/// What an encoder behind the plays shows of commands, with white noise of its own.
fn measured(name: &str, commands: &[f64], period_s: f64) -> Measurements {
    let (mut played, mut state) = ([commands[0]; 2], 7_u64);
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut text = "time_s,u1_rad,y1_rad\n".to_owned();
    for (row, command) in commands.iter().enumerate() {
        for (played, (_, half_width_rad)) in played.iter_mut().zip(PLAYS) {
            *played = played.max(command - half_width_rad).min(command + half_width_rad);
        }
        let passed: f64 = played.iter().zip(PLAYS).map(|(played, (weight, _))| weight * played).sum();
        let noise: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let y = OFFSET_RAD + GAIN * passed + NOISE_RAD * noise;
        text += &format!("{},{command},{y}\n", row as f64 * period_s);
    }
    let path = folder().join(name);
    std::fs::write(&path, text).expect("written");
    read(&path, &ColumnMap::default(), machine().0.machine().into()).expect("good data")
}

fn folder() -> PathBuf {
    let path = std::env::temp_dir().join(format!("krait-lab-experiment-{}", std::process::id()));
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn diagnosed(data: &Measurements) -> Diagnosis {
    diagnose(&machine().1, data, &DiagnoseOptions::default()).expect("a chain")
}

fn proposed(data: &Measurements) -> Experiment {
    let (file, machine) = machine();
    experiment(&machine, file.machine(), data, &diagnosed(data), &[]).expect("a chain").expect("a joint that moves")
}

/// Times and commands of a script.
fn commands(script: &str) -> (Vec<f64>, Vec<f64>) {
    let rows = script.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|row| {
        let (time_s, command) = row.split_once(',').expect("two columns");
        (time_s.parse::<f64>().expect("a time"), command.parse::<f64>().expect("a command"))
    })
    .unzip()
}

#[test]
fn after_the_motion_that_is_proposed_fewer_laws_are_alike_than_after_two_cycles() {
    let data = measured("first.csv", &two_cycles(), 0.02);
    let before = diagnosed(&data);
    let alike = before.effects.iter().find(|own| own.class.iter().any(|name| name == TRUTH));
    let n_alike = alike.unwrap_or_else(|| panic!("{}", before.sentence)).class.len();
    assert!(n_alike > 1, "two cycles leave laws of hysteresis alike: {}", before.sentence);

    let motion = proposed(&data);
    let separation = motion.separation.as_ref().expect("look-alikes");
    assert!(!motion.moves.is_empty() && (motion.seconds - separation.seconds).abs() < 0.1, "{:?}", motion.moves);
    let promised: Vec<&str> = separation
        .pairs
        .iter()
        .filter(|pair| pair.truth == TRUTH && pair.is_told())
        .map(|pair| pair.other.as_str())
        .collect();
    assert!(!promised.is_empty(), "{separation:?}");
    // A difference that is no chance and too small to matter is no promise.
    let small = |pair: &krait_lab::experiment::Pair| pair.is_beyond_chance() && !pair.is_told();
    assert!(separation.pairs.iter().any(small), "{separation:?}");
    let (time_s, told) = commands(&motion.script);
    assert!((time_s[time_s.len() - 1] - motion.seconds).abs() < 0.1);
    let low = data.inputs.iter().copied().fold(f64::INFINITY, f64::min);
    let high = data.inputs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(told.iter().all(|u| (low - 1e-6..=high + 1e-6).contains(u)), "beyond what the data show of the joint");
    assert_eq!(motion.script, proposed(&data).script, "the same data, the same motion");

    // The same joint does as it is told.
    let after = diagnosed(&measured("next.csv", &told, time_s[1] - time_s[0]));
    let named = after.effects.iter().find(|own| own.class.iter().any(|name| name == TRUTH));
    let named = named.unwrap_or_else(|| panic!("{}", after.sentence));
    assert!(named.class.len() < n_alike, "{} of {n_alike} left: {}", named.class.len(), after.sentence);
    let kept = promised.iter().find(|name| named.class.iter().any(|own| own == *name));
    assert!(kept.is_none(), "{kept:?} was promised to go: {}", after.sentence);
}

#[test]
fn a_joint_that_stood_still_has_no_experiment() {
    let (file, machine) = machine();
    let data = measured("moving.csv", &two_cycles(), 0.02);
    let diagnosis = diagnosed(&data);
    let still = Measurements { inputs: vec![0.5; data.inputs.len()], ..data };
    assert!(experiment(&machine, file.machine(), &still, &diagnosis, &[]).expect("a chain").is_none());
}
