//! A force of several joints: each joint's effects are named with it, also those of a joint whose force is small beside another one's.

use super::force_columns::{Made, made};
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict};
use krait_lab::machine::ForceLab;
use krait_lab::{AddOptions, Term, add, offered};
use krait_model::model_file::ModelFile;
use std::path::Path;

const N: usize = 2;
/// The second joint's forces, and their noise, are this part of the first one's.
const SMALL: f64 = 0.05;

/// Two joints, the second one small; `hidden` is what it has besides, of its angle and of the sign of its motion, before it is made small.
fn two_joints(seed: u64, hidden: impl Fn(f64, f64) -> f64) -> Made {
    let mut made = made(N, seed);
    let angle: Vec<f64> = made.angle_rad.iter().skip(1).step_by(N).copied().collect();
    for (row, torque) in made.torque_nm.iter_mut().skip(1).step_by(N).enumerate() {
        let (before, after) = (angle[row.saturating_sub(5)], angle[(row + 5).min(angle.len() - 1)]);
        *torque = SMALL * (*torque + hidden(angle[row], (after - before).signum()));
    }
    made
}

/// Effects with their joints, in the order of the alphabet.
fn named(diagnosis: &Diagnosis) -> Vec<(&str, Option<usize>)> {
    let mut all: Vec<_> = diagnosis.effects.iter().map(|own| (own.name.as_str(), own.joint)).collect();
    all.sort_unstable();
    all
}

fn value(diagnosis: &Diagnosis, effect: &str, joint: usize, parameter: &str) -> f64 {
    let own = diagnosis.effects.iter().find(|own| own.name == effect && own.joint == Some(joint)).expect("named");
    own.parameters.iter().find(|own| own.name == parameter).expect("a parameter").value
}

#[test]
fn every_joint_of_a_force_has_its_own_effects_however_small_it_is() {
    let diagnosis = two_joints(3, |_, _| 0.0).diagnosed("", &DiagnoseOptions::default());
    let expected: Vec<_> = ["coulomb", "gravity", "inertia", "viscous"]
        .into_iter()
        .flat_map(|name| [(name, Some(1)), (name, Some(2))])
        .collect();
    assert_eq!((diagnosis.verdict, named(&diagnosis)), (Verdict::Missing, expected), "{}", diagnosis.sentence);
    for (joint, size) in [(1, 1.0), (2, SMALL)] {
        // The second joint has seven tenths of the first one's weight and inertia, and as much friction.
        let part = if joint == 1 { 1.0 } else { 0.7 };
        for (effect, parameter, truth) in [
            ("coulomb", "torque", 0.15),
            ("gravity", "sine", 1.2 * part),
            ("inertia", "inertia", 0.05 * part),
            ("viscous", "drag", 0.08),
        ] {
            let own = value(&diagnosis, effect, joint, parameter) / (size * truth);
            assert!((own - 1.0).abs() < 0.1, "{effect} of joint {joint}: {own} of the truth");
        }
    }
    assert_eq!(diagnosis.terms.len(), 8);
    let joints: Vec<f64> = diagnosis.terms.iter().map(|term| term.values[0]).collect();
    assert!(joints.iter().all(|joint| *joint == 1.0 || *joint == 2.0), "each on one joint: {joints:?}");
    assert!(diagnosis.sentence.contains(" on joint 1"), "{}", diagnosis.sentence);
    let floor = diagnosis.noise_floor.expect("known where nothing is left");
    assert!(diagnosis.final_heldout_rms < 1.3 * floor, "{} beside {floor}", diagnosis.final_heldout_rms);
    assert!(diagnosis.candidates.iter().filter(|own| own.state.starts_with("chosen")).count() == 4);
}

#[test]
fn what_the_model_has_of_one_joint_stays_and_a_formula_is_found_on_the_joint_that_has_it() {
    let own = |kind: &str, value: &str| format!("[[effect]]\nkind = \"{kind}\"\njoint = 1\n{value}\n");
    let base = own("gravity", "sine = 1.2")
        + &own("inertia", "inertia = 0.05")
        + &own("coulomb", "torque = 0.15")
        + &own("viscous", "drag = 0.08");
    let rub = "format = 1\n[machine]\nkind = \"force\"\nn = 2\nunit = \"Nm\"\n[[effect]]\nkind = \"formula\"\nname = \"rub\"\n\
               hook = \"force\"\nformula = \"a * motion_i * exp(0 - ((angle_i - c) / w)^2)\"\n\
               params = { a = 0.005, c = 0.3, w = 0.3 }\n";
    let file = ModelFile::parse(rub).expect("a model");
    let offered = offered(Path::new("own.toml"), &file, file.machine()).expect("a formula with a size");
    let made = two_joints(3, |angle, motion| 0.2 * motion * f64::exp(-((angle - 0.4) / 0.25_f64).powi(2)));
    let diagnosis = made.diagnosed(&base, &DiagnoseOptions { offered, ..DiagnoseOptions::default() });
    let expected = ["coulomb", "gravity", "inertia", "rub", "viscous"].map(|name| (name, Some(2)));
    assert_eq!((diagnosis.verdict, named(&diagnosis)), (Verdict::Missing, expected.to_vec()), "{}", diagnosis.sentence);
    let size = value(&diagnosis, "rub", 2, "a").abs() / (0.2 * SMALL);
    assert!((size - 1.0).abs() < 0.15, "{size} of the truth");
    let texts: Vec<&str> =
        diagnosis.terms.iter().filter_map(|term| Some(term.formula.as_ref()?.text.as_str())).collect();
    assert!(texts.len() == 1 && texts[0].starts_with("max(1 - abs(joint - 2), 0) * ("), "{texts:?}");
    let kept: Vec<(&str, &[f64])> =
        diagnosis.terms.iter().take(4).map(|term| (term.name.as_str(), &term.values[..])).collect();
    assert_eq!(kept[1], ("inertia", &[1.0, 0.05][..]), "{kept:?}");
    let rub = diagnosis.effects.iter().find(|own| own.name == "rub").expect("named");
    assert!(diagnosis.term_of(rub).is_some(), "its term is found by its name and joint");
}

/// The large joint would gain more by it. What else a joint has makes its weight half right.
#[test]
fn an_effect_is_added_on_the_joint_that_is_asked_for() {
    let (machine, data) = two_joints(3, |_, _| 0.0).filtered("");
    let has_one = "[[effect]]\nkind = \"gravity\"\njoint = 1\nsine = 1.2\n";
    let (with_one, _) = two_joints(3, |_, _| 0.0).filtered(has_one);
    let added = |machine: &ForceLab, joint: f64| {
        let term = Term::new("gravity", vec![joint, 0.0, 0.0]);
        let options =
            AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() };
        add(machine, &data, &options).expect("fitted").terms.pop().expect("an effect")
    };
    let small = 1.2 * 0.7 * SMALL;
    for (machine, joint, size) in [(&machine, 1.0, 1.2), (&machine, 2.0, small), (&with_one, 2.0, small)] {
        let own = added(machine, joint);
        assert!(own.values[0] == joint && (own.values[1] / size - 1.0).abs() < 0.5, "{own:?} beside {size}");
    }
    assert_eq!(added(&machine, 0.0).values[0], 1.0, "without a joint, where it helps most");
}
