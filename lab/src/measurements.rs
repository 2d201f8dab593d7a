//! Measurements in memory: inputs, outputs and circumstances, row by row, in SI units and radians.

use crate::tip::TipFrame;

/// What inputs and outputs are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A snake: encoder positions q~ of three lines in m, push positive; the bend vector in rad.
    Snake,
    /// Segments in series: encoder positions of all lines in m, push positive; the bend vectors of all segments in rad.
    Segments,
    /// Joints: commanded and measured positions, in the units that the file names.
    Joints,
    /// Joints with a force: angles in rad, torque in Nm or current in A, all filtered alike.
    Force,
}

/// A table of measurements. Rows are in order of time within each trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements {
    /// Where they come from, for sentences: a file's name.
    pub source: String,
    /// SHA-256 of the file, 64 hexadecimal digits.
    pub sha256: String,
    /// What inputs and outputs are.
    pub quantity: Quantity,
    /// Time of each row, s.
    pub time_s: Vec<f64>,
    /// Inputs of each row (3 for a snake, n for joints), row after row: encoder positions, m, or commanded positions.
    pub inputs: Vec<f64>,
    /// Columns of `inputs`.
    pub n_inputs: usize,
    /// Outputs of each row (2 for a snake: bend vector, rad), row after row; NaN where nothing was measured. A reader leaves the
    /// tip's three coordinates here, m, where a table has them instead of a snake's shape; [`crate::Session`] makes bends of them.
    pub outputs: Vec<f64>,
    /// Columns of `outputs`.
    pub n_outputs: usize,
    /// Number of each row's trial, from 0, never falling; a new one starts the machine afresh.
    pub trial: Vec<u32>,
    /// Loads at the actuators, N, push positive, row after row of one for each input.
    pub loads_n: Option<Vec<f64>>,
    /// What fits make of them.
    pub load_use: LoadUse,
    /// Angle of the flexible stem, rad.
    pub stem_angle_rad: Option<Vec<f64>>,
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<Vec<f64>>,
    /// Standard deviation of each row's outputs, in their unit.
    pub sigma: Option<Vec<f64>>,
    /// Other columns by name, kept for formulas and reports.
    pub extra: Vec<(String, Vec<f64>)>,
    /// What the file calls inputs and outputs.
    pub names: Names,
    /// Rows that only repeated the frame of a camera slower than the file, and count as not measured.
    pub n_held_rows: usize,
    /// Where each recording's tracker stands, of bends that are made of tip positions.
    pub tip_frames: Vec<TipFrame>,
    /// The clock of a second log that the measurements come from, against that of the commands.
    pub clock: Option<SecondClock>,
}

/// A second log's clock against the first one's, as the motion that both saw says.
#[derive(Clone, Debug, PartialEq)]
pub struct SecondClock {
    /// What is to be added to the second log's times in its middle, s.
    pub shift_s: f64,
    /// How much faster the first log's clock runs, as a part of one.
    pub rate: f64,
    /// Share of what was measured that is a straight line of the commands then.
    pub share: f64,
}

/// What fits make of the loads at the actuators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadUse {
    /// They are shown and no more: what a drive estimates from a motor's current.
    Shown,
    /// They count in the likelihood, by cells whose gain is known to be one, give or take this; infinite where nothing is known
    /// of it. Where gains are free, loads cannot tell a stiff snake from cells that read too much.
    Counted {
        /// Largest distance of a cell's gain from one.
        gain_apart: f64,
    },
    /// They count as what drives estimate from a motor's current or torque: all by one common gain, which is one give or take this.
    Estimated {
        /// Standard deviation of the common gain, as the recorded configuration states it.
        gain_sd: f64,
    },
}

impl LoadUse {
    /// Loads of cells that nobody has calibrated.
    pub const UNCALIBRATED: Self = Self::Counted { gain_apart: f64::INFINITY };

    /// What can be made of both together.
    fn of_both(self, other: Self) -> Self {
        match (self, other) {
            (Self::Counted { gain_apart }, Self::Counted { gain_apart: other }) => {
                Self::Counted { gain_apart: gain_apart.max(other) }
            }
            (Self::Estimated { gain_sd }, Self::Estimated { gain_sd: other }) => {
                Self::Estimated { gain_sd: gain_sd.max(other) }
            }
            _ => Self::Shown,
        }
    }
}

/// What a file calls its columns, without units; empty where it uses the lab's own names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Of the inputs.
    pub inputs: Vec<String>,
    /// Of the outputs.
    pub outputs: Vec<String>,
}

impl Names {
    /// Those of segments' bend vectors, component by component, where a file has no names of its own.
    pub(crate) fn of_segments(outputs: impl Iterator<Item = Option<String>>) -> Vec<String> {
        let own = |k: usize| format!("segment {} bend {}", k / 2 + 1, if k.is_multiple_of(2) { "x" } else { "y" });
        outputs.enumerate().map(|(k, name)| name.unwrap_or_else(|| own(k))).collect()
    }

    /// The name of input `k`, from 0: `u1`, or what the file calls it.
    pub fn input(&self, k: usize) -> String {
        self.inputs.get(k).filter(|name| !name.is_empty()).cloned().unwrap_or_else(|| format!("u{}", k + 1))
    }

    /// The name of output `k`, from 0: `y1`, or what the file calls it.
    pub fn output(&self, k: usize) -> String {
        self.outputs.get(k).filter(|name| !name.is_empty()).cloned().unwrap_or_else(|| format!("y{}", k + 1))
    }

    /// A joint by its number, from 1, with the file's own name for what was measured of it.
    pub fn joint(&self, number: usize) -> String {
        match self.outputs.get(number.wrapping_sub(1)).filter(|name| !name.is_empty()) {
            Some(name) => format!("joint {number} ({name})"),
            None => format!("joint {number}"),
        }
    }
}

impl Measurements {
    /// Names of the outputs, as sentences and pictures have them.
    pub(crate) fn output_names(&self) -> Vec<String> {
        match self.quantity {
            Quantity::Snake => ["bend x", "bend y"].map(str::to_owned).to_vec(),
            Quantity::Segments | Quantity::Joints | Quantity::Force => {
                (0..self.n_outputs).map(|k| self.names.output(k)).collect()
            }
        }
    }

    /// Rows.
    pub fn n_rows(&self) -> usize {
        self.time_s.len()
    }

    /// Loads at the actuators that fits count, N, row after row of one for each input.
    pub fn counted_loads_n(&self) -> Option<&[f64]> {
        self.loads_n.as_deref().filter(|_| self.load_use != LoadUse::Shown)
    }

    /// Inputs of a row.
    pub fn input(&self, row: usize) -> &[f64] {
        &self.inputs[row * self.n_inputs..(row + 1) * self.n_inputs]
    }

    /// Outputs of a row.
    pub fn output(&self, row: usize) -> &[f64] {
        &self.outputs[row * self.n_outputs..(row + 1) * self.n_outputs]
    }

    /// Whether a row's outputs were measured, all of them.
    pub fn is_scored(&self, row: usize) -> bool {
        self.output(row).iter().all(|value| value.is_finite())
    }

    /// The first row of a trial, from 0, or of a later one; the number of rows where there is none.
    pub(crate) fn first_row_of(&self, trial: usize) -> usize {
        self.trial.partition_point(|own| (*own as usize) < trial)
    }

    /// Whether a row is the first of its trial.
    pub fn starts_trial(&self, row: usize) -> bool {
        row == 0 || self.trial.get(row) != self.trial.get(row - 1)
    }

    /// Time of all trials together, s.
    pub fn duration_s(&self) -> f64 {
        let pairs = self.time_s.windows(2).zip(self.trial.windows(2));
        pairs.filter(|(_, trial)| trial[0] == trial[1]).map(|(time_s, _)| time_s[1] - time_s[0]).sum()
    }

    /// Several recordings of one machine one after the other, and the name and first trial of each; columns that one of them
    /// lacks are left out. Nothing is said of recordings where there is one.
    pub fn joined(first: Self, others: impl IntoIterator<Item = Self>) -> (Self, Vec<(String, usize)>) {
        let mut all = first;
        let mut recordings = vec![(all.source.clone(), 0)];
        for part in others {
            let n_trials = all.trial.last().map_or(0, |last| last + 1);
            recordings.push((part.source.clone(), n_trials as usize));
            all.source = format!("{}, {}", all.source, part.source);
            all.sha256 = format!("{}, {}", all.sha256, part.sha256);
            all.time_s.extend(&part.time_s);
            all.inputs.extend(&part.inputs);
            all.outputs.extend(&part.outputs);
            all.n_held_rows += part.n_held_rows;
            let frames = part.tip_frames.into_iter();
            all.tip_frames.extend(frames.map(|own| TipFrame { first_trial: own.first_trial + n_trials, ..own }));
            all.trial.extend(part.trial.iter().map(|trial| trial + n_trials));
            let join = |own: &mut Option<Vec<f64>>, other: Option<Vec<f64>>| match (own.take(), other) {
                (Some(mut own_values), Some(other)) => {
                    own_values.extend(other);
                    *own = Some(own_values);
                }
                _ => *own = None,
            };
            join(&mut all.loads_n, part.loads_n);
            all.load_use = all.load_use.of_both(part.load_use);
            join(&mut all.stem_angle_rad, part.stem_angle_rad);
            join(&mut all.temperature_c, part.temperature_c);
            join(&mut all.sigma, part.sigma);
            all.extra.retain_mut(|(name, values)| {
                let other = part.extra.iter().find(|(own, _)| own == name);
                other.is_some_and(|(_, other)| {
                    values.extend(other);
                    true
                })
            });
        }
        if recordings.len() == 1 {
            recordings.clear();
        }
        (all, recordings)
    }

    /// One trial with inputs and outputs and nothing else; loads that are added count, of cells that nobody has calibrated.
    pub fn bare(
        source: String,
        quantity: Quantity,
        time_s: Vec<f64>,
        (inputs, n_inputs): (Vec<f64>, usize),
        (outputs, n_outputs): (Vec<f64>, usize),
    ) -> Self {
        Self {
            source,
            sha256: String::new(),
            quantity,
            trial: vec![0; time_s.len()],
            time_s,
            inputs,
            n_inputs,
            outputs,
            n_outputs,
            loads_n: None,
            load_use: LoadUse::UNCALIBRATED,
            stem_angle_rad: None,
            temperature_c: None,
            sigma: None,
            extra: Vec::new(),
            names: Names::default(),
            n_held_rows: 0,
            tip_frames: Vec::new(),
            clock: None,
        }
    }

    /// A column beside inputs and outputs by its name, as formulas and model files of joints call it; `None` if there is none.
    pub fn beside(&self, name: &str) -> Option<&[f64]> {
        match name {
            "temperature_c" => self.temperature_c.as_deref(),
            other => self.extra(other),
        }
    }

    /// The middle of such a column's range; `None` for one that stands still or is not there.
    pub fn middle_of(&self, name: &str) -> Option<f64> {
        crate::joint::middle(self, name)
    }

    /// Names of the columns beside inputs and outputs.
    pub fn names_beside(&self) -> impl Iterator<Item = &str> {
        let temperature = self.temperature_c.iter().map(|_| "temperature_c");
        temperature.chain(self.extra.iter().map(|(name, _)| name.as_str()))
    }

    /// Another column by its name; `None` if there is none.
    pub(crate) fn extra(&self, name: &str) -> Option<&[f64]> {
        self.extra.iter().find(|(own, _)| own == name).map(|(_, values)| values.as_slice())
    }

    /// The rows of these numbers, in their order.
    pub fn select(&self, rows: &[usize]) -> Self {
        let pick = |values: &[f64], width: usize| -> Vec<f64> {
            rows.iter().flat_map(|&row| values.iter().skip(row * width).take(width).copied()).collect()
        };
        let pick_option = |values: &Option<Vec<f64>>, width: usize| values.as_ref().map(|values| pick(values, width));
        Self {
            source: self.source.clone(),
            sha256: self.sha256.clone(),
            quantity: self.quantity,
            time_s: pick(&self.time_s, 1),
            inputs: pick(&self.inputs, self.n_inputs),
            n_inputs: self.n_inputs,
            outputs: pick(&self.outputs, self.n_outputs),
            n_outputs: self.n_outputs,
            trial: rows.iter().filter_map(|&row| self.trial.get(row).copied()).collect(),
            loads_n: pick_option(&self.loads_n, self.n_inputs),
            load_use: self.load_use,
            stem_angle_rad: pick_option(&self.stem_angle_rad, 1),
            temperature_c: pick_option(&self.temperature_c, 1),
            sigma: pick_option(&self.sigma, 1),
            extra: self.extra.iter().map(|(name, values)| (name.clone(), pick(values, 1))).collect(),
            names: self.names.clone(),
            n_held_rows: self.n_held_rows,
            tip_frames: self.tip_frames.clone(),
            clock: self.clock.clone(),
        }
    }
}
