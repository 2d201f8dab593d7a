//! Friction of the cone by hanging weights: channel unmounted, wire through it, weight at the snake's end, scale at the actuator's.
//!
//! Law, with g = e^(2 mu phi), loads as weights in grams: up, against the weight, tau~ = g (w + f); down, on the way back,
//! tau~ = (w - f)/g. The readings up give mu and f; those down add little to their precision and are the test of the law.

use crate::fit::{Parameter, fit};
use crate::log::ReadingLog;
use crate::{CalibrateError, CalibratedValue, Dialogue, LeastSquares, Reply};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, Write};
use std::path::Path;

/// Newtons of one gram at the standard acceleration of gravity; the paper's f_s was computed with 10 m/s2.
const N_PER_G: f64 = 9.80665e-3;
/// A standard error above these leaves mu (1) or f_s (N) open.
const OPEN: [f64; 2] = [0.05, 0.6];
/// Largest weight, g.
const MAX_WEIGHT_G: f64 = 20_000.0;

/// Direction in which the wire moves while it is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Towards the actuator, against the weight.
    Up,
    /// Back, with the weight.
    Down,
}

/// One row of the CSV.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionReading {
    /// Line, from 1.
    pub line: u32,
    /// Weight at the snake's end, g.
    pub weight_g: f64,
    /// Direction of motion.
    pub direction: Direction,
    /// Load at the actuator's end, g.
    pub scale_g: f64,
    /// Standard deviation of the weight, g.
    pub weight_sd_g: f64,
    /// Standard deviation of the scale, g.
    pub scale_sd_g: f64,
    /// Anything.
    #[serde(default)]
    pub note: String,
}

/// What is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSettings {
    /// Angle of each of the cone's two arcs, rad.
    pub phi_rad: f64,
    /// Standard deviation of a weight, g.
    pub weight_sd_g: f64,
    /// Standard deviation of the scale, g.
    pub scale_sd_g: f64,
    /// The scale may have a zero of its own.
    pub free_zero: bool,
}

impl Default for FrictionSettings {
    fn default() -> Self {
        Self { phi_rad: 41_f64.to_radians(), weight_sd_g: 1.0, scale_sd_g: 25.0, free_zero: false }
    }
}

/// Friction with its standard errors: values mu (1), f_s (g), and the scale's zero (g) if it was free.
#[derive(Clone, Debug, PartialEq)]
pub struct Friction {
    /// The fit.
    pub fit: LeastSquares,
}

impl Friction {
    /// mu, 1, with its standard error.
    pub fn mu(&self) -> (f64, f64) {
        (self.fit.value[0], self.fit.se(0))
    }

    /// f_s, N, with its standard error.
    pub fn f_s_n(&self) -> (f64, f64) {
        (self.fit.value[1] * N_PER_G, self.fit.se(1) * N_PER_G)
    }

    /// For the model file.
    pub fn calibrated(&self) -> Vec<CalibratedValue> {
        let value = |effect, parameter, (value, se)| CalibratedValue { effect, parameter, value, se };
        vec![value("static-friction", "f_s_n", self.f_s_n()), value("cone-friction", "mu", self.mu())]
    }

    fn sentence(&self) -> String {
        let ((mu, mu_se), (f_s, f_s_se), fit) = (self.mu(), self.f_s_n(), &self.fit);
        format!(
            "mu {mu:.4} +- {mu_se:.4}, f_s {f_s:.3} +- {f_s_se:.3} N, correlation {:.2}, chi2 {:.1}/{}",
            fit.correlation(0, 1),
            fit.chi2,
            fit.dof
        )
    }
}

/// Load at the actuator that the law gives, g.
fn law(value: &[f64], phi_rad: f64, weight_g: f64, direction: Direction) -> f64 {
    let (g, f) = ((2.0 * value[0] * phi_rad).exp(), value[1]);
    let zero = value.get(2).copied().unwrap_or(0.0);
    zero + match direction {
        Direction::Up => g * (weight_g + f),
        // Below f the weight does not come down by itself: it has to be pushed, and friction turns over.
        Direction::Down if weight_g > f => (weight_g - f) / g,
        Direction::Down => (weight_g - f) * g,
    }
}

/// Fits the law to readings.
///
/// # Errors
/// [`CalibrateError::NotDetermined`] and [`CalibrateError::Misfit`].
pub fn friction(readings: &[FrictionReading], settings: &FrictionSettings) -> Result<Friction, CalibrateError> {
    let phi_rad = settings.phi_rad;
    if !(phi_rad > 0.0 && phi_rad <= core::f64::consts::PI) {
        return Err(CalibrateError::Setting {
            name: "phi_rad",
            found: phi_rad,
            expected: "more than 0, at most pi rad",
        });
    }
    let mut parameters =
        vec![Parameter { name: "mu", start: 0.15, scale: 0.01 }, Parameter { name: "f_s", start: 150.0, scale: 10.0 }];
    if settings.free_zero {
        parameters.push(Parameter { name: "the scale's zero", start: 0.0, scale: 10.0 });
    }
    let residuals = |value: &[f64]| {
        let g = (2.0 * value[0] * phi_rad).exp();
        let one = |r: &FrictionReading| {
            let slope = if r.direction == Direction::Up { g } else { 1.0 / g };
            let sd = r.scale_sd_g.hypot(slope * r.weight_sd_g);
            (r.scale_g - law(value, phi_rad, r.weight_g, r.direction)) / sd
        };
        let all: Vec<f64> = readings.iter().map(one).collect();
        all.iter().all(|r| r.is_finite()).then_some(all)
    };
    let found = Friction { fit: fit(&parameters, residuals, |_| missing(readings))? };
    for (k, open) in OPEN.into_iter().enumerate() {
        let (value, se) = if k == 0 { found.mu() } else { found.f_s_n() };
        if se > open || !(value - 4.0 * se..=value + 4.0 * se).contains(&value.max(0.0)) {
            let parameter = parameters[k].name;
            let found = format!("{value:.3} +- {se:.3}");
            return Err(CalibrateError::NotDetermined { parameter, found, missing: missing(readings) });
        }
    }
    Ok(found)
}

/// Readings that would determine both.
fn missing(readings: &[FrictionReading]) -> String {
    let up = || readings.iter().filter(|r| r.direction == Direction::Up).map(|r| r.weight_g);
    let (low, high) = (up().fold(f64::INFINITY, f64::min), up().fold(0.0, f64::max));
    let mut words = Vec::new();
    if low > 100.0 {
        words.push("a reading `up` without weight (0 g): it gives f_s".to_owned());
    }
    if high - low.min(high) < 1000.0 {
        words.push("readings `up` with heavy weights (1000 to 1800 g): they give mu".to_owned());
    }
    if words.is_empty() {
        words.push(format!("more rounds of readings, or a better scale ({} so far)", readings.len()));
    }
    words.join(", and ")
}

/// The dialogue: readings into the CSV, then the fit.
///
/// # Errors
/// [`CalibrateError`]; what was read is in the CSV.
pub fn run<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    csv: &Path,
    settings: &FrictionSettings,
) -> Result<Friction, CalibrateError> {
    for (name, sd_g) in [("weight_sd_g", settings.weight_sd_g), ("scale_sd_g", settings.scale_sd_g)] {
        if !is_sd_g(sd_g) {
            return Err(CalibrateError::Setting { name, found: sd_g, expected: "more than 0, at most 1000 g" });
        }
    }
    let (mut log, mut readings) = ReadingLog::open::<FrictionReading>(csv)?;
    for (k, reading) in readings.iter().enumerate() {
        if let Some(reason) = odd(reading) {
            return Err(CalibrateError::Row { file: csv.display().to_string(), row: k + 2, reason });
        }
    }
    dialogue.say(
        "Wire through the unmounted channel, weight at the snake's end, scale at the actuator's. For each weight pull slowly\n\
         towards the actuator and read while it moves (up), then let it go back and read while it moves (down; above 300 g).\n\
         Weights 0, 100 ... 1800 g, three rounds in random order. An empty weight ends.",
    )?;
    if !readings.is_empty() {
        dialogue.say(&format!("{} readings are in {} already", readings.len(), log.name()))?;
    }
    while let Some(reading) = ask(dialogue, settings)? {
        log.add(&reading)?;
        readings.push(reading);
        if let (Some(last), Ok(found)) = (readings.last(), friction(&readings, settings)) {
            let model = law(&found.fit.value, settings.phi_rad, last.weight_g, last.direction);
            let word = if last.direction == Direction::Up { "up" } else { "down" };
            dialogue.say(&format!(
                "  {word} {:.0} g: {:.0} (model {model:.1}, {:+.1})",
                last.weight_g,
                last.scale_g,
                last.scale_g - model
            ))?;
        }
    }
    let found = friction(&readings, settings)?;
    dialogue.say(&found.sentence())?;
    found.fit.check("is the wire moving steadily while you read, and is the scale's error as stated?")?;
    Ok(found)
}

fn is_sd_g(sd_g: f64) -> bool {
    sd_g > 0.0 && sd_g <= 1000.0
}

/// What of a row of a file no reading can be.
fn odd(reading: &FrictionReading) -> Option<String> {
    let FrictionReading { weight_g, scale_g, weight_sd_g, scale_sd_g, .. } = *reading;
    let high = 100.0 * MAX_WEIGHT_G;
    let checks = [
        ("weight_g", weight_g, (0.0..=MAX_WEIGHT_G).contains(&weight_g), "0 to 20000"),
        ("scale_g", scale_g, (-high..=high).contains(&scale_g), "-2000000 to 2000000"),
        ("weight_sd_g", weight_sd_g, is_sd_g(weight_sd_g), "more than 0, at most 1000"),
        ("scale_sd_g", scale_sd_g, is_sd_g(scale_sd_g), "more than 0, at most 1000"),
    ];
    let (name, found, _, expected) = checks.into_iter().find(|check| !check.2)?;
    Some(format!("{name} is {found}, expected {expected} g"))
}

fn ask<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    settings: &FrictionSettings,
) -> Result<Option<FrictionReading>, CalibrateError> {
    let Reply::Numbers(line) = or_default(dialogue.numbers("line? [1]", (1, 1), (1.0, 12.0))?, 1.0) else {
        return Ok(None);
    };
    let Reply::Numbers(weight) = dialogue.numbers("weight g (empty = done)?", (1, 1), (0.0, MAX_WEIGHT_G))? else {
        return Ok(None);
    };
    let Some(word) = dialogue.word("direction up/down? [up]", &["up", "down"])? else { return Ok(None) };
    let high = 100.0 * MAX_WEIGHT_G;
    let Reply::Numbers(scale) = dialogue.numbers("scale reads g?", (1, 1), (-high, high))? else { return Ok(None) };
    Ok(Some(FrictionReading {
        line: line[0] as u32,
        weight_g: weight[0],
        direction: if word == "up" { Direction::Up } else { Direction::Down },
        scale_g: scale[0],
        weight_sd_g: settings.weight_sd_g,
        scale_sd_g: settings.scale_sd_g,
        note: String::new(),
    }))
}

fn or_default(answer: Reply, default: f64) -> Reply {
    if answer == Reply::Empty { Reply::Numbers(vec![default]) } else { answer }
}
