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

#[test]
fn explore() {
    let all = SegmentEffectsTruth::default();
    let second = |change: fn(&mut SegmentEffectsTruth)| {
        let mut own = all;
        change(&mut own);
        Some(own)
    };
    let ideal = SegmentsTruth::ideal(Vec::new()).effects;
    let cases: Vec<(&str, SegmentEffectsTruth, Option<SegmentEffectsTruth>, String)> = vec![
        ("none", all, None, known()),
        ("eta2", all, second(|own| own.load_scale *= 1.08), known()),
        ("play2", all, second(|own| own.play_m += 1.2e-4), known()),
        ("f_s2", all, second(|own| own.f_s_n += 2.0), known()),
        ("mu2", all, second(|own| own.mu += 0.12), known()),
        ("eta all", SegmentEffectsTruth { load_scale: 1.1, ..ideal }, None, String::new()),
        ("play all", SegmentEffectsTruth { play_m: 1.2e-4, ..ideal }, None, String::new()),
        ("fs all", SegmentEffectsTruth { f_s_n: 2.0, ..ideal }, None, String::new()),
        ("mu all", SegmentEffectsTruth { mu: 0.15, ..ideal }, None, String::new()),
        ("all", all, None, String::new()),
    ];
    for seed in 0..1 {
        for (what, all, second, effects) in &cases {
            let data = recorded(&truth(*all, *second), 60.0, 7 + seed);
            let begin = std::time::Instant::now();
            let found = diagnosed(&model(effects), &data);
            println!("{what}: {:?} {} [{:.1} s]", found.verdict, found.sentence, begin.elapsed().as_secs_f64());
            for own in &found.effects {
                println!("    {} class {:?} p {:.2}: {:?}", own.name, own.class, own.probability, own.parameters.iter().map(|p| (p.name.clone(), p.value, p.se)).collect::<Vec<_>>());
            }
        }
    }
}
