//! Load cells at the actuators of a snake or of segments as outputs: their noise, gain and offset, and what they say in one likelihood.
//!
//! measured_i = gain_i predicted_i + offset_(i, trial) + noise_i. Nobody calibrates cells for the lab: gain and offset are solved for
//! inside every evaluation (variable projection), so that no candidate is fitted against another's calibration, and are
//! reported. Each cell's noise is its own. A row counts where the shape was measured too.
//!
//! What real drives estimate from their motors is no cell: measured_i = g predicted_i + offset_(i, trial) + noise_i with one g for all
//! lines, and g = 1 with the stated standard deviation. g is taken out of the likelihood: what is left is weighted by
//! (1 + s^2 p p^T)^(-1/2) for the predicted loads p, so that the sum of squares is the least over g with the prior's share.
//! Where friction in a gear differs by direction no gain tells it; the noise of such loads is therefore never taken for
//! less than that part of their own size.

use crate::diagnose::LoadCell;
use crate::machine::MachineUnderTest;
use crate::noise::{FloorSource, NoiseFloor, bounds};
use crate::{LabError, LoadUse, Measurements, Problem, Quantity};

/// No cell is trusted to less than this part of its range: an ordinary one is not more linear.
const LINEARITY: f64 = 1e-3;
/// Cells that share less of their variance with the model's load of their line than this may measure something else.
const FEWEST_SHARED: f64 = 0.5;
/// Friction that the model of segments lacks can be most of a small load: with this much, and no more in common with the load of any
/// other line, a cell is its line's nevertheless.
const LEAST_SHARED: f64 = 0.2;
/// Cells need as many rows as this.
const FEWEST_ROWS: usize = 100;

/// What is known of the cells' noise.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cells {
    /// Standard deviation of each cell, N; one for each line.
    pub sigma_n: Vec<f64>,
    /// Of one output of the machine, in its unit.
    sigma_output: f64,
    /// Whether the noise of all of them is white, as far as the data tell.
    pub is_white: bool,
}

/// Whether loads can be used.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Usable {
    /// None were recorded, or the machine has none.
    Absent,
    /// They count.
    Cells(Cells),
    /// They do not, because of this.
    No(String),
}

impl Usable {
    /// The cells that count.
    pub(crate) fn cells(&self) -> Option<&Cells> {
        if let Self::Cells(cells) = self { Some(cells) } else { None }
    }

    /// The cells of measurements, judged with the machine's model as given; `excluded` rows do not count.
    ///
    /// # Errors
    /// [`LabError`] where the model cannot be computed.
    pub(crate) fn of(
        machine: &dyn MachineUnderTest,
        problem: &Problem,
        sigma_output: Option<f64>,
        shortest_block_s: f64,
    ) -> Result<Self, LabError> {
        let data = &problem.data;
        if data.counted_loads_n().is_none() {
            return Ok(Self::Absent);
        }
        let no = |why: &str| Ok(Self::No(format!("the loads are not used: {why}")));
        let (_, Some(predicted_n)) = machine.predict_with_loads(machine.effects(), data)? else {
            return no("the model's lines are rigid, and it has no loads for them; give it elastic lines");
        };
        let Some(sigma_output) = sigma_output else { return no("the shape's own noise is not known") };
        let is_scored = |row: usize| problem.weight[row * data.n_outputs] > 0.0;
        let plain = Cells { sigma_n: vec![sigma_output; data.n_inputs], sigma_output, is_white: true };
        let Some(rows) = LoadRows::new(data, &plain, is_scored) else {
            return no("they are filled in fewer than a hundred of the rows with a shape");
        };
        let mut cells = plain;
        for line in 0..rows.width() {
            let fit = rows.cell(line, &predicted_n);
            let may_lack_friction = data.quantity == Quantity::Segments
                && fit.shared >= LEAST_SHARED
                && rows.is_nearest_to_own(line, &predicted_n);
            if fit.shared < FEWEST_SHARED && !may_lack_friction {
                let shared = 100.0 * fit.shared;
                return no(&format!(
                    "tau{}_n has {shared:.0} % of its variance in common with the load that the model expects there, and loads of \
                     that line would have most; look whether the columns are those of the lines and of the actuators",
                    line + 1
                ));
            }
            let floor = noise_of(machine, data, &rows, line, &predicted_n, shortest_block_s);
            let Some((sigma_n, source)) = floor.sigma() else { return no("their noise cannot be told") };
            let least_n = match data.load_use {
                LoadUse::Estimated { gain_sd } => gain_sd * fit.size_n,
                LoadUse::Counted { .. } | LoadUse::Shown => 0.0,
            };
            cells.sigma_n[line] = sigma_n.max(LINEARITY * fit.range_n).max(least_n);
            cells.is_white &= source == FloorSource::White;
        }
        Ok(Self::Cells(cells))
    }
}

/// The noise of one cell, from what the model leaves of it.
fn noise_of(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    rows: &LoadRows,
    line: usize,
    predicted_n: &[f64],
    shortest_block_s: f64,
) -> NoiseFloor {
    let left = rows.left_n(line, predicted_n);
    let mut outputs = vec![f64::NAN; data.n_rows()];
    let mut residual = vec![0.0; data.n_rows()];
    for (&row, &left) in rows.rows.iter().zip(&left) {
        (outputs[row], residual[row]) = (left, left);
    }
    let (loads_n, sigma, tip_frames) = (None, None, Vec::new());
    let own = Measurements { outputs, n_outputs: 1, loads_n, sigma, tip_frames, ..data.clone() };
    NoiseFloor::new(&Problem::new(machine, own, &[], shortest_block_s), &residual)
}

/// The rows in which loads count, ready for a fit.
#[derive(Clone, Debug)]
pub(crate) struct LoadRows {
    /// Their numbers.
    rows: Vec<usize>,
    /// Place in `rows` at which each trial begins, and their number at the end.
    trials: Vec<usize>,
    /// Measured loads of these rows, N, cell by cell.
    measured_n: Vec<Vec<f64>>,
    /// Weight of each cell.
    weight: Vec<f64>,
    gain: Gain,
    n_all_rows: usize,
}

/// What is known of the gains.
#[derive(Clone, Copy, Debug)]
enum Gain {
    /// Each cell has its own, between these.
    Own([f64; 2]),
    /// All have one, which is 1 but for a normal error of so much; in units of a residual the prior counts as so many squares.
    Common { prior: f64 },
}

/// Of each line what was read and what is predicted, without the mean of the trial, N.
type Centred = Vec<(Vec<f64>, Vec<f64>)>;

/// What a fit of one cell found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CellFit {
    /// Newtons read for each newton of the model.
    pub gain: f64,
    /// Reading without a load in each trial, N.
    pub offset_n: Vec<f64>,
    /// Root mean square of what is left, N.
    pub left_n: f64,
    /// Share of the reading's variance that is explained, 0 to 1.
    pub shared: f64,
    /// From the least reading to the largest, N.
    pub range_n: f64,
    /// Root mean square of the reading about its trials' means, N.
    pub size_n: f64,
}

/// What the cells of a problem were found to read, where loads of two models are predicted.
pub(crate) fn load_cells(rows: &LoadRows, cells: &Cells, before: &[f64], after: &[f64]) -> Vec<LoadCell> {
    let cell = |(k, &noise_n): (usize, &f64)| {
        let found = rows.cell(k, after);
        let before_n = rows.cell(k, before).left_n;
        LoadCell { line: k + 1, gain: found.gain, offset_n: found.offset_n, noise_n, before_n, after_n: found.left_n }
    };
    cells.sigma_n.iter().enumerate().map(cell).collect()
}

impl LoadRows {
    /// Entries in each row of a residual: one for each line.
    pub(crate) fn width(&self) -> usize {
        self.measured_n.len()
    }

    /// The rows with the loads of all lines among those that are scored; `None` where they are few.
    pub(crate) fn new(data: &Measurements, cells: &Cells, is_scored: impl Fn(usize) -> bool) -> Option<Self> {
        let gain = match data.load_use {
            LoadUse::Shown => return None,
            LoadUse::Counted { gain_apart } => Gain::Own([1.0 - gain_apart, 1.0 + gain_apart]),
            LoadUse::Estimated { gain_sd } => Gain::Common { prior: (cells.sigma_output / gain_sd).powi(2) },
        };
        let (loads_n, n) = (data.loads_n.as_deref()?, data.n_inputs);
        let is_whole = |row: &usize| {
            is_scored(*row) && loads_n.get(row * n..(row + 1) * n).is_some_and(|own| own.iter().all(|x| x.is_finite()))
        };
        let rows: Vec<usize> = (0..data.n_rows()).filter(is_whole).collect();
        if rows.len() < FEWEST_ROWS {
            return None;
        }
        let begins = |k: &usize| *k == 0 || data.trial[rows[*k]] != data.trial[rows[*k - 1]];
        let trials = (0..rows.len()).filter(begins).chain([rows.len()]).collect();
        let measured_n = (0..n).map(|line| rows.iter().map(|row| loads_n[row * n + line]).collect()).collect();
        let weight = cells.sigma_n.iter().map(|sigma_n| cells.sigma_output / sigma_n).collect();
        Some(Self { rows, trials, measured_n, weight, gain, n_all_rows: data.n_rows() })
    }

    /// Loads that count.
    pub(crate) fn n_scored(&self) -> usize {
        self.width() * self.rows.len()
    }

    /// Weighted residuals of all rows, row after row of all lines, zero where no load counts, for predicted loads of all rows, N.
    pub(crate) fn residual(&self, predicted_n: &[f64]) -> Vec<f64> {
        let n = self.width();
        let mut all = vec![0.0; n * self.n_all_rows];
        let lines = self.centred(predicted_n);
        for (line, (part, (measured, predicted))) in self.parts(&lines).into_iter().zip(&lines).enumerate() {
            for (row, (y, f)) in self.rows.iter().zip(measured.iter().zip(predicted)) {
                all[row * n + line] = (y - part * f) * self.weight[line];
            }
        }
        all
    }

    /// What gain and offset leave of a cell, N.
    fn left_n(&self, line: usize, predicted_n: &[f64]) -> Vec<f64> {
        let lines = self.centred(predicted_n);
        let (gain, (measured, predicted)) = (self.gain(line, &lines), &lines[line]);
        measured.iter().zip(predicted).map(|(y, f)| y - gain * f).collect()
    }

    /// Of each line, how many times the prediction a residual takes off: the gain, or for a common gain what leaves the squares that
    /// gain and prior leave together.
    fn parts(&self, lines: &Centred) -> Vec<f64> {
        let Gain::Common { prior } = self.gain else {
            return (0..lines.len()).map(|line| self.gain(line, lines)).collect();
        };
        let [of_both, of_predicted] = self.products(lines);
        // d = measured - predicted; d - part p has the squares of d less (d p)^2 / (p p + prior).
        let left = (prior / (of_predicted + prior)).sqrt();
        let part = if of_predicted > 0.0 { (of_both - of_predicted) / of_predicted * (1.0 - left) } else { 0.0 };
        vec![1.0 + part; lines.len()]
    }

    /// Weighted products of measured with predicted and of predicted with predicted loads, of all lines.
    fn products(&self, lines: &Centred) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for ((measured, predicted), weight) in lines.iter().zip(&self.weight) {
            let squared = weight * weight;
            sums[0] += squared * product(measured, predicted);
            sums[1] += squared * product(predicted, predicted);
        }
        sums
    }

    /// The gain that fits a line best.
    fn gain(&self, line: usize, lines: &Centred) -> f64 {
        match self.gain {
            Gain::Own([least, largest]) => {
                let (measured, predicted) = &lines[line];
                let square = product(predicted, predicted);
                let gain = if square > 0.0 { product(predicted, measured) / square } else { 1.0 };
                gain.clamp(least, largest)
            }
            Gain::Common { prior } => {
                let [of_both, of_predicted] = self.products(lines);
                (of_both + prior) / (of_predicted + prior)
            }
        }
    }

    /// Readings and predictions of each line without the mean of their trial, N.
    fn centred(&self, predicted_n: &[f64]) -> Centred {
        let centred = |mut values: Vec<f64>| {
            for own in self.trials.windows(2) {
                let trial = &mut values[own[0]..own[1]];
                let mean = trial.iter().sum::<f64>() / trial.len() as f64;
                trial.iter_mut().for_each(|x| *x -= mean);
            }
            values
        };
        let n = self.width();
        let of_line = |(line, measured): (usize, &Vec<f64>)| {
            let predicted = self.rows.iter().map(|row| predicted_n[row * n + line]).collect();
            (centred(measured.clone()), centred(predicted))
        };
        self.measured_n.iter().enumerate().map(of_line).collect()
    }

    /// Whether no load of another line has more in common with what is read than that of the cell's own.
    fn is_nearest_to_own(&self, line: usize, predicted_n: &[f64]) -> bool {
        let lines = self.centred(predicted_n);
        let shared = |(_, predicted): &(Vec<f64>, Vec<f64>)| {
            let square = product(predicted, predicted);
            if square > 0.0 { product(&lines[line].0, predicted).powi(2) / square } else { 0.0 }
        };
        let own = shared(&lines[line]);
        lines.iter().all(|other| shared(other) <= own)
    }

    /// One cell's fit.
    pub(crate) fn cell(&self, line: usize, predicted_n: &[f64]) -> CellFit {
        let lines = self.centred(predicted_n);
        let (gain, (measured, predicted)) = (self.gain(line, &lines), &lines[line]);
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
        let whole = square(&mut measured.iter().copied());
        let left = square(&mut measured.iter().zip(predicted).map(|(y, f)| y - gain * f));
        let (all, n) = (&self.measured_n[line], self.width());
        let offset = |own: &[usize]| {
            let sum: f64 = (own[0]..own[1]).map(|k| all[k] - gain * predicted_n[self.rows[k] * n + line]).sum();
            sum / (own[1] - own[0]) as f64
        };
        let (low, high) = bounds(all.iter().copied());
        CellFit {
            gain,
            offset_n: self.trials.windows(2).map(offset).collect(),
            left_n: (left / self.rows.len() as f64).sqrt(),
            shared: if whole > 0.0 { 1.0 - left / whole } else { 0.0 },
            range_n: high - low,
            size_n: (whole / self.rows.len() as f64).sqrt(),
        }
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]
mod tests;
