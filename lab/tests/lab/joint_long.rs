//! Long records of a joint with play and a delay of two rows: what was thinned to a few rows a second told another hysteresis.

use crate::joint_order::{diagnosed_of, play};
use crate::noise::Noise;
use krait_lab::diagnose::{Diagnosis, Verdict};

const STEP_S: f64 = 0.01;
const DELAY_S: f64 = 0.02;
const HALF_WIDTH: f64 = 0.009;
/// The plant makes so many steps from one row to the next.
const FINE: usize = 4;

/// What is said of so many rows, with a drift of this size in rad that settles in a fifth of them.
fn diagnosed(rows: usize, drift: f64) -> Diagnosis {
    let (mut noise, mut play) = (Noise(11), play(HALF_WIDTH));
    let at = |t: f64| {
        let wave = |hz: f64, phase: f64| (core::f64::consts::TAU * hz * t + phase).sin();
        0.21 * wave(0.21, 0.3) + 0.12 * wave(0.37, 1.0) + 0.07 * wave(0.53, 2.0)
    };
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for step in 0..rows * FINE {
        let t = STEP_S / FINE as f64 * step as f64;
        let position = play(at(t - DELAY_S));
        if step % FINE == 0 {
            let drifted = drift * (1.0 - (-5.0 * step as f64 / (rows * FINE) as f64).exp());
            inputs.push(at(t));
            outputs.push(1.02 * position + 0.01 + drifted + 3.5e-4 * noise.normal());
        }
    }
    diagnosed_of(STEP_S, inputs, outputs)
}

fn is_found(found: &Diagnosis, effects: &[&str]) {
    let mut names: Vec<&str> = found.effects.iter().map(|own| own.name.as_str()).collect();
    names.sort_unstable();
    assert_eq!((found.verdict, names.as_slice()), (Verdict::Missing, effects), "{}", found.sentence);
    for (effect, number, truth) in [("backlash", "half_width", HALF_WIDTH), ("latency", "delay_s", DELAY_S)] {
        let own = found.effects.iter().find(|own| own.name == effect).expect("named");
        let value = own.parameters.iter().find(|own| own.name == number).expect("a number").value;
        assert!((value / truth - 1.0).abs() < 0.02, "{number}: {value}");
    }
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn of_many_rows_all_are_taken() {
    is_found(&diagnosed(40_000, 0.0), &["backlash", "latency"]);
}

/// The drift is that of all the time, and not that of the record's beginning.
#[test]
#[ignore = "long at work; .ci/run runs it"]
fn of_very_many_sections_are_taken_to_the_end() {
    is_found(&diagnosed(100_000, 0.005), &["backlash", "drift", "latency"]);
}
