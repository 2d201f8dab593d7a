//! A joint's torque with hidden parts from a plant of its own: known ones are named beside ones that no effect of the lab makes.

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::ForceLab;
use krait_lab_benchmark::force::{FORCE_MODEL, ForceKind, ForceRecipe, force};
use krait_model::model_file::ModelFile;

fn diagnosed(hidden: &[(&str, f64)], sweeps: bool, seed: u64) -> Diagnosis {
    let machine = ForceLab::new(&ModelFile::parse(FORCE_MODEL).expect("a model")).expect("of kind force");
    let kind = |&(name, size): &(&str, f64)| (ForceKind::from_name(name).expect("a kind"), size);
    let recipe = ForceRecipe { hidden: hidden.iter().map(kind).collect(), sweeps, seed, ..ForceRecipe::default() };
    let (data, ..) = force(&recipe).expect("data");
    let data = machine.filtered(data).expect("filtered");
    diagnose(&machine, &data, &DiagnoseOptions::default()).expect("it can be computed")
}

fn names(found: &Diagnosis) -> Vec<&str> {
    let mut names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    names.sort_unstable();
    names
}

#[test]
fn what_no_effect_makes_is_not_taken_for_one_and_what_it_depends_on_is_said() {
    let shapes = [
        ("x_stop", "the pose"),
        ("x_stiffening", "the pose"),
        ("x_rough-place", "direction of motion"),
        ("x_warming", "direction of motion, and time"),
        ("x_hold", "time"),
        ("x_sway", "time"),
    ];
    for (seed, (kind, depends)) in (40..).zip(shapes) {
        for sweeps in [false, true] {
            let found = diagnosed(&[(kind, 4.0)], sweeps, seed);
            assert_eq!(found.verdict, Verdict::Unknown, "{kind}, sweeps {sweeps}: {}", found.sentence);
            assert_eq!(found.remaining.looks_like, Some(depends), "{kind}, sweeps {sweeps}: {}", found.sentence);
        }
    }
}

#[test]
fn an_effect_beside_what_no_effect_makes_is_named_and_the_rest_is_said() {
    let pairs = [
        ("x_stop", "drag", "viscous"),
        ("x_stiffening", "dry", "coulomb"),
        ("x_hold", "mass", "inertia"),
        ("x_sway", "drag", "viscous"),
        ("x_rough-place", "mass", "inertia"),
        ("x_rough-place", "swirl", "quadratic-viscous"),
        ("x_warming", "mass", "inertia"),
    ];
    for (seed, (unknown, known, name)) in (50..).zip(pairs) {
        let found = diagnosed(&[(unknown, 4.0), (known, 3.0)], seed % 2 == 0, seed);
        assert_eq!((found.verdict, names(&found)), (Verdict::Partly, vec![name]), "{unknown}: {}", found.sentence);
    }
}

#[test]
fn the_friction_of_a_loaded_servo_is_taken_apart() {
    for (seed, sweeps) in [(60, false), (61, true)] {
        let hidden = [("weight", 5.0), ("mass", 3.0), ("dry", 4.0), ("drag", 3.0), ("gear", 2.0)];
        let found = diagnosed(&hidden, sweeps, seed);
        assert_eq!(found.verdict, Verdict::Missing, "{}", found.sentence);
        assert_eq!(names(&found), ["coulomb", "gravity", "inertia", "load-coulomb", "viscous"], "{}", found.sentence);
    }
}

#[test]
fn dry_friction_stands_beside_friction_that_differs_where_it_is_most_of_it() {
    for (seed, unknown) in [(70, "x_warming"), (71, "x_rough-place")] {
        let found = diagnosed(&[(unknown, 2.0), ("dry", 5.0)], false, seed);
        assert_eq!((found.verdict, names(&found)), (Verdict::Partly, vec!["coulomb"]), "{unknown}: {}", found.sentence);
        let alone = diagnosed(&[(unknown, 4.0)], false, seed);
        assert_eq!(alone.verdict, Verdict::Unknown, "{unknown}: {}", alone.sentence);
    }
}

/// The filter passes over the law as well as over the recorded force: what changes near rest is not smeared into a bias.
#[test]
fn the_interval_of_sticking_holds_the_truth() {
    let machine = ForceLab::new(&ModelFile::parse(FORCE_MODEL).expect("a model")).expect("of kind force");
    let holds = |seed: u64| {
        let kind = ForceKind::from_name("sticking").expect("a kind");
        let recipe =
            ForceRecipe { hidden: vec![(kind, 4.0)], sweeps: seed.is_multiple_of(2), seed, ..ForceRecipe::default() };
        let (data, truth, _) = force(&recipe).expect("data");
        let data = machine.filtered(data).expect("filtered");
        let found = diagnose(&machine, &data, &DiagnoseOptions::default()).expect("it can be computed");
        let torque = found.effects.first().and_then(|own| own.parameters.iter().find(|own| own.name == "torque"));
        let torque = torque.unwrap_or_else(|| panic!("seed {seed}: {}", found.sentence));
        (torque.value - truth.known["stribeck"]["torque"]).abs() <= 2.0 * torque.se
    };
    let n = (100..120).filter(|seed| holds(*seed)).count();
    assert!(n >= 17, "{n} of 20 intervals of two standard errors hold the truth");
}
