//! Reads measurements: CSV files of anybody, and krait's own recordings; whatever is doubtful is refused with its place.

mod cells;
mod check;
mod column_map;
mod csv;
mod dialect;
mod error;
mod header;
mod look;
mod map_file;
mod recording;
mod role;
mod stamps;
mod table;
mod unit;
mod wrap;

pub use column_map::{ColumnMap, Mapping};
pub use error::ReadError;
pub(crate) use header::in_brackets;
pub(crate) use look::{Look, Looked, look};
pub(crate) use role::N_LINES;
pub(crate) use stamps::EPOCH_S;
pub(crate) use unit::{Dimension, Unit};
pub(crate) use wrap::Turns;

use crate::Measurements;
use krait_ipc::input;
use krait_model::model_file::{Joints, Machine};
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
}

impl<'a> From<&'a Machine> for Expected<'a> {
    fn from(machine: &'a Machine) -> Self {
        match machine {
            Machine::Snake(_) => Self::Snake,
            Machine::Joints(joints) => Self::Joints(joints),
        }
    }
}

impl Expected<'_> {
    fn wanted(self) -> Vec<role::Wanted> {
        match self {
            Self::Snake => role::snake(),
            Self::Joints(joints) => role::joints(joints.n, &joints.u_unit, &joints.y_unit),
        }
    }

    /// Inputs and outputs of a row.
    fn widths(self) -> (usize, usize) {
        match self {
            Self::Snake => (role::N_LINES, 2),
            Self::Joints(joints) => (joints.n, joints.n),
        }
    }
}

/// Reads a CSV file or a recording of krait.
///
/// Everything comes back in SI units and radians, for joints in the model's units. A new label in the column `trial` begins a
/// trial. `weight` w of a row becomes a standard deviation 1/sqrt(w): only ratios of weights count; a row of weight 0 is history
/// without a measurement. Columns that the lab does not know are kept as `extra` where they hold numbers.
///
/// # Errors
/// [`ReadError`], one sentence with file, line and column.
pub fn read(path: &Path, map: &ColumnMap, expected: Expected) -> Result<Measurements, ReadError> {
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    let mut file = open(path)?;
    let mut start = Vec::new();
    file.by_ref().take(recording::MAGIC.len() as u64).read_to_end(&mut start).map_err(failed)?;
    file.rewind().map_err(failed)?;
    if start == recording::MAGIC {
        return recording::read(path, file, map, expected);
    }
    input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
    let mut hashing = Hashing { source: file, hash: Sha256::new() };
    let table = csv::read(path, &mut hashing, map, expected)?;
    let place = table::place(path, &table);
    let data = table::measurements(path, table, expected, hex(hashing.hash));
    check::enough(&place, &data)?;
    Ok(data)
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
