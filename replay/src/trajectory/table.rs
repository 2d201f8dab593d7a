//! The rows of a trajectory's table: which columns there are, what their units are, and what a row says.

use super::{Knot, MAX_TIME_S, TrajectoryError, TrajectoryLimits};
use crate::steering::{MachinePose, pose_of_bend};
use core::f64::consts::FRAC_PI_2;
use krait_model::Snake;
use nalgebra::Vector2;

/// How far a given tip_z may lie beside the one that follows from tip_x and tip_y, m.
const Z_PATIENCE_M: f64 = 1e-3;
/// Halvings that find the bend of a tip position: to the last bit of a double.
const N_HALVINGS: usize = 60;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Time,
    BendX,
    BendY,
    ThetaL,
    Delta,
    TipX,
    TipY,
    TipZ,
    /// The joint of this index, from 0.
    Joint(usize),
}

/// Name without unit, quantity, and the units that it may have with their size in SI.
type Column = (&'static str, Quantity, &'static [(&'static str, f64)]);

const DEG: f64 = core::f64::consts::PI / 180.0;
const ANGLES: &[(&str, f64)] = &[("_rad", 1.0), ("_deg", DEG)];
const LENGTHS: &[(&str, f64)] = &[("_m", 1.0), ("_mm", 1e-3)];
const COLUMNS: [Column; 8] = [
    ("time", Quantity::Time, &[("_s", 1.0), ("_ms", 1e-3)]),
    ("bend_x", Quantity::BendX, ANGLES),
    ("bend_y", Quantity::BendY, ANGLES),
    ("theta_l", Quantity::ThetaL, ANGLES),
    ("delta", Quantity::Delta, ANGLES),
    ("tip_x", Quantity::TipX, LENGTHS),
    ("tip_y", Quantity::TipY, LENGTHS),
    ("tip_z", Quantity::TipZ, LENGTHS),
];
/// The columns that together say where a snake shall be.
const SETS: [&[Quantity]; 4] = [
    &[Quantity::Time, Quantity::BendX, Quantity::BendY],
    &[Quantity::Time, Quantity::ThetaL, Quantity::Delta],
    &[Quantity::Time, Quantity::TipX, Quantity::TipY],
    &[Quantity::Time, Quantity::TipX, Quantity::TipY, Quantity::TipZ],
];
const SETS_IN_WORDS: &str = "a time and one of bend_x,bend_y | theta_l,delta | tip_x,tip_y[,tip_z], each with its unit as in \
                             time_s,bend_x_deg,bend_y_deg";

/// What the columns of a table are.
pub(super) struct Header {
    columns: Vec<(Quantity, f64)>,
}

impl Header {
    /// Reads the heading of a table for a machine.
    pub fn of(row: &Row<'_>, limits: &TrajectoryLimits<'_>) -> Result<Self, TrajectoryError> {
        let wanted = limits.columns_in_words();
        let mut columns: Vec<(Quantity, f64)> = Vec::new();
        for (idx, field) in row.fields().enumerate() {
            let new = limits.column(field).filter(|(quantity, _)| !columns.iter().any(|(there, _)| there == quantity));
            let Some(column) = new else {
                let is_joint = matches!(limits, TrajectoryLimits::Snake { .. }) && names_a_joint(field);
                let hint = if is_joint { "; for a table of joints give their model with --model FILE" } else { "" };
                return Err(row.refuse(idx + 1, &format!("{wanted}{hint}"), shown(field)));
            };
            columns.push(column);
        }
        let is_set = |set: &[Quantity]| set.len() == columns.len() && columns.iter().all(|(q, _)| set.contains(q));
        let is_whole = match limits {
            TrajectoryLimits::Snake { .. } => SETS.iter().any(|set| is_set(set)),
            // The names are those of joints that there are, and no name twice.
            TrajectoryLimits::Joints { range, .. } => columns.len() == range[0].len() + 1,
        };
        if is_whole { Ok(Self { columns }) } else { Err(row.refuse(columns.len(), &wanted, shown(row.text))) }
    }

    /// The knot that a row gives.
    pub fn knot(
        &self,
        row: &Row<'_>,
        before: Option<&Knot>,
        limits: &TrajectoryLimits<'_>,
    ) -> Result<Knot, TrajectoryError> {
        let n_found = row.fields().count();
        if n_found != self.columns.len() {
            let expected = format!("{} fields as in the heading", self.columns.len());
            return Err(row.refuse(n_found.min(self.columns.len()), &expected, format!("{n_found}")));
        }
        let mut values = Vec::with_capacity(n_found);
        for (idx, (field, (quantity, size))) in row.fields().zip(&self.columns).enumerate() {
            let number = field.parse::<f64>().ok().filter(|number| number.is_finite());
            let Some(number) = number else { return Err(row.refuse(idx + 1, "a finite number", shown(field))) };
            values.push((*quantity, number * size, idx + 1));
        }
        let values = Values { row, values: &values };
        let time = values.of(Quantity::Time);
        let (time_s, time_column) = time.unwrap_or_else(|| unreachable!("a heading without a time is refused"));
        if !(0.0..=MAX_TIME_S).contains(&time_s) || before.is_some_and(|before| time_s <= before.time_s) {
            let expected = before.map_or_else(
                || "a time from 0 to 86400 s".to_owned(),
                |before| format!("a time after {} s and up to 86400 s", before.time_s),
            );
            return Err(row.refuse(time_column, &expected, format!("{time_s} s")));
        }
        let (pose, column) = values.pose(limits)?;
        if let Some(beyond) = limits.pose_beyond(&pose) {
            let joint = beyond.joint_idx.and_then(|idx| values.of(Quantity::Joint(idx)));
            return Err(row.refuse(joint.map_or(column, |(_, column)| column), &beyond.expected, beyond.found));
        }
        Ok(Knot { time_s, pose, vel_per_s: MachinePose::zeros(), line: row.line })
    }
}

impl TrajectoryLimits<'_> {
    /// What a column of this name holds, and the size of its unit in SI.
    fn column(&self, field: &str) -> Option<(Quantity, f64)> {
        let size_of = |unit: &str, units: &[(&str, f64)]| units.iter().find(|(ending, _)| *ending == unit).map(|u| u.1);
        let joints = match self {
            Self::Snake { .. } => None,
            Self::Joints { range, slides, .. } => Some((range[0].len(), if *slides { LENGTHS } else { ANGLES })),
        };
        let known = COLUMNS.iter().filter(|column| joints.is_none() || column.1 == Quantity::Time);
        let named = known.map(|(name, quantity, units)| ((*name).to_owned(), *quantity, *units));
        let (n, units) = joints.unwrap_or((0, &[]));
        let numbered = (0..n).map(|idx| (format!("q{}", idx + 1), Quantity::Joint(idx), units));
        named.chain(numbered).find_map(|(name, quantity, units)| {
            field.strip_prefix(name.as_str()).and_then(|unit| size_of(unit, units)).map(|size| (quantity, size))
        })
    }

    /// Which columns a table has, in words.
    fn columns_in_words(&self) -> String {
        match self {
            Self::Snake { .. } => SETS_IN_WORDS.to_owned(),
            Self::Joints { range, slides, .. } => {
                let units = if *slides { ["m", "mm"] } else { ["rad", "deg"] };
                let names: Vec<String> = (1..=range[0].len()).map(|joint| format!("q{joint}_{}", units[0])).collect();
                format!("time_s,{} (or _{}), as many as the model has joints", names.join(","), units[1])
            }
        }
    }
}

/// Whether a column is one of a table of joints, as q1_deg is.
fn names_a_joint(field: &str) -> bool {
    let number = field.strip_prefix('q').and_then(|rest| rest.split_once('_')).map(|(number, _)| number);
    number.is_some_and(|number| number.parse::<u32>().is_ok())
}

struct Values<'a> {
    row: &'a Row<'a>,
    values: &'a [(Quantity, f64, usize)],
}

impl Values<'_> {
    /// A quantity's value in SI and its column.
    fn of(&self, wanted: Quantity) -> Option<(f64, usize)> {
        self.values.iter().find(|(quantity, ..)| *quantity == wanted).map(|(_, value, column)| (*value, *column))
    }

    /// The pose of a row, and a column to name if it is wrong.
    fn pose(&self, limits: &TrajectoryLimits<'_>) -> Result<(MachinePose, usize), TrajectoryError> {
        match limits {
            TrajectoryLimits::Snake { snake, .. } => {
                self.bend(snake).map(|(bend_rad, column)| (pose_of_bend(bend_rad.into()), column))
            }
            TrajectoryLimits::Joints { .. } => {
                let mut pose = MachinePose::zeros();
                for (quantity, value, _) in self.values {
                    if let Quantity::Joint(idx) = quantity {
                        pose[*idx] = *value;
                    }
                }
                Ok((pose, 1))
            }
        }
    }

    /// The bend vector of a row, and a column to name if it is wrong.
    fn bend(&self, snake: &Snake) -> Result<(Vector2<f64>, usize), TrajectoryError> {
        let pair = |a, b| self.of(a).zip(self.of(b));
        if let Some(((x, column), (y, _))) = pair(Quantity::BendX, Quantity::BendY) {
            return Ok((Vector2::new(x, y), column));
        }
        if let Some(((theta_l, column), (delta, _))) = pair(Quantity::ThetaL, Quantity::Delta) {
            if !(0.0..=FRAC_PI_2).contains(&theta_l) {
                let found = format!("{theta_l} rad");
                return Err(self.row.refuse(column, "theta_l from 0 to pi/2 (straight)", found));
            }
            let (sin, cos) = delta.sin_cos();
            return Ok((Vector2::new(cos, sin) * (FRAC_PI_2 - theta_l), column));
        }
        let Some(((x, column), (y, _))) = pair(Quantity::TipX, Quantity::TipY) else {
            return Err(self.row.refuse(1, SETS_IN_WORDS, shown(self.row.text)));
        };
        let bend = self.bend_of_tip(snake, x, y, column)?;
        if let Some((z, z_column)) = self.of(Quantity::TipZ) {
            let reached = snake.tip_pos_in_base_m(bend).z;
            if (z - reached).abs() > Z_PATIENCE_M {
                let expected =
                    format!("tip_z within 1 mm of {reached:.5} m, where the snake's tip is at this tip_x and tip_y");
                return Err(self.row.refuse(z_column, &expected, format!("{z} m")));
            }
        }
        Ok((bend, column))
    }

    /// The bend up to 90 deg whose tip lies at a distance from the axis: L (1 - cos b) / b grows with b.
    fn bend_of_tip(&self, snake: &Snake, x: f64, y: f64, column: usize) -> Result<Vector2<f64>, TrajectoryError> {
        let distance_m = x.hypot(y);
        if distance_m == 0.0 {
            return Ok(Vector2::zeros());
        }
        // The bend vector's y points away from the base frame's: the bending plane's azimuth is -delta.
        let direction = Vector2::new(x, -y) / distance_m;
        let reach_m = |b: f64| snake.tip_pos_in_base_m(Vector2::new(b, 0.0)).x;
        let (mut low, mut high) = (0.0, FRAC_PI_2);
        if distance_m > reach_m(high) {
            let expected = format!("a tip at most {:.5} m from the axis (90 deg of bend)", reach_m(high));
            return Err(self.row.refuse(column, &expected, format!("{distance_m:.5} m")));
        }
        for _ in 0..N_HALVINGS {
            let middle = 0.5 * (low + high);
            if reach_m(middle) < distance_m { low = middle } else { high = middle }
        }
        Ok(direction * (0.5 * (low + high)))
    }
}

/// A line of a table, to read and to name.
pub(super) struct Row<'a> {
    pub file: &'a str,
    pub line: usize,
    pub text: &'a str,
}

impl<'a> Row<'a> {
    fn fields(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.text.split(',').map(str::trim)
    }

    /// A refusal that names this line.
    pub fn refuse(&self, column: usize, expected: &str, found: String) -> TrajectoryError {
        TrajectoryError { file: self.file.to_owned(), line: self.line, column, expected: expected.to_owned(), found }
    }
}

/// A field as it may stand in a sentence.
fn shown(field: &str) -> String {
    let mut text: String = field.chars().take(40).collect();
    if field.chars().count() > 40 {
        text.push_str("...");
    }
    format!("{text:?}")
}
