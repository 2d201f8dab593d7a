//! Scripts: wanted motion of the tip as a table, for experiments that no hand could repeat.
//!
//! ```text
//! # comments and empty lines are skipped
//! time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch,jaw
//! 0,    0,     0, 0, 1, 0, 0
//! 1.5,  0.010, 0, 0, 1, 0, 1
//! 3,    0,     0, 0, 1, 0, 0
//! ```
//!
//! Velocities are in the view frame (x right, y down, z away), at most 0.1 m/s each, and are interpolated linearly between
//! rows; a step is two rows a little apart. Behind them may stand how fast the hand turns (`tip_wx_rad_per_s` and so on, at
//! most 10 rad/s each), for machines that have joints to be turned by it. The last three columns may be absent (present, not
//! clutched, no jaw asked to move); they hold from their row to the next. Time starts at 0 or later and increases; before the first row nothing moves, after the last the
//! script has ended. A script bypasses axis map, dead zone, curve and presence button: it says what they would have said.

use crate::MasterError;
use crate::recording::{read_bounded, shown};
use std::path::Path;

const MAX_BYTES: u64 = 64 * 1024 * 1024;
const MAX_VEL_M_PER_S: f64 = 0.1;
/// Longest script, s: a day.
const MAX_TIME_S: f64 = 86_400.0;
const MAX_TURN_RAD_PER_S: f64 = 10.0;
/// Columns without turning, and with it.
const COLUMNS: &[&str] =
    &["time_s", "tip_vx_m_per_s", "tip_vy_m_per_s", "tip_vz_m_per_s", "operator_present", "clutch", "jaw"];
const TURNING_COLUMNS: &[&str] = &[
    "time_s",
    "tip_vx_m_per_s",
    "tip_vy_m_per_s",
    "tip_vz_m_per_s",
    "tip_wx_rad_per_s",
    "tip_wy_rad_per_s",
    "tip_wz_rad_per_s",
    "operator_present",
    "clutch",
    "jaw",
];
/// Columns that no script lacks.
const N_NEEDED: usize = 4;
/// Columns at the end that one may lack.
const N_OPTIONAL: usize = 3;

/// What a script asks for at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScriptSample {
    /// Velocity of the tip in the view frame, m/s; finite.
    pub tip_vel_in_view_m_per_s: [f64; 3],
    /// Angular velocity of the hand in the view frame, rad/s; finite.
    pub tip_angular_vel_in_view_rad_per_s: [f64; 3],
    /// Whether the operator is present.
    pub is_present: bool,
    /// Whether the clutch is pressed.
    pub is_clutched: bool,
    /// Which way the jaw of a gripper shall go: 1 open, -1 closed, 0 neither.
    pub jaw: i8,
}

impl ScriptSample {
    /// Nothing is asked for and nobody is there.
    const NOBODY: Self = Self {
        tip_vel_in_view_m_per_s: [0.0; 3],
        tip_angular_vel_in_view_rad_per_s: [0.0; 3],
        is_present: false,
        is_clutched: false,
        jaw: 0,
    };

    /// What may reach the robot, m/s and rad/s: zero without presence or with the clutch pressed.
    pub(crate) fn effective(&self) -> ([f64; 3], [f64; 3]) {
        let from = if self.counts() { self } else { &Self::NOBODY };
        (from.tip_vel_in_view_m_per_s, from.tip_angular_vel_in_view_rad_per_s)
    }

    /// Which way a jaw may go: 0 likewise.
    pub(crate) fn effective_jaw(&self) -> i8 {
        if self.counts() { self.jaw } else { 0 }
    }

    fn counts(&self) -> bool {
        self.is_present && !self.is_clutched
    }
}

/// A script in memory.
#[derive(Clone, Debug)]
pub struct Script {
    // Time since the start, ns, and what is asked for then; never empty, times increase.
    rows: Vec<(i64, ScriptSample)>,
}

impl Script {
    /// Reads a file.
    ///
    /// # Errors
    /// [`MasterError::File`], [`MasterError::TooLarge`] or [`MasterError::Script`].
    pub fn load(path: &Path) -> Result<Self, MasterError> {
        Self::parse(&path.display().to_string(), &read_bounded(path, MAX_BYTES)?)
    }

    /// Reads a script from memory; `file` names it in error sentences.
    ///
    /// # Errors
    /// [`MasterError::Script`] for the first field that is wrong.
    pub fn parse(file: &str, bytes: &[u8]) -> Result<Self, MasterError> {
        let bytes = krait_ipc::input::without_mark(bytes);
        let (mut columns, mut rows) = (None, Vec::new());
        for (line_idx, line) in bytes.split(|b| *b == b'\n').enumerate() {
            let line = line.trim_ascii();
            if line.is_empty() || line.starts_with(b"#") {
                continue;
            }
            let row = Row { file, line: line_idx + 1, bytes: line };
            match columns {
                None => columns = Some(row.header()?),
                Some(columns) => rows.push(row.sample(columns, rows.last().map(|(time_ns, _)| *time_ns))?),
            }
        }
        if rows.is_empty() {
            let row = Row { file, line: bytes.split(|b| *b == b'\n').count(), bytes: b"" };
            return Err(row.refuse(1, "a header and at least one row", "the end of the file".to_owned()));
        }
        Ok(Self { rows })
    }

    /// Time of the last row, ns since the start.
    pub fn duration_ns(&self) -> i64 {
        self.rows.last().map_or(0, |(time_ns, _)| *time_ns)
    }

    /// What is asked for at a time (ns since the start); `None` after the last row.
    pub fn at(&self, time_ns: i64) -> Option<ScriptSample> {
        let n_begun = self.rows.partition_point(|(row_ns, _)| *row_ns <= time_ns);
        let Some((from_ns, from)) = n_begun.checked_sub(1).map(|idx| self.rows[idx]) else {
            return Some(ScriptSample::NOBODY);
        };
        let Some((to_ns, to)) = self.rows.get(n_begun) else {
            return (time_ns == from_ns).then_some(from);
        };
        let part = (time_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
        let between = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|k| a[k] + part * (b[k] - a[k]));
        Some(ScriptSample {
            tip_vel_in_view_m_per_s: between(from.tip_vel_in_view_m_per_s, to.tip_vel_in_view_m_per_s),
            tip_angular_vel_in_view_rad_per_s: between(
                from.tip_angular_vel_in_view_rad_per_s,
                to.tip_angular_vel_in_view_rad_per_s,
            ),
            ..from
        })
    }
}

struct Row<'a> {
    file: &'a str,
    line: usize,
    bytes: &'a [u8],
}

impl<'a> Row<'a> {
    fn fields(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        self.bytes.split(|b| *b == b',').map(<[u8]>::trim_ascii)
    }

    /// The columns that there are, in their order.
    fn header(&self) -> Result<&'static [&'static str], MasterError> {
        let n_columns = self.fields().count();
        let is_turning = self.fields().nth(N_NEEDED).is_some_and(|field| field == TURNING_COLUMNS[N_NEEDED].as_bytes());
        let (columns, n_needed) =
            if is_turning { (TURNING_COLUMNS, TURNING_COLUMNS.len() - N_OPTIONAL) } else { (COLUMNS, N_NEEDED) };
        for (idx, field) in self.fields().enumerate() {
            match columns.get(idx) {
                Some(name) if field == name.as_bytes() => {}
                Some(name) => return Err(self.refuse(idx + 1, &format!("the heading {name}"), shown(field))),
                None => return Err(self.refuse(idx + 1, "no further heading", shown(field))),
            }
        }
        if n_columns < n_needed {
            let expected = format!("the heading {}", columns[n_columns]);
            return Err(self.refuse(n_columns + 1, &expected, "nothing".to_owned()));
        }
        Ok(&columns[..n_columns])
    }

    fn sample(&self, columns: &[&str], last_ns: Option<i64>) -> Result<(i64, ScriptSample), MasterError> {
        let (n_columns, n_found) = (columns.len(), self.fields().count());
        if n_found != n_columns {
            let expected = format!("{n_columns} fields as in the heading");
            return Err(self.refuse(n_found.min(n_columns), &expected, format!("{n_found}")));
        }
        let (mut time_s, mut sample) = (0.0, ScriptSample { is_present: true, ..ScriptSample::NOBODY });
        for (idx, (name, field)) in columns.iter().zip(self.fields()).enumerate() {
            let number = self.number(name, idx, field)?;
            match *name {
                "time_s" => time_s = number,
                "operator_present" => sample.is_present = number != 0.0,
                "clutch" => sample.is_clutched = number != 0.0,
                "jaw" => sample.jaw = number as i8,
                _ if idx < N_NEEDED => sample.tip_vel_in_view_m_per_s[idx - 1] = number,
                _ => sample.tip_angular_vel_in_view_rad_per_s[idx - N_NEEDED] = number,
            }
        }
        let time_ns = (time_s * 1e9).round() as i64;
        if let Some(last_ns) = last_ns.filter(|last_ns| time_ns <= *last_ns) {
            return Err(self.refuse(1, &format!("a time after {} s", last_ns as f64 * 1e-9), format!("{time_s} s")));
        }
        Ok((time_ns, sample))
    }

    fn number(&self, name: &str, column_idx: usize, field: &[u8]) -> Result<f64, MasterError> {
        let value: Option<f64> = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
        let (is_allowed, expected): (fn(f64) -> bool, &str) = match name {
            "time_s" => (|v| (0.0..=MAX_TIME_S).contains(&v), "a time from 0 to 86400 s"),
            "operator_present" | "clutch" => (|v| v == 0.0 || v == 1.0, "0 or 1"),
            "jaw" => (|v| [-1.0, 0.0, 1.0].contains(&v), "-1 (close), 0 or 1 (open)"),
            _ if column_idx < N_NEEDED => (|v| v.abs() <= MAX_VEL_M_PER_S, "a velocity from -0.1 to 0.1 m/s"),
            _ => (|v| v.abs() <= MAX_TURN_RAD_PER_S, "an angular velocity from -10 to 10 rad/s"),
        };
        value.filter(|v| is_allowed(*v)).ok_or_else(|| self.refuse(column_idx + 1, expected, shown(field)))
    }

    fn refuse(&self, column: usize, expected: &str, found: String) -> MasterError {
        MasterError::Script {
            file: self.file.to_owned(),
            line: self.line,
            column,
            expected: expected.to_owned(),
            found,
        }
    }
}
