//! A first look at a file of which nothing is known: its columns as they are, before anything stands for anything.

use super::ReadError;
use super::at::At;
use super::csv::Opened;
use super::format::{Format, Found};
use super::grid::{MOST_CELLS, MOST_COLUMNS};
use krait_ipc::input;
use std::fs::File;
use std::path::Path;

/// A file's columns.
#[derive(Clone, Debug)]
pub(crate) struct Look {
    /// Where the names of columns stand.
    pub at: At,
    /// How the file is written: `columns separated by semicolons, decimal comma`.
    pub how: String,
    /// Whether every row was looked at.
    pub is_whole: bool,
    /// What was left out or taken for granted, a sentence each.
    pub notes: Vec<String>,
    pub columns: Vec<Looked>,
}

/// One column, as it stands in the file.
#[derive(Clone, Debug)]
pub(crate) struct Looked {
    pub name: String,
    /// NaN where a cell is empty or holds no number.
    pub values: Vec<f64>,
    /// Cells that hold something else than a number.
    pub n_texts: usize,
}

impl Looked {
    /// Values that are there.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.values.iter().copied().filter(|value| value.is_finite())
    }

    /// Least and largest value; `None` without any.
    pub(crate) fn range(&self) -> Option<(f64, f64)> {
        let fold = |range: Option<(f64, f64)>, v: f64| range.map_or(Some((v, v)), |(l, h)| Some((l.min(v), h.max(v))));
        self.numbers().fold(None, fold)
    }

    /// Largest magnitude; `None` without any value.
    pub(crate) fn reach(&self) -> Option<f64> {
        self.range().map(|(low, high)| low.abs().max(high.abs()))
    }

    /// Whether there are numbers and they change.
    pub(crate) fn moves(&self) -> bool {
        self.range().is_some_and(|(low, high)| high > low)
    }
}

/// Looks at a file's first rows.
pub(crate) fn look(path: &Path) -> Result<Look, ReadError> {
    let Found { file, format } = Format::of(path)?;
    match format {
        Format::Csv => look_at_text(path, file),
        Format::Krait => Err(ReadError::Unusable {
            path: path.to_owned(),
            reason: "a recording of krait names its columns itself; give it to `krait lab diagnose` with --data"
                .to_owned(),
        }),
        Format::Grid(read) => Ok(read(path, file)?.look()),
    }
}

fn look_at_text(path: &Path, file: File) -> Result<Look, ReadError> {
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
    let mut file = Opened::new(path, file)?;
    let heading = file.heading;
    let wrong = |reason: String| ReadError::NotCsv { path: path.to_owned(), line: heading, reason };
    if file.names.len() > MOST_COLUMNS {
        return Err(wrong(format!("there are {} columns, expected at most {MOST_COLUMNS}", file.names.len())));
    }
    if file.names.iter().any(|name| name.parse::<f64>().is_ok()) {
        return Err(wrong("there are numbers where the names of the columns are expected".to_owned()));
    }
    let columns = file.names.iter().map(|name| Looked { name: name.clone(), values: Vec::new(), n_texts: 0 });
    let mut columns: Vec<Looked> = columns.collect();
    let (dialect, mut numbers) = (file.dialect, file.dialect.numbers());
    let mut is_whole = false;
    // Of a larger file the beginning is looked at; every row is read and checked afterwards.
    for _ in 0..MOST_CELLS / columns.len().max(1) {
        let Some((_, record)) = file.row()? else {
            is_whole = true;
            break;
        };
        for (column, cell) in columns.iter_mut().zip(record) {
            let cell = cell.trim_ascii();
            let value = numbers.parse(cell);
            column.n_texts += usize::from(value.is_none() && !cell.is_empty());
            column.values.push(value.unwrap_or(f64::NAN));
        }
    }
    let comma = if numbers.has_decimal_comma() { ", decimal comma" } else { "" };
    let how = format!("columns separated by {}s{comma}", dialect.word());
    Ok(Look { at: At::Line(heading), how, is_whole, notes: Vec::new(), columns })
}
