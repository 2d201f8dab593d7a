//! Slopes of predicted bends by the learnt parameters, carried along a history, against central differences of whole histories.

use krait_model::effects::{EffectKind, SegmentEffect};
use krait_model::model_file::{Machine, ModelFile};
use krait_model::segments::{
    Bends, LineValues, MAX_BENDS, MAX_LINES, SEGMENT_EFFECTS, SegmentChain, SegmentsParameters,
};
use krait_model::{Circumstances, EffectSetting, Learn, MAX_LEARNT, SlopedPredictor};
use nalgebra::SMatrix;

const KEYS: [&str; 5] = ["eta", "share", "f_s_n", "mu", "half_width_m"];
const VALUES: [f64; 5] = [1.22, 1.0, 1.959, 0.1727, 8.9e-5];
const SDS: [f64; 5] = [0.1, 0.1, 0.2, 0.02, 1e-5];

fn effects(values: [f64; 5]) -> [EffectSetting; 5] {
    core::array::from_fn(|k| {
        let effect = EffectSetting::new(SEGMENT_EFFECTS[k]).with(KEYS[k], values[k]).unwrap();
        effect.with_learn(KEYS[k], Learn { sd: SDS[k], memory_s: 1e6 }).unwrap()
    })
}

/// What single segments have beside these.
fn of_segments() -> Vec<EffectSetting> {
    let own = [
        ("stiffness-scale-2", "eta", 1.1),
        ("static-friction-2", "f_s_n", 1.0),
        ("cone-friction-1", "mu", 0.05),
        ("backlash-2", "half_width_m", 4e-5),
        ("camera-scale-1", "relative", 0.05),
        ("camera-offset-2", "offset_x_rad", 0.02),
    ];
    let effect = |name| EffectSetting::new(EffectKind::OfSegment(SegmentEffect::from_name(name).unwrap()));
    own.map(|(name, key, value)| effect(name).with(key, value).unwrap()).to_vec()
}

fn chain(values: [f64; 5]) -> SegmentChain {
    chain_with(values, &[])
}

fn chain_with(values: [f64; 5], others: &[EffectSetting]) -> SegmentChain {
    let file = ModelFile::parse(include_str!("../../../docs/segments/two.toml")).unwrap();
    let Machine::Segments(machine) = file.machine() else { panic!("segments") };
    SegmentChain::new(machine, &[&effects(values), others].concat()).unwrap()
}

/// Positions of the actuators that bend both segments to and fro, the same for every chain.
fn positions() -> Vec<[f64; MAX_LINES]> {
    let mut compensator = chain(VALUES).compensator();
    let bends = |k: u32| {
        let t = f64::from(k) * 0.01;
        let (x, y) = (0.5 * (0.9 * t).sin(), 0.4 * (0.7 * t).sin());
        Bends::from_column_slice(&[x, y, 0.6 * (1.1 * t).sin() - 0.3 * x, 0.4 * (0.6 * t).sin() + y, 0.0, 0.0])
    };
    (0..2000).map(|k| compensator.step(&bends(k)).q_tilde_m.into()).collect()
}

fn predicted(values: [f64; 5]) -> Vec<Bends> {
    predicted_with(values, &[])
}

/// As the camera shows them.
fn predicted_with(values: [f64; 5], others: &[EffectSetting]) -> Vec<Bends> {
    let mut predictor = chain_with(values, others).predictor();
    let seen = |(k, q): (usize, &[f64; MAX_LINES])| {
        predictor.step(&LineValues::from(*q));
        predictor.observed_rad(0.01 * k as f64)
    };
    positions().iter().enumerate().map(seen).collect()
}

#[test]
fn a_late_camera_shows_the_bends_of_before_and_its_delay_has_a_slope() {
    let late = |delay_s: f64| {
        let own = EffectSetting::new(EffectKind::Latency).with("delay_s", delay_s).unwrap();
        [own.with_learn("delay_s", Learn { sd: 0.01, memory_s: 1e6 }).unwrap()]
    };
    // 50 ms are five steps.
    let (with, without) = (predicted_with(VALUES, &late(0.05)), predicted(VALUES));
    assert!(with[5..].iter().zip(&without).all(|(with, without)| (with - without).amax() < 1e-9));
    assert!(with[5..].iter().zip(&without[5..]).any(|(with, without)| (with - without).amax() > 0.02));

    // Between two samples, so that the delay's slope is one.
    let mut tangents = chain_with(VALUES, &late(0.053)).learning_predictor();
    let step = |(k, q)| tangents.step(q, &Circumstances::at(0.01 * k as f64));
    let found: Vec<_> = positions().iter().enumerate().map(step).collect();
    let [below, above, at] = [0.052, 0.054, 0.053].map(|delay_s| predicted_with(VALUES, &late(delay_s)));
    let undelayed = chain(VALUES);
    let mut eta = undelayed.learning_predictor();
    let of_eta: Vec<_> =
        positions().iter().map(|q| eta.step(q, &Circumstances::at(0.0)).1.column(0).into_owned()).collect();
    for (k, (seen, slopes)) in found.iter().enumerate().skip(10) {
        assert!((Bends::from(*seen) - at[k]).amax() < 1e-12, "step {k}");
        let quotient = (above[k] - below[k]) / 0.002 * 0.01;
        assert!((slopes.column(5) - quotient).amax() < 1e-9, "step {k}: {} {quotient}", slopes.column(5));
        // The other slopes are late too: 0.7 of five steps ago and 0.3 of six.
        let then = of_eta[k - 5] * 0.7 + of_eta[k - 6] * 0.3;
        assert!((slopes.column(0) - then).amax() < 1e-9, "step {k}");
    }
}

#[test]
fn predictions_have_the_slopes_of_differences_of_whole_histories() {
    has_slopes_of_differences(&[]);
}

#[test]
fn so_they_have_where_single_segments_have_effects_of_their_own() {
    let others = of_segments();
    let (with, without) = (predicted_with(VALUES, &others), predicted(VALUES));
    assert!(with.iter().zip(&without).any(|(with, without)| (with - without).amax() > 0.02));
    has_slopes_of_differences(&others);
}

#[allow(clippy::print_stdout, reason = "figures of a test")]
fn has_slopes_of_differences(others: &[EffectSetting]) {
    let at = Circumstances::at(0.0);
    let mut tangents = chain_with(VALUES, others).learning_predictor();
    let found: Vec<_> = positions().iter().map(|q| tangents.step(q, &at)).collect();
    assert_eq!(found.iter().map(|own| Bends::from(own.0)).collect::<Vec<_>>(), predicted_with(VALUES, others));
    for lane in 0..5 {
        let h = 1e-4 * SDS[lane];
        let [below, above] = [-h, h].map(|h| {
            let mut values = VALUES;
            values[lane] += h;
            predicted_with(values, others)
        });
        let quotients: Vec<Bends> = above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h) * SDS[lane]).collect();
        let scale = quotients.iter().map(|own| own.amax()).fold(0.0, f64::max);
        let agrees = |found: &SMatrix<f64, MAX_BENDS, MAX_LEARNT>, quotient: &Bends| {
            (found.column(lane) - quotient).amax() <= 1e-3 * scale
        };
        let n_agree = found.iter().zip(&quotients).filter(|((_, found), quotient)| agrees(found, quotient)).count();
        println!("{}: {n_agree} of {}, up to {scale:.1e} rad", KEYS[lane], quotients.len());
        // What is left are steps at which a line has just begun to slide or to stick.
        assert!(scale > 1e-4 && n_agree * 100 >= 98 * quotients.len(), "{} {n_agree} {scale}", KEYS[lane]);
    }
}

#[test]
fn new_values_move_the_memory_to_where_it_would_be() {
    const N: usize = 1500;
    let at = Circumstances::at(0.0);
    let values: [f64; 5] = core::array::from_fn(|k| VALUES[k] + 0.3 * SDS[k]);
    let mut tangents = chain(VALUES).learning_predictor();
    let positions = positions();
    for q in &positions[..N] {
        tangents.step(q, &at);
    }
    let mut lanes = [f64::NAN; MAX_LEARNT];
    lanes[..5].copy_from_slice(&values);
    tangents.set(&lanes);
    let (old, new) = (predicted(VALUES), predicted(values));
    for k in N..N + 20 {
        let found = Bends::from(tangents.step(&positions[k], &at).0);
        let (left_rad, whole_rad) = ((found - new[k]).amax(), (old[k] - new[k]).amax());
        assert!(left_rad < 0.1 * whole_rad, "step {k}: {left_rad} rad of {whole_rad} rad");
    }
}

/// Rigid lines have no loads: of the five the play alone shows, and every segment has it.
#[test]
fn of_rigid_lines_the_play_alone_has_slopes() {
    let file = ModelFile::parse(include_str!("../../../docs/segments/two.toml")).unwrap();
    let Machine::Segments(machine) = file.machine() else { panic!("segments") };
    let rigid = SegmentsParameters { rigid_lines: true, ..machine.clone() };
    let mut tangents = SegmentChain::new(&rigid, &effects(VALUES)).unwrap().learning_predictor();
    let slopes = positions().iter().map(|q| tangents.step(q, &Circumstances::at(0.0)).1).collect::<Vec<_>>();
    let largest = |lane: usize| slopes.iter().map(|own| own.column(lane).amax()).fold(0.0, f64::max);
    assert!((0..4).all(|lane| largest(lane) == 0.0) && largest(4) > 1e-3, "{}", largest(4));
}
