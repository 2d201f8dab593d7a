//! The paper's experiments on a chain that runs: the protocol that it follows, and what its recording shows.
//!
//! A protocol becomes ways of the bend vector, which a chain follows as it follows a hand. What was measured comes out of
//! the recording alone, so that the same file always gives the same tables and pictures. The bench of `krait paper` goes the
//! same ways for comparison.

mod measured;
mod outcome;
mod pictures;
mod protocol;
mod text;

pub use measured::{Announced, AnnouncedPass, METADATA_KEY, announced};
pub use outcome::{FigureOutcome, PartOutcome, PassModel, PassOutcome, PoseErrors, PoseOutcome, ReadingNoise};
pub use protocol::{ApproachSide, Before, FigureKind, Leg, Part, Protocol, WantedPose};
pub use text::{csv, terminal};

use crate::page;
use anyhow::Context;
use krait_model::Snake;
use std::path::Path;

/// Writes the table of poses, every picture and the page into a folder, which is made if it is missing.
///
/// # Errors
/// A file that cannot be written, by name.
pub fn write(outcome: &FigureOutcome, snake: &Snake, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("folder {} cannot be made", folder.display()))?;
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("{} cannot be written", path.display()))
    };
    write("poses.csv", &csv(outcome))?;
    let mut body = format!("<h1>{}, measured on a chain that ran</h1>\n", text::title(&outcome.protocol));
    body += &text::facts(outcome).lines().map(page::note).collect::<String>();
    for part in text::sections(outcome) {
        let notes = if part.notes.is_empty() { String::new() } else { page::note(&part.notes.replace('\n', " ")) };
        body += &page::section(&part.title, &(page::table(&part.table) + &notes));
    }
    body += "<h2>Figures</h2>\n";
    for figure in pictures::all(outcome, snake) {
        let picture = krait_report::svg(&figure)?;
        write(&figure.file, &picture)?;
        body += &page::picture(&picture, &figure.caption);
    }
    write("index.html", &page::document("krait experiment", &body))
}
