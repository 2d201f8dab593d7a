//! Load cells at the actuators as outputs of a snake: their noise, their gain and offset, and what they say in one likelihood.
//!
//! measured_i = gain_i predicted_i + offset_(i, trial) + noise_i. Nobody calibrates cells for the lab: gain and offset are solved for
//! inside every evaluation (variable projection), so that no candidate is fitted against another's calibration, and are
//! reported. Each cell's noise is its own. A row counts where the shape was measured too.

use crate::diagnose::LoadCell;
use crate::machine::MachineUnderTest;
use crate::noise::{FloorSource, NoiseFloor, bounds};
use crate::{LabError, LoadUse, Measurements, Problem};

/// Lines, and cells.
const N: usize = 3;
/// No cell is trusted to less than this part of its range: an ordinary one is not more linear.
const LINEARITY: f64 = 1e-3;
/// Cells that share less of their variance with the model's loads than this measure something else.
const FEWEST_SHARED: f64 = 0.5;
/// Cells need as many rows as this.
const FEWEST_ROWS: usize = 100;

/// What is known of the cells' noise.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cells {
    /// Standard deviation of each cell, N.
    pub sigma_n: [f64; N],
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
        let (_, Some(predicted_n)) = machine.predict_with_loads(machine.effects(), data)? else {
            return Ok(Self::Absent);
        };
        let no = |why: &str| Ok(Self::No(format!("the loads are not used: {why}")));
        let Some(sigma_output) = sigma_output else { return no("the shape's own noise is not known") };
        let is_scored = |row: usize| problem.weight[row * data.n_outputs] > 0.0;
        let plain = Cells { sigma_n: [sigma_output; N], sigma_output, is_white: true };
        let Some(rows) = LoadRows::new(data, &plain, is_scored) else {
            return no("they are filled in fewer than a hundred of the rows with a shape");
        };
        let mut cells = plain;
        for line in 0..N {
            let fit = rows.cell(line, &predicted_n);
            if fit.shared < FEWEST_SHARED {
                let shared = 100.0 * fit.shared;
                return no(&format!(
                    "tau{}_n has {shared:.0} % of its variance in common with the load that the model expects there, and loads of \
                     that line would have most; look whether the columns are those of the lines and of the actuators",
                    line + 1
                ));
            }
            let floor = noise_of(machine, data, &rows, line, &predicted_n, shortest_block_s);
            let Some((sigma_n, source)) = floor.sigma() else { return no("their noise cannot be told") };
            cells.sigma_n[line] = sigma_n.max(LINEARITY * fit.range_n);
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
    let own = Measurements { outputs, n_outputs: 1, loads_n: None, sigma: None, ..data.clone() };
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
    measured_n: [Vec<f64>; N],
    /// Weight of each cell.
    weight: [f64; N],
    /// Least and largest gain of a cell.
    gains: [f64; 2],
    n_all_rows: usize,
}

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
    /// Entries in each row of a residual.
    pub(crate) const WIDTH: usize = N;

    /// The rows with all three loads among those that are scored; `None` where they are few.
    pub(crate) fn new(data: &Measurements, cells: &Cells, is_scored: impl Fn(usize) -> bool) -> Option<Self> {
        let LoadUse::Counted { gain_apart } = data.load_use else { return None };
        let loads_n = data.loads_n.as_deref()?;
        let is_whole = |row: &usize| {
            is_scored(*row) && loads_n.get(row * N..(row + 1) * N).is_some_and(|own| own.iter().all(|x| x.is_finite()))
        };
        let rows: Vec<usize> = (0..data.n_rows()).filter(is_whole).collect();
        if rows.len() < FEWEST_ROWS {
            return None;
        }
        let begins = |k: &usize| *k == 0 || data.trial[rows[*k]] != data.trial[rows[*k - 1]];
        let trials = (0..rows.len()).filter(begins).chain([rows.len()]).collect();
        let measured_n = core::array::from_fn(|line| rows.iter().map(|row| loads_n[row * N + line]).collect());
        let weight = cells.sigma_n.map(|sigma_n| cells.sigma_output / sigma_n);
        Some(Self {
            rows,
            trials,
            measured_n,
            weight,
            gains: [1.0 - gain_apart, 1.0 + gain_apart],
            n_all_rows: data.n_rows(),
        })
    }

    /// Loads that count.
    pub(crate) fn n_scored(&self) -> usize {
        N * self.rows.len()
    }

    /// Weighted residuals of all rows, row after row of three, zero where no load counts, for predicted loads of all rows, N.
    pub(crate) fn residual(&self, predicted_n: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; N * self.n_all_rows];
        for line in 0..N {
            for (row, left) in self.rows.iter().zip(self.left_n(line, predicted_n)) {
                all[row * N + line] = left * self.weight[line];
            }
        }
        all
    }

    /// What gain and offset leave of a cell, N.
    fn left_n(&self, line: usize, predicted_n: &[f64]) -> Vec<f64> {
        let (gain, measured, predicted) = self.solve(line, predicted_n);
        measured.iter().zip(&predicted).map(|(y, f)| y - gain * f).collect()
    }

    /// Gain, and readings and predictions without the mean of their trial, N.
    fn solve(&self, line: usize, predicted_n: &[f64]) -> (f64, Vec<f64>, Vec<f64>) {
        let mut measured = self.measured_n[line].clone();
        let mut predicted: Vec<f64> = self.rows.iter().map(|row| predicted_n[row * N + line]).collect();
        for own in self.trials.windows(2) {
            for values in [&mut measured, &mut predicted] {
                let trial = &mut values[own[0]..own[1]];
                let mean = trial.iter().sum::<f64>() / trial.len() as f64;
                trial.iter_mut().for_each(|x| *x -= mean);
            }
        }
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let square = product(&predicted, &predicted);
        let gain = if square > 0.0 { product(&predicted, &measured) / square } else { 1.0 };
        let gain = gain.clamp(self.gains[0], self.gains[1]);
        (gain, measured, predicted)
    }

    /// One cell's fit.
    pub(crate) fn cell(&self, line: usize, predicted_n: &[f64]) -> CellFit {
        let (gain, measured, predicted) = self.solve(line, predicted_n);
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
        let whole = square(&mut measured.iter().copied());
        let left = square(&mut measured.iter().zip(&predicted).map(|(y, f)| y - gain * f));
        let all = &self.measured_n[line];
        let offset = |own: &[usize]| {
            let sum: f64 = (own[0]..own[1]).map(|k| all[k] - gain * predicted_n[self.rows[k] * N + line]).sum();
            sum / (own[1] - own[0]) as f64
        };
        let (low, high) = bounds(all.iter().copied());
        CellFit {
            gain,
            offset_n: self.trials.windows(2).map(offset).collect(),
            left_n: (left / self.rows.len() as f64).sqrt(),
            shared: if whole > 0.0 { 1.0 - left / whole } else { 0.0 },
            range_n: high - low,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;
    use crate::fit::{Variable, fit};
    use crate::machine::SnakeLab;
    use crate::{Names, Quantity, Term};
    use core::f64::consts::{PI, TAU};
    use krait_model::model_file::ModelFile;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    /// Load scale, play's half-width (m), f_s (N), friction of the cone.
    const TRUTH: [f64; 4] = [1.22, 0.089e-3, 1.959, 0.1727];
    /// Rows at each pose, so that twenty poses are rows enough; each has so much more noise.
    const AT_A_POSE: usize = 5;

    /// Encoders (m) and loads at the actuators (N) at a bend, all lines sliding, from the equations.
    fn bench(bend_rad: f64, way: f64) -> ([f64; 3], [f64; 3]) {
        let [eta, h, f_s, mu] = TRUTH;
        let ea = 54e9 * PI / 4.0 * (0.66e-3_f64.powi(2) - 0.5e-3_f64.powi(2));
        let ei = 54e9 * PI / 64.0 * (0.66e-3_f64.powi(4) - 0.5e-3_f64.powi(4));
        let (l, r) = (26e-3, 1.684e-3);
        let j = [-r, 0.5 * r, 0.5 * r];
        let sum: f64 = 1.0 / l + j.iter().map(|j| 1.0 / (l + j * bend_rad)).sum::<f64>();
        let slope: f64 = j.iter().map(|j| -j / (l + j * bend_rad).powi(2)).sum();
        let moment = ei * (bend_rad * sum + 0.5 * bend_rad * bend_rad * slope);
        let across: f64 = j.iter().map(|j| j * j).sum();
        let loads = j.map(|j| {
            let (t, s) = (eta * moment * j / across, way * j.signum());
            let slid = t + s * f_s;
            slid * (2.0 * mu * 41_f64.to_radians() * if s * slid > 0.0 { 1.0 } else { -1.0 }).exp()
        });
        let reading = core::array::from_fn(|i| {
            j[i] * bend_rad + eta * moment * j[i] / across * 0.48 / ea + loads[i] * 0.058 / ea + way * j[i].signum() * h
        });
        (reading, loads)
    }

    fn normal(random: &mut ChaCha8Rng) -> f64 {
        let mut uniform = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        (-2.0 * (1.0 - uniform()).ln()).sqrt() * (TAU * uniform()).cos()
    }

    /// Up to 62 degrees and back, measured at ten bends from 10 to 60 degrees each way.
    fn measured(seed: u64, sigma: [f64; 2]) -> Measurements {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let poses: Vec<f64> = (0..10).map(|k| 10.0 + 50.0 * f64::from(k) / 9.0).collect();
        let mut up: Vec<(f64, bool)> = (1..=124).map(|k| (0.5 * f64::from(k), false)).collect();
        up.extend(poses.iter().flat_map(|pose| [(*pose, true); AT_A_POSE]));
        up.sort_by(|a, b| a.0.total_cmp(&b.0));
        let path = up.iter().map(|own| (*own, 1.0)).chain(up.iter().rev().map(|own| (*own, -1.0)));
        let (mut inputs, mut outputs, mut loads) = (Vec::new(), Vec::new(), Vec::new());
        for ((bend_deg, is_measured), way) in path {
            let (reading, own) = bench(bend_deg.to_radians(), way);
            inputs.extend(reading);
            let seen = [bend_deg.to_radians(), 0.0].map(|b| b + sigma[0] * normal(&mut random));
            outputs.extend(if is_measured { seen } else { [f64::NAN; 2] });
            loads.extend(own.map(|n| n + sigma[1] * normal(&mut random)));
        }
        let n = outputs.len() / 2;
        Measurements {
            source: String::new(),
            sha256: String::new(),
            quantity: Quantity::Snake,
            time_s: (0..n).map(|k| 0.1 * k as f64).collect(),
            inputs,
            n_inputs: 3,
            outputs,
            n_outputs: 2,
            trial: vec![0; n],
            loads_n: Some(loads),
            load_use: LoadUse::UNCALIBRATED,
            stem_angle_rad: None,
            temperature_c: None,
            sigma: None,
            extra: Vec::new(),
            names: Names::default(),
            n_held_rows: 0,
            clock: None,
        }
    }

    /// Camera 1 degree, cells 0.1 N, twenty poses: what the rows of the likelihood predict, with gains and offsets of the cells free.
    #[test]
    fn fits_scatter_as_the_rows_of_the_likelihood_predict() {
        const PREDICTED: [f64; 4] = [0.0140, 0.00702e-3, 0.0729, 0.4564 / 41.0 * 0.1727];
        const SEEDS: u64 = 60;
        let file = ModelFile::parse("format = 1\n\n[machine]\nkind = \"snake\"\n").unwrap();
        let lab = SnakeLab::new(&file).unwrap();
        let effects: Vec<Term> = ["stiffness-scale", "backlash", "static-friction", "cone-friction"]
            .into_iter()
            .zip(TRUTH)
            .map(|(name, value)| Term::new(name, vec![1.05 * value]))
            .collect();
        let variables: Vec<Variable> =
            (0..4).map(|k| Variable::new(&lab, &effects, k, 0, 0.1 * TRUTH[k]).unwrap()).collect();
        let sigma = [1_f64.to_radians(), 0.1].map(|sigma| sigma * (AT_A_POSE as f64).sqrt());
        let cells = Cells { sigma_n: [sigma[1]; 3], sigma_output: sigma[0], is_white: true };
        let mut sums = [[0.0; 2]; 4];
        for seed in 0..SEEDS {
            let problem = Problem::new(&lab, measured(seed, sigma), &[], 1.0).with_loads(Some(&cells));
            assert_eq!((problem.width(), problem.n_scored), (5, 5 * 20 * AT_A_POSE));
            let found = fit(&problem, &effects, &variables, 30, 1e-9).unwrap();
            for ((sums, term), truth) in sums.iter_mut().zip(&found.effects).zip(TRUTH) {
                let off = term.values[0] - truth;
                *sums = [sums[0] + off, sums[1] + off * off];
            }
        }
        for ((sums, predicted), term) in sums.iter().zip(PREDICTED).zip(&effects) {
            let n = SEEDS as f64;
            let (mean, sd) = (sums[0] / n, (sums[1] / n - (sums[0] / n).powi(2)).sqrt());
            println!("{}: sd {sd:.3e}, predicted {predicted:.3e}, mean error {mean:.3e}", term.name);
            // Sixty fits know their scatter to 9 %.
            assert!((sd / predicted - 1.0).abs() < 0.25 && mean.abs() < 3.0 * predicted / n.sqrt(), "{}", term.name);
        }
    }
}
