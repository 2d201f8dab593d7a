//! Data of simulated segments in series with hidden effects, of all segments or of one, for teaching and the lab's benchmark.
//!
//! The plant is that of `krait-sim`, which shares no physics with the model. Where an effect of all segments is hidden the machine
//! is elastic lines and what is hidden; else it has friction and play, and the model has them too. A size is the root mean square
//! length of what an effect changes in all bend vectors together, in units of the noise's length sqrt(2 n) sigma of n segments.

mod base;
mod kind;
mod plant;
mod quiz;

pub use kind::SegmentKind;
pub use quiz::SegmentsQuiz;

use crate::generate::{
    Answer, GenerateError, Generated, Motion, NoiseKind, Purpose, Random, amplitude, check_ranges, weighed_n,
};
use kind::Draw;
use krait_lab::{Measurements, Quantity};
use krait_sim::SegmentsTruth;
use plant::{Measured, OfSegment, Plant, all_apart_rad, planned_m};
use std::collections::BTreeMap;

/// What to make.
#[derive(Clone, Debug)]
pub struct SegmentsRecipe {
    /// Segments, 2 or 3, of three lines each.
    pub n_segments: usize,
    /// What is hidden, and how large; empty for nothing.
    pub hidden: Vec<(SegmentKind, f64)>,
    /// The motion of each segment, half as far as a snake's alone, each drawn by itself.
    pub motion: Motion,
    /// The camera's noise, each segment's drawn by itself.
    pub noise: NoiseKind,
    /// Its standard deviation in each component, rad.
    pub sigma_rad: f64,
    /// Load cells at the actuators with white noise of this standard deviation, N; `None`: no loads are recorded.
    pub load_sigma_n: Option<f64>,
    /// Length, s.
    pub seconds: f64,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// The camera measures in every so many rows.
    pub every: usize,
    /// Everything that is drawn follows from it.
    pub seed: u64,
}

impl Default for SegmentsRecipe {
    fn default() -> Self {
        Self {
            n_segments: 2,
            hidden: Vec::new(),
            motion: Motion::Teleop,
            noise: NoiseKind::White,
            sigma_rad: 0.3 * core::f64::consts::PI / 180.0,
            load_sigma_n: None,
            seconds: 200.0,
            rate_hz: 25.0,
            every: 1,
            seed: 0,
        }
    }
}

/// How far each segment goes, as a part of a snake's motion.
const WAY: f64 = 0.5;

/// Makes data.
///
/// # Errors
/// [`GenerateError`]: a recipe out of range, or one that the plant cannot follow.
pub fn segments(recipe: &SegmentsRecipe) -> Result<Generated<SegmentsTruth>, GenerateError> {
    let ranges = [
        ("the number of segments", recipe.n_segments as f64, 2.0, 3.0),
        ("the noise's standard deviation in rad", recipe.sigma_rad, 1e-6, 0.2),
        ("the length in seconds", recipe.seconds, 1.0, 100_000.0),
        ("the rate in Hz", recipe.rate_hz, 5.0, 1000.0),
        ("the rows", recipe.seconds * recipe.rate_hz, 10.0, 1e7),
    ];
    let load_sigma = recipe.load_sigma_n.map(|found| ("the load cells' noise in N", found, 0.0, 100.0));
    let sizes = recipe.hidden.iter().map(|&(_, size)| ("a size", size, 0.01, 100.0));
    check_ranges(ranges.into_iter().chain(load_sigma).chain(sizes))?;
    let period_s = 1.0 / recipe.rate_hz;
    let n = (recipe.seconds * recipe.rate_hz).round() as usize;
    let path = |k: usize| -> OfSegment {
        let own = recipe.motion.path_rad(n, period_s, seed_of(recipe.seed, k));
        own.into_iter().map(|bend| bend.map(|component| WAY * component)).collect()
    };
    let path_rad: Vec<OfSegment> = (0..recipe.n_segments).map(path).collect();
    let readings_m = planned_m(&path_rad)?;
    let bare = Plant::bare(recipe);
    let base_rad = bare.seen_rad(&readings_m, period_s)?;
    let noise_length_rad = (2.0 * recipe.n_segments as f64).sqrt() * recipe.sigma_rad;
    let (mut plant, mut known, mut params) = (bare.clone(), BTreeMap::new(), BTreeMap::new());
    let mut random = Random::new(recipe.seed, Purpose::Effect);
    for &(kind, size) in &recipe.hidden {
        let draw = Draw::new(&mut random, recipe.seconds);
        let size_of = |amplitude: f64| {
            let mut alone = bare.clone();
            kind.hide(&mut alone, amplitude, &draw);
            Ok(all_apart_rad(&alone.seen_rad(&readings_m, period_s)?, &base_rad) / noise_length_rad)
        };
        let (name, (typical, most)) = (kind.name(), kind.typical_and_most());
        let found = amplitude(&name, (typical, most), size, size_of)?;
        kind.hide(&mut plant, found, &draw);
        params.insert(name, found.into());
        if let Some(first) = kind.right().into_iter().next().filter(|_| kind.is_known()) {
            known.insert(first, kind.known(found, &draw).into_iter().map(|(key, v)| (key.to_owned(), v)).collect());
        }
    }
    let Measured { seen_rad: clean_rad, load_n } = plant.measured(&readings_m, period_s)?;
    let mut noisy_rad = clean_rad.clone();
    for (k, seen) in noisy_rad.iter_mut().enumerate() {
        recipe.noise.add_to(seen, recipe.sigma_rad, period_s, seed_of(recipe.seed, k));
    }
    let (kind, right) = crate::truth::names(recipe.hidden.iter().map(|(kind, _)| (kind.name(), kind.right())));
    let apart_deg = |a: &[OfSegment], b: &[OfSegment]| all_apart_rad(a, b).to_degrees();
    let answer = Answer {
        file: String::new(),
        kind,
        right,
        params,
        known,
        traj: recipe.motion.name().to_owned(),
        noise: recipe.noise.name(),
        sigma_deg: recipe.sigma_rad.to_degrees(),
        load_sigma_n: recipe.load_sigma_n,
        size: recipe.hidden.iter().map(|&(_, size)| size).collect(),
        base_rms_deg: apart_deg(&noisy_rad, &base_rad),
        effect_rms_deg: apart_deg(&clean_rad, &base_rad),
        noise_rms_deg: apart_deg(&noisy_rad, &clean_rad),
        rows: n,
        seed: recipe.seed,
        perturbation: 0.0,
    };
    let mut measurements = measurements(recipe, readings_m, &noisy_rad);
    measurements.loads_n = recipe.load_sigma_n.map(|sigma_n| weighed_n(load_n, sigma_n, recipe.seed));
    Ok(Generated { measurements, answer, truth: plant.truth, model: recipe.model()? })
}

/// A seed of each segment's own.
fn seed_of(seed: u64, segment: usize) -> u64 {
    seed ^ (segment as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

fn measurements(recipe: &SegmentsRecipe, readings_m: Vec<f64>, seen_rad: &[OfSegment]) -> Measurements {
    let (n_rows, n_segments) = (seen_rad.first().map_or(0, Vec::len), seen_rad.len());
    let n_lines = readings_m.len() / n_rows.max(1);
    let every = recipe.every.max(1);
    let row_of = |row: usize| {
        let is_seen = row % every == every - 1;
        seen_rad.iter().flat_map(move |own| if is_seen { own[row] } else { [f64::NAN; 2] })
    };
    let outputs = (0..n_rows).flat_map(row_of).collect();
    let time_s = (0..n_rows).map(|row| row as f64 / recipe.rate_hz).collect();
    let source = format!("segments from seed {}", recipe.seed);
    Measurements::bare(source, Quantity::Segments, time_s, (readings_m, n_lines), (outputs, 2 * n_segments))
}

/// So many known kinds, of which no two look alike.
pub fn pick_segments(seed: u64, n_segments: usize, n_known: usize) -> Vec<SegmentKind> {
    let mut random = Random::new(seed, Purpose::Kind);
    let known: Vec<SegmentKind> = SegmentKind::all(n_segments).into_iter().filter(SegmentKind::is_known).collect();
    let mut picked: Vec<SegmentKind> = Vec::new();
    while picked.len() < n_known {
        let next = known[random.below(known.len())];
        if !picked.iter().any(|own| own.is_like(&next)) {
            picked.push(next);
        }
    }
    picked
}
