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
    diagnosed_with(DiagnoseOptions::default(), first, others)
}

fn diagnosed_with(
    options: DiagnoseOptions,
    first: Measurements,
    others: impl IntoIterator<Item = Measurements>,
) -> Diagnosis {
    let (data, recordings) = Measurements::joined(first, others);
    diagnose(&lab(), &data, &DiagnoseOptions { recordings, ..options }).unwrap()
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

/// Two recordings of a stiffer snake; the bends of each are seen larger by these angles, deg.
fn by_cameras(offsets_deg: [[f64; 2]; 2]) -> Diagnosis {
    let one = |k: usize| {
        let mut made = made_on(motion_of(800, 1), &[term("stiffness-scale", &[1.15])], 700 + k as u64);
        let seen = |(i, own): (usize, &mut f64)| *own += offsets_deg[k][i % 2].to_radians();
        made.outputs.iter_mut().enumerate().for_each(seen);
        Measurements { source: format!("run{k}.csv"), ..made }
    };
    diagnosed_with(DiagnoseOptions { is_locked: true, max_effects: 2, ..DiagnoseOptions::default() }, one(0), [one(1)])
}

fn names(found: &Diagnosis) -> Vec<&str> {
    found.effects.iter().map(|own| own.name.as_str()).collect()
}

#[test]
fn a_camera_that_was_mounted_anew_is_calibration_of_its_recording() {
    let found = by_cameras([[0.0, 0.0], [0.8, -0.5]]);
    assert_eq!((found.verdict, names(&found).len()), (Verdict::Missing, 1), "{} {:?}", found.sentence, names(&found));
    assert!(found.effects[0].class.iter().any(|name| name == "stiffness-scale"), "{}", found.sentence);
    let noise_deg = NOISE_RAD.to_degrees() * core::f64::consts::SQRT_2;
    assert!((found.final_heldout_rms / noise_deg - 1.0).abs() < 0.05, "{} deg", found.final_heldout_rms);
    for (name, truth_deg) in [("camera-offset-x", 0.8), ("camera-offset-y", -0.5)] {
        let own = found.calibration.iter().find(|own| own.name == name).unwrap();
        assert_eq!(own.recording.as_deref(), Some("run1.csv"));
        let off_deg = (own.value.to_degrees() - truth_deg).abs();
        assert!(off_deg < 3.0 * own.se.to_degrees() && own.se.to_degrees() < 0.1, "{name} {} +- {}", own.value, own.se);
    }
    assert!(found.cameras[0].is_none() && !found.cameras[1].is_none());
    assert!(found.cautions.iter().any(|own| own.contains("stood otherwise than in run0.csv")), "{:?}", found.cautions);
    // The second recording is the one that no choice has seen: where its camera stands, its first third says. The noise of the rows
    // behind it is known to 2 %; unmoved, the error would be more than twice the noise.
    let locked = found.locked.as_ref().unwrap();
    assert!(
        locked.effects.len() == 1 && (locked.rms / noise_deg - 1.0).abs() < 0.1 && locked.base_rms > 2.0 * locked.rms,
        "{locked:?}"
    );
}

#[test]
fn a_camera_that_stands_alike_in_all_recordings_is_no_calibration_of_one() {
    let straight = by_cameras([[0.0, 0.0]; 2]);
    assert_eq!((straight.verdict, straight.cameras.len()), (Verdict::Missing, 0), "{}", straight.sentence);
    let found = by_cameras([[0.8, -0.5]; 2]);
    assert_eq!((found.verdict, found.cameras.len()), (Verdict::Missing, 0), "{} {:?}", found.sentence, found.cautions);
    let is_named = |kind: &str| found.effects.iter().any(|own| own.class.iter().any(|name| name == kind));
    assert!(is_named("stiffness-scale") && is_named("camera-offset"), "{:?}", names(&found));
}
