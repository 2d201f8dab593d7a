//! Verdicts on joints that were wrong: bad rows at the ends, measurements that come ahead, a sensor that follows nothing, stairs of
//! commands, a delay behind a lag, an effect that does harm.

use super::noise::Noise;
use core::f64::consts::TAU;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::machine_of;
use krait_lab::{AddOptions, ClockOffset, Measurements, Quantity, Term, add};
use krait_model::model_file::ModelFile;

const STEP_S: f64 = 0.02;
const NOISE_RAD: f64 = 0.003;

fn machine(n: usize) -> Box<dyn krait_lab::machine::MachineUnderTest> {
    let text = format!("format = 1\n[machine]\nkind = \"joints\"\nn = {n}\n");
    machine_of(&ModelFile::parse(&text).unwrap()).unwrap()
}

/// Waves of these frequencies, each smaller than the one before.
fn waves(n: usize, hz: &[f64]) -> Vec<f64> {
    let at = |t: f64| hz.iter().zip(1..).map(|(hz, k)| (TAU * hz * t + 1.7 * f64::from(k)).sin() / f64::from(k)).sum();
    (0..n).map(|row| at(row as f64 * STEP_S)).collect()
}

fn slow(n: usize) -> Vec<f64> {
    waves(n, &[0.11, 0.23, 0.37])
}

fn fast(n: usize) -> Vec<f64> {
    waves(n, &[0.2, 0.5, 0.9, 1.7])
}

fn played(u: &[f64], half_width: f64) -> Vec<f64> {
    let mut last = u[0];
    let play = |u: &f64| {
        last = last.clamp(u - half_width, u + half_width);
        last
    };
    u.iter().map(play).collect()
}

/// Behind a lag of a command that stands from its row to the next one.
fn lagged(u: &[f64], time_s: f64) -> Vec<f64> {
    let (mut last, mut held) = (u[0], u[0]);
    let lag = |u: &f64| {
        last += (held - last) * (1.0 - (-STEP_S / time_s).exp());
        held = *u;
        last
    };
    u.iter().map(lag).collect()
}

/// The same of a command that moves evenly from row to row, as the model has it.
fn followed(u: &[f64], time_s: f64) -> Vec<f64> {
    let (mut x, mut last) = (u[0], u[0]);
    let follow = |u: &f64| {
        for k in 0..20 {
            let target = last + (u - last) * (f64::from(k) + 0.5) / 20.0;
            x += (target - x) * (1.0 - (-STEP_S / 20.0 / time_s).exp());
        }
        last = *u;
        x
    };
    u.iter().map(follow).collect()
}

/// Behind a mass on a spring; steps of a twentieth of a row.
fn swung(u: &[f64], frequency: f64, damping: f64) -> Vec<f64> {
    let (mut x, mut v, mut last) = (u[0], 0.0, u[0]);
    let swing = |u: &f64| {
        for k in 1..=20 {
            let target = last + (u - last) * f64::from(k) / 20.0;
            v += (frequency * frequency * (target - x) - 2.0 * damping * frequency * v) * STEP_S / 20.0;
            x += v * STEP_S / 20.0;
        }
        last = *u;
        x
    };
    u.iter().map(swing).collect()
}

fn late(u: &[f64], rows: usize) -> Vec<f64> {
    (0..u.len()).map(|row| u[row.saturating_sub(rows)]).collect()
}

fn ahead(u: &[f64], rows: usize) -> Vec<f64> {
    (0..u.len()).map(|row| u[(row + rows).min(u.len() - 1)]).collect()
}

/// What was measured of a position, in noise.
fn seen(x: &[f64], gain: f64, noise_rad: f64, seed: u64) -> Vec<f64> {
    let mut noise = Noise(seed);
    x.iter().map(|x| gain * x + 0.1 + noise_rad * noise.normal()).collect()
}

fn record(u: &[f64], y: Vec<f64>) -> Measurements {
    let time_s = (0..u.len()).map(|row| row as f64 * STEP_S).collect();
    Measurements::bare("made".to_owned(), Quantity::Joints, time_s, (u.to_vec(), 1), (y, 1))
}

fn diagnosed(data: &Measurements) -> Diagnosis {
    diagnose(machine(data.n_inputs).as_ref(), data, &DiagnoseOptions::default()).unwrap()
}

fn names(found: &Diagnosis) -> Vec<&str> {
    let mut names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    names.sort_unstable();
    names
}

fn assert_missing(found: &Diagnosis, expected: &[&str], what: &str) {
    assert_eq!((found.verdict, &names(found)[..]), (Verdict::Missing, expected), "{what}: {}", found.sentence);
}

#[test]
fn a_bad_row_at_either_end_is_left_out() {
    let u = slow(2000);
    let clean = seen(&played(&u, 0.08), -0.9, NOISE_RAD, 3);
    for bad in [vec![0], vec![1998], vec![0, 1999]] {
        let mut y = clean.clone();
        bad.iter().for_each(|row| y[*row] = 5.0);
        let found = diagnosed(&record(&u, y));
        assert_missing(&found, &["backlash"], &format!("{bad:?}"));
        assert_eq!(found.rows[2], bad.len(), "{bad:?}");
    }
}

/// A joint that is nowhere near its first command, one that is told to jump in the second and in the last row, one that slips.
#[test]
#[ignore = "long at work; .ci/run runs it"]
fn fast_motion_is_no_outlier() {
    let mut y = seen(&lagged(&slow(2000), 0.1), 1.0, NOISE_RAD, 3);
    (0..60).for_each(|row| y[row] += 1.5 * (-(row as f64) * STEP_S / 0.06).exp());
    assert_eq!(diagnosed(&record(&slow(2000), y)).rows[2], 0, "a joint that comes from elsewhere");
    let stairs: Vec<f64> = (0..2000).map(|row| if (row + 49) / 50 % 3 == 0 { 0.6 } else { -0.6 }).collect();
    for x in [lagged(&stairs, 0.15), swung(&stairs, 12.0, 0.3), late(&stairs, 3)] {
        let found = diagnosed(&record(&stairs, seen(&x, 1.1, NOISE_RAD, 4)));
        assert_eq!(found.rows[2], 0, "{}", found.sentence);
    }
    // Sticks until it slips by a twelfth of its range.
    let mut last = 0.0;
    let slip = |u: &f64| {
        last = if (u - last).abs() > 0.25 { *u } else { last };
        last
    };
    let u = slow(2000);
    let x: Vec<f64> = u.iter().map(slip).collect();
    assert_eq!(diagnosed(&record(&u, seen(&x, 1.0, NOISE_RAD, 5))).rows[2], 0, "a joint that slips");
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn measurements_that_come_ahead_have_a_clock_and_the_effect_beside_it_its_size() {
    let u = slow(2500);
    let plain = diagnosed(&record(&u, seen(&ahead(&u, 3), 1.1, NOISE_RAD, 3)));
    assert_eq!((plain.verdict, plain.effects.len()), (Verdict::None, 0), "{}", plain.sentence);
    let floor = plain.noise_floor.unwrap();
    assert!(plain.base_heldout_rms < 1.1 * floor, "{} beside {floor}", plain.base_heldout_rms);
    let data = record(&u, seen(&ahead(&played(&u, 0.06), 3), 1.1, NOISE_RAD, 3));
    let found = diagnosed(&data);
    assert_missing(&found, &["backlash"], "play");
    for own in [&plain, &found] {
        let [clock] = &own.clocks[..] else { panic!("{:?}", own.clocks) };
        assert!((clock.shift_s - 0.06).abs() < 1e-3, "{clock:?}");
        let delay = own.calibration.iter().find(|own| own.name == "delay").unwrap();
        assert!((delay.value + 0.06).abs() < 1e-3 && delay.se > 0.0, "{delay:?}");
        assert!(own.cautions.iter().any(|caution| caution.contains("--clock")), "{:?}", own.cautions);
        assert_eq!(own.rows[0], 2500);
    }
    // As `--clock` has it, for the command that comes next.
    let clocks: Vec<ClockOffset> = found.clocks.iter().map(|own| own.words().parse().unwrap()).collect();
    let moved = data.by_clocks(&clocks, &[0]);
    let by_hand = diagnosed(&moved);
    let ratio = found.base_heldout_rms / by_hand.base_heldout_rms;
    assert!((0.98..1.02).contains(&ratio), "{ratio}");
    let term = Term::new("backlash", vec![1.0, 0.01]);
    let options = AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() };
    let added = add(machine(1).as_ref(), &moved, &options).unwrap();
    let half_width = added.terms[0].values[1];
    assert!((half_width - 0.06).abs() < 1e-3, "{half_width}");
}

/// Of a motion what a joint does, by a clock whose seconds are longer by this part from the record's beginning on.
fn by_other_clock(n: usize, rate: f64, mut joint: impl FnMut(f64) -> f64) -> Vec<f64> {
    const FINE: usize = 20;
    let hz = [0.11, 0.23, 0.37];
    let at = |t: f64| hz.iter().zip(1..).map(|(hz, k)| (TAU * hz * t + 1.7 * f64::from(k)).sin() / f64::from(k)).sum();
    let step_s = STEP_S / FINE as f64;
    let all: Vec<f64> = (0..(n + 10) * FINE).map(|k| joint(at(k as f64 * step_s))).collect();
    let shown = |row: usize| {
        let place = row as f64 * FINE as f64 * (1.0 + rate);
        let (whole, part) = (place.floor(), place.fract());
        all[whole as usize] * (1.0 - part) + all[whole as usize + 1] * part
    };
    (0..n).map(shown).collect()
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn a_clock_of_another_rate_is_calibration_and_the_play_beside_it_has_its_size() {
    let (n, u) = (3000, slow(3000));
    for rate in [1e-3, -2e-3, 2e-4] {
        let mut last = u[0];
        let x = by_other_clock(n, rate, |u| {
            last = last.clamp(u - 0.06, u + 0.06);
            last
        });
        let found = diagnosed(&record(&u, seen(&x, 1.1, NOISE_RAD, 3)));
        assert_missing(&found, &["backlash"], &format!("{rate}"));
        let [clock] = &found.clocks[..] else { panic!("{rate}: {:?}", found.clocks) };
        let own = found.calibration.iter().find(|own| own.name == "clock-rate").unwrap();
        let off = (clock.rate - rate).abs();
        assert!(off < 2e-5 && off < 4e-6 * own.se && own.se > 0.0, "{rate}: {clock:?}, {own:?}");
        assert_eq!((own.unit.as_str(), 1e6 * clock.rate), ("ppm", own.value));
        assert!(found.cautions.iter().any(|caution| caution.contains("ppm apart")), "{:?}", found.cautions);
        let half_width = found.effects[0].parameters.iter().find(|own| own.name == "half_width").unwrap().value;
        assert!((half_width - 0.06).abs() < 1e-3, "{half_width}");
    }
    // One clock of both joints, of which one hardly tells it.
    let (x, other) = (by_other_clock(n, 1e-3, |u| u), by_other_clock(n, 1e-3, |u| -0.01 * u));
    let pairs = |a: &[f64], b: &[f64]| a.iter().zip(b).flat_map(|(a, b)| [*a, *b]).collect::<Vec<f64>>();
    let of_both = [seen(&x, 1.1, NOISE_RAD, 5), seen(&other, 1.0, NOISE_RAD, 6)];
    let time_s = (0..n).map(|row| row as f64 * STEP_S).collect();
    let told = (pairs(&u, &u), 2);
    let data =
        Measurements::bare("made".to_owned(), Quantity::Joints, time_s, told, (pairs(&of_both[0], &of_both[1]), 2));
    let found = diagnosed(&data);
    assert!(found.verdict == Verdict::None && (found.clocks[0].rate - 1e-3).abs() < 2e-5, "{}", found.sentence);
}

/// A play that grows and a lag that falls as a joint warms up look like a clock that drifts, and leave a rest beside it.
#[test]
#[ignore = "long at work; .ci/run runs it"]
fn what_grows_with_time_is_no_clock() {
    let (n, u) = (3000, slow(3000));
    let mut last = u[0];
    let widening: Vec<f64> = (0..n)
        .map(|row| {
            let half_width = 0.06 * (0.4 + 0.6 * row as f64 / n as f64);
            last = last.clamp(u[row] - half_width, u[row] + half_width);
            last
        })
        .collect();
    let mut x = u[0];
    let warming: Vec<f64> = (0..n)
        .map(|row| {
            let time_s = 0.1 + 0.2 * (-(row as f64) * STEP_S / 15.0).exp();
            x += (u[row] - x) * (1.0 - (-STEP_S / time_s).exp());
            x
        })
        .collect();
    for (what, x) in [("a play that grows", widening), ("a lag that falls", warming)] {
        let found = diagnosed(&record(&u, seen(&x, 1.1, NOISE_RAD, 3)));
        let drifts = found.clocks.iter().any(|clock| clock.rate != 0.0);
        assert!(!drifts && found.verdict != Verdict::None, "{what}: {:?} {}", found.clocks, found.sentence);
    }
}

/// One of two joints whose measurements come ahead has no clock of both.
#[test]
fn one_joint_that_comes_ahead_makes_the_other_no_later() {
    let (n, u, other) = (1500, slow(1500), waves(1500, &[0.17, 0.29]));
    let (y, still) = (seen(&ahead(&u, 3), 1.1, NOISE_RAD, 3), seen(&other, 0.9, NOISE_RAD, 4));
    let pairs = |a: &[f64], b: &[f64]| a.iter().zip(b).flat_map(|(a, b)| [*a, *b]).collect::<Vec<f64>>();
    let time_s = (0..n).map(|row| f64::from(row) * STEP_S).collect();
    let of_both = (pairs(&u, &other), 2);
    let data = Measurements::bare("made".to_owned(), Quantity::Joints, time_s, of_both, (pairs(&y, &still), 2));
    let found = diagnosed(&data);
    assert_eq!((found.verdict, found.clocks.len()), (Verdict::None, 0), "{}", found.sentence);
    assert!(found.base_heldout_rms < 1.1 * found.noise_floor.unwrap(), "{}", found.sentence);
}

#[test]
fn a_sensor_that_does_not_follow_is_said_and_nothing_is_missing_of_a_joint_at_rest() {
    let u = slow(2000);
    let noise = seen(&vec![0.0; 2000], 1.0, 0.004, 3);
    for y in [noise.clone(), vec![0.6; 2000]] {
        let found = diagnosed(&record(&u, y));
        assert_eq!((found.verdict, found.effects.len(), found.partial.len()), (Verdict::Unknown, 0, 0));
        assert!(found.sentence.contains("joint 1 does not follow its input"), "{}", found.sentence);
        assert!(found.proposals.is_empty() && found.next_experiment.is_none());
    }
    let mut random = Noise(9);
    let jitter: Vec<f64> = (0..2000).map(|_| 0.5 + 1e-4 * random.normal()).collect();
    for still in [vec![0.5; 2000], jitter] {
        let found = diagnosed(&record(&still, noise.clone()));
        assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    }
    // Much noise beside a small motion, which it follows.
    let small: Vec<f64> = u.iter().map(|u| 0.002 * u).collect();
    let found = diagnosed(&record(&small, seen(&small, 1.0, 0.006, 5)));
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
}

/// Commands in steps, as of a stepper motor or of a controller that is told every while, and a lag: no error of a screw.
#[test]
#[ignore = "long at work; .ci/run runs it"]
fn a_lag_of_stairs_is_no_error_that_repeats() {
    // A command that acts from its row on is half a row late beside one that moves evenly to it; one that was written down a row later
    // is half a row early.
    for (step, rows, shift_s) in [(0.3, 0, 0.0), (0.1, 0, 0.0), (0.3, 1, 0.01)] {
        let stairs: Vec<f64> = slow(3000).iter().map(|u| (u / step).round() * step).collect();
        let x = ahead(&lagged(&stairs, 0.2), rows);
        let found = diagnosed(&record(&stairs, seen(&x, 1.1, NOISE_RAD, 3)));
        let clock_s = found.clocks.first().map_or(0.0, |own| own.shift_s);
        assert!((clock_s - shift_s).abs() < 1e-3, "{step}, {rows}: {clock_s}");
        let lag = found
            .effects
            .iter()
            .find(|own| own.name == "first-order-lag")
            .unwrap_or_else(|| panic!("{}", found.sentence));
        assert!((lag.parameters[1].value - 0.2).abs() < 3e-3, "{:?}", lag.parameters);
        assert!(!names(&found).contains(&"periodic-error"), "{}", found.sentence);
        assert!(found.final_heldout_rms < 1.15 * found.noise_floor.unwrap(), "{}", found.sentence);
    }
}

#[test]
fn a_delay_behind_a_lag_is_named_beside_it() {
    let u = fast(3000);
    let found = diagnosed(&record(&u, seen(&late(&followed(&u, 0.15), 5), 1.0, NOISE_RAD, 3)));
    assert_missing(&found, &["first-order-lag", "latency"], "both");
    let value = |name: &str| found.effects.iter().find(|own| own.name == name).unwrap().parameters[1].value;
    assert!((value("first-order-lag") - 0.15).abs() < 3e-3, "{}", value("first-order-lag"));
    assert!((value("latency") - 0.1).abs() < 3e-3, "{}", value("latency"));
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn a_delay_a_lag_or_a_swing_alone_stays_alone() {
    let u = fast(2000);
    for (noise_rad, seed) in [(0.0005, 3), (0.02, 5)] {
        let made = [
            ("latency", late(&u, 5)),
            ("first-order-lag", followed(&u, 0.15)),
            ("second-order", swung(&u, 15.0, 0.6)),
            ("second-order", swung(&u, 12.0, 1.0)),
        ];
        for (name, x) in made {
            let found = diagnosed(&record(&u, seen(&x, 1.0, noise_rad, seed)));
            let rate = ["latency", "first-order-lag", "second-order", "rate-limit"];
            let n = names(&found).into_iter().filter(|own| rate.contains(own)).count();
            // In noise a lag and a swing that is damped are alike.
            let is_named = found.effects[0].class.iter().any(|own| own == name);
            assert!(is_named && n == 1, "{name} in {noise_rad}: {}", found.sentence);
        }
    }
}

/// A bump that no effect makes: what imitates it is asserted only as far as it explains something by itself.
#[test]
fn an_effect_that_makes_the_error_larger_is_not_asserted() {
    let u = slow(3000);
    let bump = |u: &f64| u + 0.045 * (-((u - 0.3) / 0.15).powi(2)).exp();
    let x: Vec<f64> = u.iter().map(bump).collect();
    let found = diagnosed(&record(&u, seen(&x, 1.1, NOISE_RAD, 3)));
    assert!(!found.effects.is_empty(), "{}", found.sentence);
    for own in &found.effects {
        assert!(own.after < own.before, "{}: {} to {}: {}", own.name, own.before, own.after, found.sentence);
    }
}

/// A torque whose motion is much like the command's: two effects imitate a part of what it does, and it does all of it.
#[test]
fn effects_that_imitate_a_column_are_not_asserted_and_the_column_is_named() {
    let u = slow(3000);
    let torque_nm: Vec<f64> = lagged(&u, 0.6).iter().zip(&u).map(|(x, u)| 40.0 * (x - 0.3 * u * u)).collect();
    let x: Vec<f64> = u.iter().zip(&torque_nm).map(|(u, tau)| u + 0.004 * tau).collect();
    let mut data = record(&u, seen(&x, 1.1, NOISE_RAD, 3));
    data.extra.push(("motor torque [Nm]".to_owned(), torque_nm));
    let found = diagnosed(&data);
    assert_eq!((found.verdict, found.effects.len()), (Verdict::Unknown, 0), "{}", found.sentence);
    assert!(found.sentence.contains("\"motor torque [Nm]\" takes"), "{}", found.sentence);
    assert!(found.proposals[0].column.as_ref().is_some_and(|(_, column)| column == "motor torque [Nm]"));
}
