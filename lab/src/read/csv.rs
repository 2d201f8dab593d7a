//! Rows of a CSV file into columns of numbers, each cell checked where it stands.

use super::header::{Column, Plan, plan};
use super::role::Role;
use super::{ColumnMap, Expected, ReadError};
use csv::{ByteRecord, ErrorKind, ReaderBuilder};
use std::io::Read;
use std::path::Path;

/// A file's columns, in the order of its plan; empty cells are NaN.
pub(super) struct Table {
    pub plan: Plan,
    pub columns: Vec<Vec<f64>>,
    /// Number of each row's trial.
    pub trial: Vec<u32>,
    /// Line of the last row.
    pub last_line: u64,
}

/// Reads a whole file.
pub(super) fn read(path: &Path, source: impl Read, map: &ColumnMap, expected: Expected) -> Result<Table, ReadError> {
    let mut reader = ReaderBuilder::new().has_headers(false).buffer_capacity(1 << 18).from_reader(source);
    let mut record = ByteRecord::new();
    let failed = |behind: u64| move |error: csv::Error| refusal(path, behind, error);
    if !reader.read_byte_record(&mut record).map_err(failed(0))? {
        return Err(ReadError::NotCsv { path: path.to_owned(), line: 1, reason: "the file is empty".to_owned() });
    }
    let plan = plan(path, &names(path, &record)?, map, expected)?;
    // Of lines that end with CR LF the reader takes the LF for the beginning of the next, and counts one too few.
    let behind = u64::from(reader.position().line() == 1);
    let mut rows = Rows::new(path, plan, behind);
    while reader.read_byte_record(&mut record).map_err(failed(behind))? {
        rows.push(&record)?;
    }
    if rows.trial.is_empty() {
        return Err(ReadError::NoRows { path: path.to_owned() });
    }
    Ok(rows.end())
}

fn names(path: &Path, record: &ByteRecord) -> Result<Vec<String>, ReadError> {
    let wrong = |reason: &str| ReadError::NotCsv { path: path.to_owned(), line: 1, reason: reason.to_owned() };
    let name = |cell: &[u8]| match std::str::from_utf8(cell.trim_ascii()) {
        Ok(name) if !name.contains('\0') => Ok(name.to_owned()),
        _ => Err(wrong("the names of the columns are not UTF-8")),
    };
    let names = record.iter().map(name).collect::<Result<Vec<_>, _>>()?;
    match names.as_slice() {
        [only] if only.contains([';', '\t']) => Err(wrong("columns are not separated by commas")),
        _ => Ok(names),
    }
}

struct Rows<'a> {
    path: &'a Path,
    plan: Plan,
    columns: Vec<Vec<f64>>,
    trial: Vec<u32>,
    label: Vec<u8>,
    label_field: Option<usize>,
    time: usize,
    /// Places of the shape's columns.
    shape: Vec<usize>,
    last_line: u64,
    /// Lines that the reader counts too few.
    behind: u64,
}

impl<'a> Rows<'a> {
    fn new(path: &'a Path, plan: Plan, behind: u64) -> Self {
        let is_shape = |c: &Column| matches!(c.role, Role::Output(_) | Role::ThetaL | Role::Delta);
        Self {
            path,
            columns: vec![Vec::new(); plan.columns.len()],
            trial: Vec::new(),
            label: Vec::new(),
            label_field: plan.columns.iter().find(|c| c.role == Role::Trial).map(|c| c.field),
            time: plan.place(Role::Time).unwrap_or(0),
            shape: plan.columns.iter().enumerate().filter(|(_, c)| is_shape(c)).map(|(k, _)| k).collect(),
            last_line: 1,
            behind,
            plan,
        }
    }

    fn push(&mut self, record: &ByteRecord) -> Result<(), ReadError> {
        self.last_line = record.position().map_or(self.last_line + 1, |at| at.line() + self.behind);
        let line = self.last_line;
        for (column, values) in self.plan.columns.iter().zip(&mut self.columns) {
            let cell = record.get(column.field).unwrap_or_default().trim_ascii();
            values.push(value(self.path, line, column, cell)?);
        }
        let is_first = self.next_trial(record);
        if !is_first {
            self.time_rises(line)?;
        }
        self.whole_shape(line)
    }

    /// Counts this row's trial; true for the first row of one.
    fn next_trial(&mut self, record: &ByteRecord) -> bool {
        let label = self.label_field.and_then(|field| record.get(field)).unwrap_or_default().trim_ascii();
        let Some(&last) = self.trial.last() else {
            self.label = label.to_owned();
            self.trial.push(0);
            return true;
        };
        let is_new = label != self.label;
        if is_new {
            label.clone_into(&mut self.label);
        }
        self.trial.push(last + u32::from(is_new));
        is_new
    }

    fn time_rises(&self, line: u64) -> Result<(), ReadError> {
        let times = self.columns.get(self.time).map_or(&[][..], Vec::as_slice);
        let [.., before_s, found_s] = *times else { return Ok(()) };
        if found_s > before_s {
            return Ok(());
        }
        Err(ReadError::Time {
            path: self.path.to_owned(),
            line,
            column: self.plan.names(|role| role == Role::Time),
            found_s,
            before_s,
            how: if found_s == before_s { "the same as the" } else { "before the" },
        })
    }

    /// A snake's shape is there or not; joints are measured each by itself.
    fn whole_shape(&self, line: u64) -> Result<(), ReadError> {
        let last = |place: &usize| self.columns.get(*place).and_then(|c| c.last()).is_some_and(|v| v.is_finite());
        let is_snake = self.plan.n_inputs != self.plan.n_outputs;
        let n_there = self.shape.iter().filter(|place| last(place)).count();
        if !is_snake || n_there == 0 || n_there == self.shape.len() {
            return Ok(());
        }
        let empty = self.shape.iter().find(|place| !last(place)).and_then(|&place| self.plan.columns.get(place));
        let column = empty.map_or_else(String::new, |column| column.name.clone());
        Err(ReadError::HalfShape { path: self.path.to_owned(), line, column })
    }

    fn end(self) -> Table {
        Table { plan: self.plan, columns: self.columns, trial: self.trial, last_line: self.last_line }
    }
}

/// The value of a cell in the lab's units; NaN for one that may be empty and is.
fn value(path: &Path, line: u64, column: &Column, cell: &[u8]) -> Result<f64, ReadError> {
    let may_be_empty = match column.role {
        Role::Time | Role::Input(_) | Role::StemAngle | Role::Temperature => false,
        // A label, not a number.
        Role::Trial => return Ok(0.0),
        _ => true,
    };
    if cell.is_empty() && may_be_empty {
        return Ok(f64::NAN);
    }
    let number = std::str::from_utf8(cell).ok().and_then(|text| text.parse::<f64>().ok()).filter(|x| x.is_finite());
    let Some(number) = number else {
        // Notes beside the measurements need not be numbers.
        if column.role == Role::Extra {
            return Ok(f64::NAN);
        }
        return Err(not_a_number(path, line, column, cell, may_be_empty));
    };
    let value = number * column.factor + column.shift;
    let is_beyond = column.limit.as_ref().filter(|(limit, ..)| value.abs() > *limit);
    let must_be_positive =
        matches!(column.role, Role::Sigma) && value <= 0.0 || column.role == Role::Weight && value < 0.0;
    let implausible = |what: &str, advice: &str| ReadError::Implausible {
        path: path.to_owned(),
        line,
        column: column.name.clone(),
        found: String::from_utf8_lossy(cell).into_owned(),
        reason: format!("{what}; {advice}"),
    };
    match is_beyond {
        Some((_, what, advice)) => Err(implausible(what, advice)),
        None if must_be_positive => Err(implausible("not positive", "leave the cell empty where it is not known")),
        None => Ok(value),
    }
}

fn not_a_number(path: &Path, line: u64, column: &Column, cell: &[u8], may_be_empty: bool) -> ReadError {
    let advice = match column.role {
        Role::Output(_) | Role::ThetaL | Role::Delta => "leave the shape's cells empty where the camera gave none",
        _ if may_be_empty => "leave the cell empty where nothing was measured",
        _ => "this column needs a number in every row",
    };
    ReadError::NotNumber {
        path: path.to_owned(),
        line,
        column: column.name.clone(),
        found: String::from_utf8_lossy(cell.get(..40).unwrap_or(cell)).into_owned(),
        advice,
    }
}

fn refusal(path: &Path, behind: u64, error: csv::Error) -> ReadError {
    let path = path.to_owned();
    let line = error.position().map_or(1, |at| at.line() + behind);
    match error.into_kind() {
        ErrorKind::Io(source) => ReadError::Io { path, source },
        ErrorKind::UnequalLengths { expected_len, len, .. } => {
            ReadError::Cut { path, line, found: len, expected: expected_len }
        }
        _ => ReadError::NotCsv { path, line, reason: "it cannot be read as rows of cells".to_owned() },
    }
}
