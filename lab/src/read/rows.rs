//! Rows of any file into columns of numbers, each cell checked where it stands.

use super::ReadError;
use super::at::At;
use super::cells::{Cell, Cells};
use super::dialect::Numbers;
use super::header::Plan;
use super::role::Role;
use super::stamps::EPOCH_S;
use std::path::Path;

/// A file's columns, in the order of its plan; empty cells are NaN.
pub(super) struct Table {
    pub plan: Plan,
    pub columns: Vec<Vec<f64>>,
    /// Number of each row's trial.
    pub trial: Vec<u32>,
    /// Place of the last row.
    pub last: At,
}

/// Rows of a file that are read one after the other.
pub(super) struct Rows<'a> {
    path: &'a Path,
    plan: Plan,
    columns: Vec<Vec<f64>>,
    trial: Vec<u32>,
    label: Vec<u8>,
    label_field: Option<usize>,
    time: usize,
    /// Places of the shape's columns.
    shape: Vec<usize>,
    last: At,
    cells: Cells<'a>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(path: &'a Path, plan: Plan, numbers: Numbers) -> Self {
        Self {
            path,
            columns: vec![Vec::new(); plan.columns.len()],
            trial: Vec::new(),
            label: Vec::new(),
            label_field: plan.columns.iter().find(|c| c.role == Role::Trial).map(|c| c.field),
            time: plan.place(Role::Time).unwrap_or_else(|| unreachable!("a heading without a time is refused")),
            shape: plan.columns.iter().enumerate().filter(|(_, c)| c.role.is_of_shape()).map(|(k, _)| k).collect(),
            last: At::Names,
            cells: Cells::new(path, numbers, &plan),
            plan,
        }
    }

    /// Takes the next row: the cell of each of the file's columns.
    pub(super) fn push<'c>(&mut self, at: At, cell: impl Fn(usize) -> Cell<'c>) -> Result<(), ReadError> {
        self.last = at;
        let label = self.label_field.map_or(Cell::Empty, &cell);
        let is_first = self.next_trial(label);
        if is_first {
            self.cells.restart();
        }
        for (place, (column, values)) in self.plan.columns.iter().zip(&mut self.columns).enumerate() {
            values.push(self.cells.value(at, place, column, cell(column.field))?);
        }
        if !is_first {
            self.time_rises(at)?;
        }
        self.whole_shape(at)
    }

    /// Counts this row's trial; true for the first row of one.
    fn next_trial(&mut self, label: Cell) -> bool {
        let is_new = !label.is_label(&self.label);
        if is_new || self.trial.is_empty() {
            self.label = label.label();
        }
        let Some(&last) = self.trial.last() else {
            self.trial.push(0);
            return true;
        };
        self.trial.push(last + u32::from(is_new));
        is_new
    }

    fn time_rises(&self, at: At) -> Result<(), ReadError> {
        let times = self.columns.get(self.time).map_or(&[][..], Vec::as_slice);
        let [.., before_s, found_s] = *times else { return Ok(()) };
        let column = || self.plan.names(|role| role == Role::Time);
        if found_s - before_s >= EPOCH_S {
            return Err(ReadError::Implausible {
                path: self.path.to_owned(),
                at,
                column: column(),
                found: format!("{found_s} s"),
                reason: format!(
                    "years after {before_s} s in the row before, and no recording rests so long: the clock was not set there; remove the \
                     rows before this one"
                ),
            });
        }
        if found_s > before_s {
            return Ok(());
        }
        Err(ReadError::Time {
            path: self.path.to_owned(),
            at,
            column: column(),
            found_s,
            before_s,
            how: if found_s == before_s { "the same as the" } else { "before the" },
        })
    }

    /// A snake's shape is there or not; joints are measured each by itself.
    fn whole_shape(&self, at: At) -> Result<(), ReadError> {
        let last = |place: &usize| self.columns.get(*place).and_then(|c| c.last()).is_some_and(|v| v.is_finite());
        let is_snake = self.plan.n_inputs != self.plan.n_outputs || self.plan.place(Role::TipPos(0)).is_some();
        let n_there = self.shape.iter().filter(|place| last(place)).count();
        if !is_snake || n_there == 0 || n_there == self.shape.len() {
            return Ok(());
        }
        let empty = self.shape.iter().find(|place| !last(place)).and_then(|&place| self.plan.columns.get(place));
        let column = empty.map_or_else(String::new, |column| column.name.clone());
        Err(ReadError::HalfShape { path: self.path.to_owned(), at, column })
    }

    /// What was read.
    pub(super) fn end(self) -> Result<Table, ReadError> {
        if self.trial.is_empty() {
            return Err(ReadError::NoRows { path: self.path.to_owned(), at: At::Line(1) });
        }
        Ok(Table { plan: self.plan, columns: self.columns, trial: self.trial, last: self.last })
    }
}
