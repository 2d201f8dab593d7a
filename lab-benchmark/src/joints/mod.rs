//! Data of a simulated pair of joints, the first with hidden effects, for the lab's benchmark.
//!
//! Gain and offset are drawn and not told: the model that the lab gets leaves them out. Sizes are root mean squares of what an
//! effect changes beyond a gain and an offset, in units of the noise.

mod kind;
mod plant;

pub use kind::{JOINT_KINDS, JointKind};

use crate::generate::{Answer, NoiseKind, Purpose, Random};
use core::f64::consts::TAU;
use kind::Draw;
use krait_lab::{Measurements, Quantity};
use plant::{Plant, middle_and_half};
use std::collections::BTreeMap;

/// What to make.
#[derive(Clone, Debug)]
pub struct JointRecipe {
    /// What is hidden in the first joint, and how large in units of the noise.
    pub hidden: Vec<(&'static JointKind, f64)>,
    /// Whether joints reach and rest as an operator moves them; else they go up and down by many ways.
    pub is_teleop: bool,
    /// The sensor's noise.
    pub noise: NoiseKind,
    /// Its standard deviation over a half range of the motion.
    pub sigma: f64,
    /// Length, s.
    pub seconds: f64,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// Every so many rows the sensor measures.
    pub every: usize,
    /// Everything that is drawn follows from it.
    pub seed: u64,
}

impl Default for JointRecipe {
    fn default() -> Self {
        Self {
            hidden: Vec::new(),
            is_teleop: false,
            noise: NoiseKind::White,
            sigma: 0.01,
            seconds: 100.0,
            rate_hz: 50.0,
            every: 1,
            seed: 0,
        }
    }
}

/// The model that the lab gets.
pub const JOINTS_MODEL: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 2\n";
/// Rounds of the search for an amplitude.
const ROUNDS: usize = 8;
const NEAR: f64 = 0.03;

/// Measurements and their answer; `None` where an effect cannot be made as large as asked for.
pub fn joints(recipe: &JointRecipe) -> Option<(Measurements, Answer)> {
    let period_s = 1.0 / recipe.rate_hz;
    let n = (recipe.seconds * recipe.rate_hz).round() as usize;
    let mut motion = Random::new(recipe.seed, Purpose::Motion);
    let own = path(&mut motion, n, period_s, recipe.is_teleop);
    let other = path(&mut motion, n, period_s, true);
    let mut random = Random::new(recipe.seed, Purpose::Effect);
    let mut plant = Plant::default();
    for &(kind, size) in &recipe.hidden {
        let draw = Draw::new(&mut random, recipe.seconds);
        let size_of = |amplitude: f64| {
            let mut alone = Plant::default();
            (kind.apply)(&mut alone, amplitude, &draw);
            beyond_a_line(&own, &alone.run(&own, &other, period_s)) / recipe.sigma
        };
        (kind.apply)(&mut plant, amplitude(kind.typical, size, size_of)?, &draw);
    }
    let clean = plant.run(&own, &other, period_s);
    let mut machine = Random::new(recipe.seed, Purpose::Machine);
    let gains = [0, 1].map(|_| machine.sign() * machine.between(0.3, 2.0));
    let offsets = [0, 1].map(|_| machine.normal() * 0.3);
    let mut seen: Vec<[f64; 2]> = clean.iter().zip(&other).map(|(a, b)| [*a, *b]).collect();
    recipe.noise.add_to(&mut seen, recipe.sigma, period_s, recipe.seed);
    let is_measured = |row: usize| row % recipe.every == recipe.every - 1;
    let output = |(row, seen): (usize, &[f64; 2])| {
        [0, 1].map(|k| if is_measured(row) { gains[k] * seen[k] + offsets[k] } else { f64::NAN })
    };
    let outputs: Vec<f64> = seen.iter().enumerate().flat_map(output).collect();
    let (kind, right) =
        crate::truth::names(recipe.hidden.iter().map(|(kind, _)| (kind.name, kind.right.iter().copied())));
    let deg = 180.0 / core::f64::consts::PI * gains[0].abs();
    let answer = Answer {
        file: String::new(),
        kind,
        right,
        params: BTreeMap::new(),
        known: known(recipe, &plant),
        traj: if recipe.is_teleop { "teleop" } else { "stairs" }.to_owned(),
        noise: recipe.noise.name(),
        sigma_deg: recipe.sigma * deg,
        load_sigma_n: None,
        size: recipe.hidden.iter().map(|&(_, size)| size).collect(),
        base_rms_deg: beyond_a_line(&own, &clean).hypot(recipe.sigma) * deg,
        effect_rms_deg: beyond_a_line(&own, &clean) * deg,
        // Both joints' noise: the lab's errors are lengths over all joints.
        noise_rms_deg: recipe.sigma * gains[0].hypot(gains[1]) * 180.0 / core::f64::consts::PI,
        rows: n,
        seed: recipe.seed,
        perturbation: 0.0,
    };
    let time_s = (0..n).map(|k| k as f64 * period_s).collect();
    let inputs = own.iter().zip(&other).flat_map(|(a, b)| [*a, *b]).collect();
    let source = format!("joints from seed {}", recipe.seed);
    let data = Measurements::bare(source, Quantity::Joints, time_s, (inputs, 2), (outputs, 2));
    Some((data, answer))
}

/// Kinds that do not explain the same, so many known ones and, if wanted, one that nothing explains, in front.
pub fn pick_joints(seed: u64, n_known: usize, with_unknown: bool) -> Vec<&'static JointKind> {
    let mut random = Random::new(seed, Purpose::Kind);
    let mut picked: Vec<&'static JointKind> = Vec::new();
    let of =
        |known: bool| -> Vec<&'static JointKind> { JOINT_KINDS.iter().filter(|k| k.is_known() == known).collect() };
    let (known, unknown) = (of(true), of(false));
    if with_unknown {
        picked.push(unknown[random.below(unknown.len())]);
    }
    let wanted = picked.len() + n_known;
    while picked.len() < wanted {
        let next = known[random.below(known.len())];
        if !picked.iter().any(|own| own.is_like(next)) {
            picked.push(next);
        }
    }
    picked
}

fn known(recipe: &JointRecipe, plant: &Plant) -> BTreeMap<String, BTreeMap<String, f64>> {
    let mut all: BTreeMap<String, BTreeMap<String, f64>> = BTreeMap::new();
    for (effect, parameter, value) in recipe.hidden.iter().flat_map(|(kind, _)| (kind.known)(plant)) {
        all.entry(effect.to_owned()).or_default().insert(parameter.to_owned(), value);
    }
    all
}

/// The amplitude that gives the wanted size: secants of a nearly proportional function.
fn amplitude(typical: f64, wanted: f64, size_of: impl Fn(f64) -> f64) -> Option<f64> {
    let mut amplitude = typical;
    for _ in 0..ROUNDS {
        let found = size_of(amplitude);
        if (found / wanted - 1.0).abs() < NEAR {
            return Some(amplitude);
        }
        // An amplitude near one is a motion as large as the command's.
        amplitude = (amplitude * (wanted / found.max(1e-9)).clamp(0.2, 5.0)).clamp(1e-5, 0.9);
    }
    ((size_of(amplitude) / wanted - 1.0).abs() < 0.2).then_some(amplitude)
}

/// Root mean square of what no gain and offset of the command makes.
fn beyond_a_line(command: &[f64], seen: &[f64]) -> f64 {
    let n = command.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (mx, my) = (mean(command), mean(seen));
    let (xx, xy) =
        command.iter().zip(seen).fold((0.0, 0.0), |(xx, xy), (x, y)| (xx + (x - mx).powi(2), xy + (x - mx) * (y - my)));
    let rest = command.iter().zip(seen).map(|(x, y)| (y - my - xy / xx * (x - mx)).powi(2)).sum::<f64>();
    (rest / n).sqrt()
}

/// A motion from -1 to 1.
fn path(random: &mut Random, n: usize, period_s: f64, is_teleop: bool) -> Vec<f64> {
    let mut path = if is_teleop { reaches(random, n, period_s) } else { stairs(random, n, period_s) };
    let (middle, half) = middle_and_half(&path);
    path.iter_mut().for_each(|u| *u = (*u - middle) / half);
    path
}

/// Sums of slow sines, held now and then.
fn reaches(random: &mut Random, n: usize, period_s: f64) -> Vec<f64> {
    let lines: Vec<[f64; 3]> = (0..9)
        .map(|_| {
            let hz = random.between(0.02, 0.5);
            [random.normal() / (1.0 + 3.0 * hz), TAU * hz, random.between(0.0, TAU)]
        })
        .collect();
    let mut path = Vec::with_capacity(n);
    let (mut clock_s, mut held_until, mut next_hold) = (0.0, 0.0, random.between(3.0, 15.0));
    for k in 0..n {
        let t = k as f64 * period_s;
        if t >= next_hold {
            held_until = t + random.between(1.5, 4.0);
            next_hold = held_until + random.between(8.0, 25.0);
        }
        if t >= held_until {
            clock_s += period_s;
        }
        path.push(lines.iter().map(|[a, w, phase]| a * (w * clock_s + phase).sin()).sum());
    }
    path
}

/// Up and down by several ways at several speeds, with rests.
fn stairs(random: &mut Random, n: usize, period_s: f64) -> Vec<f64> {
    let (ways, speeds) = ([1.0, 0.7, 0.45, 0.25], [0.15, 0.4, 1.0]);
    let mut path = vec![0.0];
    let (mut x, mut sign): (f64, f64) = (0.0, 1.0);
    while path.len() < n {
        let (to, speed) = (sign * ways[random.below(4)], speeds[random.below(3)]);
        let steps = ((to - x).abs() / speed / period_s).ceil().max(3.0);
        path.extend((1..=steps as usize).map(|k| x + (to - x) * k as f64 / steps));
        (x, sign) = (to, -sign);
        if random.between(0.0, 1.0) < 0.4 {
            let rest = (random.between(1.0, 4.0) / period_s) as usize;
            path.extend(core::iter::repeat_n(x, rest));
        }
    }
    path.truncate(n);
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_the_size_that_is_asked_for_and_equal_recipes_make_equal_bytes() {
        for kind in JOINT_KINDS {
            let recipe = JointRecipe { hidden: vec![(kind, 2.0)], seconds: 60.0, seed: 5, ..JointRecipe::default() };
            let (data, answer) = joints(&recipe).unwrap_or_else(|| panic!("{}", kind.name));
            let size = answer.effect_rms_deg / answer.sigma_deg;
            assert!((size / 2.0 - 1.0).abs() < 0.2, "{}: {size}", kind.name);
            assert_eq!(joints(&recipe).map(|(again, _)| again.outputs), Some(data.outputs));
        }
    }

    #[test]
    fn nothing_hidden_leaves_noise_alone() {
        let recipe = JointRecipe { seconds: 60.0, seed: 2, ..JointRecipe::default() };
        let (_, answer) = joints(&recipe).unwrap_or_else(|| panic!("made"));
        assert!(answer.effect_rms_deg < 1e-9 * answer.sigma_deg && answer.kind == "none");
    }

    #[test]
    fn picked_kinds_do_not_explain_the_same() {
        for seed in 0..200 {
            let picked = pick_joints(seed, 4, seed % 2 == 0);
            assert_eq!(picked.iter().filter(|kind| kind.is_known()).count(), 4);
            for (k, kind) in picked.iter().enumerate() {
                assert!(!picked[..k].iter().any(|own| own.is_like(kind)), "{seed}");
            }
        }
    }
}
