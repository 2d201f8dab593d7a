//! Joints with hidden effects from a plant of its own: known ones are named beside ones that no effect of the lab makes.

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::JointsLab;
use krait_lab_benchmark::joints::{JOINTS_MODEL, JointKind, JointRecipe, joints};
use krait_model::model_file::ModelFile;

fn diagnosed(hidden: &[(&str, f64)], seed: u64) -> Diagnosis {
    let file = ModelFile::parse(JOINTS_MODEL).expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    let kind = |&(name, size): &(&str, f64)| (JointKind::from_name(name).expect("a kind"), size);
    let recipe =
        JointRecipe { hidden: hidden.iter().map(kind).collect(), seconds: 60.0, seed, ..JointRecipe::default() };
    let (data, _) = joints(&recipe).expect("data");
    diagnose(&machine, &data, &DiagnoseOptions { max_effects: 3, ..DiagnoseOptions::default() }).expect("a chain")
}

#[test]
fn what_no_effect_makes_is_not_taken_for_one_and_what_it_looks_like_is_said() {
    let shapes = [("x_collision", "jump"), ("x_kink", "slope"), ("x_product", "product"), ("x_sway", "rhythm")];
    for (seed, (kind, word)) in (40..).zip(shapes) {
        let found = diagnosed(&[(kind, 3.0)], seed);
        assert_eq!(found.verdict, Verdict::Unknown, "{kind}: {}", found.sentence);
        assert!(found.remaining.looks_like.is_some_and(|own| own.contains(word)), "{kind}: {:?}", found.remaining);
    }
}

#[test]
fn a_known_effect_beside_one_that_no_effect_makes_is_named_and_the_rest_is_said() {
    for (seed, unknown) in (50..).zip(["x_collision", "x_kink"]) {
        let found = diagnosed(&[(unknown, 2.5), ("play", 3.0)], seed);
        let names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
        assert_eq!((found.verdict, names.as_slice()), (Verdict::Partly, &["backlash"][..]), "{}", found.sentence);
    }
}

#[test]
fn three_effects_of_one_joint_are_named_and_the_other_joint_is_left_alone() {
    let found = diagnosed(&[("play", 3.0), ("cubic", 2.0), ("delay", 3.0)], 60);
    let mut names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["backlash", "cubic", "latency"], "{}", found.sentence);
    assert!(found.effects.iter().all(|own| own.joint == Some(1)), "{}", found.sentence);
}
