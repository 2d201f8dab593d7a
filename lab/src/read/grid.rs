//! A table from a file that is no text: columns with their names, and how they become checked rows.

use super::ReadError;
use super::at::At;
use super::cells::Cell;
use super::dialect::Dialect;
use super::header::Plan;
use super::look::{Look, Looked};
use super::role::Role;
use super::rows::{Rows, Table};
use std::path::Path;

/// Numbers that a table may have, 80 MB: what unpacks to more fills no memory. Other cells weigh more ([`GridCells::WHOLE`]).
pub(super) const MOST_CELLS: usize = 10_000_000;
/// Columns that a table may have.
pub(super) const MOST_COLUMNS: usize = 1000;

/// Columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Grid {
    /// How the file is written, for a sentence.
    pub how: String,
    pub columns: Vec<GridColumn>,
    /// What was left out or taken for granted, a sentence each.
    pub notes: Vec<String>,
}

/// One column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GridColumn {
    pub name: String,
    pub cells: GridCells,
    /// Whether a value stands until the next one does, where a row must have one: a command of a slower topic.
    pub is_held: bool,
}

/// Its cells, of one sort.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum GridCells {
    /// NaN where nothing was measured.
    Numbers(Vec<f64>),
    /// Whole numbers that no floating-point number holds, such as nanoseconds since 1970.
    Whole(Vec<Option<i64>>),
    /// Labels.
    Texts(Vec<Box<[u8]>>),
}

impl GridCells {
    /// What a whole number weighs, in numbers: it may be missing.
    pub(super) const WHOLE: usize = 2;
    /// What a label weighs besides its text, in numbers: a place, a length, and a piece of memory.
    pub(super) const TEXT: usize = 6;

    /// What one of them weighs, in numbers.
    pub(super) fn weight_of_one(&self) -> usize {
        match self {
            Self::Numbers(_) => 1,
            Self::Whole(_) => Self::WHOLE,
            Self::Texts(_) => Self::TEXT,
        }
    }

    /// What they weigh, in numbers.
    pub(super) fn weight(&self) -> usize {
        self.weight_of_one() * self.len()
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Numbers(own) => own.len(),
            Self::Whole(own) => own.len(),
            Self::Texts(own) => own.len(),
        }
    }

    fn cell(&self, row: usize) -> Cell<'_> {
        match self {
            Self::Numbers(own) => {
                own.get(row).filter(|value| !value.is_nan()).map_or(Cell::Empty, |v| Cell::Number(*v))
            }
            Self::Whole(own) => own.get(row).copied().flatten().map_or(Cell::Empty, Cell::Whole),
            Self::Texts(own) => own.get(row).map_or(Cell::Empty, |text| Cell::of_text(text)),
        }
    }

    /// All of them as numbers, NaN for a cell that is none, and the number of those that hold something else.
    fn looked(self) -> (Vec<f64>, usize) {
        match self {
            Self::Numbers(own) => (own.into_iter().map(|v| if v.is_finite() { v } else { f64::NAN }).collect(), 0),
            Self::Whole(own) => (own.into_iter().map(|v| v.map_or(f64::NAN, |whole| whole as f64)).collect(), 0),
            Self::Texts(own) => {
                let mut numbers = COMMA.numbers();
                let values: Vec<f64> = own.iter().map(|text| numbers.parse(text).unwrap_or(f64::NAN)).collect();
                let n_texts = values.iter().zip(&own).filter(|(v, text)| v.is_nan() && !text.is_empty()).count();
                (values, n_texts)
            }
        }
    }
}

/// Numbers in text are written as in a CSV file with commas.
const COMMA: Dialect = Dialect { delimiter: b',' };

impl Grid {
    fn n_rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.cells.len())
    }

    /// Every row, checked as the rows of a CSV file are, with the plan that is made of the names.
    pub(super) fn read(
        &self,
        path: &Path,
        plan: impl FnOnce(At, &[String]) -> Result<Plan, ReadError>,
    ) -> Result<Table, ReadError> {
        let names: Vec<String> = self.columns.iter().map(|column| column.name.clone()).collect();
        let plan = plan(At::Names, &names)?;
        let needed: Vec<usize> = plan.columns.iter().filter(|column| is_needed(column.role)).map(|c| c.field).collect();
        let mut rows = Rows::new(path, plan, COMMA.numbers());
        let mut standing: Vec<Option<usize>> = vec![None; self.columns.len()];
        let mut n_behind = 0;
        for row in 0..self.n_rows() {
            let mut is_whole = true;
            for &field in &needed {
                let Some(column) = self.columns.get(field).filter(|column| column.is_held) else { continue };
                let Some(last) = standing.get_mut(field) else { continue };
                *last = if column.cells.cell(row) == Cell::Empty { *last } else { Some(row) };
                is_whole &= last.is_some();
            }
            // Before the first command the machine's history is not known.
            if !is_whole {
                n_behind += 1;
                continue;
            }
            rows.push(At::Row(row as u64 + 1), |field| {
                let held = standing.get(field).copied().flatten();
                self.columns.get(field).map_or(Cell::Empty, |column| column.cells.cell(held.unwrap_or(row)))
            })?;
        }
        if n_behind == self.n_rows() {
            return Err(ReadError::NoRows { path: path.to_owned(), at: At::Names });
        }
        rows.end()
    }

    /// The columns as they are, before anything stands for anything.
    pub(super) fn look(self) -> Look {
        let looked = |column: GridColumn| {
            let (values, n_texts) = column.cells.looked();
            Looked { name: column.name, values, n_texts }
        };
        let columns = self.columns.into_iter().map(looked).collect();
        Look { at: At::Names, how: self.how, is_whole: true, notes: self.notes, columns }
    }
}

/// Whether a row without it is none.
fn is_needed(role: Role) -> bool {
    matches!(role, Role::Input(_) | Role::StemAngle | Role::Temperature)
}
