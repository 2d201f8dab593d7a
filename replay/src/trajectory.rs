//! Trajectories from a table: time, and where the snake shall be, as a smooth curve of the bend vector.
//!
//! ```text
//! # comments and empty lines are skipped
//! time_s, bend_x_deg, bend_y_deg
//! 0,      0,          0
//! 2,      30,         0
//! 4,      0,          30
//! ```
//!
//! The columns after the time are one of: `bend_x`, `bend_y` (the bend vector b (cos delta, sin delta)); `theta_l`, `delta` (the
//! paper's angles); `tip_x`, `tip_y` and, if wanted, `tip_z` (the end disk's centre in the base frame). Angles end in `_rad`
//! or `_deg`, lengths in `_m` or `_mm`, times in `_s` or `_ms`; the order is free. Between rows the curve is a cubic through
//! them, at rest at both ends.
//!
//! A table comes from outside: what is wrong with it is said with file, line and column, before anything moves.

use crate::program::PERIOD_NS;
use core::f64::consts::FRAC_PI_2;
use krait_model::Snake;
use nalgebra::Vector2;
use std::path::Path;

/// Longest table that is read, bytes.
const MAX_BYTES: u64 = 64 * 1024 * 1024;
/// Longest trajectory, s: a day.
const MAX_TIME_S: f64 = 86_400.0;
/// How far a given tip_z may lie beside the one that follows from tip_x and tip_y, m.
const Z_PATIENCE_M: f64 = 1e-3;
/// Halvings that find the bend of a tip position: to the last bit of a double.
const N_HALVINGS: usize = 60;

/// A table was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("trajectory {file}, line {line}, column {column}: expected {expected}, found {found}")]
pub struct TrajectoryError {
    /// The file.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1.
    pub column: usize,
    /// What was expected.
    pub expected: String,
    /// What stands there.
    pub found: String,
}

/// What a trajectory may ask for.
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryLimits {
    /// Largest bend, rad.
    pub max_bend_rad: f64,
    /// Fastest change of the bend vector, rad/s.
    pub max_bend_vel_rad_per_s: f64,
}

/// A smooth curve of the bend vector over time, at rest at both ends.
#[derive(Clone, Debug)]
pub struct Trajectory {
    knots: Vec<Knot>,
    from_s: f64,
    to_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Knot {
    time_s: f64,
    bend_rad: Vector2<f64>,
    bend_vel_rad_per_s: Vector2<f64>,
    line: usize,
}

impl Trajectory {
    /// Reads a table.
    ///
    /// # Errors
    /// [`TrajectoryError`] for the first field that is wrong, or where the curve asks for more than the limits allow.
    pub fn load(path: &Path, snake: &Snake, limits: &TrajectoryLimits) -> Result<Self, TrajectoryError> {
        let file = path.display().to_string();
        let whole = |expected: &str, found: String| TrajectoryError {
            file: file.clone(),
            line: 1,
            column: 1,
            expected: expected.to_owned(),
            found,
        };
        let bytes = krait_ipc::input::bytes(path, MAX_BYTES)
            .map_err(|e| whole("a file of at most 64 MB that can be read", e.to_string()))?;
        Self::parse(&file, &bytes, snake, limits)
    }

    /// Reads a table from memory; `file` names it in error sentences.
    ///
    /// # Errors
    /// As [`Trajectory::load`].
    pub fn parse(file: &str, bytes: &[u8], snake: &Snake, limits: &TrajectoryLimits) -> Result<Self, TrajectoryError> {
        let (mut header, mut knots) = (None, Vec::<Knot>::new());
        for (line_idx, line) in bytes.split(|b| *b == b'\n').enumerate() {
            let text = String::from_utf8_lossy(line);
            let row = Row { file, line: line_idx + 1, text: text.trim() };
            if row.text.is_empty() || row.text.starts_with('#') {
                continue;
            }
            match &header {
                None => header = Some(Header::of(&row)?),
                Some(header) => knots.push(header.knot(&row, knots.last(), snake, limits)?),
            }
        }
        if knots.len() < 2 {
            let row = Row { file, line: bytes.split(|b| *b == b'\n').count(), text: "" };
            return Err(row.refuse(1, "a heading and at least two rows", format!("{} rows", knots.len())));
        }
        give_tangents(&mut knots);
        let (from_s, to_s) = (knots[0].time_s, knots[knots.len() - 1].time_s);
        let trajectory = Self { knots, from_s, to_s };
        trajectory.check(file, limits)?;
        Ok(trajectory)
    }

    /// The part between two times of the table, s; none if nothing of it lies there.
    pub fn between(mut self, from_s: f64, to_s: f64) -> Option<Self> {
        (self.from_s, self.to_s) = (self.from_s.max(from_s), self.to_s.min(to_s));
        (self.from_s < self.to_s).then_some(self)
    }

    /// Where it begins, rad.
    pub fn start_bend_rad(&self) -> [f64; 2] {
        self.at(self.from_s).0.into()
    }

    /// Its length, s.
    pub fn length_s(&self) -> f64 {
        self.to_s - self.from_s
    }

    /// Samples at 1 kHz, both ends included.
    pub fn n_samples(&self) -> u64 {
        (self.length_s() * 1e9 / PERIOD_NS as f64).floor() as u64 + 1
    }

    /// Bend vector, rad, and its rate, rad/s, of the n-th sample, from 0; `None` after the last.
    pub fn sample(&self, n: u64) -> Option<(Vector2<f64>, Vector2<f64>)> {
        (n < self.n_samples()).then(|| self.at(self.from_s + n as f64 * PERIOD_NS as f64 * 1e-9))
    }

    /// The cubic of Hermite between the two knots around a time.
    fn at(&self, time_s: f64) -> (Vector2<f64>, Vector2<f64>) {
        let after = self.knots.partition_point(|knot| knot.time_s <= time_s).clamp(1, self.knots.len() - 1);
        let (a, b) = (&self.knots[after - 1], &self.knots[after]);
        let h_s = b.time_s - a.time_s;
        let u = ((time_s - a.time_s) / h_s).clamp(0.0, 1.0);
        let (va, vb) = (a.bend_vel_rad_per_s * h_s, b.bend_vel_rad_per_s * h_s);
        let rise = b.bend_rad - a.bend_rad;
        let bend = a.bend_rad + (va + (rise * 3.0 - va * 2.0 - vb + (va + vb - rise * 2.0) * u) * u) * u;
        let slope = va + ((rise * 3.0 - va * 2.0 - vb) * 2.0 + (va + vb - rise * 2.0) * (3.0 * u)) * u;
        (bend, slope / h_s)
    }

    fn check(&self, file: &str, limits: &TrajectoryLimits) -> Result<(), TrajectoryError> {
        for n in 0..self.n_samples() {
            let time_s = self.from_s + n as f64 * PERIOD_NS as f64 * 1e-9;
            let (bend, vel) = self.at(time_s);
            let line = self.knots.iter().find(|knot| knot.time_s >= time_s).map_or(0, |knot| knot.line);
            let row = Row { file, line, text: "" };
            if vel.norm() > limits.max_bend_vel_rad_per_s {
                let expected = format!("a motion up to this row of at most {} rad/s", limits.max_bend_vel_rad_per_s);
                return Err(row.refuse(1, &expected, format!("{:.3} rad/s at {time_s:.3} s", vel.norm())));
            }
            if bend.norm() > limits.max_bend_rad {
                let expected = format!("a curve up to this row of at most {} rad of bend", limits.max_bend_rad);
                return Err(row.refuse(1, &expected, format!("{:.4} rad at {time_s:.3} s", bend.norm())));
            }
        }
        Ok(())
    }
}

/// Tangents of Catmull and Rom for unequal steps; at rest at both ends.
fn give_tangents(knots: &mut [Knot]) {
    for idx in 1..knots.len().saturating_sub(1) {
        let (a, b, c) = (knots[idx - 1], knots[idx], knots[idx + 1]);
        let (before_s, after_s) = (b.time_s - a.time_s, c.time_s - b.time_s);
        let (before, after) = ((b.bend_rad - a.bend_rad) / before_s, (c.bend_rad - b.bend_rad) / after_s);
        knots[idx].bend_vel_rad_per_s = (before * after_s + after * before_s) / (before_s + after_s);
    }
}

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
}

/// Name without unit, quantity, and the units that it may have with their size in SI.
type Column = (&'static str, Quantity, &'static [(&'static str, f64)]);

const DEG: f64 = core::f64::consts::PI / 180.0;
const COLUMNS: [Column; 8] = [
    ("time", Quantity::Time, &[("_s", 1.0), ("_ms", 1e-3)]),
    ("bend_x", Quantity::BendX, &[("_rad", 1.0), ("_deg", DEG)]),
    ("bend_y", Quantity::BendY, &[("_rad", 1.0), ("_deg", DEG)]),
    ("theta_l", Quantity::ThetaL, &[("_rad", 1.0), ("_deg", DEG)]),
    ("delta", Quantity::Delta, &[("_rad", 1.0), ("_deg", DEG)]),
    ("tip_x", Quantity::TipX, &[("_m", 1.0), ("_mm", 1e-3)]),
    ("tip_y", Quantity::TipY, &[("_m", 1.0), ("_mm", 1e-3)]),
    ("tip_z", Quantity::TipZ, &[("_m", 1.0), ("_mm", 1e-3)]),
];
/// The columns that together say where the snake shall be.
const SETS: [&[Quantity]; 4] = [
    &[Quantity::Time, Quantity::BendX, Quantity::BendY],
    &[Quantity::Time, Quantity::ThetaL, Quantity::Delta],
    &[Quantity::Time, Quantity::TipX, Quantity::TipY],
    &[Quantity::Time, Quantity::TipX, Quantity::TipY, Quantity::TipZ],
];
const SETS_IN_WORDS: &str = "a time and one of bend_x,bend_y | theta_l,delta | tip_x,tip_y[,tip_z], each with its unit as in \
                             time_s,bend_x_deg,bend_y_deg";

struct Header {
    columns: Vec<(Quantity, f64)>,
}

impl Header {
    fn of(row: &Row<'_>) -> Result<Self, TrajectoryError> {
        let mut columns: Vec<(Quantity, f64)> = Vec::new();
        for (idx, field) in row.fields().enumerate() {
            let known = COLUMNS.iter().find_map(|(name, quantity, units)| {
                let unit = field.strip_prefix(name)?;
                units.iter().find(|(ending, _)| *ending == unit).map(|(_, size)| (*quantity, *size))
            });
            let new = known.filter(|(quantity, _)| !columns.iter().any(|(there, _)| there == quantity));
            let Some(column) = new else { return Err(row.refuse(idx + 1, SETS_IN_WORDS, shown(field))) };
            columns.push(column);
        }
        let is_set = |set: &&[Quantity]| set.len() == columns.len() && columns.iter().all(|(q, _)| set.contains(q));
        if !SETS.iter().any(is_set) {
            return Err(row.refuse(columns.len(), SETS_IN_WORDS, shown(row.text)));
        }
        Ok(Self { columns })
    }

    fn knot(
        &self,
        row: &Row<'_>,
        before: Option<&Knot>,
        snake: &Snake,
        limits: &TrajectoryLimits,
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
        let (time_s, time_column) = values.of(Quantity::Time).unwrap_or_default();
        if !(0.0..=MAX_TIME_S).contains(&time_s) || before.is_some_and(|before| time_s <= before.time_s) {
            let expected = before.map_or_else(
                || "a time from 0 to 86400 s".to_owned(),
                |before| format!("a time after {} s and up to 86400 s", before.time_s),
            );
            return Err(row.refuse(time_column, &expected, format!("{time_s} s")));
        }
        let (bend_rad, column) = values.bend(snake)?;
        if bend_rad.norm() > limits.max_bend_rad {
            let expected = format!("a bend of at most {} rad", limits.max_bend_rad);
            return Err(row.refuse(column, &expected, format!("{:.4} rad", bend_rad.norm())));
        }
        Ok(Knot { time_s, bend_rad, bend_vel_rad_per_s: Vector2::zeros(), line: row.line })
    }
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

struct Row<'a> {
    file: &'a str,
    line: usize,
    text: &'a str,
}

impl<'a> Row<'a> {
    fn fields(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.text.split(',').map(str::trim)
    }

    fn refuse(&self, column: usize, expected: &str, found: String) -> TrajectoryError {
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

#[cfg(test)]
mod tests {
    use super::*;
    use krait_model::MachineParameters;

    const LIMITS: TrajectoryLimits = TrajectoryLimits { max_bend_rad: 1.3, max_bend_vel_rad_per_s: 2.0 };

    fn parse(text: &str) -> Result<Trajectory, TrajectoryError> {
        let snake = Snake::new(&MachineParameters::default()).expect("a snake");
        Trajectory::parse("path.csv", text.as_bytes(), &snake, &LIMITS)
    }

    #[test]
    fn the_same_curve_in_every_set_of_columns_is_the_same() {
        let snake = Snake::new(&MachineParameters::default()).expect("a snake");
        let bends = [(0.0, 0.0), (0.4, 0.3), (-0.2, 0.6)];
        let mut tables = [
            "time_s,bend_x_rad,bend_y_rad\n".to_owned(),
            "time_ms,bend_x_deg,bend_y_deg\n".to_owned(),
            "time_s,theta_l_deg,delta_rad\n".to_owned(),
            "tip_y_mm,tip_x_mm,time_s\n".to_owned(),
            "time_s,tip_x_m,tip_y_m,tip_z_m\n".to_owned(),
        ];
        for (k, (x, y)) in bends.into_iter().enumerate() {
            let tip = snake.tip_pos_in_base_m(Vector2::new(x, y));
            let theta_l = FRAC_PI_2 - f64::hypot(x, y);
            tables[0] += &format!("{k},{x},{y}\n");
            tables[1] += &format!("{},{},{}\n", 1000 * k, x.to_degrees(), y.to_degrees());
            tables[2] += &format!("{k},{},{}\n", theta_l.to_degrees(), f64::atan2(y, x));
            tables[3] += &format!("{},{},{k}\n", tip.y * 1e3, tip.x * 1e3);
            tables[4] += &format!("{k},{},{},{}\n", tip.x, tip.y, tip.z);
        }
        let first = parse(&tables[0]).expect("a table");
        assert_eq!(first.n_samples(), 2001);
        for table in &tables[1..] {
            let other = parse(table).expect(table);
            for n in 0..2001 {
                let (a, b) = (first.sample(n).expect("there").0, other.sample(n).expect("there").0);
                assert!((a - b).norm() < 1e-9, "{table}: {a} {b}");
            }
        }
    }

    #[test]
    fn the_curve_goes_through_its_rows_is_smooth_and_rests_at_both_ends() {
        let curve = parse("time_s,bend_x_rad,bend_y_rad\n0,0,0\n1,0.5,0\n2,0.5,0.5\n").expect("a table");
        let at = |n| curve.sample(n).expect("there");
        assert!((at(1000).0 - Vector2::new(0.5, 0.0)).norm() < 1e-12);
        assert!(at(0).1.norm() < 1e-12 && at(2000).1.norm() < 1e-9);
        for n in 1..2000 {
            let slope = (at(n + 1).0 - at(n - 1).0) / 2e-3;
            // At a row the curve's second derivative jumps, by a few rad/s2, and a quotient over 2 ms sees half of it.
            let within = if n == 1000 { 5e-3 } else { 1e-4 };
            assert!((slope - at(n).1).norm() < within, "{n}: {slope}");
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_file_line_and_column() {
        for (text, words) in [
            ("time_s,bend_x_rad\n0,0\n", "line 1, column 2: expected a time and one of"),
            ("time_s,bend_x,bend_y_rad\n", "line 1, column 2: expected a time and one of"),
            (
                "time_s,bend_x_rad,bend_y_rad\n0,0,0\n1,zero,0\n",
                "line 3, column 2: expected a finite number, found \"zero\"",
            ),
            ("time_s,bend_x_rad,bend_y_rad\n0,0,0\n1,inf,0\n", "line 3, column 2: expected a finite number"),
            ("time_s,bend_x_rad,bend_y_rad\n0,0,0\n0,0,0\n", "line 3, column 1: expected a time after 0 s"),
            ("time_s,bend_x_rad,bend_y_rad\n0,0\n", "line 2, column 2: expected 3 fields"),
            ("time_s,bend_x_rad,bend_y_rad\n0,0,0\n9,1.4,0\n", "line 3, column 2: expected a bend of at most 1.3 rad"),
            ("time_s,bend_x_rad,bend_y_rad\n0,0,0\n0.1,1,0\n", "line 3, column 1: expected a motion up to this row"),
            ("time_s,tip_x_mm,tip_y_mm\n0,0,0\n9,40,0\n", "line 3, column 2: expected a tip at most"),
            ("time_s,tip_x_mm,tip_y_mm,tip_z_mm\n0,0,0,5\n", "line 2, column 4: expected tip_z within 1 mm"),
            ("time_s,theta_l_rad,delta_rad\n0,1.7,0\n", "line 2, column 2: expected theta_l from 0 to pi/2"),
            ("", "line 1, column 1: expected a heading and at least two rows"),
        ] {
            let sentence = parse(text).expect_err(text).to_string();
            assert!(sentence.starts_with("trajectory path.csv, "), "{sentence}");
            assert!(sentence.contains(words), "{words:?} is not in: {sentence}");
        }
    }
}
