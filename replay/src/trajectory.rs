//! Trajectories from a table: time, and where the snake or the joints shall be, as a smooth curve.
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
//! or `_deg`, lengths in `_m` or `_mm`, times in `_s` or `_ms`; the order is free. Joints have the columns `q1` to `qn`, all of
//! them. Between rows the curve is a cubic through them, at rest at both ends.
//!
//! A table comes from outside: what is wrong with it is said with file, line and column, before anything moves.

mod table;

use crate::program::PERIOD_NS;
use crate::steering::MachinePose;
use krait_model::Snake;
use std::path::Path;
use table::{Header, Row};

/// Longest table that is read, bytes.
const MAX_BYTES: u64 = 64 * 1024 * 1024;
/// Longest trajectory, s: a day.
const MAX_TIME_S: f64 = 86_400.0;

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

/// What a trajectory may ask for, of which machine.
#[derive(Clone, Copy, Debug)]
pub enum TrajectoryLimits<'a> {
    /// Of a snake.
    Snake {
        /// The kinematics.
        snake: &'a Snake,
        /// Largest bend, rad.
        max_bend_rad: f64,
        /// Fastest change of the bend vector, rad/s.
        max_bend_vel_rad_per_s: f64,
    },
    /// Of joints.
    Joints {
        /// Least and largest position of each, rad (m of sliding joints); as many as there are joints, at most
        /// [`krait_ipc::message::MAX_JOINTS`].
        range: [&'a [f64]; 2],
        /// Fastest motion of a joint, rad/s (m/s).
        max_vel_per_s: f64,
        /// Whether their positions are lengths.
        slides: bool,
    },
}

/// A smooth curve of a machine's pose over time, at rest at both ends.
#[derive(Clone, Debug)]
pub struct Trajectory {
    knots: Vec<Knot>,
    from_s: f64,
    to_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Knot {
    time_s: f64,
    pose: MachinePose,
    vel_per_s: MachinePose,
    line: usize,
}

impl Trajectory {
    /// Reads a table.
    ///
    /// # Errors
    /// [`TrajectoryError`] for the first field that is wrong, or where the curve asks for more than the limits allow.
    pub fn load(path: &Path, limits: &TrajectoryLimits<'_>) -> Result<Self, TrajectoryError> {
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
        Self::parse(&file, &bytes, limits)
    }

    /// Reads a table from memory; `file` names it in error sentences.
    ///
    /// # Errors
    /// As [`Trajectory::load`].
    pub fn parse(file: &str, bytes: &[u8], limits: &TrajectoryLimits<'_>) -> Result<Self, TrajectoryError> {
        let bytes = krait_ipc::input::without_mark(bytes);
        let (mut header, mut knots) = (None, Vec::<Knot>::new());
        for (line_idx, line) in bytes.split(|b| *b == b'\n').enumerate() {
            let text = String::from_utf8_lossy(line);
            let row = Row { file, line: line_idx + 1, text: text.trim() };
            if row.text.is_empty() || row.text.starts_with('#') {
                continue;
            }
            match &header {
                None => header = Some(Header::of(&row, limits)?),
                Some(header) => knots.push(header.knot(&row, knots.last(), limits)?),
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

    /// Where it begins.
    pub fn start(&self) -> MachinePose {
        self.at(self.from_s).0
    }

    /// Its length, s.
    pub fn length_s(&self) -> f64 {
        self.to_s - self.from_s
    }

    /// Samples at 1 kHz, both ends included.
    pub fn n_samples(&self) -> u64 {
        (self.length_s() * 1e9 / PERIOD_NS as f64).floor() as u64 + 1
    }

    /// Pose and its rate, 1/s, of the n-th sample, from 0; `None` after the last.
    pub fn sample(&self, n: u64) -> Option<(MachinePose, MachinePose)> {
        (n < self.n_samples()).then(|| self.at(self.from_s + n as f64 * PERIOD_NS as f64 * 1e-9))
    }

    /// The cubic of Hermite between the two knots around a time.
    fn at(&self, time_s: f64) -> (MachinePose, MachinePose) {
        let after = self.knots.partition_point(|knot| knot.time_s <= time_s).clamp(1, self.knots.len() - 1);
        let (a, b) = (&self.knots[after - 1], &self.knots[after]);
        let h_s = b.time_s - a.time_s;
        let u = ((time_s - a.time_s) / h_s).clamp(0.0, 1.0);
        let (va, vb) = (a.vel_per_s * h_s, b.vel_per_s * h_s);
        let rise = b.pose - a.pose;
        let pose = a.pose + (va + (rise * 3.0 - va * 2.0 - vb + (va + vb - rise * 2.0) * u) * u) * u;
        let slope = va + ((rise * 3.0 - va * 2.0 - vb) * 2.0 + (va + vb - rise * 2.0) * (3.0 * u)) * u;
        (pose, slope / h_s)
    }

    fn check(&self, file: &str, limits: &TrajectoryLimits<'_>) -> Result<(), TrajectoryError> {
        for n in 0..self.n_samples() {
            let time_s = self.from_s + n as f64 * PERIOD_NS as f64 * 1e-9;
            let (pose, vel_per_s) = self.at(time_s);
            if let Some(beyond) = limits.vel_beyond(&vel_per_s).or_else(|| limits.curve_beyond(&pose)) {
                let line = self.knots.iter().find(|knot| knot.time_s >= time_s).map_or(0, |knot| knot.line);
                let row = Row { file, line, text: "" };
                return Err(row.refuse(1, &beyond.expected, format!("{} at {time_s:.3} s", beyond.found)));
            }
        }
        Ok(())
    }
}

/// What lies outside of the limits.
struct Beyond {
    expected: String,
    found: String,
    /// The joint, from 0, where it is one joint's position.
    joint_idx: Option<usize>,
}

impl TrajectoryLimits<'_> {
    /// What of a pose lies outside. Written so that NaN does.
    fn pose_beyond(&self, pose: &MachinePose) -> Option<Beyond> {
        match *self {
            Self::Snake { max_bend_rad, .. } => {
                let bend_rad = pose[0].hypot(pose[1]);
                (!(0.0..=max_bend_rad).contains(&bend_rad)).then(|| Beyond {
                    expected: format!("a bend of at most {max_bend_rad} rad"),
                    found: format!("{bend_rad:.4} rad"),
                    joint_idx: None,
                })
            }
            Self::Joints { range: [lows, highs], .. } => {
                let mut joints = lows.iter().zip(highs).zip(pose).enumerate();
                let outside = joints.find(|(_, ((low, high), found))| !(**low..=**high).contains(*found));
                outside.map(|(idx, ((low, high), found))| Beyond {
                    expected: format!("joint {} from {low} to {high} {}", idx + 1, self.unit()),
                    found: format!("{found:.5} {}", self.unit()),
                    joint_idx: Some(idx),
                })
            }
        }
    }

    /// The same between two rows.
    fn curve_beyond(&self, pose: &MachinePose) -> Option<Beyond> {
        let beyond = self.pose_beyond(pose)?;
        Some(Beyond { expected: format!("a curve up to this row with {}", beyond.expected), ..beyond })
    }

    /// The same of a rate.
    fn vel_beyond(&self, vel_per_s: &MachinePose) -> Option<Beyond> {
        let (limit, found) = match *self {
            Self::Snake { max_bend_vel_rad_per_s, .. } => (max_bend_vel_rad_per_s, vel_per_s.norm()),
            Self::Joints { max_vel_per_s, .. } => (max_vel_per_s, vel_per_s.amax()),
        };
        let unit = self.unit();
        (!(0.0..=limit).contains(&found)).then(|| Beyond {
            expected: format!("a motion up to this row of at most {limit} {unit}/s"),
            found: format!("{found:.3} {unit}/s"),
            joint_idx: None,
        })
    }

    /// Unit of its poses.
    fn unit(&self) -> &'static str {
        if matches!(self, Self::Joints { slides: true, .. }) { "m" } else { "rad" }
    }
}

/// Tangents of Catmull and Rom for unequal steps; at rest at both ends.
fn give_tangents(knots: &mut [Knot]) {
    for idx in 1..knots.len().saturating_sub(1) {
        let (a, b, c) = (knots[idx - 1], knots[idx], knots[idx + 1]);
        let (before_s, after_s) = (b.time_s - a.time_s, c.time_s - b.time_s);
        let (before, after) = ((b.pose - a.pose) / before_s, (c.pose - b.pose) / after_s);
        knots[idx].vel_per_s = (before * after_s + after * before_s) / (before_s + after_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;
    use krait_model::MachineParameters;
    use nalgebra::Vector2;

    fn parse(text: &str) -> Result<Trajectory, TrajectoryError> {
        let snake = Snake::new(&MachineParameters::default()).expect("a snake");
        let limits = TrajectoryLimits::Snake { snake: &snake, max_bend_rad: 1.3, max_bend_vel_rad_per_s: 2.0 };
        Trajectory::parse("path.csv", text.as_bytes(), &limits)
    }

    fn parse_joints(text: &str, slides: bool) -> Result<Trajectory, TrajectoryError> {
        let range: [&[f64]; 2] = if slides { [&[-4e-3; 2], &[4e-3; 2]] } else { [&[-0.8; 2], &[0.8, 0.6]] };
        let limits = TrajectoryLimits::Joints { range, max_vel_per_s: if slides { 0.02 } else { 2.0 }, slides };
        Trajectory::parse("path.csv", text.as_bytes(), &limits)
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
        assert!((at(1000).0.fixed_rows::<2>(0) - Vector2::new(0.5, 0.0)).norm() < 1e-12);
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

    #[test]
    fn a_table_of_joints_that_is_given_to_a_snake_names_what_is_missing() {
        let refused = parse("time_s,q1_deg,q2_deg\n0,0,0\n1,1,1\n").expect_err("no snake's table").to_string();
        assert!(refused.contains("column 2") && refused.contains("--model FILE"), "{refused}");
        let other = parse("time_s,quality,q2_deg\n0,0,0\n").expect_err("no table").to_string();
        assert!(!other.contains("--model"), "{other}");
    }

    #[test]
    fn joints_go_through_their_rows_in_their_own_unit_within_their_limits() {
        let turning = parse_joints("q2_deg,time_s,q1_rad\n0,0,0\n30,1,-0.2\n0,2,0.5\n", false).expect("a table");
        let middle = turning.sample(1000).expect("there").0;
        assert!((middle[0] + 0.2).abs() < 1e-12 && (middle[1] - 30f64.to_radians()).abs() < 1e-12, "{middle}");
        assert!(middle.iter().skip(2).all(|value| *value == 0.0));
        let sliding = parse_joints("time_ms,q1_mm,q2_m\n0,0,0\n1000,2,-0.003\n", true).expect("a table");
        let end = sliding.sample(1000).expect("there").0;
        assert!((end[0] - 2e-3).abs() < 1e-15 && (end[1] + 3e-3).abs() < 1e-15, "{end}");
        for (text, slides, words) in [
            (
                "time_s,q1_rad\n",
                false,
                "line 1, column 2: expected time_s,q1_rad,q2_rad (or _deg), as many as the model",
            ),
            ("time_s,q1_rad,q3_rad\n", false, "line 1, column 3: expected time_s,q1_rad,q2_rad"),
            ("time_s,q1_rad,q2_mm\n", false, "line 1, column 3: expected time_s,q1_rad,q2_rad"),
            ("time_s,q1_rad,q2_rad\n", true, "line 1, column 2: expected time_s,q1_m,q2_m (or _mm)"),
            ("time_s,bend_x_deg,bend_y_deg\n", false, "line 1, column 2: expected time_s,q1_rad"),
            (
                "time_s,q1_rad,q2_rad\n0,0,0\n9,0,0.7\n",
                false,
                "line 3, column 3: expected joint 2 from -0.8 to 0.6 rad, found 0.70000 rad",
            ),
            (
                "time_s,q1_rad,q2_rad\n0,0,0\n0.1,0.5,0\n",
                false,
                "line 3, column 1: expected a motion up to this row of at most 2 rad/s, found",
            ),
            (
                "time_s,q1_mm,q2_mm\n0,0,0\n9,4.5,0\n",
                true,
                "line 3, column 2: expected joint 1 from -0.004 to 0.004 m, found 0.00450 m",
            ),
        ] {
            let sentence = parse_joints(text, slides).expect_err(text).to_string();
            assert!(sentence.contains(words), "{words:?} is not in: {sentence}");
        }
    }
}
