//! Why measurements are refused: one sentence with file, line and column, and what to do.

use super::at::At;
use std::io;
use std::path::PathBuf;

/// Measurements that the lab does not take. Nothing is guessed and nothing is left out silently.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file could not be read.
    #[error("{} cannot be read: {source}; check the path and the disk", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A folder, a device or a pipe.
    #[error("{} is not a regular file; give a file of measurements or a recording of krait", path.display())]
    NotAFile {
        /// What was given.
        path: PathBuf,
    },
    /// A file of another program that cannot be used as it is.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What was found, what was expected, what to do.
        reason: String,
    },
    /// Bytes that are no CSV.
    #[error("{} line {line}: {reason}; give a CSV file in UTF-8 whose first line names the columns", path.display())]
    NotCsv {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// What is wrong.
        reason: String,
    },
    /// A recording of krait that cannot be read.
    #[error(transparent)]
    Recording(#[from] Box<krait_record::RecordingReadError>),
    /// A recording that does not hold what was recorded.
    #[error("{}: {missing}; `krait export` writes what is there to a CSV file, which the lab reads", path.display())]
    CutRecording {
        /// The file.
        path: PathBuf,
        /// What is missing.
        missing: String,
    },
    /// Columns of a recording need no other names.
    #[error("{}: --map is for files of other programs, and this is a recording of krait; leave --map out", path.display())]
    MappedRecording {
        /// The file.
        path: PathBuf,
    },
    /// A required column is not there.
    #[error(
        "{}{at}: column {column} is missing; the nearest name there is {nearest:?}: rename it, or map it with --map {column}=NAME",
        path.display()
    )]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// Where the names stand.
        at: At,
        /// The column.
        column: String,
        /// A name of the file that looks like it.
        nearest: String,
    },
    /// A column is there under a name with no unit or with one that is not known.
    #[error(
        "{}{at}: column {found}, expected {expected} with one of the units {units}; rename it, or map it with --map",
        path.display()
    )]
    UnknownUnit {
        /// The file.
        path: PathBuf,
        /// Where the names stand.
        at: At,
        /// The column and what is wrong with it.
        found: String,
        /// The quantity.
        expected: String,
        /// The units that are known for it.
        units: String,
    },
    /// Two columns of one name, or of one quantity.
    #[error("{}{at}: columns {first} and {second} both give {quantity}; remove or rename one", path.display())]
    DuplicateColumn {
        /// The file.
        path: PathBuf,
        /// Where the names stand.
        at: At,
        /// What they give.
        quantity: String,
        /// Place and name of the one.
        first: String,
        /// Place and name of the other.
        second: String,
    },
    /// Loads of more or fewer lines than the machine has.
    #[error(
        "{}{at}: there are loads of {found} line{}, expected those of all {n_lines} lines, tau1_n to tau{n_lines}_n, or none; add or remove columns, or rename those that are no loads of lines",
        path.display(), if *found == 1 { "" } else { "s" }
    )]
    Loads {
        /// The file.
        path: PathBuf,
        /// Where the names stand.
        at: At,
        /// Lines with a load.
        found: usize,
        /// Lines of the machine.
        n_lines: usize,
    },
    /// A `--map` that is none.
    #[error("--map {found:?} is no mapping, expected LAB_COLUMN=FILE_COLUMN or LAB_COLUMN=FILE_COLUMN:UNIT")]
    MapSyntax {
        /// What was given.
        found: String,
    },
    /// A mapping file that is none.
    #[error(
        "mapping file {}{line}: {reason}; expected format = 1 and under [columns] lines such as time_s = {{ column = \"Time\", unit = \"ms\" }}",
        path.display()
    )]
    MapFile {
        /// The file.
        path: PathBuf,
        /// ` line 3`, or nothing.
        line: String,
        /// What is wrong.
        reason: String,
    },
    /// A unit that is not known.
    #[error(
        "--map {found:?}: unit {unit:?} is unknown, expected s, ms, us, ns, m, cm, mm, um, rad, mrad, deg, n, mn, kn, c, k, 1 or percent"
    )]
    MapUnit {
        /// What was given.
        found: String,
        /// The unit.
        unit: String,
    },
    /// A mapping to a column that the lab does not know, or in a unit that it cannot have.
    #[error("--map {target}=...: {reason}; the columns are {known}")]
    MapTarget {
        /// What was given.
        target: String,
        /// Why not.
        reason: String,
        /// Columns of this kind of machine.
        known: String,
    },
    /// A mapping from a column that the file does not have.
    #[error("{}{at}: column {column:?} of --map is missing; the nearest name there is {nearest:?}", path.display())]
    MapSource {
        /// The file.
        path: PathBuf,
        /// Where the names stand.
        at: At,
        /// The column.
        column: String,
        /// A name of the file that looks like it.
        nearest: String,
    },
    /// A row with fewer or more cells than the header.
    #[error(
        "{} line {line}: {found} columns, the header has {expected}; the file is cut short or damaged there, give another copy or remove the line",
        path.display()
    )]
    Cut {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Cells in that line.
        found: u64,
        /// Cells in the header.
        expected: u64,
    },
    /// A cell that holds no finite number.
    #[error("{}{at}, column {column}: {found:?} is no finite number; {advice}", path.display())]
    NotNumber {
        /// The file.
        path: PathBuf,
        /// Where.
        at: At,
        /// Column.
        column: String,
        /// The cell.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// One cell of a shape without the other.
    #[error(
        "{}{at}, column {column}: empty, but the rest of the shape is there; leave all of its cells empty or none",
        path.display()
    )]
    HalfShape {
        /// The file.
        path: PathBuf,
        /// Where.
        at: At,
        /// The empty column.
        column: String,
    },
    /// A value that no machine of this kind has.
    #[error("{}{at}, column {column}: {found} is {reason}", path.display())]
    Implausible {
        /// The file.
        path: PathBuf,
        /// Where.
        at: At,
        /// Column.
        column: String,
        /// The cell.
        found: String,
        /// Why it cannot be, and what to do.
        reason: String,
    },
    /// Time stands still or runs backwards within a trial.
    #[error(
        "{}{at}, column {column}: time {found_s} s is {how} {before_s} s of the row before; sort the rows, remove doubles, or give each run its own label in a column trial",
        path.display()
    )]
    Time {
        /// The file.
        path: PathBuf,
        /// Where.
        at: At,
        /// Column.
        column: String,
        /// The row's time, s.
        found_s: f64,
        /// The time of the row before, s.
        before_s: f64,
        /// `before` or `the same as`.
        how: &'static str,
    },
    /// Nothing below the header.
    #[error("{}{at}: there are no rows below the header; give a file with measurements", path.display())]
    NoRows {
        /// The file.
        path: PathBuf,
        /// Where the names stand.
        at: At,
    },
    /// Too little was measured to compare anything.
    #[error("{} {rows}: {what}, expected {expected}; {advice}", path.display())]
    TooLittle {
        /// The file.
        path: PathBuf,
        /// Where: `lines 2 to 61`.
        rows: String,
        /// What there is, with its columns.
        what: String,
        /// What is needed.
        expected: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// A second log cannot be joined to the first.
    #[error("--with {}: {why}", path.display())]
    With {
        /// The second log.
        path: PathBuf,
        /// What was found and expected, and what to do.
        why: String,
    },
    /// Model and data are of different machines.
    #[error("{}: {found}, but the model is of {expected}; use the model that belongs to these data", path.display())]
    OtherMachine {
        /// The file.
        path: PathBuf,
        /// What the columns say.
        found: String,
        /// What the model says.
        expected: String,
    },
}

impl From<krait_record::RecordingReadError> for ReadError {
    fn from(error: krait_record::RecordingReadError) -> Self {
        Self::Recording(Box::new(error))
    }
}
