//! Measurements made ready for statistics: which rows count, how much, and the blocks of time that resampling keeps together.

use crate::cells::{Cells, LoadRows};
use crate::diagnose::screen::{orthonormal, remove};
use crate::machine::MachineUnderTest;
use crate::{LabError, Measurements, Term};
use rayon::prelude::*;

/// A machine, its measurements, and what of them is scored.
#[derive(Clone)]
pub struct Problem<'a> {
    /// The machine.
    pub machine: &'a dyn MachineUnderTest,
    /// The measurements.
    pub data: Measurements,
    /// Weight of each output, row after row: 0 where nothing is scored, 1 where all rows are alike.
    pub weight: Vec<f64>,
    /// Block of each row, from 0, never falling.
    pub block: Vec<usize>,
    /// How many blocks there are.
    pub n_blocks: usize,
    /// None is shorter than this, s.
    shortest_block_s: f64,
    /// Outputs with a weight, and loads.
    pub n_scored: usize,
    /// Standard deviation of a row's noise in the outputs' unit, which says how strongly known values draw a fit; zero: not at all.
    pub noise: f64,
    /// Loads at the actuators, behind the outputs of each row of a residual; `None` where none are scored.
    loads: Option<LoadRows>,
    /// Shapes that stand beside the effects, orthonormal: a residual is what they leave of it.
    beside: Vec<Vec<f64>>,
    /// By how much each output counts beside the others; it is in the weights.
    output_factors: Vec<f64>,
}

/// Signs of fewer blocks than this cannot reach a small p-value.
pub const FEWEST_BLOCKS: usize = 12;
/// Blocks are as many as this where time allows.
const MOST_BLOCKS: usize = 40;

impl<'a> Problem<'a> {
    /// Blocks of equally many scored rows, none shorter than `shortest_block_s`; outputs in `excluded` (row numbers) do not count.
    pub fn new(
        machine: &'a dyn MachineUnderTest,
        data: Measurements,
        excluded: &[usize],
        shortest_block_s: f64,
    ) -> Self {
        let width = data.n_outputs;
        let mut weight = vec![0.0; data.n_rows() * width];
        let typical = typical_sigma(&data);
        for row in (0..data.n_rows()).filter(|&row| data.is_scored(row)) {
            let own = data.sigma.as_ref().and_then(|sigma| sigma.get(row)).map_or(1.0, |sigma| typical / sigma);
            weight[row * width..(row + 1) * width].fill(own);
        }
        for &row in excluded {
            weight[row * width..(row + 1) * width].fill(0.0);
        }
        let n_scored = weight.iter().filter(|w| **w > 0.0).count();
        let (block, n_blocks) = blocks(&data, &weight, n_scored / width.max(1), shortest_block_s);
        Self {
            machine,
            output_factors: vec![1.0; width],
            data,
            weight,
            block,
            n_blocks,
            shortest_block_s,
            n_scored,
            noise: 0.0,
            loads: None,
            beside: Vec::new(),
        }
    }

    /// The same with outputs that count by a factor each.
    pub(crate) fn by_output(mut self, factors: &[f64]) -> Self {
        scale_by_output(&mut self.weight, factors);
        self.output_factors = factors.to_vec();
        self
    }

    /// By how much each output counts beside the others.
    pub(crate) fn output_factors(&self) -> &[f64] {
        &self.output_factors
    }

    /// The same with the noise of a row, in the outputs' unit.
    pub(crate) fn with_noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// The same with the loads at the actuators in one likelihood with the outputs, each cell in units of its own noise.
    pub(crate) fn with_loads(mut self, cells: Option<&Cells>) -> Self {
        let is_scored = |row: usize| self.weight[row * self.data.n_outputs] > 0.0;
        if let Some(rows) = cells.and_then(|cells| LoadRows::new(&self.data, cells, is_scored)) {
            self.n_scored += rows.n_scored();
            self.loads = Some(rows);
        }
        self
    }

    /// The same with shapes beside the effects, which every fit may make as large as it likes; `columns` are weighted as residuals are.
    pub(crate) fn beside(&self, columns: &[Vec<f64>]) -> Self {
        Self { beside: orthonormal(columns), ..self.clone() }
    }

    /// The same measurements without the loads, and without shapes beside the effects.
    pub(crate) fn of_outputs(&self) -> Self {
        Self { n_scored: self.n_scored_outputs(), loads: None, beside: Vec::new(), ..self.clone() }
    }

    /// The loads, where they are scored.
    pub(crate) fn loads(&self) -> Option<&LoadRows> {
        self.loads.as_ref()
    }

    /// Whole seconds of such data that make enough blocks for a test of signs, one more than their blocks are long: a record of so many
    /// seconds covers one row less.
    pub(crate) fn needed_s(&self) -> f64 {
        let n_rows = self.n_scored_outputs() / self.data.n_outputs.max(1);
        let of_row_s = scored_time_s(&self.data) / n_rows.max(1) as f64;
        (FEWEST_BLOCKS as f64 * self.shortest_block_s.max(of_row_s)).floor() + 1.0
    }

    /// Entries of a residual in each row: the outputs, and the loads where they are scored.
    pub fn width(&self) -> usize {
        self.data.n_outputs + self.loads.as_ref().map_or(0, LoadRows::width)
    }

    /// Outputs with a weight, loads left out.
    pub(crate) fn n_scored_outputs(&self) -> usize {
        self.n_scored - self.loads.as_ref().map_or(0, LoadRows::n_scored)
    }

    /// A value of every output in the units of a residual, and laid out as one: the loads' entries are zero.
    pub(crate) fn laid_out(&self, mut column: Vec<f64>) -> Vec<f64> {
        column.iter_mut().zip(&self.weight).for_each(|(x, w)| *x *= w);
        let Some(loads) = &self.loads else { return column };
        let zeros = || core::iter::repeat_n(0.0, loads.width());
        let row = |outputs: &[f64]| outputs.iter().copied().chain(zeros()).collect::<Vec<_>>();
        column.chunks(self.data.n_outputs).flat_map(row).collect()
    }

    /// The entries of some rows of columns that are laid out as residuals are.
    pub(crate) fn part_of(&self, columns: &[Vec<f64>], rows: &[usize]) -> Vec<Vec<f64>> {
        let width = self.width();
        let part = |own: &Vec<f64>| rows.iter().flat_map(|row| &own[row * width..][..width]).copied().collect();
        columns.iter().map(part).collect()
    }

    /// The outputs' entries of a residual or a slope, row after row.
    pub(crate) fn outputs_of(&self, entries: &[f64]) -> Vec<f64> {
        entries.chunks(self.width()).flat_map(|row| row.iter().take(self.data.n_outputs)).copied().collect()
    }

    /// Weighted residuals, measured minus predicted, row after row; zero where nothing is scored.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the effects make no chain.
    pub fn residual(&self, effects: &[Term]) -> Result<Vec<f64>, LabError> {
        self.residual_at(effects, &self.data)
    }

    /// The same with the predictions for other inputs.
    pub(crate) fn residual_at(&self, effects: &[Term], inputs: &Measurements) -> Result<Vec<f64>, LabError> {
        let mut residual = match &self.loads {
            None => self.weigh(&self.machine.predict(effects, inputs)?),
            Some(loads) => {
                let (predicted, loads_n) = self.predicted_with_loads(effects, inputs)?;
                let left = loads.residual(&loads_n);
                let rows = self.weigh(&predicted);
                let rows = rows.chunks(self.data.n_outputs).zip(left.chunks(loads.width()));
                rows.flat_map(|(outputs, loads)| outputs.iter().chain(loads)).copied().collect()
            }
        };
        remove(&self.beside, &mut residual);
        Ok(residual)
    }

    /// Predicted outputs and loads at the actuators, of a machine whose loads are scored.
    pub(crate) fn predicted_with_loads(
        &self,
        effects: &[Term],
        inputs: &Measurements,
    ) -> Result<(Vec<f64>, Vec<f64>), LabError> {
        let (outputs, loads_n) = self.machine.predict_with_loads(effects, inputs)?;
        Ok((outputs, loads_n.unwrap_or_else(|| unreachable!("loads are scored where the machine predicts them"))))
    }

    /// Weighted residuals of predicted outputs.
    pub fn weigh(&self, predicted: &[f64]) -> Vec<f64> {
        let entry = |((y, f), w): ((&f64, &f64), &f64)| if *w > 0.0 { (y - f) * w } else { 0.0 };
        self.data.outputs.iter().zip(predicted).zip(&self.weight).map(entry).collect()
    }

    /// Predictions for several lists of effects, in parallel; `None` where a list makes no chain.
    pub fn residuals(&self, lists: &[Vec<Term>]) -> Vec<Option<Vec<f64>>> {
        lists.par_iter().map(|effects| self.residual(effects).ok()).collect()
    }

    /// Length of the error, root mean square over scored rows, in the outputs' unit; with loads of everything that is scored, each
    /// cell's noise counted as if it were an output's.
    pub fn rms(&self, sum_of_squares: f64) -> f64 {
        (sum_of_squares * self.data.n_outputs as f64 / self.n_scored.max(1) as f64).sqrt()
    }

    /// The same of the outputs alone.
    pub(crate) fn rms_of_outputs(&self, sum_of_squares: f64) -> f64 {
        (sum_of_squares * self.data.n_outputs as f64 / self.n_scored_outputs().max(1) as f64).sqrt()
    }

    /// Sums over the rows of each block.
    pub fn block_sums(&self, entry: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.n_blocks];
        let width = self.width();
        for (row, &block) in self.block.iter().enumerate() {
            for k in row * width..(row + 1) * width {
                sums[block] += entry(k);
            }
        }
        sums
    }

    /// First entry of each block and the end of the last: entries of block b are `[b]..[b + 1]`.
    pub fn block_bounds(&self) -> Vec<usize> {
        let width = self.width();
        let mut bounds: Vec<usize> =
            (0..self.n_blocks).map(|b| self.block.partition_point(|&own| own < b) * width).collect();
        bounds.push(self.block.len() * width);
        bounds
    }
}

/// Multiplies the outputs of all rows, row after row, by a factor each.
pub(crate) fn scale_by_output(values: &mut [f64], factors: &[f64]) {
    values.iter_mut().zip(factors.iter().cycle()).for_each(|(value, factor)| *value *= factor);
}

fn typical_sigma(data: &Measurements) -> f64 {
    let Some(sigma) = &data.sigma else { return 1.0 };
    let mut sorted: Vec<f64> = sigma.iter().copied().filter(|s| *s > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
}

fn blocks(data: &Measurements, weight: &[f64], n_rows: usize, shortest_s: f64) -> (Vec<usize>, usize) {
    let scored_s = scored_time_s(data);
    let n_blocks = ((scored_s / shortest_s) as usize).clamp(1, MOST_BLOCKS).min(n_rows.max(1));
    let mut n_before = 0;
    let mut block = Vec::with_capacity(data.n_rows());
    for row in 0..data.n_rows() {
        block.push((n_before * n_blocks / n_rows.max(1)).min(n_blocks - 1));
        n_before += usize::from(weight.get(row * data.n_outputs).is_some_and(|w| *w > 0.0));
    }
    (block, n_blocks)
}

/// Time covered by all trials together, s.
pub fn scored_time_s(data: &Measurements) -> f64 {
    (1..data.n_rows()).filter(|&row| !data.starts_trial(row)).map(|row| data.time_s[row] - data.time_s[row - 1]).sum()
}
