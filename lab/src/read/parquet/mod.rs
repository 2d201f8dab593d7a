//! Flat Parquet tables: numbers, times and labels, a null where nothing was measured.

mod column;
mod pages;

use super::ReadError;
use super::grid::{Grid, GridCells, GridColumn, MOST_CELLS, MOST_COLUMNS};
use super::header::in_brackets;
use super::unit::{Dimension, Unit};
use column::Kind;
use krait_ipc::input;
use parquet::basic::Compression;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// How a file begins and ends.
pub(super) const MAGIC: &[u8] = b"PAR1";

/// Reads every column that is flat and holds numbers or labels.
pub(super) fn grid(path: &Path, file: File) -> Result<Grid, ReadError> {
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    let unusable = |reason: String| ReadError::Unusable { path: path.to_owned(), reason };
    let damaged = |what: String| unusable(format!("this Parquet file is cut or damaged ({what}); write it again"));
    input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
    let mut pages = file.try_clone().map_err(failed)?;
    let reader = catch_unwind(AssertUnwindSafe(|| SerializedFileReader::new(file)))
        .map_err(|_panic| damaged("its footer is damaged".to_owned()))?
        .map_err(|error| damaged(one_line(&error.to_string())))?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut notes = Vec::new();
    let mut wanted = Vec::new();
    for (place, descriptor) in schema.columns().iter().enumerate() {
        match Kind::of(descriptor) {
            Ok(kind) => wanted.push((place, kind, name(descriptor.name(), kind))),
            Err(why) => notes.push(format!("{:?} is left out: {why}", descriptor.path().string())),
        }
    }
    if wanted.is_empty() || wanted.len() > MOST_COLUMNS {
        let n = wanted.len();
        return Err(unusable(format!(
            "it has {n} columns of numbers, expected 1 to {MOST_COLUMNS}; write a flat table"
        )));
    }
    let mut n_rows = 0_usize;
    for group in reader.metadata().row_groups() {
        n_rows = usize::try_from(group.num_rows()).ok().and_then(|n| n_rows.checked_add(n)).unwrap_or(usize::MAX);
    }
    let weight: usize = wanted.iter().map(|(_, kind, _)| kind.room(0).weight_of_one()).sum();
    if n_rows.saturating_mul(weight) > MOST_CELLS {
        let n = wanted.len();
        return Err(unusable(format!(
            "it has {n_rows} rows of {n} columns, expected at most {MOST_CELLS} numbers (a label weighs {}, a whole number of 64 bits {}); write fewer columns, or a part of the rows",
            GridCells::TEXT,
            GridCells::WHOLE
        )));
    }
    let mut n_text_bytes = 0;
    let mut columns: Vec<GridColumn> = Vec::with_capacity(wanted.len());
    for (place, kind, name) in wanted {
        let mut cells = kind.room(n_rows);
        for (number, group) in reader.metadata().row_groups().iter().enumerate() {
            let chunk = group.columns().get(place).ok_or_else(|| damaged("a column is missing".to_owned()))?;
            is_readable(chunk).map_err(|what| unusable(format!("column {name:?} is {what}")))?;
            let (begin, n_bytes) =
                place_of(chunk).ok_or_else(|| damaged("a column begins before the file".to_owned()))?;
            let n_rows = u64::try_from(group.num_rows()).map_err(|error| damaged(error.to_string()))?;
            pages::check(&mut pages, begin, n_bytes, n_rows).map_err(&damaged)?;
            // The library panics where a page is damaged inside; what it has read of the column is given up then.
            let read = catch_unwind(AssertUnwindSafe(|| {
                let own = reader.get_row_group(number).and_then(|group| group.get_column_reader(place));
                own.map_err(|error| error.to_string())
                    .and_then(|own| kind.read(own, n_rows, &mut cells, &mut n_text_bytes))
            }));
            let read = read.unwrap_or_else(|_panic| Err(format!("a page of column {name:?} is damaged inside")));
            read.map_err(|what| damaged(one_line(&what)))?;
        }
        columns.push(GridColumn { name, cells, is_held: false });
    }
    if n_text_bytes > MOST_CELLS {
        return Err(unusable(format!(
            "its labels take {n_text_bytes} bytes, expected at most {MOST_CELLS}; leave them out"
        )));
    }
    Ok(Grid { how: "a Parquet table".to_owned(), columns, notes })
}

fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}

/// A column of times says their unit in its name.
fn name(name: &str, kind: Kind) -> String {
    let Kind::Times(unit) = kind else { return name.to_owned() };
    let is_time = |suffix: &str| Unit::from_suffix(suffix).is_some_and(|unit| unit.dimension == Dimension::Time);
    let stem = match (in_brackets(name), name.rsplit_once('_')) {
        (Some((stem, _)), _) => stem,
        (None, Some((stem, suffix))) if is_time(suffix) => stem,
        _ => name,
    };
    format!("{stem} [{unit}]")
}

fn is_readable(chunk: &ColumnChunkMetaData) -> Result<(), String> {
    match chunk.compression() {
        Compression::UNCOMPRESSED
        | Compression::SNAPPY
        | Compression::GZIP(_)
        | Compression::LZ4
        | Compression::LZ4_RAW
        | Compression::ZSTD(_) => Ok(()),
        other => {
            let name = other.to_string();
            let name = name.split('(').next().unwrap_or_default();
            Err(format!("compressed with {name}; write it with snappy, zstd, gzip or lz4"))
        }
    }
}

/// Where a column's pages begin, and how many bytes they take.
fn place_of(chunk: &ColumnChunkMetaData) -> Option<(u64, u64)> {
    let begin = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset());
    Some((u64::try_from(begin).ok()?, u64::try_from(chunk.compressed_size()).ok()?))
}
