//! Rows of a CSV file into columns of numbers, each cell checked where it stands.

use super::cells::Cells;
use super::dialect::{Dialect, Numbers};
use super::header::{Column, Plan, plan};
use super::role::Role;
use super::{ColumnMap, Expected, ReadError};
use csv::{ByteRecord, ErrorKind, Reader, ReaderBuilder};
use std::io::{self, BufRead, BufReader, Read};
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

/// Most bytes that are read for one row, empty lines before it included: what holds no line ends fills no memory.
const MOST_ROW_BYTES: usize = 1 << 20;

/// A source that gives bounded room to each row.
struct Bounded<R> {
    source: R,
    /// What may still be read for this row.
    n_left: usize,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.n_left == 0 {
            let text =
                format!("a row has more than {MOST_ROW_BYTES} bytes, expected rows of cells that end with the line");
            return Err(io::Error::new(io::ErrorKind::InvalidData, text));
        }
        let n = buffer.len().min(self.n_left);
        let n = self.source.read(buffer.get_mut(..n).unwrap_or_default())?;
        self.n_left -= n;
        Ok(n)
    }
}

/// A file whose first line was read.
pub(super) struct Opened<'a, R> {
    path: &'a Path,
    reader: Reader<BufReader<Bounded<R>>>,
    record: ByteRecord,
    pub dialect: Dialect,
    pub names: Vec<String>,
    /// Lines that the reader counts too few.
    behind: u64,
}

impl<'a, R: Read> Opened<'a, R> {
    pub(super) fn new(path: &'a Path, source: R) -> Result<Self, ReadError> {
        let mut source = BufReader::with_capacity(1 << 18, Bounded { source, n_left: MOST_ROW_BYTES });
        let start = source.fill_buf().map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
        let dialect = Dialect::of(path, start)?;
        let mut reader = ReaderBuilder::new().has_headers(false).delimiter(dialect.delimiter).from_reader(source);
        let mut record = ByteRecord::new();
        if !reader.read_byte_record(&mut record).map_err(|error| refusal(path, 0, error))? {
            return Err(ReadError::NotCsv { path: path.to_owned(), line: 1, reason: "the file is empty".to_owned() });
        }
        let names = names(path, &record)?;
        // Of lines that end with CR LF the reader takes the LF for the beginning of the next, and counts one too few.
        let behind = u64::from(reader.position().line() == 1);
        Ok(Self { path, reader, record, dialect, names, behind })
    }

    /// The next row and its line.
    pub(super) fn row(&mut self) -> Result<Option<(u64, &ByteRecord)>, ReadError> {
        self.reader.get_mut().get_mut().n_left = MOST_ROW_BYTES;
        let is_there = self.reader.read_byte_record(&mut self.record);
        let is_there = is_there.map_err(|error| refusal(self.path, self.behind, error))?;
        let line = self.record.position().map_or(0, |at| at.line() + self.behind);
        Ok(is_there.then_some((line, &self.record)))
    }
}

/// Reads a whole file.
pub(super) fn read(path: &Path, source: impl Read, map: &ColumnMap, expected: Expected) -> Result<Table, ReadError> {
    let mut file = Opened::new(path, source)?;
    let plan = plan(path, &file.names, map, expected)?;
    let mut rows = Rows::new(path, plan, file.dialect.numbers());
    while let Some((line, record)) = file.row()? {
        rows.push(line, record)?;
    }
    if rows.trial.is_empty() {
        return Err(ReadError::NoRows { path: path.to_owned() });
    }
    Ok(rows.end())
}

fn names(path: &Path, record: &ByteRecord) -> Result<Vec<String>, ReadError> {
    let name = |cell: &[u8]| match std::str::from_utf8(cell.trim_ascii()) {
        Ok(name) if !name.contains('\0') => Ok(name.to_owned()),
        _ => {
            let reason = "the names of the columns are not UTF-8".to_owned();
            Err(ReadError::NotCsv { path: path.to_owned(), line: 1, reason })
        }
    };
    record.iter().map(name).collect()
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
    cells: Cells<'a>,
}

impl<'a> Rows<'a> {
    fn new(path: &'a Path, plan: Plan, numbers: Numbers) -> Self {
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
            cells: Cells::new(path, numbers, &plan),
            plan,
        }
    }

    fn push(&mut self, line: u64, record: &ByteRecord) -> Result<(), ReadError> {
        self.last_line = line;
        let is_first = self.next_trial(record);
        if is_first {
            self.cells.restart();
        }
        for (place, (column, values)) in self.plan.columns.iter().zip(&mut self.columns).enumerate() {
            let cell = record.get(column.field).unwrap_or_default().trim_ascii();
            values.push(self.cells.value(line, place, column, cell)?);
        }
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

fn refusal(path: &Path, behind: u64, error: csv::Error) -> ReadError {
    let path = path.to_owned();
    let line = error.position().map_or(1, |at| at.line() + behind);
    match error.into_kind() {
        // The bound of a row says of itself what was expected.
        ErrorKind::Io(source) if source.kind() == io::ErrorKind::InvalidData => {
            ReadError::NotCsv { path, line, reason: source.to_string() }
        }
        ErrorKind::Io(source) => ReadError::Io { path, source },
        ErrorKind::UnequalLengths { expected_len, len, .. } => {
            ReadError::Cut { path, line, found: len, expected: expected_len }
        }
        _ => ReadError::NotCsv { path, line, reason: "it cannot be read as rows of cells".to_owned() },
    }
}
