//! Frames of a camera slower than the file's rows: a logger writes the last one again until the next comes, and only the first counts.
//!
//! A row that repeats looks like a measurement of the pose that the machine has meanwhile left. A coarse encoder repeats too, and its
//! repetitions are measurements: it changes by its smallest step or not at all, where a camera jumps by whatever the machine moved.
//! A play without noise repeats as well, but all at once: only frames repeat after nearly every change.

use crate::Measurements;

/// Fewer rows in motion say nothing.
const FEWEST_ROWS: usize = 40;
/// This share of the changes in the faster half of the moving rows is followed by a repetition where frames are held.
const FOLLOWED: f64 = 0.5;
/// A typical change of what is measured, in units of the smallest one: less is an encoder's quantum.
const BEYOND_A_QUANTUM: f64 = 4.0;

/// Takes the repetitions out, and counts them in [`Measurements::n_held_rows`].
pub(super) fn take_out(data: &mut Measurements) {
    let repeats: Vec<bool> = (0..data.n_rows()).map(|row| is_repetition(data, row)).collect();
    if !are_held(data, &repeats) {
        return;
    }
    let width = data.n_outputs;
    for row in (0..repeats.len()).filter(|row| repeats[*row]) {
        data.outputs[row * width..(row + 1) * width].fill(f64::NAN);
        data.n_held_rows += 1;
    }
}

fn is_repetition(data: &Measurements, row: usize) -> bool {
    !data.starts_trial(row) && data.is_scored(row) && data.output(row) == data.output(row - 1)
}

fn are_held(data: &Measurements, repeats: &[bool]) -> bool {
    let travel = |row: usize| -> f64 {
        data.input(row).iter().zip(data.input(row - 1)).map(|(now, before)| (now - before).abs()).sum()
    };
    let both = |row: &usize| !data.starts_trial(*row) && data.is_scored(*row) && data.is_scored(row - 1);
    let mut moving: Vec<(f64, usize)> = (0..data.n_rows()).filter(both).map(|row| (travel(row), row)).collect();
    moving.retain(|(travel, _)| *travel > 0.0);
    moving.sort_by(|a, b| a.0.total_cmp(&b.0));
    let fast = &moving[moving.len() / 2..];
    let fresh = || fast.iter().filter(|(_, row)| !repeats[*row]);
    let n_followed = fresh().filter(|(_, row)| repeats.get(row + 1) == Some(&true)).count();
    if fast.len() < FEWEST_ROWS || (n_followed as f64) < FOLLOWED * fresh().count() as f64 || n_followed == 0 {
        return false;
    }
    (0..data.n_outputs).any(|k| {
        let change = |(_, row): &(f64, usize)| (data.output(*row)[k] - data.output(row - 1)[k]).abs();
        let mut changes: Vec<f64> = fast.iter().map(change).filter(|change| *change > 0.0).collect();
        changes.sort_by(f64::total_cmp);
        let typical = changes.get(changes.len() / 2).copied();
        // The quantum shows where the machine is slow.
        let least = moving.iter().map(change).filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min);
        typical.is_some_and(|typical| typical > BEYOND_A_QUANTUM * least)
    })
}
