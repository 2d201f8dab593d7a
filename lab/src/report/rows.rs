//! Rows as pictures need them: residuals along the axes of the machine, where it was, and where it was going.

use super::MOST_POINTS;
use crate::compare::motion::{self, Motion};
use crate::machine::MachineUnderTest;
use crate::noise::{bounds, largest_range};
use crate::{Measurements, Quantity};

/// Measurements and predictions in the unit of errors.
pub(super) struct Rows<'a> {
    pub data: &'a Measurements,
    /// Name and outputs of each model, the one as given first.
    pub models: Vec<(String, Vec<f64>)>,
    /// Rows with a measurement.
    pub scored: Vec<usize>,
    pub motion: Vec<Motion>,
    /// Length of the error that noise alone makes, rms, in the unit of errors; `None` where it is not known.
    pub floor: Option<f64>,
    /// Unit of errors.
    pub unit: String,
    /// Units of errors to one of outputs.
    pub scale: f64,
    /// Unit of inputs that people read, and how many of it there are to one input unit.
    pub input_unit: (String, f64),
}

/// Below this bend, rad, noise decides what in-plane is.
const PLANE_FROM_RAD: f64 = 0.05;
/// Outputs that are drawn; more curves cannot be told apart.
const MOST_DRAWN: usize = 4;
/// Travel against the motion that is a reversal, as a share of the range.
const REVERSAL: f64 = 0.02;

impl<'a> Rows<'a> {
    pub(super) fn new(
        machine: &dyn MachineUnderTest,
        data: &'a Measurements,
        models: Vec<(String, Vec<f64>)>,
        floor: Option<f64>,
    ) -> Self {
        let (unit, scale) = machine.error_unit();
        let input_unit = match machine.input_unit() {
            "m" => ("mm".to_owned(), 1e3),
            "rad" => ("deg".to_owned(), 180.0 / core::f64::consts::PI),
            other => (other.to_owned(), 1.0),
        };
        Self {
            data,
            models,
            scored: (0..data.n_rows()).filter(|&row| data.is_scored(row)).collect(),
            motion: motion::all(data),
            floor,
            unit: unit.to_owned(),
            scale,
            input_unit,
        }
    }

    /// Whether the machine is a snake.
    pub(super) fn is_snake(&self) -> bool {
        self.data.quantity == Quantity::Snake
    }

    /// Names of the outputs.
    pub(super) fn outputs(&self) -> Vec<String> {
        self.data.output_names()
    }

    /// Names of the axes along which residuals are looked at.
    pub(super) fn axes(&self) -> Vec<String> {
        match self.data.quantity {
            Quantity::Snake => ["in-plane", "out-of-plane"].map(str::to_owned).to_vec(),
            Quantity::Segments | Quantity::Joints | Quantity::Force => self.outputs(),
        }
    }

    /// The outputs that pictures have curves of, those with the largest error, in their own order.
    pub(super) fn drawn(&self) -> Vec<usize> {
        let error = |k: usize| self.scored.iter().map(|&row| self.off(0, row, k).powi(2)).sum::<f64>();
        let mut all: Vec<(f64, usize)> = (0..self.data.n_outputs).map(|k| (error(k), k)).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut drawn: Vec<usize> = all.into_iter().take(MOST_DRAWN).map(|(_, k)| k).collect();
        drawn.sort_unstable();
        drawn
    }

    /// The same of axes along which residuals are looked at; a snake's hysteresis is in its plane.
    pub(super) fn drawn_axes(&self) -> Vec<usize> {
        if self.is_snake() { vec![0] } else { self.drawn() }
    }

    /// What pictures say where not every output has a curve.
    pub(super) fn left_out(&self) -> String {
        let n = self.data.n_outputs;
        if n <= MOST_DRAWN {
            String::new()
        } else {
            format!("; of {n} outputs the {MOST_DRAWN} with the largest error")
        }
    }

    /// The noise floor of one output, where all have the same.
    pub(super) fn floor_of_one(&self) -> Option<f64> {
        self.floor.map(|floor| floor / (self.data.n_outputs as f64).sqrt())
    }

    /// Measured minus predicted, of an output.
    pub(super) fn off(&self, model: usize, row: usize, output: usize) -> f64 {
        self.measured(row, output) - self.predicted(model, row, output)
    }

    /// An output of a model, in the unit of errors.
    pub(super) fn predicted(&self, model: usize, row: usize, output: usize) -> f64 {
        let values = self.models.get(model).map_or(&[][..], |(_, values)| values);
        values.get(row * self.data.n_outputs + output).map_or(f64::NAN, |value| value * self.scale)
    }

    /// A measured output, in the unit of errors.
    pub(super) fn measured(&self, row: usize, output: usize) -> f64 {
        self.data.output(row).get(output).map_or(f64::NAN, |value| value * self.scale)
    }

    /// Measured minus predicted, along an axis of [`Rows::axes`]; NaN where a snake is too straight to have a plane.
    pub(super) fn residual(&self, model: usize, row: usize, axis: usize) -> f64 {
        let off = |k: usize| self.off(model, row, k);
        if !self.is_snake() {
            return off(axis);
        }
        let (x, y) = (self.predicted(0, row, 0), self.predicted(0, row, 1));
        let bend = x.hypot(y);
        if bend < PLANE_FROM_RAD * self.scale {
            return f64::NAN;
        }
        let (along, across) = ((off(0) * x + off(1) * y) / bend, (off(1) * x - off(0) * y) / bend);
        if axis == 0 { along } else { across }
    }

    /// Square of the length of the residual.
    pub(super) fn square(&self, model: usize, row: usize) -> f64 {
        (0..self.data.n_outputs).map(|k| self.off(model, row, k).powi(2)).sum()
    }

    /// Where the machine is along an axis: a snake's bend, a joint's own position.
    pub(super) fn position(&self, row: usize, axis: usize) -> f64 {
        if self.is_snake() {
            self.predicted(0, row, 0).hypot(self.predicted(0, row, 1))
        } else {
            self.predicted(0, row, axis)
        }
    }

    /// What [`Rows::position`] is called.
    pub(super) fn position_name(&self) -> String {
        let what = if self.is_snake() { "predicted bend" } else { "predicted position" };
        format!("{what} ({})", self.unit)
    }

    /// Names of the two directions.
    pub(super) fn directions(&self) -> [&'static str; 2] {
        if self.is_snake() { ["loading", "unloading"] } else { ["rising", "falling"] }
    }

    /// Direction of motion along an axis (1, -1; 0 before the first motion) and travel since the last reversal, row by row.
    pub(super) fn travel(&self, axis: usize) -> Vec<(i8, f64)> {
        let n = self.data.n_rows();
        let all = (0..n).map(|row| self.position(row, axis));
        let (low, high) = bounds(all);
        let threshold = REVERSAL * (high - low);
        let (mut extreme, mut turn, mut direction) = (f64::NAN, f64::NAN, 0_i8);
        let mut found = Vec::with_capacity(n);
        for row in 0..n {
            let own = self.position(row, axis);
            if self.data.starts_trial(row) || extreme.is_nan() {
                (extreme, turn, direction) = (own, own, 0);
            }
            let moved = own - extreme;
            if direction == 0 && moved.abs() > threshold {
                (extreme, direction) = (own, moved.signum() as i8);
            } else if moved * f64::from(direction) > 0.0 {
                extreme = own;
            } else if -moved * f64::from(direction) > threshold {
                (turn, extreme, direction) = (extreme, own, -direction);
            }
            found.push((direction, (own - turn).abs()));
        }
        found
    }

    /// Every n-th of these rows, so that a curve has at most [`MOST_POINTS`] points.
    pub(super) fn thinned(rows: &[usize]) -> Vec<usize> {
        rows.iter().copied().step_by(rows.len().div_ceil(MOST_POINTS).max(1)).collect()
    }

    /// Scored rows of the stretch of `length_s` with the largest error of the model as given.
    pub(super) fn worst(&self, length_s: f64) -> Vec<usize> {
        let (mut first, mut sum) = (0, 0.0);
        let mut best = (0.0, 0..0);
        for (end, &row) in self.scored.iter().enumerate() {
            sum += self.square(0, row);
            let is_apart = |first: usize| {
                let start = self.scored[first];
                self.data.trial[start] != self.data.trial[row]
                    || self.data.time_s[row] - self.data.time_s[start] > length_s
            };
            while is_apart(first) {
                sum -= self.square(0, self.scored[first]);
                first += 1;
            }
            if sum > best.0 {
                best = (sum, first..end + 1);
            }
        }
        self.scored.get(best.1).unwrap_or_default().to_vec()
    }

    /// Whether the inputs move at all.
    pub(super) fn moves(&self) -> bool {
        largest_range(self.data) > 0.0
    }
}
