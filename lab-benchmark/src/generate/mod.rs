//! Data with a hidden effect, from the simulated snake: for teaching, and to find out how good the lab is.
//!
//! The plant is that of `krait-slave`, which shares no physics with `krait-model`, and it is stepped four times as finely as
//! the rows. A recipe says what is hidden, how large (root mean square of what the effect changes in the picture, in units
//! of the noise's length sqrt(2) sigma), under which motion and noise; the answer says all of it again, and which names count as
//! right. Equal recipes make equal bytes.

mod answer;
mod kind;
mod motion;
mod noise;
mod plant;
mod quiz;
mod random;
mod seal;

pub use answer::Answer;
pub use kind::{KINDS, Kind};
pub use motion::Motion;
pub use noise::NoiseKind;
pub(crate) use quiz::OF_LARGEST;
pub use quiz::{Difficulty, Judgement, Quiz};
pub use seal::{SealError, Sealed, base_model, is_unmodified};

use core::f64::consts::SQRT_2;
use kind::Draw;
use krait_lab::{Measurements, Quantity};
use krait_model::{ChainError, MachineParameters};
use krait_sim::{EffectsTruth, Truth, TruthError};
use krait_slave::DriveError;
pub(crate) use plant::apart_rad;
pub(crate) use random::{Purpose, Random};

/// Rounds of the search for an amplitude; each comes about ten times nearer.
const ROUNDS: usize = 5;
/// Where the search ends, relative.
const NEAR: f64 = 0.02;

/// What to make.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// What is hidden, and how large; empty for nothing.
    pub hidden: Vec<(&'static Kind, f64)>,
    /// The motion.
    pub motion: Motion,
    /// The camera's noise.
    pub noise: NoiseKind,
    /// Its standard deviation in each component, rad.
    pub sigma_rad: f64,
    /// Load cells at the actuators with white noise of this standard deviation, N; `None`: no loads are recorded.
    pub load_sigma_n: Option<f64>,
    /// Length, s.
    pub seconds: f64,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// Everything that is drawn follows from it.
    pub seed: u64,
    /// The camera measures in every so many rows.
    pub every: usize,
    /// The plant's dimensions and modulus differ from the base model's by up to this part, 1.
    pub perturbation: f64,
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            hidden: Vec::new(),
            motion: Motion::Rich,
            noise: NoiseKind::White,
            sigma_rad: 0.3 * core::f64::consts::PI / 180.0,
            load_sigma_n: None,
            seconds: 200.0,
            rate_hz: 50.0,
            every: 1,
            seed: 0,
            perturbation: 0.0,
        }
    }
}

impl Recipe {
    /// Whether the camera measures in this row.
    fn sees(&self, row: usize) -> bool {
        row % self.every.max(1) == self.every.max(1) - 1
    }
}

/// What came out, of a snake or of another machine with a truth of its own.
#[derive(Clone, Debug)]
pub struct Generated<T = Truth> {
    /// What the lab may see.
    pub measurements: Measurements,
    /// What it may not.
    pub answer: Answer,
    /// The plant that made it: a truth file for `krait run --truth`.
    pub truth: T,
    /// The model file that the lab gets.
    pub model: String,
}

/// Why nothing was made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// A number of the recipe is out of range.
    #[error("{what} is {found}, expected {low} to {high}; choose a value in this range")]
    OutOfRange {
        /// Which.
        what: &'static str,
        /// Smallest.
        low: f64,
        /// Largest.
        high: f64,
        /// The value found.
        found: f64,
    },
    /// The plant cannot have such an effect.
    #[error(transparent)]
    Truth(TruthError),
    /// The motion leaves the actuators' travel.
    #[error(transparent)]
    Drive(DriveError),
    /// The base model makes no path.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The plant found no equilibrium.
    #[error("the simulated machine found no equilibrium at {n} steps with this effect; choose a smaller size")]
    Unsolved {
        /// How often.
        n: u64,
    },
    /// The effect cannot be made that large.
    #[error(
        "{kind} at its largest changes the picture by {found} of the noise's length, expected {wanted}; choose a smaller size or noise"
    )]
    TooLarge {
        /// Which.
        kind: String,
        /// The size asked for.
        wanted: f64,
        /// The size reached.
        found: f64,
    },
}

/// Picks one kind, or two with `pair`, from a seed; the same ones every time.
pub fn pick(seed: u64, pair: bool) -> Vec<&'static Kind> {
    let mut random = Random::new(seed, Purpose::Kind);
    let known: Vec<&Kind> = KINDS.iter().filter(|kind| kind.is_known() || !pair).collect();
    let first = known[random.below(known.len())];
    if !pair {
        return vec![first];
    }
    // Look-alikes could not be told apart by anybody.
    let others: Vec<&Kind> = known.into_iter().filter(|kind| !kind.is_like(first)).collect();
    vec![first, others[random.below(others.len())]]
}

/// Picks so many known kinds of which no two look alike, and in front of them, if wanted, one that no known effect explains.
pub fn several(seed: u64, n_known: usize, with_unknown: bool) -> Vec<&'static Kind> {
    let mut random = Random::new(seed, Purpose::Kind);
    let of = |known: bool| -> Vec<&'static Kind> { KINDS.iter().filter(|kind| kind.is_known() == known).collect() };
    let (known, unknown) = (of(true), of(false));
    let mut picked = Vec::new();
    if with_unknown {
        picked.push(unknown[random.below(unknown.len())]);
    }
    while picked.len() < n_known + usize::from(with_unknown) {
        let next = known[random.below(known.len())];
        let is_new = picked.iter().all(|own: &&Kind| !own.is_like(next));
        if is_new {
            picked.push(next);
        }
    }
    picked
}

/// Makes data.
///
/// # Errors
/// [`GenerateError`]: a recipe out of range, or one that the plant cannot follow.
pub fn generate(recipe: &Recipe) -> Result<Generated, GenerateError> {
    check(recipe)?;
    let period_s = 1.0 / recipe.rate_hz;
    let n = (recipe.seconds * recipe.rate_hz).round() as usize;
    let path_rad = recipe.motion.path_rad(n, period_s, recipe.seed);
    let readings_m = plant::planned_m(&MachineParameters::default(), &path_rad, period_s)?;
    let bare = bare(recipe);
    let truth = hide(recipe, &bare, &readings_m, period_s)?;
    let elastic = Truth { effects: EffectsTruth::none(), ..Truth::default() };
    let base_rad = plant::seen_rad(&elastic, &readings_m, period_s, plant::FINE)?;
    let plant::Measured { bend_rad: clean_rad, load_n } = plant::measured(&truth, &readings_m, period_s, plant::FINE)?;
    let mut noisy_rad = clean_rad.clone();
    recipe.noise.add_to(&mut noisy_rad, recipe.sigma_rad, period_s, recipe.seed);
    let apart = [(&noisy_rad, &base_rad), (&clean_rad, &base_rad), (&noisy_rad, &clean_rad)];
    let answer = Answer::new(recipe, &truth, apart.map(|(a, b)| plant::apart_rad(a, b)), n);
    let mut measurements = measurements(recipe, &readings_m, &noisy_rad);
    measurements.loads_n =
        recipe.load_sigma_n.map(|sigma_n| weighed_n(load_n.into_iter().flatten(), sigma_n, recipe.seed));
    Ok(Generated { measurements, answer, truth, model: base_model() })
}

/// What load cells with white noise read, N, row after row.
pub(crate) fn weighed_n(load_n: impl IntoIterator<Item = f64>, sigma_n: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed, Purpose::Loads);
    load_n.into_iter().map(|load_n| load_n + sigma_n * random.normal()).collect()
}

/// Keys of the machine that [`Recipe::perturbation`] makes wrong.
pub const PERTURBED: [&str; 5] = ["l_m", "r_m", "e_pa", "l_d_m", "l_c_m"];

/// The plant without what is hidden.
fn bare(recipe: &Recipe) -> Truth {
    let mut truth = Truth { effects: EffectsTruth::none(), ..Truth::default() };
    let mut random = Random::new(recipe.seed, Purpose::Machine);
    let machine = &mut truth.machine;
    for value in [&mut machine.l_m, &mut machine.r_m, &mut machine.e_pa, &mut machine.l_d_m, &mut machine.l_c_m] {
        *value *= 1.0 + recipe.perturbation * random.between(-1.0, 1.0);
    }
    truth
}

/// Hides every effect at its size, each sought by itself.
fn hide(recipe: &Recipe, bare: &Truth, readings_m: &[[f64; 3]], period_s: f64) -> Result<Truth, GenerateError> {
    let mut random = Random::new(recipe.seed, Purpose::Effect);
    let mut truth = bare.clone();
    if recipe.hidden.is_empty() {
        return Ok(truth);
    }
    let without = plant::seen_rad(bare, readings_m, period_s, plant::COARSE)?;
    for &(kind, size) in &recipe.hidden {
        let draw = Draw::new(&mut random, recipe.seconds);
        let size_of = |amplitude: f64| {
            let mut alone = bare.clone();
            kind.hide(&mut alone, amplitude, &draw);
            let seen = plant::seen_rad(&alone, readings_m, period_s, plant::COARSE)?;
            Ok(plant::apart_rad(&seen, &without) / (SQRT_2 * recipe.sigma_rad))
        };
        kind.hide(&mut truth, amplitude(kind.name, (kind.typical, kind.most), size, size_of)?, &draw);
    }
    Ok(truth)
}

/// The amplitude, at most this one, at which an effect has the wanted size: it is nearly proportional, so a few secants do.
pub(crate) fn amplitude(
    kind: &str,
    (typical, most): (f64, f64),
    wanted: f64,
    size_of: impl Fn(f64) -> Result<f64, GenerateError>,
) -> Result<f64, GenerateError> {
    let mut amplitude = typical;
    let mut found = size_of(amplitude)?;
    for _ in 0..ROUNDS {
        if (found / wanted - 1.0).abs() < NEAR {
            return Ok(amplitude);
        }
        let next = (amplitude * wanted / found.max(1e-12)).min(most);
        if next == amplitude {
            break;
        }
        amplitude = next;
        found = size_of(amplitude)?;
    }
    // What cannot be hit within a fifth would make the answer's size a lie.
    if (found / wanted - 1.0).abs() < 0.2 {
        return Ok(amplitude);
    }
    Err(GenerateError::TooLarge { kind: kind.to_owned(), wanted, found })
}

fn check(recipe: &Recipe) -> Result<(), GenerateError> {
    let ranges = [
        ("the noise's standard deviation in rad", recipe.sigma_rad, 1e-6, 0.2),
        ("the length in seconds", recipe.seconds, 1.0, 100_000.0),
        ("the rate in Hz", recipe.rate_hz, 5.0, 1000.0),
        ("the rows", recipe.seconds * recipe.rate_hz, 10.0, 1e7),
        ("the perturbation", recipe.perturbation, 0.0, 0.1),
    ];
    let load_sigma = recipe.load_sigma_n.map(|found| ("the load cells' noise in N", found, 0.0, 100.0));
    let sizes = recipe.hidden.iter().map(|&(_, size)| ("a size", size, 0.01, 100.0));
    check_ranges(ranges.into_iter().chain(load_sigma).chain(sizes))
}

/// Checks numbers of a recipe: what, found, smallest, largest.
pub(crate) fn check_ranges(ranges: impl Iterator<Item = (&'static str, f64, f64, f64)>) -> Result<(), GenerateError> {
    for (what, found, low, high) in ranges {
        // Written so that NaN is out of range.
        if !(low..=high).contains(&found) {
            return Err(GenerateError::OutOfRange { what, low, high, found });
        }
    }
    Ok(())
}

fn measurements(recipe: &Recipe, readings_m: &[[f64; 3]], seen_rad: &[[f64; 2]]) -> Measurements {
    let time_s = (0..readings_m.len()).map(|k| k as f64 / recipe.rate_hz).collect();
    let seen = seen_rad.iter().enumerate().flat_map(|(row, seen)| if recipe.sees(row) { *seen } else { [f64::NAN; 2] });
    let source = format!("generated from seed {}", recipe.seed);
    Measurements::bare(source, Quantity::Snake, time_s, (readings_m.concat(), 3), (seen.collect(), 2))
}
