//! One joint's measurements, ready for fits: what it was told, what was measured, which rows count.

use crate::diagnose::turns;
use crate::machine::JointsLab;
use crate::noise::{bounds, is_still};
use crate::{LabError, Measurements, Offered};
use krait_model::Circumstances;
use krait_model::joints::AtJoint;
use std::collections::BTreeMap;
use std::sync::Arc;

/// One joint's measurements.
#[derive(Clone, Debug)]
pub(super) struct Signal {
    /// Which joint, from 0.
    pub joint: usize,
    /// Commands of every joint, one column each.
    pub inputs: Vec<Vec<f64>>,
    /// What the model's own effects make of this joint's command ...
    pub base: Arc<Vec<f64>>,
    /// ... and the parts that go around further effects.
    pub base_added: Vec<f64>,
    /// Measured positions without what the model's own effects at the sensor add; NaN where nothing was measured.
    pub measured: Vec<f64>,
    /// Time of each row, s.
    pub time_s: Vec<f64>,
    /// Time since the row before, s; 0 where a trial begins.
    pub step_s: Vec<f64>,
    /// Time since the trial began, s.
    pub trial_s: Vec<f64>,
    /// Whether a trial begins.
    pub fresh: Vec<bool>,
    /// Number of each row's trial, from 0.
    pub trial: Vec<usize>,
    /// Trials.
    pub n_trials: usize,
    /// Recording of each trial; each recording has its own gain and offset.
    pub recording_of_trial: Vec<usize>,
    /// Recordings.
    pub n_recordings: usize,
    /// Rows that the loss counts.
    pub rows: Vec<usize>,
    /// Largest command of this joint less the smallest, and the middle.
    pub range: f64,
    /// Smallest command.
    pub low: f64,
    /// Median time between rows, s.
    pub typical_step_s: f64,
    /// Length of the longest trial, s.
    pub longest_s: f64,
    /// The command's own strong waves: a rhythm in time there cannot be told from the motion.
    pub own_waves: Vec<Wave>,
    /// A speed that is rarely exceeded.
    pub fast: f64,
    /// Columns beside commands and measurements that may act on the joint; none where nobody asked ([`Signal::with_columns`]).
    pub columns: Vec<Column>,
    /// What formulas see beside commands and positions; nothing where none is offered ([`Signal::with_formulas`]).
    pub formulas: Arc<Formulas>,
    /// The commands of a joint that is told them in steps; nothing where it is told to move.
    pub levels: Vec<f64>,
    /// What the model knows of gain and offset.
    pub gain: Number,
    /// The same for the offset.
    pub offset: Number,
}

/// A column beside commands and measurements, in halves of its range from its middle.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub name: String,
    pub values: Arc<Vec<f64>>,
    pub middle: f64,
    pub half: f64,
}

/// What formulas see beside commands and positions, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Formulas {
    /// Gain and offset of the joint.
    line: (f64, f64),
    /// Sign of the last change of the command, 0 before the first.
    motion: Vec<f64>,
    temperature_c: Vec<f64>,
    /// Columns by name, each gap as the row before.
    columns: BTreeMap<&'static str, Vec<f64>>,
}

impl Formulas {
    fn new(data: &Measurements, offered: &[Offered], signal: &Signal, line: (f64, f64)) -> Self {
        let command = &signal.inputs[signal.joint];
        let mut last = 0.0;
        let motion = (0..signal.n()).map(|row| {
            if signal.fresh[row] {
                last = 0.0;
            } else if command[row] != command[row - 1] {
                last = (command[row] - command[row - 1]).signum();
            }
            last
        });
        let motion = motion.collect();
        let without_gaps = |values: &[f64]| -> Vec<f64> {
            let mut last = f64::NAN;
            let held = values.iter().map(|value| {
                last = if value.is_finite() { *value } else { last };
                last
            });
            held.collect()
        };
        let names = offered.iter().flat_map(|own| own.columns());
        Self {
            line,
            motion,
            temperature_c: data.temperature_c.as_deref().map_or(Vec::new(), without_gaps),
            columns: names.filter_map(|name| Some((name, without_gaps(data.beside(name)?)))).collect(),
        }
    }

    fn at(&self, own: Offered, row: usize, time_s: f64) -> Circumstances {
        let mut at = Circumstances::at(time_s);
        at.temperature_c = self.temperature_c.get(row).copied().unwrap_or(f64::NAN);
        for (value, name) in at.columns.iter_mut().zip(own.columns()) {
            *value = self.columns.get(name).and_then(|own| own.get(row)).copied().unwrap_or(f64::NAN);
        }
        at
    }
}

/// A frequency that makes much of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wave {
    pub hz: f64,
    /// Whether it makes nearly all of it.
    pub is_alone: bool,
}

/// A number of the machine: held, free, or drawn to a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number {
    /// As the model has it.
    Held(f64),
    /// Whatever the data say.
    Free,
    /// A fitted value with its standard error.
    Near(f64, f64),
}

impl Signal {
    /// The signal of a joint on these rows of the data, of which at most `most` measured ones, evenly chosen, make the loss.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model's own effects make no chain.
    pub fn new(
        machine: &JointsLab,
        data: &Measurements,
        joint: usize,
        excluded: &[usize],
        most: usize,
        recordings: &[usize],
    ) -> Result<Self, LabError> {
        let n = data.n_rows();
        let [passed, added, behind] = machine.parts(data)?;
        let n_joints = data.n_inputs;
        assert!(joint < n_joints && data.n_outputs == n_joints, "a machine of joints has as many outputs as inputs");
        let column =
            |values: &[f64], k: usize| -> Vec<f64> { values.iter().skip(k).step_by(n_joints).copied().collect() };
        let base = column(&passed, joint);
        let gains = &machine.joints().gain[joint];
        let base_added = column(&added, joint);
        // What other joints do through a full matrix is known.
        let mut measured = column(&data.outputs, joint);
        for (row, measured) in measured.iter_mut().enumerate() {
            let at = row * n_joints;
            let others = (0..n_joints).filter(|k| *k != joint);
            let through: f64 = others.map(|k| gains[k] * (passed[at + k] + added[at + k])).sum();
            *measured -= through + behind[at + joint];
        }
        let (mut step_s, mut trial_s, mut fresh, mut trial) = (vec![0.0; n], vec![0.0; n], vec![false; n], vec![0; n]);
        let mut n_trials = 0;
        for row in 0..n {
            fresh[row] = data.starts_trial(row);
            n_trials += usize::from(fresh[row]);
            trial[row] = n_trials - 1;
            if !fresh[row] {
                step_s[row] = (data.time_s[row] - data.time_s[row - 1]).max(0.0);
                trial_s[row] = trial_s[row - 1] + step_s[row];
            }
        }
        let longest_s = trial_s.iter().copied().fold(0.0, f64::max).max(1e-9);
        let is_excluded = |row: &usize| excluded.binary_search(row).is_ok();
        let mut frames: Vec<usize> = (0..n).filter(|row| measured[*row].is_finite() && !is_excluded(row)).collect();
        // Nobody knows what a delay has before a trial's first row: of many rows one of these would count for many others.
        if frames.len() > MANY * most {
            frames.retain(|row| trial_s[*row] >= BEFORE_FIRST_ROW_S || longest_s < SHORT_TRIAL_S);
        }
        let stride = frames.len().div_ceil(most).max(1);
        let inputs: Vec<Vec<f64>> = (0..n_joints).map(|k| column(&data.inputs, k)).collect();
        let (low, high) = bounds(inputs[joint].iter().copied());
        let mut steps: Vec<f64> = step_s.iter().copied().filter(|dt| *dt > 0.0).collect();
        steps.sort_by(f64::total_cmp);
        // Rows of two clocks nearly coincide: the way from one to the other is no step.
        let long = steps.get(3 * steps.len() / 4).copied().unwrap_or(0.0);
        steps.retain(|dt| *dt > NO_STEP * long);
        let mut speeds: Vec<f64> = (1..n)
            .filter(|row| step_s[*row] > 0.0)
            .map(|row| (inputs[joint][row] - inputs[joint][row - 1]).abs() / step_s[row])
            .collect();
        speeds.sort_by(f64::total_cmp);
        let own_waves = strong_waves(&inputs[joint], &data.time_s, &trial);
        let at = |sorted: &[f64], part: f64| sorted.get((part * sorted.len() as f64) as usize).copied();
        Ok(Self {
            joint,
            base: Arc::new(base),
            base_added,
            measured,
            longest_s,
            time_s: data.time_s.clone(),
            step_s,
            trial_s,
            fresh,
            trial,
            n_trials,
            recording_of_trial: (0..n_trials)
                .map(|k| recordings.partition_point(|first| *first <= k).max(1) - 1)
                .collect(),
            n_recordings: recordings.len().max(1),
            own_waves,
            rows: frames.into_iter().step_by(stride).collect(),
            range: if high > low { high - low } else { 1.0 },
            low,
            typical_step_s: at(&steps, 0.5).unwrap_or(1.0),
            fast: at(&speeds, 0.995).filter(|speed| *speed > 0.0).unwrap_or(1.0),
            levels: levels(&inputs[joint]),
            columns: Vec::new(),
            formulas: Arc::new(Formulas::default()),
            gain: machine.gain_known(joint),
            offset: machine.offset_known(joint),
            inputs,
        })
    }

    /// The same with the columns beside the motion, which take their time on long records.
    pub fn with_columns(self, data: &Measurements) -> Self {
        Self { columns: super::beside::columns(data, self.joint), ..self }
    }

    /// The same with what these formulas see; `line` is gain and offset of the joint.
    pub fn with_formulas(self, data: &Measurements, offered: &[Offered], line: (f64, f64)) -> Self {
        if offered.is_empty() {
            return self;
        }
        let formulas = Formulas::new(data, offered, &self, line);
        Self { formulas: Arc::new(formulas), ..self }
    }

    /// What a formula adds in each row of the loss with one of its amplitudes 1, where the positions before it are `x`.
    pub fn formula(&self, own: Offered, x: &[f64], amplitude: usize, shapes: &[f64]) -> Vec<f64> {
        let parameters = own.unit(amplitude, shapes);
        let added = |&row: &usize| {
            let here = AtJoint {
                u: self.inputs[self.joint][row],
                y: self.formulas.line.0 * (x[row] + self.base_added[row]) + self.formulas.line.1,
                motion: self.formulas.motion[row],
                joint: self.joint,
            };
            own.value(here, &self.formulas.at(own, row, self.time_s[row]), &parameters)
        };
        self.rows.iter().map(added).collect()
    }

    /// Whether the joint was told to move and did: else nothing can be said of it.
    pub fn moves(&self) -> bool {
        let measured = self.rows.iter().map(|&row| self.measured[row]);
        !is_still(bounds(self.base.iter().copied())) && !is_still(bounds(measured))
    }

    /// Slowest and fastest rhythm that is looked for, Hz: slower ones are drift; of long records fewer, so that the grid stays small.
    pub fn rhythms_hz(&self) -> (f64, f64) {
        let low = f64::max(0.08, 6.0 / self.longest_s);
        let fastest = 1.2_f64.min(0.2 / self.typical_step_s).min(low + MOST_RHYTHMS / (2.0 * self.longest_s));
        (low, fastest.max(low * 1.2))
    }

    /// Whether the motion has this frequency, Hz, or hysteresis could make it of a motion that is one sine.
    pub fn is_of_motion(&self, hz: f64) -> bool {
        let multiples = |wave: &Wave| if wave.is_alone { 1..=HARMONICS } else { 1..=1 };
        let near = |wave: &Wave| multiples(wave).any(|n| (hz - f64::from(n) * wave.hz).abs() < 1.0 / self.longest_s);
        self.own_waves.iter().any(near)
    }

    /// Ways from one reversal of the command to the next, with the first and the last of each trial.
    pub fn n_strokes(&self) -> usize {
        let command = self.inputs[self.joint].iter().copied();
        turns(command, |row| self.fresh[row], SMALLEST_TURN * self.range) + self.n_trials
    }

    /// Range of a joint's command.
    pub fn range_of(&self, joint: usize) -> f64 {
        let (low, high) = bounds(self.inputs[joint].iter().copied());
        if high > low { high - low } else { 1.0 }
    }

    /// Rows of the simulation.
    pub fn n(&self) -> usize {
        self.time_s.len()
    }

    /// The recording of a row.
    pub fn recording(&self, row: usize) -> usize {
        self.recording_of_trial[self.trial[row]]
    }
}

/// Every row of the loss stands for at least so many.
const MANY: usize = 4;
/// What a model may remember of before a trial's first row, s, and a trial that is too short for it to be left out.
const BEFORE_FIRST_ROW_S: f64 = 0.2;
const SHORT_TRIAL_S: f64 = 2.0;
/// Less than this part of a usual step from row to row is none.
const NO_STEP: f64 = 0.02;
/// Rhythms that are tried.
const MOST_RHYTHMS: f64 = 300.0;
/// A frequency of this share of the command's variance is the motion's own, of this one the motion is mostly one sine.
const STRONG: f64 = 0.05;
const ALONE: f64 = 0.6;
/// A turn that counts, as a part of the range.
const SMALLEST_TURN: f64 = 0.02;
/// Multiples of that sine that count.
const HARMONICS: u32 = 6;
/// Rows that the spectrum is made of, and its last half wave.
const ROWS_OF_SPECTRUM: usize = 2000;
const HALF_WAVES: u32 = 200;

/// More commands than this are many.
const MOST_LEVELS: usize = 64;
/// Share of all rows in which a command in steps has one of those at which it stands.
const ON_LEVELS: f64 = 0.8;

/// The values at which a command in steps stands from one row to the next, in their order; nothing where these are many, or where the
/// command also moves between them.
fn levels(command: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for stands in command.windows(2).filter(|pair| pair[0] == pair[1]) {
        let at = all.partition_point(|own| *own < stands[0]);
        if all.get(at) != Some(&stands[0]) {
            all.insert(at, stands[0]);
        }
        if all.len() > MOST_LEVELS {
            return Vec::new();
        }
    }
    let is_on_one = |value: &&f64| all.binary_search_by(|own| own.total_cmp(value)).is_ok();
    let n = command.iter().filter(is_on_one).count();
    if n as f64 >= ON_LEVELS * command.len() as f64 { all } else { Vec::new() }
}

/// Frequencies that make much of the first part of a command; none of one that stands still.
fn strong_waves(command: &[f64], time_s: &[f64], trial: &[usize]) -> Vec<Wave> {
    let first = trial.iter().position(|own| *own == 0).unwrap_or(0);
    let end = trial.iter().position(|own| *own > 0).unwrap_or(command.len());
    let stride = (end - first).div_ceil(ROWS_OF_SPECTRUM).max(1);
    let rows: Vec<usize> = (first..end).step_by(stride).collect();
    let n = rows.len() as f64;
    let mean = rows.iter().map(|&row| command[row]).sum::<f64>() / n.max(1.0);
    let whole: f64 = rows.iter().map(|&row| (command[row] - mean).powi(2)).sum();
    let seconds = rows.last().map_or(0.0, |&row| time_s[row] - time_s[first]);
    if seconds <= 0.0 || whole <= 0.0 {
        return Vec::new();
    }
    let share = |hz: f64| {
        let (s, c) = rows.iter().fold((0.0, 0.0), |(s, c), &row| {
            let (sine, cosine) = (core::f64::consts::TAU * hz * (time_s[row] - time_s[first])).sin_cos();
            (s + (command[row] - mean) * sine, c + (command[row] - mean) * cosine)
        });
        2.0 * (s * s + c * c) / n / whole
    };
    let all = (2..HALF_WAVES).map(|k| 0.5 * f64::from(k) / seconds).map(|hz| (hz, share(hz)));
    all.filter(|(_, share)| *share > STRONG).map(|(hz, share)| Wave { hz, is_alone: share > ALONE }).collect()
}
