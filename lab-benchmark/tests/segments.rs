//! Two segments of the simulation with something hidden, which the lab has to find: values, the segment, and nothing where nothing is.
#![allow(clippy::expect_used, clippy::panic, reason = "the helpers of a test fail as the test does")]

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{MachineUnderTest, SegmentsLab};
use krait_lab::{AddOptions, Measurements, Quantity, Term, add, refit, save};
use krait_model::model_file::ModelFile;
use krait_model::segments::{Bends, LineValues};
use krait_sim::{SegmentEffectsTruth, SegmentTruth, SegmentsTruth, SimulatedSegments};

const TWO: &str = include_str!("../../docs/segments/two.toml");
/// The camera's standard deviation of each component, rad: 0.3 deg.
const SIGMA_RAD: f64 = 0.3 * core::f64::consts::PI / 180.0;
const RATE_HZ: f64 = 25.0;

/// The shipped model with other effects.
fn model(effects: &str) -> ModelFile {
    let machine = TWO.split("[[effect]]").next().expect("a machine");
    ModelFile::parse(&format!("{machine}{effects}")).expect("a model")
}

fn machine(file: &ModelFile) -> SegmentsLab {
    SegmentsLab::new(file).expect("segments")
}

/// SplitMix64.
struct Draw(u64);

impl Draw {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (core::f64::consts::TAU * self.uniform()).cos()
    }
}

/// The two segments of the shipped model as the simulation has them, segment 2 with its own effects where they are given.
fn truth(all: SegmentEffectsTruth, of_second: Option<SegmentEffectsTruth>) -> SegmentsTruth {
    let of = |first_deg: f64, effects| SegmentTruth {
        azimuths_rad: [0.0, 120.0, 240.0].map(|deg: f64| (first_deg + deg).to_radians()).to_vec(),
        effects,
        ..SegmentTruth::default()
    };
    SegmentsTruth { segment: vec![of(0.0, None), of(60.0, of_second)], effects: all, ..SegmentsTruth::default() }
}

/// So many seconds: 8 s of motion, 2 s of rest, again and again; both segments bend in all planes, with reversals of many sizes.
fn recorded(truth: &SegmentsTruth, seconds: f64, seed: u64) -> Measurements {
    let mut plant = SimulatedSegments::new(truth).expect("a truth");
    let mut draw = Draw(seed);
    let phases: [f64; 8] = core::array::from_fn(|_| core::f64::consts::TAU * draw.uniform());
    let commands = machine_commands();
    let n = (seconds * RATE_HZ) as usize;
    let (mut time_s, mut inputs, mut outputs) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..n {
        let t_s = row as f64 / RATE_HZ;
        let (round, within_s) = ((t_s / 10.0).floor(), t_s % 10.0);
        let moved_s = 8.0 * round + within_s.min(8.0);
        // Begins straight and at rest.
        let grown = (moved_s / 2.0).min(1.0);
        let bends = Bends::from_fn(|k, _| {
            let wave = |hz: f64, phase: f64| (core::f64::consts::TAU * hz * moved_s + phase).sin();
            let slow = [0.071, 0.113, 0.089, 0.131].get(k).map_or(0.0, |hz| wave(*hz, phases[k]));
            let fast = [0.31, 0.23, 0.37, 0.27].get(k).map_or(0.0, |hz| wave(*hz, phases[4 + k]));
            grown * (0.42 * slow + 0.16 * fast)
        });
        let q_m = commands(&bends);
        plant.move_to(&q_m);
        time_s.push(t_s);
        inputs.extend(&q_m);
        outputs.extend((0..4).map(|k| plant.bend_rad(k / 2)[k % 2] + SIGMA_RAD * draw.normal()));
    }
    assert_eq!(plant.n_unsolved(), 0);
    Measurements::bare(format!("seed {seed}"), Quantity::Segments, time_s, (inputs, 6), (outputs, 4))
}

/// Positions of the six lines for bends, as a controller without a model of friction asks for them.
fn machine_commands() -> impl Fn(&Bends) -> Vec<f64> {
    let chain = model("[[effect]]\nkind = \"stiffness-scale\"\n").segment_chain().expect("a chain").expect("segments");
    move |bends| {
        let mut compensator = chain.compensator();
        let q: LineValues = compensator.step(bends).q_tilde_m;
        q.iter().take(6).copied().collect()
    }
}

/// The shipped model's effects, which the simulation has too.
fn known() -> String {
    format!("[[effect]]{}", TWO.split_once("[[effect]]").expect("effects").1)
}

fn named(found: &Diagnosis) -> Vec<&str> {
    found.effects.iter().map(|own| own.name.as_str()).collect()
}

fn diagnosed(file: &ModelFile, data: &Measurements) -> Diagnosis {
    diagnose(&machine(file), data, &DiagnoseOptions::default()).expect("it can be computed")
}

/// Recordings of each kind; the figures of docs/bench/2026-11-26-lab-segments.md are of 10.
const N_SEEDS: u64 = 1;

/// What is hidden in segment 2: the effect's name, its parameter, and its size small and large.
const OF_SECOND: [(&str, &str, [f64; 2]); 4] = [
    ("stiffness-scale-2", "eta", [1.03, 1.1]),
    ("backlash-2", "half_width_m", [2e-5, 6e-5]),
    ("static-friction-2", "f_s_n", [1.5, 3.0]),
    ("cone-friction-2", "mu", [0.08, 0.15]),
];

/// The shipped truth with an effect of the second segment.
fn hidden(name: &str, size: f64) -> SegmentsTruth {
    let all = SegmentEffectsTruth::default();
    let mut own = all;
    match name {
        "stiffness-scale-2" => own.load_scale *= size,
        "backlash-2" => own.play_m += 2.0 * size,
        "static-friction-2" => own.f_s_n += size,
        "cone-friction-2" => own.mu += size,
        other => panic!("{other} is not simulated"),
    }
    truth(all, Some(own))
}

#[test]
fn nothing_is_named_where_nothing_is_hidden() {
    let truth = truth(SegmentEffectsTruth::default(), None);
    for seed in 0..3 * N_SEEDS {
        let found = diagnosed(&model(&known()), &recorded(&truth, 60.0, seed));
        assert_eq!((found.verdict, named(&found).len()), (Verdict::None, 0), "seed {seed}: {}", found.sentence);
    }
}

#[test]
fn an_effect_of_the_second_segment_is_named_as_of_the_second_segment_with_its_value() {
    let file = model(&known());
    for (name, key, sizes) in OF_SECOND {
        for (which, size) in sizes.into_iter().enumerate() {
            let (mut n_first, mut apart) = (0, Vec::new());
            for seed in 0..N_SEEDS {
                let found = diagnosed(&file, &recorded(&hidden(name, size), 60.0, 100 + seed));
                assert_eq!(found.verdict, Verdict::Missing, "{name} {size}, seed {seed}: {}", found.sentence);
                let [own] = found.effects.as_slice() else { panic!("{name} {size}, seed {seed}: {}", found.sentence) };
                assert!(own.class.iter().any(|other| other == name), "{name} {size}, seed {seed}: {}", found.sentence);
                assert!(own.class.iter().all(|other| other.ends_with("-2")), "seed {seed}: {}", found.sentence);
                if own.name == name {
                    let value = own.parameters.iter().find(|own| own.name == key).expect("its parameter");
                    n_first += 1;
                    apart.push((value.value - size) / value.se);
                }
            }
            println!("{name} {size}: named itself {n_first} of {N_SEEDS}, standard errors off {apart:.1?}");
            assert!(apart.iter().all(|apart| apart.abs() < 3.5), "{name} {size}: {apart:?}");
            // A small friction is a play of the same width: one of the two, whichever fits better by chance.
            assert!(n_first == N_SEEDS || which == 0 || name == "static-friction-2", "{name} {size}: {n_first}");
        }
    }
}

#[test]
fn values_that_are_not_known_are_fitted_within_their_standard_errors() {
    let effects = "[[effect]]\nkind = \"stiffness-scale\"\neta = 1.0\n[[effect]]\nkind = \"inside-extension\"\n[[effect]]\nkind = \
                   \"static-friction\"\nf_s_n = 1.0\n[[effect]]\nkind = \"cone-friction\"\nmu = 0.1\n[[effect]]\nkind = \"backlash\"\n\
                   half_width_m = 0.0\n";
    let file = model(effects);
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
        let data = recorded(&truth(SegmentEffectsTruth::default(), None), 60.0, 200 + seed);
        let fitted = refit(&machine(&file), &data, &free).expect("a fit");
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
    let ideal = SegmentsTruth::ideal(Vec::new()).effects;
    let data = recorded(&truth(SegmentEffectsTruth { play_m: 1.2e-4, ..ideal }, None), 60.0, 300);
    let found = diagnosed(&model(""), &data);
    let class: Vec<&str> = found.effects.iter().flat_map(|own| own.class.iter().map(String::as_str)).collect();
    assert_eq!((found.verdict, class), (Verdict::Missing, vec!["backlash", "static-friction"]), "{}", found.sentence);
    assert!(found.next_experiment.is_some_and(|next| next.instruction.contains("nested loops")));
}

#[test]
fn what_the_camera_does_to_one_segment_is_named_as_the_camera_s() {
    for (name, output) in [("camera-offset-2", 3), ("camera-scale-1", 0)] {
        let mut data = recorded(&truth(SegmentEffectsTruth::default(), None), 60.0, 400);
        for row in data.outputs.chunks_mut(4) {
            if name == "camera-offset-2" {
                row[output] += 0.02;
            } else {
                row[..2].iter_mut().for_each(|bend| *bend *= 1.04);
            }
        }
        let found = diagnosed(&model(&known()), &data);
        let class: Vec<&String> = found.effects.iter().flat_map(|own| &own.class).collect();
        assert_eq!(found.verdict, Verdict::Missing, "{name}: {}", found.sentence);
        assert!(class.iter().any(|own| *own == name), "{name}: {}", found.sentence);
    }
}

#[test]
fn what_no_effect_makes_is_not_named() {
    let mut data = recorded(&truth(SegmentEffectsTruth::default(), None), 60.0, 500);
    // Segment 2 is pushed aside where segment 1 bends to one side.
    for row in data.outputs.chunks_mut(4) {
        row[2] += 0.25 * (row[0] - 0.1).max(0.0).powi(2);
    }
    let found = diagnosed(&model(&known()), &data);
    println!("{}", found.sentence);
    assert!(matches!(found.verdict, Verdict::Unknown | Verdict::Partly), "{}", found.sentence);
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
fn the_model_with_what_was_added_holds_the_value_and_tracks_better() {
    for (name, key, [_, size]) in OF_SECOND {
        let (truth, before) = (hidden(name, size), model(&known()));
        let data = recorded(&truth, 60.0, 600);
        let lab = machine(&before);
        let parameters = lab.parameters(&term(name, Vec::new())).expect("its parameters");
        let term = term(name, parameters.iter().map(|own| own.default).collect());
        let options =
            AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() };
        let added = add(&lab, &data, &options).expect("added");
        let after = save(&before, &added, name, &data, "2026-11-26").expect("a file");
        let read = ModelFile::parse(&after.to_toml()).expect("it reads back");
        let effect = read.effects().iter().find(|own| own.setting().label() == name).expect("the effect");
        let (value, se) = (effect.setting().value(key).expect("a value"), effect.origin(key).and_then(|own| own.se));
        let [error, better] = [&before, &read].map(|file| tracked_deg(file, &truth));
        let se = se.expect("a standard error");
        println!("{name}: {value:.5e} +- {se:.1e} ({size}); tracked to {error:.3} deg before, {better:.3} after");
        assert!(((value - size) / se).abs() < 3.5, "{name} {value}");
        assert!(better < 0.5 * error, "{name}: {error} deg before, {better} after");
    }
}

fn term(name: &str, values: Vec<f64>) -> Term {
    Term { name: name.to_owned(), values, formula: None }
}
