//! A clock that runs at another rate than that of the commands: the measurements are then ever earlier, or ever later, than what a fit
//! predicts, from one end of a recording to the other.

use super::decide::{FAR_ABOVE_ROWS, fast_noise};
use super::refine::Fit;
use super::search::n_effective;
use super::signal::Signal;
use crate::Measurements;
use crate::clock::ClockOffset;
use crate::diagnose::{ERRORS, LEAST_SHARE, speeds};
use crate::fit::{dot, inverse, normal_equations};

/// Rates at which a search begins: a larger one than the first steps reach is found from the nearest of them.
const STARTS: [f64; 5] = [0.0, -0.003, 0.003, -0.008, 0.008];
const STEPS: usize = 12;
/// A step of less than this part of a standard error is the last.
const SMALL: f64 = 0.05;
const SMALL_S: f64 = 1e-4;
/// Fewer blocks say nothing of a standard error.
const FEWEST_BLOCKS: usize = 8;
const MOST_BLOCKS: f64 = 50.0;
/// Rows that tell the rate are at least this part of all.
const FEWEST_ROWS: f64 = 0.7;
/// A clock of another rate beside which a rest remains takes away more than this part of what is left without it.
const BESIDE_A_REST: f64 = 0.5;
/// Shift alone, shift and rate, and a rate that changes.
const SHIFT: usize = 1;
const RATE: usize = 2;
const BEND: usize = 3;

/// What is said of the rate of a clock in one recording, with its standard error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    value: f64,
    pub error: f64,
    /// Part of what is left without it that it takes away.
    share: f64,
    /// Whether it takes away most of that, and is the same all the time, as the rate of a clock is.
    pub is_clear: bool,
    /// Whether what it leaves could be the noise from row to row.
    pub may_be_all: bool,
}

impl Rate {
    /// The rate of one clock for all joints; `None` where they do not show one beyond doubt.
    pub fn told(of_joints: &[Option<Self>]) -> Option<Self> {
        let all = || of_joints.iter().flatten();
        let weight: f64 = all().map(|own| own.error.powi(-2)).sum();
        let value = all().map(|own| own.value * own.error.powi(-2)).sum::<f64>() / weight;
        let error = weight.powf(-0.5);
        let share = all().filter(|own| own.value * value > 0.0).map(|own| own.share).fold(0.0, f64::max);
        let is_told = share > LEAST_SHARE && value.abs() > ERRORS * error;
        let (is_clear, may_be_all) = (all().any(|own| own.is_clear), all().all(|own| own.may_be_all));
        is_told.then_some(Self { value, error, share, is_clear, may_be_all })
    }

    /// The clock with this rate beside what was known of it, where the recording's middle is `half_s` behind its beginning: there both
    /// clocks are one, as far as anybody can say.
    pub fn beside(&self, own: ClockOffset, half_s: f64) -> ClockOffset {
        let rate = (own.rate + self.value).clamp(-ClockOffset::MOST_RATE, ClockOffset::MOST_RATE);
        ClockOffset { shift_s: own.shift_s + (rate - own.rate) * half_s, rate }
    }
}

/// A joint's measurements of one recording beside what a fit predicts of them.
struct Track {
    time_s: Vec<f64>,
    trial: Vec<usize>,
    measured: Vec<f64>,
    predicted: Vec<f64>,
    speed: Vec<f64>,
    acceleration: Vec<f64>,
    middle_s: f64,
}

/// What is predicted for a row.
struct Seen {
    row: usize,
    since_middle_s: f64,
    predicted: f64,
    speed: f64,
    acceleration: f64,
}

/// A shift and a rate, and how they change once more, by least squares.
struct Solved {
    shift_s: f64,
    rate: f64,
    /// Of the speed, and of the speed times each power of the time: s, s/s, s/s^2.
    steps: Vec<f64>,
    /// Standard error of the last of them.
    error: f64,
    mean_square: f64,
}

/// What a fit says of the rate of each recording's clock; `firsts` has the first trial of each.
pub(super) fn rates(signal: &Signal, fit: &Fit, firsts: &[usize], data: &Measurements) -> Vec<Option<Rate>> {
    (0..firsts.len()).map(|k| rate(signal, fit, k, data.middle_s(data.trials_of(k, firsts)))).collect()
}

/// The same of one recording, from its middle; `None` where it cannot say anything.
fn rate(signal: &Signal, fit: &Fit, recording: usize, middle_s: f64) -> Option<Rate> {
    let track = Track::new(signal, fit, recording, middle_s);
    let n_blocks = (n_effective(fit) / 4.0).min(MOST_BLOCKS) as usize;
    if !signal.moves() || n_blocks < FEWEST_BLOCKS {
        return None;
    }
    let without = track.settled(0.0, SHIFT, n_blocks)?;
    let with = STARTS.iter().filter_map(|start| track.settled(*start, RATE, n_blocks));
    let with = with.min_by(|a, b| a.mean_square.total_cmp(&b.mean_square))?;
    let bent = track.solved(with.shift_s, with.rate, BEND, n_blocks)?;
    let share = 1.0 - with.mean_square / without.mean_square.max(1e-300);
    let is_steady = bent.steps.last().is_some_and(|step| step.abs() < ERRORS * bent.error);
    (with.error > 0.0).then(|| Rate {
        value: with.rate,
        error: with.error,
        share,
        is_clear: share > BESIDE_A_REST && is_steady,
        may_be_all: with.mean_square < FAR_ABOVE_ROWS * FAR_ABOVE_ROWS * fast_noise(signal),
    })
}

impl Track {
    fn new(signal: &Signal, fit: &Fit, recording: usize, middle_s: f64) -> Self {
        let own = |(_, row): &(usize, &usize)| signal.recording(**row) == recording;
        let (places, rows): (Vec<usize>, Vec<usize>) = signal.rows.iter().enumerate().filter(own).unzip();
        let time_s: Vec<f64> = rows.iter().map(|&row| signal.time_s[row]).collect();
        let trial: Vec<usize> = rows.iter().map(|&row| signal.trial[row]).collect();
        let measured: Vec<f64> = rows.iter().map(|&row| signal.measured[row]).collect();
        let predicted: Vec<f64> =
            measured.iter().zip(&places).map(|(y, &place)| y - fit.solution.residual[place]).collect();
        let speed = speeds(&time_s, &trial, &predicted);
        let acceleration = speeds(&time_s, &trial, &speed);
        Self { time_s, trial, measured, predicted, speed, acceleration, middle_s }
    }

    /// What is predicted for a row by another clock; `None` outside its trial.
    fn seen(&self, row: usize, shift_s: f64, rate: f64) -> Option<Seen> {
        let since_middle_s = self.time_s[row] - self.middle_s;
        let time_s = self.time_s[row] + shift_s + rate * since_middle_s;
        let first = self.trial.partition_point(|trial| *trial < self.trial[row]);
        let end = self.trial.partition_point(|trial| *trial <= self.trial[row]);
        let to = first + self.time_s[first..end].partition_point(|own| *own < time_s);
        if to == first || to == end {
            return None;
        }
        let from = to - 1;
        let part = (time_s - self.time_s[from]) / (self.time_s[to] - self.time_s[from]);
        let between = |values: &[f64]| values[from] + part * (values[to] - values[from]);
        let (predicted, speed) = (between(&self.predicted), between(&self.speed));
        Some(Seen { row, since_middle_s, predicted, speed, acceleration: between(&self.acceleration) })
    }

    /// What is left by a clock, and the steps that so many numbers of it ask for beside gain, offset and what the other numbers of a model
    /// would do: a lag, and play. `None` where most rows lie outside.
    fn solved(&self, shift_s: f64, rate: f64, n_steps: usize, n_blocks: usize) -> Option<Solved> {
        let seen: Vec<Seen> = (0..self.time_s.len()).filter_map(|row| self.seen(row, shift_s, rate)).collect();
        if (seen.len() as f64) < FEWEST_ROWS * self.time_s.len() as f64 || seen.len() < n_blocks {
            return None;
        }
        let column = |of: &dyn Fn(&Seen) -> f64| seen.iter().map(of).collect::<Vec<f64>>();
        let mut columns = vec![
            column(&|at| at.predicted),
            column(&|_| 1.0),
            column(&|at| at.acceleration),
            column(&|at| at.speed.signum()),
        ];
        let n_others = columns.len();
        let powers = (0..n_steps as i32).map(|power| column(&|at| at.speed * at.since_middle_s.powi(power)));
        columns.extend(powers);
        let mut left = column(&|at| self.measured[at.row]);
        let (gram, gradient) = normal_equations(&columns, &left);
        let inverse = inverse(&gram);
        let numbers = &inverse * &gradient;
        for (column, number) in columns.iter().zip(numbers.iter()) {
            left.iter_mut().zip(column).for_each(|(left, own)| *left -= number * own);
        }
        let of_last = inverse.row(columns.len() - 1);
        let influence = |row: usize| of_last.iter().zip(&columns).map(|(own, column)| own * column[row]).sum();
        let influence: Vec<f64> = (0..seen.len()).map(influence).collect();
        let gain = numbers[0];
        Some(Solved {
            shift_s,
            rate,
            steps: numbers.iter().skip(n_others).map(|number| number / gain).collect(),
            error: spread(&influence, &left, n_blocks) / gain.abs(),
            mean_square: dot(&left, &left) / seen.len() as f64,
        })
    }

    /// The clock that leaves least, from a rate on; `None` where it does not settle within its bounds.
    fn settled(&self, start: f64, n_steps: usize, n_blocks: usize) -> Option<Solved> {
        let mut own = self.solved(0.0, start, n_steps, n_blocks)?;
        for _ in 0..STEPS {
            let (by_s, by) = (own.steps[0], own.steps.get(1).copied().unwrap_or(0.0));
            if by.abs() <= SMALL * own.error && by_s.abs() < SMALL_S {
                break;
            }
            let shift_s = (own.shift_s + by_s).clamp(-ClockOffset::MOST_S, ClockOffset::MOST_S);
            let rate = (own.rate + by).clamp(-ClockOffset::MOST_RATE, ClockOffset::MOST_RATE);
            own = self.solved(shift_s, rate, n_steps, n_blocks)?;
        }
        let is_within = own.rate.abs() < ClockOffset::MOST_RATE && own.shift_s.abs() < ClockOffset::MOST_S;
        is_within.then_some(own)
    }
}

/// Standard error of a number by how much each row moves it and what is left there, over blocks of rows.
fn spread(influence: &[f64], left: &[f64], n_blocks: usize) -> f64 {
    let length = left.len().div_ceil(n_blocks).max(1);
    let blocks = influence.chunks(length).zip(left.chunks(length));
    blocks.map(|(influence, left)| dot(influence, left).powi(2)).sum::<f64>().sqrt()
}
