//! How good is the lab? A seeded grid of generated data, diagnosed in parallel and scored against sealed answers.
//!
//! The data come from a plant that shares no equation with the model, the answers are only looked at for scoring, and the
//! baselines see the same data. Every finished cell is one line of a JSONL file, so that a run that was ended goes on where
//! it was; the first line says which grid it is.

mod baseline;
mod grid;
mod outcome;
mod page;
mod pictures;
mod summary;

pub use baseline::Baselines;
pub use grid::{GridCell, Group, Task, force_grid, grid, joint_grid, segments_grid};
pub use outcome::{Outcome, Said};
pub use page::page;
pub use summary::{Rate, Summary};

use crate::force::FORCE_MODEL;
use crate::generate::{PERTURBED, base_model};
use crate::joints::JOINTS_MODEL;
use krait_ipc::input;
use krait_lab::machine::{ForceLab, JointsLab, SnakeLab};
use krait_model::model_file::ModelFile;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Which grid, and how much is asked of each cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Everything drawn follows from it.
    pub seed: u64,
    /// Length of each set of data, s.
    pub seconds: f64,
    /// Whether the baselines are asked, which takes about as long again.
    pub with_baselines: bool,
}

/// A benchmark that cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum BenchmarkError {
    /// The results cannot be read or written.
    #[error("benchmark results {}: {source}; check the path and the space left", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is of another grid.
    #[error(
        "benchmark results {} are of another grid ({found}), expected {expected}; choose another directory or the same options", file.display()
    )]
    OtherGrid {
        /// The file.
        file: PathBuf,
        /// Its first line.
        found: String,
        /// The line of these options.
        expected: String,
    },
}

/// The machines with the models that the lab gets.
pub struct Labs {
    /// A snake of elastic lines.
    snake: SnakeLab,
    /// The same with every dimension free that a generated plant may have wrong.
    open_snake: SnakeLab,
    /// Two joints.
    joints: JointsLab,
    /// One joint with its torque.
    force: ForceLab,
}

impl Labs {
    fn new() -> Option<Self> {
        let free: String = PERTURBED.iter().map(|key| format!("{key} = \"free\"\n")).collect();
        let open = format!("format = 1\n[machine]\nkind = \"snake\"\n{free}");
        let snake = |text: &str| ModelFile::parse(text).ok().as_ref().and_then(SnakeLab::new);
        let joints = ModelFile::parse(JOINTS_MODEL).ok().as_ref().and_then(JointsLab::new)?;
        let force = ModelFile::parse(FORCE_MODEL).ok().as_ref().and_then(ForceLab::new)?;
        Some(Self { snake: snake(&base_model())?, open_snake: snake(&open)?, joints, force })
    }
}

/// Works out every cell (of [`grid`]) that the results do not have yet; returns all of them in the grid's order.
///
/// `progress` hears of every finished cell: how many are done, of how many, and what came of it.
///
/// # Errors
/// [`BenchmarkError`]. What was finished before is kept.
pub fn run(
    options: &Options,
    cells: &[GridCell],
    results: &Path,
    progress: impl Fn(usize, usize, &Outcome) + Sync,
) -> Result<Vec<Outcome>, BenchmarkError> {
    let failed = |source| BenchmarkError::Io { file: results.to_owned(), source };
    let (lines, before) = read(options, results)?;
    let done: BTreeSet<&str> = before.iter().map(|outcome| outcome.id.as_str()).collect();
    let file = Mutex::new(rewritten(options, results, &lines).map_err(failed)?);
    let todo: Vec<&GridCell> = cells.iter().filter(|cell| !done.contains(cell.id.as_str())).collect();
    let n_done = Mutex::new(cells.len() - todo.len());
    let Some(labs) = Labs::new() else { return Ok(Vec::new()) };
    let finished: Result<Vec<Outcome>, io::Error> = todo
        .par_iter()
        .map(|cell| {
            let outcome = Outcome::of(cell, &labs, options.with_baselines);
            append(&file, &outcome)?;
            if let Ok(mut n) = n_done.lock() {
                *n += 1;
                progress(*n, cells.len(), &outcome);
            }
            Ok(outcome)
        })
        .collect();
    let mut all = before;
    all.extend(finished.map_err(failed)?);
    let place = |outcome: &Outcome| cells.iter().position(|cell| cell.id == outcome.id);
    all.retain(|outcome| place(outcome).is_some());
    all.sort_by_key(|outcome| place(outcome));
    Ok(all)
}

/// Finished cells of earlier runs with their lines; one that was cut short is as if it had never been begun.
fn read(options: &Options, results: &Path) -> Result<(Vec<String>, Vec<Outcome>), BenchmarkError> {
    let text = match input::text(results, input::TABLE_BYTES) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok((Vec::new(), Vec::new())),
        Err(source) => return Err(BenchmarkError::Io { file: results.to_owned(), source }),
    };
    let Some(found) = text.lines().next() else { return Ok((Vec::new(), Vec::new())) };
    let expected = first_line(options);
    if found != expected {
        let (file, found) = (results.to_owned(), found.chars().take(200).collect());
        return Err(BenchmarkError::OtherGrid { file, found, expected });
    }
    Ok(text.lines().skip(1).filter_map(|line| Some((line.to_owned(), serde_json::from_str(line).ok()?))).unzip())
}

/// The file with what was finished, whole lines only, open for more. It is replaced in one step: nothing is lost in between.
fn rewritten(options: &Options, results: &Path, lines: &[String]) -> io::Result<File> {
    if let Some(folder) = results.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let fresh = results.with_extension("jsonl.new");
    let mut text = first_line(options) + "\n";
    for line in lines {
        text += line;
        text.push('\n');
    }
    std::fs::write(&fresh, text)?;
    std::fs::rename(&fresh, results)?;
    OpenOptions::new().append(true).open(results)
}

fn append(file: &Mutex<File>, outcome: &Outcome) -> io::Result<()> {
    let line = serde_json::to_string(outcome)? + "\n";
    match file.lock() {
        Ok(mut file) => file.write_all(line.as_bytes()),
        Err(_poisoned) => Err(io::Error::other("another cell failed while it wrote")),
    }
}

fn first_line(options: &Options) -> String {
    serde_json::to_string(options).unwrap_or_default()
}
