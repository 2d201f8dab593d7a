//! Data of a simulated joint whose torque has hidden parts, for the lab's benchmark of machines of kind force.
//!
//! The plant shares the laws of the library with the model, nothing else: angle and derivatives are exact here and come from a
//! filter there. A part's size is the root mean square of what neither an offset nor the other hidden parts make of it, in units of
//! the sensor's noise. The model that the lab gets says nothing but that there is one joint.

mod kind;
mod plant;

pub use kind::{FORCE_KINDS, ForceKind};

use crate::HiddenTruth;
use crate::generate::{NoiseKind, Purpose, Random};
use kind::Draw;
use krait_lab::{Measurements, Quantity};
use plant::{Moment, beyond, column, motion};

/// What to make.
#[derive(Clone, Debug)]
pub struct ForceRecipe {
    /// What is hidden, and how large in units of the noise; friction of the loaded gear stands behind the weight that loads it.
    pub hidden: Vec<(&'static ForceKind, f64)>,
    /// Whether one frequency rises and falls; else four sines.
    pub sweeps: bool,
    /// Whether a sensor tells what the gear carries.
    pub has_load: bool,
    /// Noise of the torque's sensor.
    pub noise: NoiseKind,
    /// Its standard deviation, Nm.
    pub sigma_nm: f64,
    /// Length, s.
    pub seconds: f64,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// Everything that is drawn follows from it.
    pub seed: u64,
}

impl Default for ForceRecipe {
    fn default() -> Self {
        Self {
            hidden: Vec::new(),
            sweeps: false,
            has_load: false,
            noise: NoiseKind::White,
            sigma_nm: 0.02,
            seconds: 80.0,
            rate_hz: 100.0,
            seed: 0,
        }
    }
}

/// The model that the lab gets.
pub const FORCE_MODEL: &str = "format = 1\n[machine]\nkind = \"force\"\nn = 1\nunit = \"Nm\"\n";
/// Standard deviation of the encoder's noise, rad.
const ENCODER_RAD: f64 = 1e-4;
/// A part of which neither an offset nor the others leave so much cannot be told from them by anybody.
const LEAST_OWN: f64 = 0.02;

/// Measurements as they are recorded, their truth with the noise of a recorded row, and the sensor's noise by itself in the same place as the torque; `None` where a
/// part is made by the others in this motion.
pub fn force(recipe: &ForceRecipe) -> Option<(Measurements, HiddenTruth, Measurements)> {
    let period_s = 1.0 / recipe.rate_hz;
    let n = (recipe.seconds * recipe.rate_hz).round() as usize;
    let mut moments = motion(&mut Random::new(recipe.seed, Purpose::Motion), n, period_s, recipe.sweeps);
    let mut random = Random::new(recipe.seed, Purpose::Effect);
    let draws: Vec<Draw> = recipe.hidden.iter().map(|_| Draw::new(&mut random)).collect();
    let parts: Vec<(&ForceKind, f64, &Draw)> =
        recipe.hidden.iter().zip(&draws).map(|(&(kind, size), draw)| (kind, size, draw)).collect();
    // What the gear carries is known before its friction.
    let (geared, plain): (Vec<_>, Vec<_>) = parts.into_iter().partition(|(kind, ..)| kind.needs_load);
    let mut clean = vec![0.0; n];
    let mut made: Vec<(&ForceKind, f64, &Draw)> = Vec::new();
    for group in [plain, geared] {
        let columns: Vec<Vec<f64>> = group.iter().map(|(kind, _, draw)| column(kind, draw, &moments)).collect();
        let before: Vec<Vec<f64>> = made.iter().map(|(kind, _, draw)| column(kind, draw, &moments)).collect();
        for (k, (kind, size, draw)) in group.iter().enumerate() {
            let others: Vec<Vec<f64>> = columns
                .iter()
                .enumerate()
                .filter_map(|(i, own)| (i != k).then_some(own))
                .chain(&before)
                .cloned()
                .collect();
            let own = beyond(&columns[k], &others);
            if own < LEAST_OWN * beyond(&columns[k], &[]) || own == 0.0 {
                return None;
            }
            let amplitude = size * recipe.sigma_nm / own;
            clean.iter_mut().zip(&columns[k]).for_each(|(sum, value)| *sum += amplitude * value);
            made.push((kind, amplitude, draw));
        }
        let loads: Vec<f64> = moments.iter().map(|now| load(now, &made, recipe.has_load)).collect();
        moments.iter_mut().zip(loads).for_each(|(now, load)| now.load = load);
    }
    let effect_nm = beyond(&clean, &[]);
    let mut machine = Random::new(recipe.seed, Purpose::Machine);
    let offset_nm = 5.0 * recipe.sigma_nm * machine.normal();
    let noise_nm = noise(&clean, recipe, period_s);
    let angles: Vec<f64> = moments.iter().map(|now| now.angle + ENCODER_RAD * machine.normal()).collect();
    let mut cells = Random::new(recipe.seed, Purpose::Loads);
    let loads_nm: Vec<f64> = moments.iter().map(|now| now.load + recipe.sigma_nm * cells.normal()).collect();
    let extra = if recipe.has_load { vec![("load1_nm".to_owned(), loads_nm)] } else { Vec::new() };
    let (kind, right) = crate::truth::names(recipe.hidden.iter().map(|(kind, _)| (kind.name, [kind.right])));
    let truth = HiddenTruth {
        kind,
        right,
        known: made
            .iter()
            .filter(|(kind, ..)| kind.is_known())
            .map(|(kind, amplitude, draw)| {
                let values = (kind.known)(*amplitude, draw);
                (kind.right.to_owned(), values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
            })
            .collect(),
        motion: if recipe.sweeps { "sweep" } else { "sines" }.to_owned(),
        noise: recipe.noise.name(),
        size: recipe.hidden.iter().map(|&(_, size)| size).collect(),
        unit: "Nm".to_owned(),
        noise_length: recipe.sigma_nm,
        base_rms: effect_nm.hypot(recipe.sigma_nm),
        effect_rms: effect_nm,
        noise_rms: recipe.sigma_nm,
        seed: recipe.seed,
    };
    let torques_nm = clean.iter().zip(&noise_nm).map(|(clean, noise)| clean + noise + offset_nm).collect();
    let (source, time_s) = (format!("force from seed {}", recipe.seed), moments.iter().map(|now| now.time_s).collect());
    let bare = Measurements::bare(source, Quantity::Force, time_s, (angles, 1), (torques_nm, 1));
    let data = Measurements { extra, ..bare };
    let noise_alone = Measurements { outputs: noise_nm, ..data.clone() };
    Some((data, truth, noise_alone))
}

/// What the gear carries: where nothing measures it, the weight alone counts, as in the lab's model; else inertia as well.
fn load(now: &Moment, made: &[(&ForceKind, f64, &Draw)], is_measured: bool) -> f64 {
    let carried = |kind: &ForceKind| kind.right == "gravity" || is_measured && kind.right == "inertia";
    made.iter()
        .filter(|(kind, ..)| carried(kind))
        .map(|(kind, amplitude, draw)| amplitude * (kind.law)(now, draw))
        .sum()
}

/// The sensor's noise. Kinds that depend on the size of what is measured see it relative to its half range.
fn noise(clean: &[f64], recipe: &ForceRecipe, period_s: f64) -> Vec<f64> {
    let half = clean.iter().fold(3.0 * recipe.sigma_nm, |most, value| value.abs().max(most));
    let mut seen: Vec<[f64; 2]> = clean.iter().map(|value| [value / half, 0.0]).collect();
    recipe.noise.add_to(&mut seen, recipe.sigma_nm / half, period_s, recipe.seed);
    seen.iter().zip(clean).map(|([seen, _], clean)| seen * half - clean).collect()
}

/// So many known kinds and, if wanted, one that nothing explains, in front; no friction of the loaded gear without a weight.
pub fn pick_force(seed: u64, n_known: usize, with_unknown: bool) -> Vec<&'static ForceKind> {
    let mut random = Random::new(seed, Purpose::Kind);
    let of = |known: bool| -> Vec<&'static ForceKind> {
        FORCE_KINDS.iter().filter(|kind| kind.is_known() == known).collect()
    };
    let (known, unknown) = (of(true), of(false));
    let mut picked: Vec<&'static ForceKind> = Vec::new();
    if with_unknown {
        picked.push(unknown[random.below(unknown.len())]);
    }
    let wanted = picked.len() + n_known;
    while picked.len() < wanted {
        let next = known[random.below(known.len())];
        let has = |right: &str| picked.iter().any(|own| own.right == right);
        if !has(next.right) && (!next.needs_load || has("gravity")) {
            picked.push(next);
        }
    }
    picked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_has_the_size_that_is_asked_for_and_equal_recipes_make_equal_bytes() {
        let weight = ForceKind::from_name("weight").unwrap_or_else(|| panic!("a kind"));
        for kind in FORCE_KINDS {
            let own: &[(&'static ForceKind, f64)] = &[(weight, 3.0), (kind, 2.0)];
            let hidden = if kind.needs_load { own.to_vec() } else { own[1..].to_vec() };
            let recipe = ForceRecipe { hidden, seed: 5, ..ForceRecipe::default() };
            let (data, truth, noise) = force(&recipe).unwrap_or_else(|| panic!("{}", kind.name));
            let (size, wanted) = (truth.effect_rms / truth.noise_length, if kind.needs_load { 3.0 } else { 2.0 });
            assert!(size > 0.99 * wanted && (kind.needs_load || size < 1.01 * wanted), "{}: {size}", kind.name);
            assert_eq!(force(&recipe).map(|(again, ..)| again.outputs), Some(data.outputs));
            let square = noise.outputs.iter().map(|x| x * x).sum::<f64>() / noise.outputs.len() as f64;
            assert!((square.sqrt() / 0.02 - 1.0).abs() < 0.05, "{}", kind.name);
        }
    }

    #[test]
    fn picked_kinds_are_of_different_effects_and_a_loaded_gear_has_a_load() {
        for seed in 0..300 {
            let picked = pick_force(seed, 4, seed % 2 == 0);
            assert_eq!(picked.iter().filter(|kind| kind.is_known()).count(), 4);
            for (k, kind) in picked.iter().enumerate() {
                assert!(!kind.is_known() || !picked[..k].iter().any(|own| own.right == kind.right), "{seed}");
                assert!(!kind.needs_load || picked.iter().any(|own| own.right == "gravity"), "{seed}");
            }
        }
    }
}
