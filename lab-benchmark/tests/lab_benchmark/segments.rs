//! Two segments of the simulation with something hidden, which the lab has to find: values, the segment, and nothing where nothing is.

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{MachineUnderTest, SegmentsLab};
use krait_lab::report::{PageOrigin, diagnosis_page};
use krait_lab::{AddOptions, Term, add, refit, save};
use krait_lab_benchmark::generate::Generated;
use krait_lab_benchmark::segments::{SegmentKind, SegmentsRecipe, pick_segments, segments};
use krait_model::model_file::ModelFile;
use krait_model::segments::{Bends, LineValues};
use krait_sim::{SegmentsTruth, SimulatedSegments};
use std::collections::BTreeSet;

/// A minute of two segments with these hidden.
fn recipe(hidden: &[(&str, f64)], seed: u64) -> SegmentsRecipe {
    let kind = |&(name, size): &(&str, f64)| (SegmentKind::from_name(name, 2).expect("a kind"), size);
    SegmentsRecipe { hidden: hidden.iter().map(kind).collect(), seconds: 60.0, seed, ..SegmentsRecipe::default() }
}

fn made(hidden: &[(&str, f64)], seed: u64) -> Generated<SegmentsTruth> {
    segments(&recipe(hidden, seed)).unwrap_or_else(|e| panic!("{hidden:?}: {e}"))
}

fn model(text: &str) -> ModelFile {
    ModelFile::parse(text).expect("a model")
}

fn machine(file: &ModelFile) -> SegmentsLab {
    SegmentsLab::new(file).expect("segments")
}

fn named(found: &Diagnosis) -> Vec<&str> {
    found.effects.iter().map(|own| own.name.as_str()).collect()
}

fn diagnosed(made: &Generated<SegmentsTruth>) -> Diagnosis {
    let lab = machine(&model(&made.model));
    diagnose(&lab, &made.measurements, &DiagnoseOptions::default()).expect("it can be computed")
}

/// Recordings of each kind; the figures of docs/bench/2026-11-26-lab-segments.md are of 10.
const N_SEEDS: u64 = 1;

/// What is hidden in segment 2, and sizes small and large in units of the noise's length.
const OF_SECOND: [&str; 4] = ["stiffness-2", "backlash-2", "static-friction-2", "cone-2"];
const SIZES: [f64; 2] = [0.5, 2.0];

/// The effect whose parameter is known, the parameter, and its value.
fn truth_of(made: &Generated<SegmentsTruth>) -> (&str, &str, f64) {
    let (effect, values) = made.answer.known.first_key_value().expect("a known effect");
    let (key, value) = values.first_key_value().expect("a value");
    (effect, key, *value)
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn columns_of_segments_that_are_exchanged_or_negated_are_said_before_any_effect() {
    type Spoil = fn(&mut krait_lab::Measurements);
    let cases: [(Spoil, &str); 5] = [
        (|data| data.inputs.chunks_mut(6).for_each(|row| row.swap(1, 4)), "q2 and q5 are probably exchanged"),
        (
            |data| data.outputs.chunks_mut(4).for_each(|row| row.rotate_left(2)),
            "segments 1 and 2 are probably exchanged",
        ),
        (|data| data.outputs.chunks_mut(2).for_each(|row| row[1] = -row[1]), "picture is probably mirrored"),
        (|data| data.inputs.iter_mut().for_each(|q| *q = -*q), "negated"),
        (|data| data.outputs.iter_mut().for_each(|y| *y = y.to_degrees()), "in degrees"),
    ];
    let made = made(&[("backlash-2", 2.0)], 71);
    let lab = machine(&model(&made.model));
    for (spoil, words) in cases {
        let mut data = made.measurements.clone();
        spoil(&mut data);
        let found = diagnose(&lab, &data, &DiagnoseOptions::default()).expect("it can be computed");
        assert!(
            found.sentence.starts_with("the columns first") && found.sentence.contains(words),
            "{}",
            found.sentence
        );
        assert_eq!((found.verdict, named(&found).len(), found.partial.len()), (Verdict::Unknown, 0, 0), "{words}");
    }
}

#[test]
fn nothing_is_named_where_nothing_is_hidden() {
    for seed in 0..3 * N_SEEDS {
        let found = diagnosed(&made(&[], seed));
        assert_eq!((found.verdict, named(&found).len()), (Verdict::None, 0), "seed {seed}: {}", found.sentence);
    }
}

#[test]
fn an_effect_of_the_second_segment_is_named_as_of_the_second_segment_with_its_value() {
    for kind in OF_SECOND {
        for size in SIZES {
            let (mut n_first, mut apart, mut hidden) = (0, Vec::new(), Vec::new());
            for seed in 0..N_SEEDS {
                let made = made(&[(kind, size)], 100 + seed);
                let (found, (name, key, truth)) = (diagnosed(&made), truth_of(&made));
                assert_eq!(found.verdict, Verdict::Missing, "{kind} {size}, seed {seed}: {}", found.sentence);
                let [own] = found.effects.as_slice() else { panic!("{kind} {size}, seed {seed}: {}", found.sentence) };
                assert!(own.class.iter().any(|other| other == name), "{kind} {size}, seed {seed}: {}", found.sentence);
                assert!(own.class.iter().all(|other| other.ends_with("-2")), "seed {seed}: {}", found.sentence);
                hidden.push(format!("{truth:.2e}"));
                if own.name == name {
                    let value = own.parameters.iter().find(|own| own.name == key).expect("its parameter");
                    n_first += 1;
                    apart.push((value.value - truth) / value.se);
                }
            }
            println!("{kind} {size}: {hidden:?}, named itself {n_first} of {N_SEEDS}, standard errors off {apart:.1?}");
            assert!(apart.iter().all(|apart| apart.abs() < 3.5), "{kind} {size}: {apart:?}");
            // A small friction is a play of the same width: one of the two, whichever fits better by chance.
            assert!(n_first == N_SEEDS || size < 1.0 || kind == "static-friction-2", "{kind} {size}: {n_first}");
        }
    }
}

#[test]
fn the_page_says_of_which_segment_an_effect_is() {
    let made = made(&[("backlash-2", 2.0)], 100);
    let (lab, found) = (machine(&model(&made.model)), diagnosed(&made));
    let origin = PageOrigin { command: "krait lab diagnose", version: "1" };
    let page = diagnosis_page(&lab, &made.measurements, &found, origin).expect("a page");
    let words = "Here: of the lines of segment 2 alone, beside what all have.";
    assert!(page.contains(words), "{}", found.sentence);
    let told = found.to_json()["effects"][0]["explanation"]["what"].to_string();
    assert!(told.contains(words), "the console's page: {told}");
}

#[test]
fn values_that_are_not_known_are_fitted_within_their_standard_errors() {
    let effects = "[[effect]]\nkind = \"stiffness-scale\"\neta = 1.0\n[[effect]]\nkind = \"inside-extension\"\n[[effect]]\nkind = \
                   \"static-friction\"\nf_s_n = 1.0\n[[effect]]\nkind = \"cone-friction\"\nmu = 0.1\n[[effect]]\nkind = \"backlash\"\n\
                   half_width_m = 0.0\n";
    let right = [
        ("stiffness-scale", "eta", 1.22),
        ("static-friction", "f_s_n", 1.959),
        ("cone-friction", "mu", 0.1727),
        ("backlash", "half_width_m", 8.9e-5),
    ];
    let free = right.map(|(effect, key, _)| (effect.to_owned(), key.to_owned()));
    // Standard errors that a minute of motion must reach.
    let largest = [3e-3, 0.8, 0.02, 8e-6];
    let mut apart = Vec::new();
    for seed in 0..N_SEEDS {
        let made = made(&[], 200 + seed);
        let bare = made.model.split("[[effect]]").next().expect("a machine");
        let fitted = refit(&machine(&model(&format!("{bare}{effects}"))), &made.measurements, &free).expect("a fit");
        for (k, (effect, key, right)) in right.into_iter().enumerate() {
            let value = fitted.variables[k].value(&fitted.terms);
            let off = (value - right) / fitted.uncertainty.robust[k];
            println!("seed {seed}: {effect}.{key} {value:.5e} +- {:.1e}, {off:.1} off", fitted.uncertainty.robust[k]);
            assert!(fitted.uncertainty.robust[k] < largest[k], "{effect}.{key}: {}", fitted.uncertainty.robust[k]);
            apart.push(off);
        }
        let floor = fitted.noise_floor.expect("a floor");
        assert!(fitted.before > 3.0 * floor && fitted.after < 1.04 * floor, "{} {}", fitted.before, fitted.after);
    }
    assert!(apart.iter().all(|off| off.abs() < 3.5), "{apart:.1?}");
}

#[test]
fn play_of_all_lines_and_friction_that_looks_like_it_are_said_to_be_one_class() {
    let found = diagnosed(&made(&[("backlash", 2.0)], 300));
    let class: Vec<&str> = found.effects.iter().flat_map(|own| own.class.iter().map(String::as_str)).collect();
    assert_eq!((found.verdict, class), (Verdict::Missing, vec!["backlash", "static-friction"]), "{}", found.sentence);
    assert!(found.next_experiment.is_some_and(|next| next.instruction.contains("nested loops")));
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn what_the_camera_does_to_one_segment_or_to_all_is_named_as_the_camera_s() {
    for kind in ["camera-offset-2", "camera-scale-1", "delay"] {
        let made = made(&[(kind, 2.0)], 400);
        let (found, name) = (diagnosed(&made), truth_of(&made).0);
        let class: Vec<&String> = found.effects.iter().flat_map(|own| &own.class).collect();
        assert_eq!(found.verdict, Verdict::Missing, "{name}: {}", found.sentence);
        assert!(class.iter().any(|own| own.as_str() == name), "{name}: {}", found.sentence);
    }
}

#[test]
fn what_no_effect_makes_is_not_named() {
    let found = diagnosed(&made(&[("x_push", 2.0)], 500));
    println!("{}", found.sentence);
    assert!(matches!(found.verdict, Verdict::Unknown | Verdict::Partly), "{}", found.sentence);
}

#[test]
fn every_kind_has_the_size_that_was_asked_for_and_names_effects_of_its_segment_in_two_and_in_three() {
    for n_segments in [2, 3] {
        for kind in SegmentKind::all(n_segments) {
            let recipe = SegmentsRecipe { n_segments, hidden: vec![(kind, 1.0)], ..recipe(&[], 7) };
            let made = segments(&recipe).unwrap_or_else(|e| panic!("{}: {e}", kind.name()));
            let (answer, data) = (&made.answer, &made.measurements);
            assert_eq!((data.n_inputs, data.n_outputs, data.n_rows()), (3 * n_segments, 2 * n_segments, 1500));
            let size = answer.effect_rms_deg / (0.3 * (2.0 * n_segments as f64).sqrt());
            assert!((size - 1.0).abs() < 0.05, "{} of {n_segments}: {size}", kind.name());
            let lab = machine(&model(&made.model));
            let candidates: Vec<&str> = lab.candidates(data).iter().map(|own| own.name).collect();
            for name in answer.right.iter().flatten().filter(|_| kind.is_known()) {
                assert!(candidates.contains(&name.as_str()), "{name} is no candidate");
            }
            // The law of the plant is the model's, but for the friction that two rows hide from each other.
            let Some((effect, values)) = answer.known.first_key_value() else { continue };
            let term = term(effect, Vec::new());
            let known = lab.parameters(&term).expect("its parameters");
            assert!(values.keys().all(|key| known.iter().any(|own| own.name == *key)), "{effect}: {values:?}");
            let values = known.iter().map(|own| values.get(&own.name).copied().unwrap_or(own.default)).collect();
            let left = |terms: &[Term]| {
                let predicted = lab.predict(terms, data).expect("a prediction");
                let square: f64 = predicted.iter().zip(&data.outputs).map(|(a, b)| (a - b).powi(2)).sum();
                (square / 1500.0).sqrt().to_degrees()
            };
            let with = [lab.effects(), &[Term { values, ..term }]].concat();
            let (before, after) = (left(lab.effects()), left(&with));
            assert!(after < 1.03 * answer.noise_rms_deg, "{}: {before} deg, then {after}", kind.name());
        }
    }
}

#[test]
fn equal_recipes_make_equal_bytes_and_other_seeds_others_and_pairs_do_not_look_alike() {
    let [a, b, c] = [5, 5, 6].map(|seed| made(&[("cone-1", 1.0)], seed));
    assert_eq!((a.csv(), a.answer.to_json()), (b.csv(), b.answer.to_json()));
    assert_ne!(a.csv(), c.csv());
    let header = "time_s,u1_m,u2_m,u3_m,u4_m,u5_m,u6_m,y1_rad,y2_rad,y3_rad,y4_rad\n";
    assert!(a.csv().starts_with(header), "{}", &a.csv()[..80]);
    let mut picked = BTreeSet::new();
    for seed in 0..300 {
        let [first, second] = pick_segments(seed, 3, 2)[..] else { panic!("two") };
        assert!(!first.is_like(&second), "{} {}", first.name(), second.name());
        picked.extend([first.name(), second.name()]);
    }
    assert_eq!(picked.len(), SegmentKind::all(3).iter().filter(|kind| kind.is_known()).count());
}

/// Error of the bends that a controller with this model reaches on a machine, deg rms, both segments together.
fn tracked_deg(file: &ModelFile, truth: &SegmentsTruth) -> f64 {
    let mut plant = SimulatedSegments::new(truth).expect("a truth");
    let mut commands = file.segment_chain().expect("a chain").expect("segments").compensator();
    let (mut sum, n) = (0.0, 2000);
    for row in 0..n {
        let t_s = f64::from(row) * 0.01;
        let bend = |hz: f64| 0.5 * (core::f64::consts::TAU * hz * t_s).sin();
        let wanted = Bends::from_column_slice(&[bend(0.11), bend(0.17), bend(0.13), bend(0.19), 0.0, 0.0]);
        let q: LineValues = commands.step(&wanted).q_tilde_m;
        plant.move_to(&q.as_slice()[..6]);
        sum += (0..4).map(|k| (plant.bend_rad(k / 2)[k % 2] - wanted[k]).powi(2)).sum::<f64>();
    }
    (sum / f64::from(n)).sqrt().to_degrees()
}

#[test]
#[ignore = "tens of seconds of processor time; .ci/long runs it"]
fn the_model_with_what_was_added_holds_the_value_and_tracks_better() {
    for kind in OF_SECOND {
        let made = made(&[(kind, 2.0)], 600);
        let (before, data, (name, key, size)) = (model(&made.model), &made.measurements, truth_of(&made));
        let lab = machine(&before);
        let parameters = lab.parameters(&term(name, Vec::new())).expect("its parameters");
        let term = term(name, parameters.iter().map(|own| own.default).collect());
        let options =
            AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() };
        let added = add(&lab, data, &options).expect("added");
        let after = save(&before, &added, name, data, "2026-11-26").expect("a file");
        let read = ModelFile::parse(&after.to_toml()).expect("it reads back");
        let effect = read.effects().iter().find(|own| own.setting().label() == name).expect("the effect");
        let (value, se) = (effect.setting().value(key).expect("a value"), effect.origin(key).and_then(|own| own.se));
        let [error, better] = [&before, &read].map(|file| tracked_deg(file, &made.truth));
        let se = se.expect("a standard error");
        println!("{name}: {value:.5e} +- {se:.1e} ({size:.5e}); tracked to {error:.3} deg before, {better:.3} after");
        assert!(((value - size) / se).abs() < 3.5, "{name} {value}");
        assert!(better < 0.5 * error, "{name}: {error} deg before, {better} after");
    }
}

fn term(name: &str, values: Vec<f64>) -> Term {
    Term::new(name, values)
}
