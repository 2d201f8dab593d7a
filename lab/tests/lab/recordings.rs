//! Several recordings of one snake: each is judged by what the others say, and one that contradicts them is named.

use super::diagnose::{NOISE_RAD, lab, made_on, motion_of, term};
use krait_lab::Measurements;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};

/// Recordings of 40 s of snakes of these stiffnesses, called by their number.
fn together(etas: &[f64]) -> Diagnosis {
    let one = |(k, eta): (usize, &f64)| {
        let made = made_on(motion_of(800, 1), &[term("stiffness-scale", &[*eta])], 500 + k as u64);
        Measurements { source: format!("run{k}.csv"), ..made }
    };
    let mut all = etas.iter().enumerate().map(one);
    diagnosed(all.next().unwrap(), all)
}

fn diagnosed(first: Measurements, others: impl IntoIterator<Item = Measurements>) -> Diagnosis {
    let (data, recordings) = Measurements::joined(first, others);
    diagnose(&lab(), &data, &DiagnoseOptions { recordings, ..DiagnoseOptions::default() }).unwrap()
}

fn odd(found: &Diagnosis) -> Vec<&str> {
    let cautions = found.cautions.iter().filter_map(|own| own.split_once(" disagrees with the other recordings: "));
    cautions.map(|(name, _)| name).collect()
}

#[test]
fn recordings_of_one_snake_agree_and_each_is_predicted_by_the_others() {
    let found = together(&[1.15; 3]);
    assert_eq!((found.verdict, odd(&found).len()), (Verdict::Missing, 0), "{}", found.sentence);
    assert!(found.effects[0].class.iter().any(|name| name == "stiffness-scale"), "{}", found.sentence);
    let noise_deg = NOISE_RAD.to_degrees() * core::f64::consts::SQRT_2;
    assert!((found.final_heldout_rms / noise_deg - 1.0).abs() < 0.05, "{} deg", found.final_heldout_rms);
}

#[test]
fn a_recording_that_contradicts_the_others_is_named() {
    let found = together(&[1.25, 1.25, 1.0, 1.25]);
    assert_eq!(odd(&found), ["run2.csv"], "{:?}", found.cautions);
    assert_ne!(found.verdict, Verdict::Missing, "{}", found.sentence);
}

/// One in which the machine hardly moves has nothing to explain.
#[test]
fn a_recording_in_which_nothing_is_to_be_seen_contradicts_nobody() {
    let one = |k: u64, size: f64| {
        let mut motion = motion_of(800, 1);
        motion.inputs.iter_mut().for_each(|q| *q *= size);
        let made = made_on(motion, &[term("stiffness-scale", &[1.15])], 600 + k);
        Measurements { source: format!("run{k}.csv"), ..made }
    };
    let found = diagnosed(one(0, 1.0), [one(1, 1.0), one(2, 0.02), one(3, 1.0)]);
    assert_eq!((found.verdict, odd(&found).len()), (Verdict::Missing, 0), "{:?}", found.cautions);
}

#[test]
fn what_one_recording_alone_has_is_not_asserted_of_all() {
    let found = together(&[1.3, 0.96, 0.96]);
    assert!(found.verdict == Verdict::Unknown && found.effects.is_empty(), "{} {:?}", found.sentence, found.cautions);
}
