//! A first look at a CSV file of which nothing is known: its columns as they are, before anything stands for anything.

use super::ReadError;
use super::csv::Opened;
use super::dialect::Dialect;
use krait_ipc::input;
use std::path::Path;

/// Cells that are looked at, 160 MB; every row is read and checked afterwards.
const MOST_CELLS: usize = 20_000_000;
const MOST_COLUMNS: usize = 1000;

/// A file's columns.
#[derive(Clone, Debug)]
pub(crate) struct Look {
    pub dialect: Dialect,
    pub has_decimal_comma: bool,
    /// Whether every row was looked at.
    pub is_whole: bool,
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
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    let file = super::open(path)?;
    input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
    let mut file = Opened::new(path, file)?;
    let wrong = |reason: String| ReadError::NotCsv { path: path.to_owned(), line: 1, reason };
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
    Ok(Look { dialect, has_decimal_comma: numbers.has_decimal_comma(), is_whole, columns })
}
