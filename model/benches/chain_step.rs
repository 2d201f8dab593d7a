//! Time of one step of the compensator on a chain of four effects, beside the same step written straight-line, and of the
//! predictor on chains of none to four effects.
//!
//! `cargo bench -p krait-model --bench chain_step`. Prints the least of many rounds, which is what an idle machine takes.

#![allow(clippy::unwrap_used, reason = "a panic is how a benchmark fails")]
#![allow(clippy::print_stdout, reason = "a benchmark prints")]
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

#[path = "../tests/straight/mod.rs"]
mod straight;

use krait_model::effects::EffectKind as K;
use krait_model::{Chain, Circumstances, EffectSetting, MachineParameters};
use nalgebra::Vector3;
use std::hint::black_box;
use std::time::Instant;
use straight::{four, four_by_hand, motion};

const N_STEPS: usize = 2000;
const N_ROUNDS: usize = 400;

fn main() {
    let bends = motion(N_STEPS);
    let compensator = four().compensator().unwrap();
    let chain_ns = least_ns_per_step(&bends, || {
        let mut own = compensator.clone();
        let mut k = 0.0;
        move |b| {
            k += 1e-3;
            black_box(own.step(b, &Circumstances::at(k)));
        }
    });
    let straight_ns = least_ns_per_step(&bends, || {
        let mut own = four_by_hand();
        let mut k = 0.0;
        move |b| {
            k += 1e-3;
            black_box(own.step(b, &Circumstances::at(k)));
        }
    });
    println!("machine: {}", processor());
    println!("compensate, chain of four effects: {chain_ns:.0} ns/step");
    println!("the same step straight-line:       {straight_ns:.0} ns/step");
    let readings: Vec<Vector3<f64>> = {
        let mut own = compensator.clone();
        let at = |k: usize| Circumstances::at(k as f64 * 1e-3);
        bends.iter().enumerate().map(|(k, b)| own.step(*b, &at(k)).q_tilde_m).collect()
    };
    let lists: [&[K]; 4] = [
        &[],
        &[K::StiffnessScale, K::Backlash],
        &[K::ConeFriction, K::BoucWen],
        &[K::StiffnessScale, K::Backlash, K::StaticFriction, K::ConeFriction],
    ];
    for kinds in lists {
        let predict_ns = predict_ns(kinds, &readings);
        let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
        println!("predict, {} effects: {predict_ns:.0} ns/step {}", kinds.len(), names.join(" "));
    }
}

fn predict_ns(kinds: &[K], readings: &[Vector3<f64>]) -> f64 {
    let effects: Vec<EffectSetting> = kinds.iter().map(|kind| EffectSetting::new(*kind)).collect();
    let chain = Chain::new(&MachineParameters::default(), Default::default(), &effects, Default::default()).unwrap();
    let predictor = chain.predictor();
    least_ns_per_step(readings, || {
        let mut own = predictor.clone();
        let mut k = 0.0;
        move |q| {
            k += 1e-3;
            black_box(own.step(q, &Circumstances::at(k)));
        }
    })
}

/// The least of many rounds, each from a fresh start.
fn least_ns_per_step<T: Copy, F: FnMut(T)>(inputs: &[T], start: impl Fn() -> F) -> f64 {
    let round = || {
        let mut step = start();
        let from = Instant::now();
        inputs.iter().for_each(|input| step(black_box(*input)));
        from.elapsed().as_secs_f64() * 1e9 / inputs.len() as f64
    };
    (0..N_ROUNDS).map(|_| round()).fold(f64::INFINITY, f64::min)
}

fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")).and_then(|rest| rest.split(':').nth(1));
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!("{}, {cores} cores", model.unwrap_or("unknown processor").trim())
}
