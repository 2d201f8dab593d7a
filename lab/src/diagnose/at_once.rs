//! Lists as a whole, to first order: every part of a found list with every further effect beside it, without a simulation for each.
//!
//! Members that are exchanged one by one lead from one list to another only where each step pays. A friction of wide reach in the place
//! of two plain ones, or three effects none of which looks good alone, are left so by no step. What a list leaves without some of its
//! members is one simulation; what its other members and any further effect can make of that follows from products of columns:
//! with s the scores of the columns on what is left and G their Gram matrix, a list takes away s' G^-1 s.

use super::screen::{Cell, screen_beside};
use super::search::{Search, Trial, keep_first, memory, price};
use crate::Term;
use crate::fit::{dot, inverse};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Lists that are lengthened, of those without the same members ...
const WIDTH: usize = 6;
/// ... and the best of all that are refined by whole simulations.
const N_REFINED: usize = 8;
/// Of what a column does, this share must be more than the list's own columns can make.
const LEAST_VISIBLE: f64 = 1e-3;
/// An effect so many times its start is beyond what a first order tells.
const MOST_TIMES: f64 = 30.0;

/// A list to first order.
#[derive(Clone)]
struct Sketch {
    /// Which members are kept, a bit each.
    kept: usize,
    /// Places of the cells that are added.
    added: Vec<usize>,
    /// Candidates of the members that are kept and added.
    found: Vec<usize>,
    /// ln RSS with the price of the free numbers.
    badness: f64,
}

/// Lists of up to `n_most` effects that look better as a whole than others, refined, best first; the list itself is not among them.
pub(super) fn lists(search: &Search, list: &Trial, n_most: usize) -> Vec<Trial> {
    let cells: Vec<Cell> = screen_beside(search.problem, &list.fit, search.candidates);
    let cells: Vec<Cell> = cells.into_iter().filter(|cell| !cell.columns.is_empty()).collect();
    let products = Products::new(search, list, &cells);
    let time = memory(search.problem, core::slice::from_ref(list));
    let price = price(search.problem, time);
    let sketches: Vec<Sketch> = (0..1_usize << list.found.len())
        .into_par_iter()
        .flat_map_iter(|kept| products.lengthened(search, list, &cells, kept, n_most, price))
        .collect();
    search.refine(starts(search, list, &cells, &products, sketches))
}

/// From where the best lists of different members are refined.
fn starts(
    search: &Search,
    list: &Trial,
    cells: &[Cell],
    products: &Products,
    mut sketches: Vec<Sketch>,
) -> Vec<(Vec<usize>, Vec<Term>)> {
    sketches.sort_by(|a, b| a.badness.total_cmp(&b.badness));
    keep_first(&mut sketches, |own| &own.found);
    let start = |own: Sketch| {
        let (factors, _) = products.solved(&own)?;
        let mut effects = part(search, list, own.kept);
        let mut first = products.of_part(own.kept).len();
        for &k in &own.added {
            let n = cells[k].columns.len();
            effects.push(search.term(&cells[k], &factors.rows(first, n).into_owned()));
            first += n;
        }
        Some((own.found, effects))
    };
    sketches.into_iter().filter_map(start).take(N_REFINED).collect()
}

/// The model's own effects and the members that are kept.
fn part(search: &Search, list: &Trial, kept: usize) -> Vec<Term> {
    let (own, members) = list.fit.effects.split_at(search.base.len());
    own.iter().chain(slots(list, kept).map(|slot| &members[slot])).cloned().collect()
}

/// Places of the members that a sketch keeps.
fn slots(list: &Trial, kept: usize) -> impl Iterator<Item = usize> {
    (0..list.found.len()).filter(move |slot| kept >> slot & 1 == 1)
}

/// Products of all columns with each other and with what each part of the list leaves.
struct Products {
    /// Of each slope of the list: the place of its member, `None` for the model's own.
    member: Vec<Option<usize>>,
    /// Where each cell's columns begin, behind the slopes; one more at the end.
    first: Vec<usize>,
    gram: DMatrix<f64>,
    /// For each part of the list that makes a chain: scores of all columns, and the sum of squares that it leaves.
    parts: Vec<Option<(DVector<f64>, f64)>>,
}

impl Products {
    fn new(search: &Search, list: &Trial, cells: &[Cell]) -> Self {
        let n_base = search.base.len();
        let free = || list.fit.slopes.iter().zip(&list.fit.variables).filter(|(_, own)| own.prior.is_none());
        let member = free().map(|(_, own)| own.effect.checked_sub(n_base)).collect();
        let mut columns: Vec<&Vec<f64>> = free().map(|(slope, _)| slope).collect();
        let mut first = Vec::with_capacity(cells.len() + 1);
        for cell in cells {
            first.push(columns.len());
            columns.extend(&cell.columns);
        }
        first.push(columns.len());
        let n = columns.len();
        let rows: Vec<Vec<f64>> =
            (0..n).into_par_iter().map(|i| (0..=i).map(|j| dot(columns[i], columns[j])).collect()).collect();
        let gram = DMatrix::from_fn(n, n, |i, j| rows[i.max(j)][i.min(j)]);
        let scored = |kept: usize| {
            let left = search.problem.residual(&part(search, list, kept)).ok()?;
            Some((DVector::from_fn(n, |k, _| dot(columns[k], &left)), dot(&left, &left)))
        };
        let parts = (0..1_usize << list.found.len()).into_par_iter().map(scored).collect();
        Self { member, first, gram, parts }
    }

    /// Places of the columns that a part of the list has: slopes of the model's own numbers and of the members that are kept.
    fn of_part(&self, kept: usize) -> Vec<usize> {
        let is_kept = |own: &Option<usize>| own.is_none_or(|slot| kept >> slot & 1 == 1);
        (0..self.member.len()).filter(|&k| is_kept(&self.member[k])).collect()
    }

    /// Places of a cell's columns.
    fn of_cell(&self, cell: usize) -> core::ops::Range<usize> {
        self.first[cell]..self.first[cell + 1]
    }

    fn of_sketch(&self, own: &Sketch) -> Vec<usize> {
        let added = own.added.iter().flat_map(|&cell| self.of_cell(cell));
        self.of_part(own.kept).into_iter().chain(added).collect()
    }

    /// A part of the list lengthened step by step; of each length the best.
    fn lengthened(
        &self,
        search: &Search,
        list: &Trial,
        cells: &[Cell],
        kept: usize,
        n_most: usize,
        price: f64,
    ) -> Vec<Sketch> {
        let found: Vec<usize> = slots(list, kept).map(|slot| list.found[slot]).collect();
        let n_kept = found.len();
        let mut all = Vec::new();
        let alone = Sketch { kept, added: Vec::new(), found, badness: 0.0 };
        let mut beam = vec![alone.clone()];
        for _ in n_kept..n_most {
            let mut next: Vec<Sketch> =
                beam.iter().flat_map(|own| self.next(search, cells, own, price).unwrap_or_default()).collect();
            next.sort_by(|a, b| a.badness.total_cmp(&b.badness));
            keep_first(&mut next, |own| &own.found);
            next.truncate(WIDTH);
            all.extend(next.iter().cloned());
            beam = next;
        }
        // A part alone is a shorter list.
        if kept != 0
            && n_kept < list.found.len()
            && let Some((factors, left)) = self.solved(&alone)
        {
            let badness = left.max(f64::MIN_POSITIVE).ln() + factors.len() as f64 * price;
            all.push(Sketch { badness, ..alone });
        }
        all
    }

    /// A list with each cell of a candidate that it does not hold; `None` where its own columns are no basis.
    fn next(&self, search: &Search, cells: &[Cell], own: &Sketch, price: f64) -> Option<Vec<Sketch>> {
        let (scores, left) = self.parts[own.kept].as_ref()?;
        let columns = self.of_sketch(own);
        let n_of = |k: usize| search.candidates[cells[k].candidate].free.len();
        let n_own = self.of_part(own.kept).len() + own.added.iter().map(|&k| n_of(k)).sum::<usize>();
        // Of each column, the part that the list's own columns make: rows of `made` are coordinates in an orthonormal basis of them.
        let (made, along) = match columns.is_empty() {
            true => (DMatrix::zeros(0, self.gram.ncols()), DVector::zeros(0)),
            false => {
                let lower = scaled(&self.gram.select_rows(&columns).select_columns(&columns)).cholesky()?.unpack();
                let size: Vec<f64> = columns.iter().map(|&k| self.gram[(k, k)].sqrt()).collect();
                let mut right = self.gram.select_rows(&columns);
                right.row_iter_mut().zip(&size).for_each(|(mut row, size)| row /= *size);
                let score = DVector::from_fn(columns.len(), |k, _| scores[columns[k]] / size[k]);
                (lower.solve_lower_triangular(&right)?, lower.solve_lower_triangular(&score)?)
            }
        };
        let left = left - along.norm_squared();
        let is_new = |k: &usize| !own.found.contains(&cells[*k].candidate);
        let longer = |k: usize| {
            let gain = self.gain(scores, &made, &along, k, cells[k].one_sided)?;
            let badness = (left - gain).max(f64::MIN_POSITIVE).ln() + (n_own + n_of(k)) as f64 * price;
            let added = own.added.iter().copied().chain([k]).collect();
            let found = own.found.iter().copied().chain([cells[k].candidate]).collect();
            Some(Sketch { kept: own.kept, added, found, badness })
        };
        Some((0..cells.len()).filter(is_new).filter_map(longer).collect())
    }

    /// How much a cell takes away of what the columns of `made` leave; `None` where it does nothing else, or too much is needed of it.
    fn gain(
        &self,
        scores: &DVector<f64>,
        made: &DMatrix<f64>,
        along: &DVector<f64>,
        cell: usize,
        is_one_sided: bool,
    ) -> Option<f64> {
        let own = self.of_cell(cell);
        let (start, n) = (own.start, own.len());
        let coordinates = made.columns(start, n);
        let gram = self.gram.view((start, start), (n, n)) - coordinates.transpose() * coordinates;
        if (0..n).any(|k| gram[(k, k)] <= LEAST_VISIBLE * self.gram[(start + k, start + k)]) {
            return None;
        }
        let score = scores.rows(start, n) - coordinates.transpose() * along;
        let factors = inverse(&gram) * &score;
        let is_possible = factors.iter().all(|f| f.abs() <= MOST_TIMES) && (!is_one_sided || factors[0] > 0.0);
        is_possible.then(|| score.dot(&factors))
    }

    /// Factors on the columns of a list, all of them free, and what it leaves to first order.
    fn solved(&self, own: &Sketch) -> Option<(DVector<f64>, f64)> {
        let (scores, left) = self.parts[own.kept].as_ref()?;
        let columns = self.of_sketch(own);
        let score = scores.select_rows(&columns);
        let factors = inverse(&self.gram.select_rows(&columns).select_columns(&columns)) * &score;
        let left = left - score.dot(&factors);
        Some((factors, left))
    }
}

/// A Gram matrix with ones on its diagonal.
fn scaled(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let size = gram.diagonal().map(f64::sqrt);
    DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| gram[(i, j)] / (size[i] * size[j]))
}
