//! Reads measurements: CSV, Parquet, MATLAB files and ROS 2 bags of anybody, and krait's own recordings; whatever is doubtful is refused with its place.

mod at;
mod cells;
mod check;
mod column_map;
mod csv;
mod dialect;
mod error;
mod force;
mod format;
mod grid;
mod header;
mod held;
mod look;
mod map_file;
mod matlab;
mod merge;
mod parquet;
mod preamble;
mod recording;
mod role;
mod ros;
mod rows;
mod setpoints;
mod stamps;
mod table;
mod unit;
mod with;
mod wrap;

pub use at::At;
pub(crate) use column_map::NONE;
pub use column_map::{ColumnMap, Mapping};
pub use error::ReadError;
pub(crate) use force::{
    CUT_OFF_HZ, column, filter_s, filtered, of_joint, scatter_before_filter, scatter_behind_filter,
};
pub(crate) use header::in_brackets;
pub(crate) use look::{Look, Looked, look};
pub(crate) use merge::merged;
pub use recording::joint_scale;
pub(crate) use role::{N_LINES, force_names};
pub use setpoints::{Setpoints, setpoints};
pub(crate) use stamps::EPOCH_S;
pub(crate) use unit::{Dimension, Unit};
pub(crate) use wrap::Turns;

use crate::Measurements;
use check::Place;
use column_map::Part;
use format::{Format, Found};
use krait_ipc::input;
use krait_model::model_file::{ForceMachine, Joints, Machine};
use krait_model::segments::SegmentsParameters;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

/// Which machine the measurements must be of.
#[derive(Clone, Copy, Debug)]
pub enum Expected<'a> {
    /// A snake: `q1_m`..`q3_m` and its shape.
    Snake,
    /// Joints: `u1`..`un` and `y1`..`yn` in the model's units.
    Joints(&'a Joints),
    /// Joints with a force: `q1`..`qn`, rad, and `tau1_nm`.. or `i1_a`..
    Force(&'a ForceMachine),
    /// Segments in series: `u1_m`.. of every line and `y1_rad`.., two for each segment's bend vector.
    Segments(&'a SegmentsParameters),
}

impl<'a> From<&'a Machine> for Expected<'a> {
    fn from(machine: &'a Machine) -> Self {
        match machine {
            Machine::Snake(_) => Self::Snake,
            Machine::Segments(segments) => Self::Segments(segments),
            Machine::Joints(joints) => Self::Joints(joints),
            Machine::Force(force) => Self::Force(force),
        }
    }
}

impl Expected<'_> {
    fn wanted(self) -> Vec<role::Wanted> {
        match self {
            Self::Snake => role::snake(),
            Self::Joints(joints) => role::joints(joints.n, &joints.u_unit, &joints.y_unit),
            Self::Force(force) => role::force(force),
            Self::Segments(_) => {
                let (n_lines, n_bends) = self.widths();
                role::segments(n_lines, n_bends)
            }
        }
    }

    /// Inputs and outputs of a row.
    fn widths(self) -> (usize, usize) {
        match self {
            Self::Snake => (role::N_LINES, 2),
            Self::Joints(joints) => (joints.n, joints.n),
            Self::Force(force) => (force.n, force.n),
            Self::Segments(own) => {
                (own.segments.iter().map(|segment| segment.lines.len()).sum(), 2 * own.segments.len())
            }
        }
    }
}

/// Reads a CSV file, a Parquet table, a MATLAB file of level 5, a ROS 2 bag in MCAP, or a recording of krait.
///
/// Everything comes back in SI units and radians, for joints in the model's units. A new label in the column `trial` begins a
/// trial. `weight` w of a row becomes a standard deviation 1/sqrt(w): only ratios of weights count; a row of weight 0 is history
/// without a measurement. Columns that the lab does not know are kept as `extra` where they hold numbers.
///
/// # Errors
/// [`ReadError`], one sentence with file, line and column.
pub fn read(path: &Path, map: &ColumnMap, expected: Expected) -> Result<Measurements, ReadError> {
    let (table, hash) = match read_table(path, map, expected)? {
        Content::Table(table, hash) => (table, hash),
        Content::Whole(data) => return Ok(*data),
    };
    let place = table::place(path, &table);
    let mut data = table::measurements(path, table, expected, hash);
    if !matches!(expected, Expected::Force(_)) {
        held::take_out(&mut data);
    }
    check::enough(&place, &data)?;
    let Expected::Force(machine) = expected else { return Ok(data) };
    let filtered = force::prepare(&place, data, machine)?;
    check::enough(&place, &filtered)?;
    Ok(filtered)
}

/// Reads the commands of one table and what was measured of them from another, whose clock is its own.
///
/// # Errors
/// [`ReadError`], one sentence: as [`read`], and where the two cannot be joined.
pub fn read_with(path: &Path, with: &Path, map: &ColumnMap, expected: Expected) -> Result<Measurements, ReadError> {
    let refusal = |why: &str| ReadError::With { path: with.to_owned(), why: why.to_owned() };
    if matches!(expected, Expected::Force(_)) {
        return Err(refusal("angle and force must have one clock, expected one file; leave --with out"));
    }
    let part = |path: &Path, part: Part| match read_table(path, &map.of_part(part), expected)? {
        Content::Table(table, hash) => Ok((table, hash)),
        Content::Whole(_) => Err(refusal("a recording of krait has one clock, expected two tables; leave --with out")),
    };
    let ((commands, hash), (seen, seen_hash)) = (part(path, Part::Commands)?, part(with, Part::Seen)?);
    let place = Place { inputs: table::place(path, &commands).inputs, ..table::place(with, &seen) };
    let commands = table::measurements(path, commands, expected, hash);
    let seen = table::measurements(with, seen, expected, seen_hash);
    let joined = with::join(commands, seen, with)?;
    check::enough(&place, &joined)?;
    Ok(joined)
}

/// What a file holds.
enum Content {
    Table(rows::Table, String),
    /// A recording of krait is no table.
    Whole(Box<Measurements>),
}

fn read_table(path: &Path, map: &ColumnMap, expected: Expected) -> Result<Content, ReadError> {
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    let Found { mut file, format } = Format::of(path)?;
    let plan = |at, names: &[String]| header::plan(path, at, names, map, expected);
    match format {
        Format::Krait => Ok(Content::Whole(Box::new(recording::read(path, file, map, expected)?))),
        Format::Csv => {
            input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
            let mut hashing = Hashing { source: file, hash: Sha256::new() };
            let table = csv::read(path, &mut hashing, plan)?;
            Ok(Content::Table(table, hex(hashing.hash)))
        }
        Format::Grid(grid) => {
            let table = grid(path, file.try_clone().map_err(failed)?)?.read(path, plan)?;
            file.rewind().map_err(failed)?;
            Ok(Content::Table(table, sha256(path, file)?))
        }
    }
}

/// Hash of a whole file.
fn sha256(path: &Path, file: File) -> Result<String, ReadError> {
    let mut hashing = Hashing { source: file, hash: Sha256::new() };
    io::copy(&mut hashing, &mut io::sink()).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    Ok(hex(hashing.hash))
}

fn open(path: &Path) -> Result<File, ReadError> {
    input::regular(path, input::ANY_BYTES).map_err(|error| match error.kind() {
        io::ErrorKind::InvalidInput => ReadError::NotAFile { path: path.to_owned() },
        _ => ReadError::Io { path: path.to_owned(), source: error },
    })
}

/// A file's name, for sentences and histories.
fn source(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// A source whose bytes are hashed on their way.
struct Hashing<R> {
    source: R,
    hash: Sha256,
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.source.read(buffer)?;
        self.hash.update(buffer.get(..n).unwrap_or_default());
        Ok(n)
    }
}

fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
