//! Rows of a CSV file into columns of numbers, each cell checked where it stands.

use super::ReadError;
use super::at::At;
use super::cells::Cell;
use super::dialect::Dialect;
use super::header::Plan;
use super::preamble::Preamble;
use super::rows::{Rows, Table};
use csv::{ByteRecord, ErrorKind, Reader, ReaderBuilder};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

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

/// A file whose heading was read.
pub(super) struct Opened<'a, R> {
    path: &'a Path,
    reader: Reader<BufReader<Bounded<R>>>,
    record: ByteRecord,
    pub dialect: Dialect,
    pub names: Vec<String>,
    /// The line in which the names stand.
    pub heading: u64,
    /// Lines that the reader counts too few.
    behind: u64,
}

impl<'a, R: Read> Opened<'a, R> {
    pub(super) fn new(path: &'a Path, source: R) -> Result<Self, ReadError> {
        let mut source = BufReader::with_capacity(1 << 18, Bounded { source, n_left: MOST_ROW_BYTES });
        let start = source.fill_buf().map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
        let Preamble { n_bytes, n_lines } = Preamble::of(start);
        let dialect = Dialect::of(path, start.get(n_bytes..).unwrap_or_default())?;
        source.consume(n_bytes);
        let heading = n_lines + 1;
        let mut reader = ReaderBuilder::new().has_headers(false).delimiter(dialect.delimiter).from_reader(source);
        let mut record = ByteRecord::new();
        if !reader.read_byte_record(&mut record).map_err(|error| refusal(path, n_lines, error))? {
            return Err(ReadError::NotCsv {
                path: path.to_owned(),
                line: heading,
                reason: "the file is empty".to_owned(),
            });
        }
        let names = names(path, heading, &record)?;
        // Of lines that end with CR LF the reader takes the LF for the beginning of the next, and counts one too few.
        let behind = n_lines + u64::from(reader.position().line() == 1);
        Ok(Self { path, reader, record, dialect, names, heading, behind })
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

/// Reads a whole file, with the plan that is made of its names.
pub(super) fn read(
    path: &Path,
    source: impl Read,
    plan: impl FnOnce(At, &[String]) -> Result<Plan, ReadError>,
) -> Result<Table, ReadError> {
    let mut file = Opened::new(path, source)?;
    let plan = plan(At::Line(file.heading), &file.names)?;
    let mut rows = Rows::new(path, plan, file.dialect.numbers());
    while let Some((line, record)) = file.row()? {
        rows.push(At::Line(line), |field| Cell::of_text(record.get(field).unwrap_or_default()))?;
    }
    rows.end()
}

fn names(path: &Path, line: u64, record: &ByteRecord) -> Result<Vec<String>, ReadError> {
    let name = |cell: &[u8]| match std::str::from_utf8(cell.trim_ascii()) {
        Ok(name) if !name.contains('\0') => Ok(name.to_owned()),
        _ => {
            let reason = "the names of the columns are not UTF-8".to_owned();
            Err(ReadError::NotCsv { path: path.to_owned(), line, reason })
        }
    };
    record.iter().map(name).collect()
}

fn refusal(path: &Path, behind: u64, error: csv::Error) -> ReadError {
    let path = path.to_owned();
    let line = error.position().map_or(behind + 1, |at| at.line() + behind);
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
