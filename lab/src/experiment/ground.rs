//! Where an experiment may move: a snake within the limits that a chain has by default, a joint within what the data show of it.

use super::moves::{Move, Pen, of_joint, of_snake};
use crate::diagnose::Diagnosis;
use crate::noise::bounds;
use crate::{LabError, Measurements, Names, Quantity};
use krait_model::model_file::{Joints, Machine, SnakeMachine};
use krait_model::{Chain, Circumstances, KnownColumns, Snake};
use nalgebra::Vector2;

/// Time between a snake's rows, s.
const SNAKE_PERIOD_S: f64 = 0.05;
/// Shortest and longest time between rows of joints, s.
const JOINT_PERIODS_S: [f64; 2] = [0.01, 0.05];
/// Rest before the first motion, s: a snake's homing ends in this time.
const LEAD_S: f64 = 5.0;
/// Rest between two moves, s.
const BETWEEN_S: f64 = 2.0;
/// The fastest speed of a joint is that of its fastest hundredth: a command that jumps says nothing of speed.
const FASTEST: f64 = 0.99;

/// A machine that an experiment can move.
pub(super) struct Ground {
    body: Body,
    /// Time between rows, s.
    pub period_s: f64,
    /// Where every move begins and ends.
    home: Vec<f64>,
    /// Measured rows a second of the data.
    measured_per_s: f64,
    names: Names,
}

/// What moves.
pub(super) enum Body {
    /// The snake, as a model without effects.
    Snake(SnakeMachine),
    /// Joints.
    Joints {
        /// Their units.
        joints: Joints,
        /// The one that moves, from 0.
        joint: usize,
        /// Lowest and highest command of each, in its unit.
        ranges: Vec<[f64; 2]>,
        /// Fastest command of each, in its unit a second.
        fastest: Vec<f64>,
    },
}

impl Ground {
    /// The ground of a machine; `None` where the lab cannot move it, or the joint (from 1) stood still.
    pub fn new(machine: &Machine, data: &Measurements, diagnosis: &Diagnosis, joint: Option<usize>) -> Option<Self> {
        let seconds = data.duration_s();
        let n_measured = (0..data.n_rows()).filter(|row| data.is_scored(*row)).count();
        let measured_per_s = n_measured as f64 / seconds;
        let names = data.names.clone();
        match machine {
            Machine::Snake(snake) => Some(Self {
                body: Body::Snake(snake.clone()),
                period_s: SNAKE_PERIOD_S,
                home: vec![0.0, 0.0],
                measured_per_s,
                names,
            }),
            Machine::Joints(joints) => {
                let column = |k: usize| data.inputs.iter().skip(k).step_by(data.n_inputs).copied();
                let ranges: Vec<[f64; 2]> = (0..joints.n).map(|k| bounds(column(k)).into()).collect();
                let fastest: Vec<f64> = (0..joints.n).map(|k| fastest(data, k)).collect();
                let moves = |k: &usize| ranges[*k][1] > ranges[*k][0] && fastest[*k] > 0.0;
                let first = diagnosis.effects.iter().chain(&diagnosis.partial).find_map(|effect| effect.joint);
                let joint = match joint.or(first) {
                    Some(number) => number - 1,
                    None => (0..joints.n).find(moves)?,
                };
                let period_s = (seconds / data.n_rows() as f64).clamp(JOINT_PERIODS_S[0], JOINT_PERIODS_S[1]);
                moves(&joint).then(|| Self {
                    home: ranges.iter().map(|[low, high]| 0.5 * (low + high)).collect(),
                    body: Body::Joints { joints: joints.clone(), joint, ranges, fastest },
                    period_s,
                    measured_per_s,
                    names,
                })
            }
            Machine::Segments(_) | Machine::Force(_) => None,
        }
    }

    /// What moves.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// What the data's own file calls an input, from 0.
    pub fn input_name(&self, k: usize) -> String {
        self.names.input(k)
    }

    /// Every move that this machine may make.
    pub fn moves(&self) -> Vec<Move> {
        match &self.body {
            Body::Snake(_) => of_snake(self.period_s),
            Body::Joints { joint, ranges, fastest, .. } => of_joint(*joint, ranges, fastest, self.period_s),
        }
    }

    /// Moves one after the other, with a rest before each.
    pub fn joined(&self, moves: &[Move], picked: &[usize]) -> Vec<Vec<f64>> {
        let mut path = self.rested(LEAD_S);
        for &k in picked {
            path.extend(moves[k].path.iter().skip(1).cloned());
            path.extend(self.rested(BETWEEN_S).into_iter().skip(1));
        }
        path
    }

    /// One move alone, as a trial: with a rest before it.
    pub fn alone(&self, own: &Move) -> Vec<Vec<f64>> {
        let mut path = self.rested(BETWEEN_S);
        path.extend(own.path.iter().skip(1).cloned());
        path
    }

    fn rested(&self, seconds: f64) -> Vec<Vec<f64>> {
        let mut pen = Pen::new(&self.home, self.period_s);
        pen.rest(seconds);
        pen.into_path()
    }

    /// How long a path takes, s.
    pub fn seconds(&self, path: &[Vec<f64>]) -> f64 {
        path.len().saturating_sub(1) as f64 * self.period_s
    }

    /// Rows that will be measured for each row of a path, at the data's own rate.
    pub fn measured_for_each_row(&self) -> f64 {
        self.measured_per_s * self.period_s
    }

    /// Values that will be measured on a path: two for each row of a snake, one for each row of a joint.
    pub fn measured_values(&self, path: &[Vec<f64>]) -> f64 {
        let of_a_row = match &self.body {
            Body::Snake(_) => 2.0,
            Body::Joints { .. } => 1.0,
        };
        of_a_row * self.measured_for_each_row() * path.len() as f64
    }

    /// A path as measurements without outputs; a snake's encoders as a compensated elastic snake is told.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model makes no chain.
    pub fn measurements(&self, path: &[Vec<f64>]) -> Result<Measurements, LabError> {
        let n = path.len();
        let time_s: Vec<f64> = (0..n).map(|row| row as f64 * self.period_s).collect();
        let (quantity, inputs, n_inputs, n_outputs) = match &self.body {
            Body::Snake(machine) => (Quantity::Snake, encoders(machine, path, &time_s)?, 3, 2),
            Body::Joints { joints, .. } => (Quantity::Joints, path.concat(), joints.n, joints.n),
        };
        let outputs = (vec![0.0; n_outputs * n], n_outputs);
        Ok(Measurements::bare("the experiment".to_owned(), quantity, time_s, (inputs, n_inputs), outputs))
    }
}

/// Encoder positions of a path of bend vectors, m, row after row of 3.
fn encoders(machine: &SnakeMachine, path: &[Vec<f64>], time_s: &[f64]) -> Result<Vec<f64>, LabError> {
    let columns = KnownColumns { time: true, ..KnownColumns::default() };
    let chain = Chain::new(&machine.parameters, machine.settings, &[], columns)?;
    let mut compensator = chain.compensator()?;
    let step = |(bend, time_s): (&Vec<f64>, &f64)| {
        let command = compensator.step(Vector2::new(bend[0], bend[1]), &Circumstances::at(*time_s));
        [command.q_tilde_m.x, command.q_tilde_m.y, command.q_tilde_m.z]
    };
    Ok(path.iter().zip(time_s).flat_map(step).collect())
}

/// The snake of a model, for the positions of its tip.
///
/// # Errors
/// [`LabError::Chain`] for dimensions that a model file would refuse.
pub(super) fn snake(machine: &SnakeMachine) -> Result<Snake, LabError> {
    Snake::new(&machine.parameters).map_err(|error| LabError::Chain(error.into()))
}

/// Speed of a joint's command, in its unit a second: of the rows between which it moves, all but the fastest hundredth are slower.
fn fastest(data: &Measurements, k: usize) -> f64 {
    let speed = |row: usize| {
        let (way, time_s) = (data.input(row)[k] - data.input(row - 1)[k], data.time_s[row] - data.time_s[row - 1]);
        way.abs() / time_s
    };
    let rows = (1..data.n_rows()).filter(|row| !data.starts_trial(*row));
    let mut speeds: Vec<f64> = rows.map(speed).filter(|speed| *speed > 0.0 && speed.is_finite()).collect();
    speeds.sort_by(f64::total_cmp);
    let place = (FASTEST * speeds.len() as f64) as usize;
    speeds.get(place.min(speeds.len().saturating_sub(1))).copied().unwrap_or(0.0)
}
