//! Loads at the actuators: the simulated snake's against the model's, and what they tell the lab.

use krait_lab::Term;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{MachineUnderTest, SnakeLab};
use krait_lab_benchmark::generate::{Generated, Kind, Recipe, base_model, generate};
use krait_model::effects::EffectKind;
use krait_model::model_file::ModelFile;

fn lab() -> SnakeLab {
    SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap()
}

fn hidden(kinds: &[&str], seed: u64, load_sigma_n: f64) -> Generated {
    let hidden = kinds.iter().map(|name| (Kind::from_name(name).unwrap(), 2.0)).collect();
    generate(&Recipe { hidden, seed, load_sigma_n: Some(load_sigma_n), seconds: 60.0, ..Recipe::default() }).unwrap()
}

/// The diagnosis, with the loads or without.
fn answer(made: &Generated, with_loads: bool) -> Diagnosis {
    let mut data = made.measurements.clone();
    data.loads_n = data.loads_n.filter(|_| with_loads);
    diagnose(&lab(), &data, &DiagnoseOptions::default()).unwrap()
}

fn classes(found: &Diagnosis) -> Vec<Vec<&str>> {
    let mut all: Vec<Vec<&str>> =
        found.effects.iter().map(|own| own.class.iter().map(String::as_str).collect()).collect();
    all.sort_unstable();
    all
}

/// The model has the plant's parameters and none of its code: where both have the same law, they have the same loads.
#[test]
fn with_the_answer_s_parameters_the_model_s_loads_are_the_plant_s() {
    for kind in ["stiffness", "backlash", "static-friction", "cone", "compliance", "viscous", "tip", "creep"] {
        let made = hidden(&[kind], 11, 0.0);
        let (effect, known) = made.answer.known.first_key_value().unwrap();
        let definition = EffectKind::from_name(effect).unwrap().definition();
        let values = definition.parameters.iter().map(|p| known.get(p.name).copied().unwrap_or(p.default)).collect();
        let term = Term::new(effect, values);
        let measured = made.measurements.loads_n.as_ref().unwrap();
        let left = |effects: &[Term]| {
            let (_, predicted) = lab().predict_with_loads(effects, &made.measurements).unwrap();
            let square: f64 = predicted.unwrap().iter().zip(measured).map(|(f, y)| (y - f).powi(2)).sum();
            (square / measured.len() as f64).sqrt()
        };
        let (before, after) = (left(&[]), left(&[term]));
        println!("{kind}: {before:.4} N of the loads are not the base model's, {after:.4} N not those of the effect");
        assert!(after < 0.03, "{kind}: {after} N");
    }
}

#[test]
fn play_and_static_friction_are_told_apart_by_the_loads_and_by_nothing_else() {
    for seed in [1, 2, 3] {
        for (kind, value) in [("backlash", "half_width_m"), ("static-friction", "f_s_n")] {
            let made = hidden(&[kind], seed, 0.1);
            let (with, without) = (answer(&made, true), answer(&made, false));
            assert_eq!((with.verdict, without.verdict), (Verdict::Missing, Verdict::Missing), "{seed}");
            let (named, alike) = (&with.effects[0].class, &without.effects[0].class);
            assert_eq!((with.effects.len(), named[0].as_str()), (1, kind), "{seed}: {named:?}");
            for name in ["backlash", "static-friction"] {
                assert!(alike.iter().any(|own| own == name), "{seed} {kind}: {alike:?}");
                assert_eq!(named.iter().any(|own| own == name), name == kind, "{seed} {kind}: {named:?}");
            }
            let next = without.next_experiment.unwrap();
            assert!(next.instruction.contains("record the loads"), "{}", next.instruction);
            // What moves like play and changes no load either stays alike, and no advice says to do what was done.
            assert!(named.iter().all(|own| !own.contains("friction") || own == kind), "{seed} {kind}: {named:?}");
            assert!(with.next_experiment.is_none_or(|next| !next.instruction.contains("record the loads")));
            assert!(without.loads.is_none());
            let found = with.effects[0].parameters.iter().find(|own| own.name == value).unwrap();
            let truth = made.answer.known[kind][value];
            assert!((found.value - truth).abs() < 4.0 * found.se, "{seed} {kind}: {found:?} and {truth}");
            for cell in with.loads.unwrap() {
                assert!((cell.gain - 1.0).abs() < 0.01 && (cell.after_n / 0.1 - 1.0).abs() < 0.1, "{cell:?}");
            }
        }
    }
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn play_and_static_friction_together_are_both_named_with_loads_and_stand_for_each_other_without() {
    let made = hidden(&["backlash", "static-friction"], 1, 0.1);
    assert_eq!(classes(&answer(&made, true)), [["backlash"], ["static-friction"]]);
    let without = answer(&made, false);
    assert_eq!(without.effects.len(), 1);
    assert!(classes(&without)[0].contains(&"backlash") && classes(&without)[0].contains(&"static-friction"));
}

/// Latency is in the camera and drag in the lines: look-alikes without loads.
#[test]
fn latency_and_viscous_friction_are_told_apart_by_the_loads() {
    for (kind, effect) in [("delay", "latency"), ("viscous", "viscous-friction")] {
        assert_eq!(classes(&answer(&hidden(&[kind], 1, 0.1), true)), [[effect]]);
    }
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn cells_of_another_gain_zero_and_sign_change_no_answer_and_are_reported() {
    let made = hidden(&["static-friction"], 2, 0.1);
    let mut other = made.clone();
    for three in other.measurements.loads_n.iter_mut().flat_map(|loads| loads.chunks_exact_mut(3)) {
        (three[0], three[1]) = (1.1 * three[0] + 4.0, -three[1] - 7.0);
    }
    let (own, other) = (answer(&made, true), answer(&other, true));
    assert_eq!(classes(&own), classes(&other));
    let value = |found: &Diagnosis| found.effects[0].parameters[0].value;
    assert!((value(&own) / value(&other) - 1.0).abs() < 1e-3);
    let cells = other.loads.unwrap();
    assert!((cells[0].gain - 1.1).abs() < 0.01 && (cells[0].offset_n[0] - 4.0).abs() < 0.1, "{cells:?}");
    assert!((cells[1].gain + 1.0).abs() < 0.01 && (cells[1].offset_n[0] + 7.0).abs() < 0.1);
    assert!(other.cautions.iter().any(|own| own.contains("tau2_n") && own.contains("negated")), "{:?}", other.cautions);
}

#[test]
fn without_anything_hidden_nothing_is_named_and_loads_of_other_lines_are_not_used() {
    let made = hidden(&[], 1, 0.1);
    assert_eq!(answer(&made, true).verdict, Verdict::None);
    let mut other = made;
    for three in other.measurements.loads_n.iter_mut().flat_map(|loads| loads.chunks_exact_mut(3)) {
        three.rotate_left(1);
    }
    let found = answer(&other, true);
    assert!(found.loads.is_none() && found.verdict == Verdict::None);
    assert!(found.cautions.iter().any(|own| own.contains("loads are not used")), "{:?}", found.cautions);
}

#[test]
fn generated_loads_stand_in_the_file_and_change_nothing_else_in_it() {
    let with = hidden(&["backlash"], 4, 0.1);
    let mut without = with.clone();
    without.measurements.loads_n = None;
    let (with, without) = (with.csv(), without.csv());
    assert!(with.starts_with("time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,tau1_n,tau2_n,tau3_n\n"));
    for (with, without) in with.lines().zip(without.lines()).skip(1) {
        assert!(with.strip_prefix(without).is_some_and(|loads| loads.matches(',').count() == 3), "{with}");
    }
    let plain = generate(&Recipe {
        hidden: vec![(Kind::from_name("backlash").unwrap(), 2.0)],
        seed: 4,
        seconds: 60.0,
        ..Recipe::default()
    });
    assert_eq!(plain.unwrap().csv(), without);
}
