//! The watch for changes of segments, off the clock: how often it is wrong on simulated machines that do not change, and how soon it is
//! right on those that do, over many seeds.

#![allow(
    clippy::panic,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a panic is how a test fails; a measurement is printed"
)]

use crate::allocations::allocations_of;
use crate::common::segments::{CAMERA_HZ, TICK_NS, bends_rad, truth};
use crate::common::{T0_NS, ready_state, setpoint};
use krait_bridge::{
    CompensateConfig, EstimateConfig, EstimatorCore, LiveModel, SegmentCompensateCore, SegmentEstimateCore,
    SegmentModel,
};
use krait_ipc::Reason;
use krait_ipc::message::{Setpoint, Shape, SlaveState};
use krait_model::ChangeKind;
use krait_model::model_file::ModelFile;
use krait_sim::{SegmentDrives, SegmentsTruth};
use krait_slave::{Drive, SeenShape};

const TWO: &str = include_str!("../../../docs/segments/two.toml");
const LEARN: &str = include_str!("../../../docs/segments/learn.toml");
/// Motion from which the watch learns what is normal, s.
const LEARN_S: f64 = 15.0;
/// When a machine changes, s, and how long it is then looked at.
const CHANGED_S: f64 = 32.0;
const LOOKED_AT_S: f64 = 15.0;
/// The machine that takes the place of the first one moves for so long before, so that its play is taken up.
const BEFORE_S: f64 = 6.0;

/// What becomes of a machine.
struct Fate {
    truth: fn(&mut SegmentsTruth),
    camera: fn([f64; 4]) -> [f64; 4],
}

const NONE: Fate = Fate { truth: |_| {}, camera: |seen_rad| seen_rad };

/// An alarm.
#[derive(Clone, Copy, Debug)]
struct Alarm {
    at_s: f64,
    segment: u32,
    kind: ChangeKind,
}

/// A machine that moves for so long, and what the watch says; also how long it watched, s.
fn run(text: &str, seed: u64, per_hour: f64, seconds: f64, fate: &Fate) -> (f64, Vec<Alarm>) {
    let model = LiveModel::of(&ModelFile::parse(text).expect("a model")).expect("it can be driven");
    let model: &SegmentModel = model.segments().expect("segments");
    let mut changed = truth(seed);
    (fate.truth)(&mut changed);
    let mut machines = [truth(seed), changed].map(|truth| SegmentDrives::new(&truth).expect("a truth"));
    machines.iter_mut().for_each(|own| assert!(own.set_power(T0_NS, true).is_ok()));
    let config = EstimateConfig { false_alarms_per_hour: per_hour, learn_s: LEARN_S, ..EstimateConfig::default() };
    let mut compensate = SegmentCompensateCore::new(model, CompensateConfig::default()).expect("defaults");
    let mut estimate = SegmentEstimateCore::new(model, config).expect("in range");
    let (mut n_shapes, mut n_watched, mut alarms) = (0, 0u32, Vec::new());
    for tick in 1..=(seconds * 1e9) as i64 / TICK_NS {
        let (now_ns, t_s) = (T0_NS + tick * TICK_NS, (tick * TICK_NS) as f64 * 1e-9);
        let is_changed = t_s > CHANGED_S;
        // One camera: what is seen of the other machine is not looked at.
        let seen = machines.each_mut().map(|own| own.shape(now_ns))[usize::from(is_changed)];
        let measured_q_m = machines[usize::from(is_changed)].read(now_ns).expect("encoders").q_tilde_m;
        let state = SlaveState { sample_ns: now_ns, measured_q_m, ..ready_state(tick as u64) };
        let setpoint = Setpoint {
            sample_ns: now_ns,
            bend_rad: [f64::NAN; 2],
            joints_rad: bends_rad(t_s),
            n_joints: 4,
            n_actuators: 6,
            model_hash: model.hash().0,
            ..setpoint(tick as u64, [0.0; 2])
        };
        estimate.note_state(&state);
        compensate.note_state(&state);
        let command = compensate.step(&setpoint, now_ns).expect("a good setpoint");
        for (own, from_s) in machines.iter_mut().zip([0.0, CHANGED_S - BEFORE_S]) {
            if t_s > from_s {
                own.write(now_ns, command.q_tilde_m).expect("within the stroke");
            }
        }
        let Some(seen) = seen else { continue };
        let SeenShape::Joints(seen_rad, 4) = seen.seen else { panic!("two segments") };
        let mut shown_rad = [seen_rad[0], seen_rad[1], seen_rad[2], seen_rad[3]];
        if is_changed {
            shown_rad = (fate.camera)(shown_rad);
        }
        n_shapes += 1;
        let mut shape = Shape::of_joints(n_shapes, seen.exposure_ns, now_ns, &shown_rad);
        shape.joint_variances_rad2 = [seen.sigma_rad * seen.sigma_rad; 8];
        let mut newest = None;
        assert_eq!(allocations_of(|| newest = Some(estimate.step(&shape))), 0, "a step allocates nothing");
        let update = newest.expect("an update");
        compensate.note_update(&update).expect("of this model");
        n_watched += update.is_watching;
        if update.n_changes > alarms.len() as u64 {
            assert_eq!((update.changed_ns, update.is_watching), (shape.sample_ns, 0), "all learn anew");
            assert!(estimate.reasons(now_ns).contains(Reason::ModelChanged));
            let kind = ChangeKind::from_number(update.change_kind).expect("a kind");
            alarms.push(Alarm { at_s: t_s, segment: update.changed_segment, kind });
        }
    }
    (f64::from(n_watched) / CAMERA_HZ, alarms)
}

/// Alarms of machines that do not change, held against the rate that was asked for.
fn false_alarms(name: &str, text: &str, n_seeds: u64) {
    const PER_HOUR: f64 = 20.0;
    let (mut watched_s, mut n_alarms) = (0.0, 0.0);
    for seed in 1..=n_seeds {
        let (own_s, alarms) = run(text, seed, PER_HOUR, 75.0, &NONE);
        (watched_s, n_alarms) = (watched_s + own_s, n_alarms + alarms.len() as f64);
        alarms.iter().for_each(|alarm| println!("{name} {seed}: {alarm:?}"));
    }
    let asked = PER_HOUR * watched_s / 3600.0;
    println!("{name}: {n_alarms} false alarms in {watched_s:.0} s of {n_seeds} machines, at most {asked:.1} asked for");
    assert!(watched_s > 40.0 * n_seeds as f64, "{watched_s} s were watched");
    // Counts follow Poisson's law: three standard deviations.
    assert!(n_alarms <= asked + 3.0 * asked.sqrt(), "{n_alarms}");
}

#[test]
fn machines_that_do_not_change_give_no_more_alarms_than_asked_for() {
    false_alarms("the right model", TWO, 4);
}

#[test]
fn nor_do_machines_whose_model_is_still_learnt() {
    false_alarms("a model that is learnt", LEARN, 4);
}

#[test]
#[ignore = "over many seeds; .ci/long runs it"]
fn nor_do_many_of_either() {
    false_alarms("the right model", TWO, 24);
    false_alarms("a model that is learnt", LEARN, 24);
}

/// How many of the machines are seen to change within the time, after how long, and in which segments.
fn detected(name: &str, fate: &Fate, n_seeds: u64) -> (u64, Vec<Alarm>) {
    let (mut first, mut n_before) = (Vec::new(), 0);
    for seed in 1..=n_seeds {
        let (_, alarms) = run(TWO, 100 + seed, 1.0, CHANGED_S + LOOKED_AT_S, fate);
        n_before += alarms.iter().filter(|alarm| alarm.at_s <= CHANGED_S).count();
        first.extend(alarms.into_iter().find(|alarm| alarm.at_s > CHANGED_S));
    }
    let mut seconds: Vec<f64> = first.iter().map(|alarm| alarm.at_s - CHANGED_S).collect();
    seconds.sort_by(f64::total_cmp);
    let of = |segment| first.iter().filter(|alarm| alarm.segment == segment).count();
    println!(
        "{name}: {} of {n_seeds} seen, {n_before} before; after {:.2} s (median), {:.2} s (last); segment 1 {}, segment 2 {}; {:?}",
        first.len(),
        seconds.get(seconds.len() / 2).copied().unwrap_or(f64::NAN),
        seconds.last().copied().unwrap_or(f64::NAN),
        of(1),
        of(2),
        first.iter().map(|alarm| alarm.kind).collect::<Vec<_>>()
    );
    (first.len() as u64, first)
}

#[test]
fn machines_that_change_are_seen_to() {
    are_seen_to_change(3);
}

#[test]
#[ignore = "over many seeds; .ci/long runs it"]
fn and_so_are_many() {
    are_seen_to_change(8);
    are_told_of_their_segment(8);
}

fn are_seen_to_change(n_seeds: u64) {
    // Small ones: 0.02 mm of play to either side of every line, 1.6 % of load, 5 % of the stiffness of one segment.
    let play = Fate { truth: |truth| truth.effects.play_m = 0.22e-3, ..NONE };
    let stiffer = Fate { truth: |truth| truth.effects.load_scale = 1.24, ..NONE };
    let one_stiffer = Fate { truth: |truth| truth.segment[1].machine.e_pa *= 1.05, ..NONE };
    for (name, fate) in [("play", play), ("load scale", stiffer), ("segment 2 stiffer", one_stiffer)] {
        let (n, _) = detected(name, &fate, n_seeds);
        assert_eq!(n, n_seeds, "{name}");
    }
}

#[test]
fn what_one_segment_alone_shows_is_told_of_that_segment() {
    are_told_of_their_segment(3);
}

fn are_told_of_their_segment(n_seeds: u64) {
    let aside = Fate { camera: |[a, b, c, d]| [a, b, c + 0.5f64.to_radians(), d], ..NONE };
    let first_turned = Fate { camera: |[a, b, c, d]| [a - 0.05 * b, b + 0.05 * a, c, d], ..NONE };
    for (name, fate, segment) in [("segment 2 aside", aside, 2), ("segment 1 turned", first_turned, 1)] {
        let (n, first) = detected(name, &fate, n_seeds);
        assert_eq!(n, n_seeds, "{name}");
        assert!(first.iter().all(|alarm| alarm.segment == segment), "{name}: {first:?}");
    }
}
