//! Is anything missing at all? Sign flips of blocks over every candidate's grid at once, gain and offset taken out.

use super::kind::Kind;
use super::search::Search;
use super::simulate::{Member, Run, columns};
use crate::Problem;
use crate::diagnose::screen::{Cell, block_moments, total};
use crate::diagnose::sign_flip::sign_flip;
use crate::fit::inverse;
use rayon::prelude::*;

/// Periods of periodic errors that are tested: every fourth of the grid.
const EVERY_PERIOD: usize = 4;

/// Family-wise p-value of the best cell, and of each kind's best.
pub(super) struct First {
    pub p_value: f64,
    pub of_kind: Vec<(Kind, f64)>,
}

/// Tests the residual of the model as given.
pub(super) fn first(search: &Search, problem: &Problem, seed: u64) -> First {
    let (signal, base) = (search.signal, search.base());
    let run = Run::new(signal, &[]);
    let plain = run.passed_on_rows(signal);
    let mut jobs: Vec<(Kind, Vec<f64>)> = Vec::new();
    for &kind in search.candidates.iter().filter(|kind| !kind.is_shape()) {
        let every = if kind == Kind::Periodic { EVERY_PERIOD } else { 1 };
        jobs.extend(kind.grid(signal).into_iter().step_by(every).map(|values| (kind, values)));
    }
    let cells: Vec<(Kind, Cell)> = jobs
        .into_par_iter()
        .map(|(kind, values)| {
            let member = Member::new(signal, kind, &values, 0.0);
            let mut own = if kind.carries() {
                let with = Run::new(signal, &[member]).passed_on_rows(signal);
                vec![with.iter().zip(&plain).map(|(a, b)| a - b).collect()]
            } else {
                columns(signal, &member, &signal.base)
            };
            own.iter_mut().for_each(|column: &mut Vec<f64>| base.solution.project(column, search.loss.weight));
            let blocks = block_moments(problem, &own, &base.solution.residual);
            let (score, gram) = total(&blocks);
            let cell = Cell {
                candidate: 0,
                start: 0,
                columns: Vec::new(),
                factors: inverse(&gram) * score,
                blocks,
                one_sided: false,
                sum_of_squares: 0.0,
                visible: 1.0,
            };
            (kind, cell)
        })
        .collect();
    let (kinds, cells): (Vec<Kind>, Vec<Cell>) = cells.into_iter().unzip();
    let test = sign_flip(&cells, seed);
    let of_kind = search.candidates.iter().filter(|kind| !kind.is_shape()).map(|&kind| {
        let own = kinds.iter().zip(&test.p_of_cell).filter(|(own, _)| **own == kind);
        (kind, own.map(|(_, p)| *p).fold(1.0, f64::min))
    });
    First { p_value: test.p_value, of_kind: of_kind.collect() }
}
