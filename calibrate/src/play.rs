//! Play by a dial indicator on an actuator's output, line unloaded: encoder travel without dial motion after each turning round.
//!
//! The output follows a play operator: turned at encoder e_0 with dial d_0, it stands until the encoder has gone back by 2 h, then
//! follows. A reading at travel t beyond the play says 2 h = t - |d - d_0| by itself, so that a turn needs its start and a few
//! places beyond any plausible play, not the place where the dial begins to move: which a dial's own error always finds too early.

use crate::fit::{Parameter, fit};
use crate::log::ReadingLog;
use crate::{CalibrateError, CalibratedValue, Dialogue, LeastSquares, Reply};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, Write};
use std::path::Path;

/// Travels back at which the dial is read, m.
const TRAVELS_M: [f64; 4] = [0.0, 0.3e-3, 0.4e-3, 0.5e-3];
/// Travel towards the turning point, m: it takes up the play before the dial's zero is read.
const APPROACH_M: f64 = 1e-3;
/// Turns of each line: five each way.
const TURNS: u32 = 10;
/// A standard error above this leaves the half-width open, m.
const OPEN_M: f64 = 20e-6;
/// Largest half-width, um.
const GRID_UM: u32 = 2000;
/// The dial must follow by this many of its standard deviations at a turn's farthest reading.
const FOLLOWED_SD: f64 = 5.0;

/// One row of the CSV.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlayReading {
    /// Line, from 1.
    pub line: u32,
    /// Turning round, from 1 in each line; its first reading is where the line turned.
    pub turn: u32,
    /// Encoder, m.
    pub encoder_m: f64,
    /// Dial, m, with the encoder's sign.
    pub dial_m: f64,
    /// Direction after the turn: 1 or -1.
    pub direction: i32,
    /// Standard deviation of the dial, m.
    pub dial_sd_m: f64,
}

/// What is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaySettings {
    /// Standard deviation of the dial, m.
    pub dial_sd_m: f64,
    /// Lines of the robot, each with an actuator.
    pub n_lines: u32,
}

impl Default for PlaySettings {
    fn default() -> Self {
        Self { dial_sd_m: 10e-6, n_lines: 3 }
    }
}

/// Half-width of one line.
#[derive(Clone, Debug, PartialEq)]
pub struct LinePlay {
    /// The line, from 1.
    pub line: u32,
    /// The fit: half-width, m.
    pub fit: LeastSquares,
}

/// Half-widths of every line and what the model takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Play {
    /// Each line that was measured.
    pub lines: Vec<LinePlay>,
}

impl Play {
    /// Mean half-width, m, with its standard error: the model has one for all lines.
    pub fn half_width_m(&self) -> (f64, f64) {
        let weights: Vec<f64> = self.lines.iter().map(|l| l.fit.se(0).powi(-2)).collect();
        let sum: f64 = weights.iter().sum();
        let mean = self.lines.iter().zip(&weights).map(|(l, w)| l.fit.value[0] * w).sum::<f64>() / sum;
        (mean, sum.sqrt().recip())
    }

    /// The two lines that differ most, where they do by more than three standard errors.
    pub fn unlike(&self) -> Option<(u32, u32, f64)> {
        let mut worst = None;
        let mut most = 3.0;
        for a in &self.lines {
            for b in &self.lines {
                let apart = (a.fit.value[0] - b.fit.value[0]) / a.fit.se(0).hypot(b.fit.se(0));
                if apart > most {
                    most = apart;
                    worst = Some((a.line, b.line, apart));
                }
            }
        }
        worst
    }

    /// For the model file.
    pub fn calibrated(&self) -> Vec<CalibratedValue> {
        let (value, se) = self.half_width_m();
        vec![CalibratedValue { effect: "backlash", parameter: "half_width_m", value, se }]
    }
}

/// Fits one half-width per line.
///
/// # Errors
/// [`CalibrateError::NotDetermined`] and [`CalibrateError::Misfit`].
pub fn play(readings: &[PlayReading]) -> Result<Play, CalibrateError> {
    let mut names: Vec<u32> = readings.iter().map(|r| r.line).collect();
    names.sort_unstable();
    names.dedup();
    if names.is_empty() {
        return Err(open("no reading".to_owned(), missing(0)));
    }
    let lines: Result<_, _> = names.into_iter().map(|line| of_line(line, readings)).collect();
    Ok(Play { lines: lines? })
}

fn of_line(line: u32, readings: &[PlayReading]) -> Result<LinePlay, CalibrateError> {
    let own: Vec<&PlayReading> = readings.iter().filter(|r| r.line == line).collect();
    let mut turns: Vec<Vec<&PlayReading>> = Vec::new();
    for reading in own {
        match turns.last_mut().filter(|turn| turn[0].turn == reading.turn) {
            Some(turn) => turn.push(reading),
            None => turns.push(vec![reading]),
        }
    }
    let residuals = |value: &[f64]| Some(turns.iter().flat_map(|turn| of_turn(turn, value[0])).collect());
    // The sum of squares has a knee wherever a reading passes into the play: begin at the best of a fine grid.
    let square = |h: f64| turns.iter().flat_map(|turn| of_turn(turn, h)).map(|r| r * r).sum::<f64>();
    let grid = (0..=GRID_UM).step_by(5).map(|um| f64::from(um) * 1e-6);
    let start = grid.map(|h| (h, square(h))).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |best| best.0);
    let n_turns = turns.len();
    let parameter = Parameter { name: "half_width_m", start, scale: 1e-6 };
    let mut fit = fit(&[parameter], residuals, |_| missing(line))?;
    // Each turn has spent one reading on its own zero.
    fit.dof = fit.dof.saturating_sub(n_turns);
    if fit.se(0) > OPEN_M {
        return Err(open(
            format!("line {line} has {:.3} +- {:.3} mm", fit.value[0] * 1e3, fit.se(0) * 1e3),
            missing(line),
        ));
    }
    let far_m =
        |turn: &Vec<&PlayReading>| turn.iter().map(|r| (r.encoder_m - turn[0].encoder_m).abs()).fold(0.0, f64::max);
    let mean_m = turns.iter().map(far_m).sum::<f64>() / n_turns as f64;
    let dial_sd_m = turns.iter().flatten().map(|r| r.dial_sd_m).fold(0.0, f64::max);
    if mean_m - 2.0 * fit.value[0] < FOLLOWED_SD * dial_sd_m {
        let found = format!("the dial of line {line} hardly moved in {:.2} mm of travel", mean_m * 1e3);
        return Err(open(found, format!("turns of line {line} with readings farther back")));
    }
    fit.check("is the line unloaded, and the dial on the actuator's output?")?;
    Ok(LinePlay { line, fit })
}

/// Residuals of one turn in standard deviations of the dial, with the dial's zero of that turn taken out.
fn of_turn(turn: &[&PlayReading], half_width_m: f64) -> Vec<f64> {
    let first = turn[0];
    let left = |r: &&PlayReading| {
        let travel_m = (r.encoder_m - first.encoder_m).abs();
        r.dial_m - f64::from(first.direction) * (travel_m - 2.0 * half_width_m).max(0.0)
    };
    let zero_m = turn.iter().map(left).sum::<f64>() / turn.len() as f64;
    turn.iter().map(|r| (left(r) - zero_m) / r.dial_sd_m).collect()
}

fn open(found: String, missing: String) -> CalibrateError {
    CalibrateError::NotDetermined { parameter: "half_width_m", found, missing }
}

fn missing(line: u32) -> String {
    let line = if line == 0 { "each line".to_owned() } else { format!("line {line}") };
    format!("turns of {line} with the dial read at the turn and at 0.3, 0.4 and 0.5 mm of travel back")
}

/// The dialogue: `go` moves one actuator to a position (m) and says what its encoder reads (m).
///
/// # Errors
/// [`CalibrateError`]; what was read is in the CSV.
pub fn run<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    csv: &Path,
    settings: &PlaySettings,
    mut go: impl FnMut(&mut Dialogue<R, W>, u32, f64) -> Result<f64, CalibrateError>,
) -> Result<Play, CalibrateError> {
    let PlaySettings { dial_sd_m, n_lines } = *settings;
    if !(dial_sd_m > 0.0 && dial_sd_m < 1e-3) {
        return Err(CalibrateError::Setting {
            name: "dial_sd_m",
            found: dial_sd_m,
            expected: "more than 0, less than 1 mm",
        });
    }
    let (mut log, mut readings) = ReadingLog::open::<PlayReading>(csv)?;
    dialogue
        .say("Dial on the actuator's output, line unloaded. Type what the dial reads in mm, s to skip, q to stop.")?;
    'all: for line in 1..=n_lines {
        for turn in 1..=TURNS {
            // A turn that was cut short is not taken up again: the line has moved since.
            if readings.iter().any(|r: &PlayReading| r.line == line && r.turn == turn) {
                continue;
            }
            let direction = if turn % 2 == 0 { 1 } else { -1 };
            // Three places of the stroke.
            let place_m = f64::from(turn % 3) * 1e-3 - 1e-3;
            go(dialogue, line, place_m + f64::from(direction) * APPROACH_M)?;
            go(dialogue, line, place_m)?;
            for travel_m in TRAVELS_M {
                let encoder_m = go(dialogue, line, place_m + f64::from(direction) * travel_m)?;
                let question = format!("line {line}, turn {turn}, encoder {:.3} mm: dial mm?", encoder_m * 1e3);
                let dial = match dialogue.numbers(&question, (1, 1), (-100.0, 100.0))? {
                    Reply::Numbers(dial) => dial[0],
                    // Without its start a turn says nothing, and with fewer places it says less.
                    Reply::Skip | Reply::Empty => break,
                    Reply::Quit => break 'all,
                };
                let reading = PlayReading { line, turn, encoder_m, dial_m: dial * 1e-3, direction, dial_sd_m };
                log.add(&reading)?;
                readings.push(reading);
            }
        }
    }
    let found = play(&readings)?;
    for own in &found.lines {
        dialogue.say(&format!(
            "line {}: half-width {:.4} +- {:.4} mm, chi2 {:.1}/{}",
            own.line,
            own.fit.value[0] * 1e3,
            own.fit.se(0) * 1e3,
            own.fit.chi2,
            own.fit.dof
        ))?;
    }
    if let Some((a, b, apart)) = found.unlike() {
        dialogue.say(&format!(
            "lines {a} and {b} differ by {apart:.1} standard errors; the model has one half-width, the mean"
        ))?;
    }
    let (value, se) = found.half_width_m();
    dialogue.say(&format!("half-width {:.4} +- {:.4} mm", value * 1e3, se * 1e3))?;
    Ok(found)
}
