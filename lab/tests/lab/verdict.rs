//! What a verdict rests on: whether the data are long enough for a test, and how well the floor is known.

use super::diagnose::{NOISE_RAD, adding, diagnosed, lab, made_on, motion, motion_of, term};
use super::init::{TextbookJoint, of_force};
use super::noise::Noise;
use krait_lab::diagnose::{Diagnosis, Verdict};
use krait_lab::machine::MachineUnderTest;
use krait_lab::noise::NoiseFloor;
use krait_lab::{Measurements, Problem, add};

/// A snake whose tip sways in time, which no effect does; 20 rows a second.
fn swaying(seconds: usize) -> Diagnosis {
    let mut data = made_on(motion_of(20 * seconds, 1), &[], 31);
    for (row, time_s) in data.time_s.clone().into_iter().enumerate() {
        data.outputs[2 * row] += 0.02 * (2.0 * core::f64::consts::PI * 0.27 * time_s).sin();
    }
    diagnosed(&data)
}

/// A torque that has nothing but an offset, noise and a slow sway; 100 rows a second.
fn swaying_torque(seconds: usize) -> Diagnosis {
    let text = TextbookJoint::default().csv(3);
    let row = |line: &str| {
        let mut cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells[2] += 0.3 * (2.0 * core::f64::consts::PI * cells[0] / 7.0).sin();
        format!("{:.3},{:.5},{:.5}\n", cells[0], cells[1], cells[2])
    };
    let (header, rows) = text.split_once('\n').unwrap();
    let rows: String = rows.lines().take(100 * seconds).map(row).collect();
    of_force(&format!("sway_{seconds}"), &format!("{header}\n{rows}"))
}

/// Too short with a length; of that length no longer, two seconds less still.
fn needs_what_it_says(what: &str, of: fn(usize) -> Diagnosis) {
    let short = of(12);
    assert_eq!(short.verdict, Verdict::TooShort, "{what}: {}", short.sentence);
    let needed_s = short.needed_s.unwrap();
    assert!(short.sentence.contains(&format!("{needed_s:.0} s of such data")), "{what}: {}", short.sentence);
    assert!(short.effects.is_empty() && short.explained_share.is_none(), "{what}: {}", short.sentence);
    let json = short.to_json();
    assert_eq!((&json["verdict"], &json["needed_s"]), (&"too-short".into(), &needed_s.into()), "{what}");

    let nearly = of(needed_s as usize - 2);
    assert_eq!((nearly.verdict, nearly.needed_s), (Verdict::TooShort, Some(needed_s)), "{what}: {}", nearly.sentence);
    let enough = of(needed_s as usize);
    assert_ne!(enough.verdict, Verdict::TooShort, "{what}: {}", enough.sentence);
    assert_eq!(enough.needed_s, None, "{what}");
}

#[test]
fn a_short_record_of_a_snake_says_how_long_it_must_be_and_so_long_a_one_is_judged() {
    needs_what_it_says("a snake", swaying);
}

#[test]
fn a_short_record_of_a_torque_says_how_long_it_must_be_and_so_long_a_one_is_judged() {
    needs_what_it_says("a torque", swaying_torque);
}

/// A tenth of a minute is enough where nothing but white noise is left: the floor says so, no test need.
#[test]
fn a_short_record_at_the_floor_is_no_question_of_length() {
    let found = diagnosed(&made_on(motion_of(300, 1), &[], 5));
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    let found = diagnosed(&made_on(motion_of(300, 1), &[term("stiffness-scale", &[1.3])], 5));
    assert_eq!(found.verdict, Verdict::Missing, "{}", found.sentence);
}

/// Noise of standard deviation [`NOISE_RAD`] in two outputs, each row with this part of the row before.
fn noise(n_rows: usize, kept: f64, seed: u64) -> Vec<f64> {
    let (mut source, mut last) = (Noise(seed), [0.0; 2]);
    let new = NOISE_RAD * (1.0 - kept * kept).sqrt();
    (0..2 * n_rows)
        .map(|k| {
            last[k % 2] = kept * last[k % 2] + new * source.normal();
            last[k % 2]
        })
        .collect()
}

/// Standard deviation of many estimates, as a part of their mean.
fn scatter(all: &[f64]) -> f64 {
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt() / mean
}

#[test]
fn standard_errors_of_a_floor_are_how_much_it_scatters_from_record_to_record() {
    let machine = lab();
    let problem = Problem::new(&machine, made_on(motion(), &[], 1), &[], 4.0);
    // White noise, and noise that remembers a third of a second: 2400 rows with ten rests of three seconds.
    for kept in [0.0, 0.85] {
        let of = |seed| NoiseFloor::new(&problem, &noise(problem.data.n_rows(), kept, seed));
        let floors: Vec<NoiseFloor> = (1..=80).map(of).collect();
        let mean = |own: fn(&NoiseFloor) -> f64| floors.iter().map(own).sum::<f64>() / floors.len() as f64;
        let all = |own: fn(&NoiseFloor) -> f64| scatter(&floors.iter().map(own).collect::<Vec<_>>());
        let rest = mean(|own| own.rest_relative_se) / all(|own| own.rest.unwrap());
        assert!((0.7..1.4).contains(&rest), "rests, {kept}: {rest}");
        if kept == 0.0 {
            let fast = mean(|own| own.differences_relative_se) / all(|own| own.differences.unwrap());
            assert!((0.75..1.33).contains(&fast), "differences: {fast}");
        }
    }
}

/// Loops without any rest.
fn restless() -> Measurements {
    let mut data = motion();
    for (row, time_s) in data.time_s.clone().into_iter().enumerate() {
        let (bend, plane) = (0.5 + 0.45 * (0.9 * time_s).sin(), 2.7 * (0.23 * time_s).sin());
        for line in 0..3 {
            let angle = plane + line as f64 * 2.0 * core::f64::consts::PI / 3.0;
            data.inputs[3 * row + line] = -0.003 * bend * angle.cos();
        }
    }
    data
}

fn in_noise(hidden: &[krait_lab::Term], kept: f64, seed: u64) -> Measurements {
    let mut data = made_on(restless(), hidden, seed);
    let clean = lab().predict(hidden, &data).unwrap();
    let noise = noise(data.n_rows(), kept, seed);
    data.outputs = clean.iter().zip(noise).map(|(clean, noise)| clean + noise).collect();
    data
}

#[test]
fn differences_alone_are_a_floor_only_where_what_is_left_has_no_memory() {
    let hidden = [term("stiffness-scale", &[1.1])];
    let [in_white, in_slow] = [0.0, 0.5].map(|kept| in_noise(&hidden, kept, 3));
    let white = diagnosed(&in_white);
    assert_eq!(white.verdict, Verdict::Missing, "{}", white.sentence);
    let floor = white.noise_floor.unwrap() / (NOISE_RAD.to_degrees() * 2.0_f64.sqrt());
    assert!((0.9..1.1).contains(&floor) && white.explained_share.unwrap() > 0.9, "{floor} {:?}", white.explained_share);
    assert!(white.to_json()["noise_floor_relative_se"].as_f64().is_some_and(|error| error > 0.0));

    // Half of the row before.
    let slow = diagnosed(&in_slow);
    assert!(slow.floor_source.starts_with("unknown"), "{}", slow.floor_source);
    assert_eq!((slow.noise_floor, slow.explained_share), (None, None), "{}", slow.sentence);
    assert_eq!(slow.verdict, Verdict::Missing, "{}", slow.sentence);
    assert!(slow.to_json()["noise_floor_relative_se"].is_null());
    let alarms = (40..46).filter(|&seed| diagnosed(&in_noise(&[], 0.5, seed)).verdict != Verdict::None).count();
    assert!(alarms <= 1, "{alarms} of 6");

    // Adding the effect judges the floor alike.
    let [in_white, in_slow] =
        [in_white, in_slow].map(|data| add(&lab(), &data, &adding("stiffness-scale", 1.05, Vec::new())).unwrap());
    assert!(in_white.noise_floor.is_some() && in_white.floor_relative_error > 0.0, "{:?}", in_white.noise_floor);
    assert_eq!((in_slow.noise_floor, in_slow.floor_relative_error), (None, 0.0));
}
